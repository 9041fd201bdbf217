"""What the table scripts have in common: their options, and where a table goes.

Nothing that git tracks is rewritten without --write.
"""
import argparse
import hashlib
import json
import os
import pathlib
import shutil
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent
RESULTS = ROOT / "docs" / "results"


def parser(doc, name, rows=()):
    """The options of every table; `rows` are the names of its rows, if they can be run alone."""
    p = argparse.ArgumentParser(description=doc, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("--build", type=pathlib.Path, default=ROOT / "build" / "release", help="build folder, with TUTTI_BUILD_BENCH")
    p.add_argument("--data", type=pathlib.Path, default=os.environ.get("TUTTI_DATA", ROOT.parent / "shared" / "data"))
    p.add_argument("--out", type=pathlib.Path, default=ROOT / "build" / "bench" / name, help="folder for the runs (kept)")
    p.add_argument("--reuse", action="store_true", help="take the runs that are in --out already")
    p.add_argument("--write", action="store_true", help="rewrite the tracked file, too")
    if rows:
        p.add_argument("rows", nargs="*", metavar="ROW", help=" ".join(rows))
    return p


def parse(p, rows=()):
    """The arguments, checked, with absolute paths and --out made; `tutti` is the executable."""
    a = p.parse_args()
    for name in getattr(a, "rows", []):
        if name not in rows:
            p.error(f"unknown row '{name}'; rows are {' '.join(rows)}")
    a.build, a.data, a.out = a.build.resolve(), a.data.resolve(), a.out.resolve()
    a.tutti = a.build / "apps" / "tutti" / "tutti"
    a.out.mkdir(parents=True, exist_ok=True)
    if rows:
        a.rows = a.rows or list(rows)
    return a


def tum_images(data):
    """The colour images of a folder in TUM's layout, in the order of rgb.txt."""
    return [data / line.split()[1] for line in (data / "rgb.txt").read_text().splitlines() if line and not line.startswith("#")]


def link_numbered(images, folder):
    """Makes a folder anew, with a link for each {number: file}, named by its number."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    for number, file in images.items():
        (folder / f"{number:06d}{file.suffix}").symlink_to(file.resolve())


def put(a, document, text):
    """Shows a document, and writes it if --write says so."""
    if not a.write:
        print(text)
        print(f"(not written; with --write it is {shown(document)})", file=sys.stderr)
        return
    document.parent.mkdir(parents=True, exist_ok=True)
    document.write_text(text.rstrip("\n") + "\n")
    print(f"written: {shown(document)}")


def put_between(a, document, name, text):
    """The same for what stands between <!-- name:begin --> and <!-- name:end -->; ValueError if they are missing."""
    begin, end = f"<!-- {name}:begin -->", f"<!-- {name}:end -->"
    whole = document.read_text()
    head, tail = whole.index(begin) + len(begin), whole.index(end)
    if not a.write:
        print(text)
        print(f"(not written; with --write it is '{name}' in {shown(document)})", file=sys.stderr)
        return
    document.write_text(whole[:head] + "\n" + text + "\n" + whole[tail:])
    print(f"written: '{name}' in {shown(document)}")


def put_json(a, name, rows):
    """Merges rows (name: figures) into docs/results/NAME.json, or into a copy in --out without --write; returns all rows."""
    tracked, file = RESULTS / f"{name}.json", (RESULTS if a.write else a.out) / f"{name}.json"
    whole = json.loads(tracked.read_text()) if tracked.exists() else {}
    whole.update(rows)
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(json.dumps(whole, indent=1) + "\n")
    return whole


def put_rows(a, name, rows, title, intro):
    """Measures the rows that are asked for (name: function of `a` that gives (what, measured, bound)), each kept as soon as it is
    there, and puts all of them into docs/results/NAME.md."""
    made = {}
    for row in a.rows:
        made = put_json(a, name, {row: list(rows[row](a))})
    lines = [f"# {title}", "", intro, "", "| what | measured | bound |", "|---|---|---|"]
    lines += [f"| {' | '.join(line)} |" for row in rows for line in made.get(row, [])]
    put(a, RESULTS / f"{name}.md", "\n".join(lines))


def shown(path):
    return path.relative_to(ROOT) if path.is_relative_to(ROOT) else path


def generate(tutti, folder, options):
    """The folder of a world, which is made once for these options and this code; it is deterministic."""
    done = folder / ".options"
    code = hashlib.sha256(b"".join(f.read_bytes() for f in sorted((ROOT / "data" / "synthetic").iterdir()))).hexdigest()
    words = " ".join(map(str, [*options, code]))
    if not (done.exists() and done.read_text() == words):
        shutil.rmtree(folder, ignore_errors=True)
        subprocess.run([tutti, "generate", "--out", folder, *map(str, options)], check=True, stdout=subprocess.DEVNULL)
        done.write_text(words)
    return folder


def run(a, folder, config, dataset, *options):
    """summary.json of a `tutti run`, which is made unless --reuse finds it."""
    if not (a.reuse and (folder / "summary.json").exists()):
        subprocess.run([a.tutti, "run", "--quiet", "--no-report", "--require", "failed", "--config", config, "--dataset", dataset, "--out",
                        folder, *map(str, options)], check=True, stdout=subprocess.DEVNULL)
    return json.loads((folder / "summary.json").read_text())


def errors(a, dataset, estimate, align):
    """What `tutti evaluate` says of a trajectory against the ground truth of a data set (KITTI, TUM); None if nothing can be compared."""
    truth = [dataset / "poses.txt", "--times", dataset / "times.txt"] if (dataset / "poses.txt").exists() else [dataset / "groundtruth.txt"]
    file = a.out / "errors.json"
    done = subprocess.run([a.tutti, "evaluate", "--reference", *truth, "--estimate", estimate, "--align", align, "--json", file],
                          stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    return json.loads(file.read_text()) if done.returncode == 0 else None


# Other worlds of a kind: other houses and textures, and for towns other routes (blocks that they go around).
WORLD_SEEDS = [1, 2, 3, 4, 5]
TOWN_ROUTES = [(), ("--blocks-x", 3), ("--blocks-x", 2, "--blocks-y", 2), ("--blocks-x", 3, "--blocks-y", 2), ("--blocks-x", 4)]
