#!/usr/bin/env python3
"""What did the ensemble buy? Runs `tutti compare` on every row and rewrites BENCHMARK.md.

usage: bench/benchmark.py --tutti build/release/apps/tutti/tutti [--data DIR] [--out DIR] [--seeds N] [ROW...]
Rows: redkitchen kitti_00_head town town_alike town_dusk town_changed room. Rows that are not run, or whose data is absent, keep what
BENCHMARK.md says. A row whose runs are all there already in --out is not run again with --reuse. Needs Python 3 alone.
"""
import argparse
import json
import os
import pathlib
import shutil
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent
VARIANTS = ["odometry", "surf", "sift", "orb", "naive", "product", "majority", "mean", "log-pool", "seed", "ensemble"]
SMALL_TOWN = ["--sensor", "stereo", "--world", "town", "--laps", "1.25", "--rate", "5", "--width", "512", "--height", "256",
              "--supersample", "1", "--noise"]
HARD_TOWN = ["1.5" if word == "1.25" else word for word in SMALL_TOWN]

# title, configuration and data set, or what to generate; seeds.
ROWS = {
    "redkitchen": {"title": "7-Scenes RedKitchen, RGB-D, 500 frames", "config": "7scenes.yaml", "data": "redkitchen", "seeds": 3},
    "kitti_00_head": {"title": "KITTI 00, frames 0 to 1699, mono", "config": "kitti_00-02_mono.yaml", "data": "kitti_00_head",
                      "seeds": 1, "why": "a run takes more than a minute"},
    "town": {"title": "Synthetic town, stereo, 1.25 laps", "generate": SMALL_TOWN, "seeds": 3},
    "town_alike": {"title": "Synthetic town whose houses look alike (`--repeat 1 --facades 5 --signs 0`), stereo, 1.25 laps",
                   "generate": SMALL_TOWN + ["--repeat", "1", "--facades", "5", "--signs", "0"], "seeds": 3},
    "town_dusk": {"title": "Synthetic town, the second lap at dusk (dark, noisy, lamps are lit), stereo, 1.5 laps",
                  "generate": HARD_TOWN + ["--dusk"], "seeds": 3},
    "town_changed": {"title": "Synthetic town, the second lap with other parked cars and behind lorries (30 % of the image), stereo, "
                              "1.5 laps", "generate": HARD_TOWN + ["--other-cars", "--occlusion", "0.3"], "seeds": 3},
    "room": {"title": "Synthetic room, RGB-D with the noise of a Kinect, 1.5 laps",
             "generate": ["--sensor", "rgbd", "--world", "room", "--laps", "1.5", "--rate", "8", "--width", "480", "--height", "360",
                          "--supersample", "1", "--kinect-noise"], "seeds": 3},
}

INTRO = """# What did the ensemble buy?

`./dev benchmark` rewrites this file: `tutti compare` runs every variant on an odometry that is tracked once per seed, so that
only the loop closure differs ([docs/comparison.md](docs/comparison.md) has the columns). Ground truth serves the evaluation
alone. Times are of the machine that ran it, and of whatever else ran on it: wide intervals of the times are its load.

Mono is aligned by Sim(3), the rest by SE(3). In `redkitchen` colour and depth are not synchronised: differences of ATE below about
half a centimetre mean nothing there.
"""


def mark(name, end=False):
    return f"<!-- {name}:{'end' if end else 'begin'} -->"


def generate(tutti, row, folder):
    """The world is made once; it is deterministic."""
    done = folder / ".done-by-benchmark"
    if not (done.exists() and done.read_text() == " ".join(row["generate"])):
        shutil.rmtree(folder, ignore_errors=True)
        subprocess.run([tutti, "generate", "--out", folder, *row["generate"]], check=True, stdout=subprocess.DEVNULL)
        done.write_text(" ".join(row["generate"]))
    return folder / "config.yaml", folder


def run_row(name, a):
    """The folder of the comparison; None if the data is absent."""
    row, folder = ROWS[name], a.out / name
    if "generate" in row:
        config, dataset = generate(a.tutti, row, a.out / f"{name}-data")
    else:
        config, dataset = ROOT / "data" / "configs" / row["config"], a.data / row["data"]
        if not dataset.exists():
            print(f"{name}: {dataset} is absent; the row is left as it is", file=sys.stderr)
            return None
    if a.reuse and (folder / "comparison.json").exists():
        return folder
    done = subprocess.run([a.tutti, "compare", "--config", config, "--dataset", dataset, "--out", folder, "--variants",
                           ",".join(VARIANTS), "--seeds", str(a.seeds or row["seeds"])])
    if done.returncode not in (0, 1):  # 1: a run failed, and the table says so
        raise subprocess.CalledProcessError(done.returncode, done.args)
    return folder


def section(name, folder):
    """Table and verdict of a row, as `tutti compare` wrote them, without the path of the data set."""
    row = ROWS[name]
    comparison = json.loads((folder / "comparison.json").read_text())
    seeds = max(v["ate_rmse_m"]["count"] for v in comparison["datasets"][0]["variants"])
    text = (folder / "comparison.md").read_text().split("\n", 2)[2].strip()
    made = f"`tutti generate {' '.join(row['generate'])}`; " if "generate" in row else ""
    few = f" ({row['why']})" if seeds < 2 and "why" in row else ""
    return f"## {row['title']}\n\n{made}{seeds} seed{'s' if seeds != 1 else ''}{few}.\n\n{text}\n"


def verdict(found):
    """One line for each row: where the ensemble helped, and where it did not."""
    lines = ["## Where the ensemble helped, and where it did not", "",
             "| row | odometry, ATE | ensemble, ATE | best variant | false loops of the ensemble | did the ensemble help? |",
             "|---|---|---|---|---|---|"]
    for name, comparison in found.items():
        variants = {v["variant"]: v for v in comparison["datasets"][0]["variants"]}
        ate = {v: variants[v]["ate_rmse_m"]["mean"] for v in variants if variants[v]["ate_rmse_m"]["mean"] is not None}
        if "ensemble" not in ate or "odometry" not in ate:
            lines.append(f"| {name} | - | - | - | - | a run failed |")
            continue
        best = min(ate, key=ate.get)
        worse = [v for v in ate if v != "ensemble" and ate[v] <= ate["ensemble"]]
        test = variants["odometry"]["ate_minus_ensemble"]
        sure = " (one seed, no test)" if test["pairs"] < 2 else f" (p = {test['p']:.3f} against the odometry)"
        if ate["ensemble"] >= ate["odometry"]:
            said = "no: not better than the odometry alone"
        elif worse:
            said = f"over the odometry{sure}; not over {', '.join(worse)}"
        else:
            said = f"yes, the best of all{sure}"
        lines.append(f"| {name} | {ate['odometry']:.4f} m | {ate['ensemble']:.4f} m | {best} ({ate[best]:.4f} m) "
                     f"| {variants['ensemble']['loops_false']['mean'] or 0:.1f} | {said} |")
    return "\n".join(lines) + "\n"


def rewrite(path, sections, comparisons):
    old = path.read_text() if path.exists() else ""
    parts, found = [INTRO], {}
    for name in ROWS:
        data = mark(name + " data")
        if name in sections:
            body, found[name] = sections[name], comparisons[name]
        elif mark(name) in old:
            body = old.split(mark(name), 1)[1].split(mark(name, True), 1)[0].strip("\n") + "\n"
            kept = body.split(f"{data[:-4]}\n", 1)
            body = kept[0]
            found[name] = json.loads(kept[1].split("\n-->", 1)[0])
        else:
            continue
        # The figures themselves stay in the file, so that a row can be run alone.
        parts.append(f"{mark(name)}\n{body.rstrip()}\n\n{data[:-4]}\n{json.dumps(found[name])}\n-->\n{mark(name, True)}\n")
    parts.insert(1, verdict(found))
    path.write_text("\n".join(parts))


def slim(comparison):
    """Of comparison.json, what verdict() needs."""
    keys = ("variant", "ate_rmse_m", "loops_false", "ate_minus_ensemble")
    return {"datasets": [{"variants": [{k: v[k] for k in keys} for v in comparison["datasets"][0]["variants"]]}]}


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--tutti", required=True, type=pathlib.Path, help="the executable")
    parser.add_argument("--data", type=pathlib.Path, default=os.environ.get("TUTTI_DATA", ROOT.parent / "shared" / "data"))
    parser.add_argument("--out", type=pathlib.Path, default="/tmp/tutti-benchmark", help="folder for the runs (kept)")
    parser.add_argument("--seeds", type=int, default=0, help="for every row (default: the row's own)")
    parser.add_argument("--reuse", action="store_true", help="take the comparisons that are in --out already")
    parser.add_argument("--markdown", type=pathlib.Path, default=ROOT / "BENCHMARK.md", help="the file to rewrite")
    parser.add_argument("rows", nargs="*", metavar="ROW", help=" ".join(ROWS))
    a = parser.parse_args()
    for name in a.rows:
        if name not in ROWS:
            parser.error(f"unknown row '{name}'; rows are {' '.join(ROWS)}")
    a.tutti, a.out = a.tutti.resolve(), a.out.resolve()
    a.out.mkdir(parents=True, exist_ok=True)
    failed = False
    for name in a.rows or ROWS:
        try:
            folder = run_row(name, a)
        except subprocess.CalledProcessError as error:
            print(f"{name}: FAILED: {error}", file=sys.stderr)
            failed = True
            continue
        if folder is None:
            continue
        comparison = json.loads((folder / "comparison.json").read_text())
        rewrite(a.markdown, {name: section(name, folder)}, {name: slim(comparison)})
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
