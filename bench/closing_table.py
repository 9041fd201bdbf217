#!/usr/bin/env python3
"""Does the map close? SLAM where single members lose the loop: the ensemble against each member alone and the seed's mean.

usage: ./dev bench closing [ROW...] [--write]

`ring`: a ring of corridors, a little more than one lap, the overlap at dusk. `long`: kitti_00_head with one camera, whose only loop
is the short overlap from frame 1564 on; the images from there on are changed. Both by `tutti compare`, on an odometry that is tracked
once for all variants. `session`, `merge`, `localize`: a town by day, and again at dusk; the second lap goes on in the map of the first
(`tutti run --map`), is a map of its own that joins it (`tutti merge`), or is located in it (`tutti localize`).

Five seeds each: of the world, or of the change. A map closes if a true loop is in it that leads over the gap, and no false one; the two
sessions must become one map; half of the frames must be located. Needs nothing but Python 3.
"""
import csv
import functools
import json
import shutil
import statistics
import subprocess
import sys

import table

# variant of `tutti compare`: title, and the same as a setting of `tutti run`.
VARIANTS = {"odometry": ("no loops", None), "surf": ("SURF alone", "loops.rule=surf"), "sift": ("SIFT alone", "loops.rule=sift"),
            "orb": ("ORB alone", "loops.rule=orb"), "standardised-mean": ("the seed's mean", "loops.preset=standardised-mean"),
            "ensemble": ("**the ensemble**", "loops.rule=joint")}
LOOKING = [v for v in VARIANTS if v != "odometry"]  # for loops

RING = ["--sensor", "stereo", "--world", "corridor", "--corridor", "16", "--laps", "1.1", "--speed", "0.8", "--rate", "8", "--width",
        "320", "--height", "240", "--supersample", "1", "--noise", "--dusk"]
TOWN = ["--sensor", "stereo", "--world", "town", "--blocks-x", "1", "--block", "26", "--laps", "2", "--rate", "4.5", "--width", "320",
        "--height", "160", "--supersample", "1", "--noise", "--dusk"]
BACK = 1564  # first frame of kitti_00_head that shows what was seen before,
SEEN = 230   # namely by frames up to this one
CHANGES = ["overexposed:2", "occluded:2", "dark:2", "overexposed:1", "dark:1"]  # one for each seed


def ring(a, seed):
    """Folder, configuration and the gap that a loop has to lead over [frames]."""
    world = table.generate(a.tutti, a.out / f"ring-{seed}", [*RING, "--seed", seed])
    frames = len((world / "times.txt").read_text().split())
    return world, world / "config.yaml", frames // 2


def long(a, seed):
    """The same; the folder has links to the images that are not changed."""
    source, folder = a.data / "kitti_00_head", a.out / f"long-{seed}"
    images = sorted((source / "image_0").iterdir())
    if not (folder / ".done").exists():
        last = a.out / f"long-{seed}-last"
        table.link_numbered(dict(enumerate(images[BACK:], BACK)), last)
        changed = table.generate(a.tutti, a.out / f"long-{seed}-changed", ["--from-images", last, "--change", CHANGES[seed - 1], "--seed", seed])
        table.link_numbered({**dict(enumerate(images[:BACK])), **dict(enumerate(sorted(changed.glob("*.png")), BACK))}, folder / "image_0")
        for name in ("times.txt", "calib.txt", "poses.txt"):
            (folder / name).symlink_to((source / name).resolve())
        (folder / ".done").write_text("")
    return folder, table.ROOT / "data" / "configs" / "kitti_00-02_mono.yaml", BACK - SEEN


def compared(row, a, seed):
    """{variant: figures} of one seed."""
    dataset, config, gap = row(a, seed)
    out = a.out / f"{row.__name__}-{seed}-compared"
    if not (a.reuse and (out / "comparison.json").exists()):
        subprocess.run([a.tutti, "compare", "--config", config, "--out", out, "--variants", ",".join(VARIANTS), "--runs", "1", "--dataset",
                        dataset], check=True, stdout=subprocess.DEVNULL)
    found = {}
    for variant in VARIANTS:
        folder = out / variant / "run_1"
        summary = json.loads((folder / "summary.json").read_text())
        with open(folder / "loops.csv", newline="") as file:
            loops = [loop for loop in csv.DictReader(file) if loop["accepted"] == "1"]
        over = [loop for loop in loops if loop["correct"] == "1" and int(loop["query"]) - int(loop["candidate"]) >= gap]
        false = summary["loops"]["false"]
        found[variant] = {"closed": bool(over) and not false, "true": summary["loops"]["true"], "false": false,
                          "posed": summary["frames"]["tracked"] / summary["frames"]["total"],
                          "ate_m": summary["evaluation"]["slam"].get("ate_rmse_m")}
    return found


def town(a, seed):
    """Folder, and the first frame of the second lap."""
    folder = table.generate(a.tutti, a.out / f"town-{seed}", [*TOWN, "--seed", seed])
    return folder, len((folder / "times.txt").read_text().split()) // 2


def lap(a, seed, variant, name, *more):
    """Map and summary of a run over a part of the town."""
    dataset, folder = town(a, seed)[0], a.out / f"town-{seed}-{variant}-{name}"
    return folder / "map.tutti", table.run(a, folder, dataset / "config.yaml", dataset, "--set", VARIANTS[variant][1],
                                           "run.odometry_pass=false", *more)


def day(a, seed, variant):
    return lap(a, seed, variant, "day", "--end", town(a, seed)[1])[0]


def error(a, seed, map_file):
    """ATE of all frames of both laps [m]."""
    trajectory = map_file.with_suffix(".txt")
    subprocess.run([a.tutti, "export", map_file, "--tum", trajectory], check=True, stdout=subprocess.DEVNULL)
    return table.errors(a, town(a, seed)[0], trajectory, "sim3")["ate"]["rmse"]


def session(a, seed, variant):
    both, summary = lap(a, seed, variant, "both", "--start", town(a, seed)[1], "--map", day(a, seed, variant))
    info = subprocess.run([a.tutti, "map", "info", both, "--json"], check=True, stdout=subprocess.PIPE, text=True).stdout
    joined, loops = json.loads(info)["submaps"] == 1, summary["loops"]
    return {"closed": joined and not loops["false"], "true": loops["true"], "false": loops["false"],
            "ate_m": error(a, seed, both) if joined else None}


def merge(a, seed, variant):
    dusk, _ = lap(a, seed, variant, "dusk", "--start", town(a, seed)[1])
    file = a.out / f"town-{seed}-{variant}-merged.tutti"
    joined = subprocess.run([a.tutti, "merge", day(a, seed, variant), dusk, "-o", file], capture_output=True).returncode == 0
    return {"closed": joined, "true": None, "false": None, "ate_m": error(a, seed, file) if joined else None}


def localize(a, seed, variant):
    (dataset, dusk), folder = town(a, seed), a.out / f"town-{seed}-{variant}-located"
    shutil.rmtree(folder, ignore_errors=True)
    done = subprocess.run([a.tutti, "localize", "--quiet", "--map", day(a, seed, variant), "--config", dataset / "config.yaml", "--dataset",
                           dataset, "--out", folder, "--start", str(dusk)], stdout=subprocess.DEVNULL)
    if done.returncode not in (0, 1):  # 1: no frame was found, which is a result
        raise subprocess.CalledProcessError(done.returncode, done.args)
    summary = folder / "summary.json"
    frames = json.loads(summary.read_text())["frames"] if summary.exists() else {"localized": 0, "total": 1}
    return {"closed": 2 * frames["localized"] >= frames["total"], "true": None, "false": None, "ate_m": None,
            "located": frames["localized"] / frames["total"]}


def of_variants(row, a, seed):
    return {variant: row(a, seed, variant) for variant in LOOKING}


# name: title, what measures one seed, and which data it needs.
ROWS = {
    "ring": ("a ring of corridors, 1.1 laps, the overlap at dusk, stereo", functools.partial(compared, ring), None),
    "long": (f"`kitti_00_head`, one camera; from frame {BACK} on: {', '.join(CHANGES)}", functools.partial(compared, long), "kitti_00_head"),
    "session": ("a town by day, gone on at dusk (`tutti run --map`), stereo", functools.partial(of_variants, session), None),
    "merge": ("a town by day and one at dusk, merged (`tutti merge`), stereo", functools.partial(of_variants, merge), None),
    "localize": ("frames at dusk in the map of a town by day (`tutti localize`), stereo", functools.partial(of_variants, localize), None)}


def mean(values, form="{:.1f}"):
    values = [v for v in values if v is not None]
    return form.format(statistics.mean(values)) if values else "-"


def section(name, seeds):
    """`seeds`: {variant: figures} of each seed."""
    located = name == "localize"
    lines = [f"## {ROWS[name][0]}", "",
             f"| variant | closed | {'frames located' if located else 'loops true / false'} | frames in the map | ATE |",
             "|---|--:|--:|--:|--:|"]
    for variant in VARIANTS:
        runs = [seed[variant] for seed in seeds if variant in seed]
        if not runs:
            continue
        said = f"{100 * statistics.mean(r['located'] for r in runs):.0f} %" if located else (
            f"{mean([r['true'] for r in runs])} / {mean([r['false'] for r in runs])}")
        posed = f"{100 * statistics.mean(r['posed'] for r in runs):.0f} %" if "posed" in runs[0] else "-"
        lines.append(f"| {VARIANTS[variant][0]} | {sum(r['closed'] for r in runs)} of {len(runs)} | {said} | {posed} "
                     f"| {mean([r['ate_m'] for r in runs], '{:.3f} m')} |")
    return "\n".join(lines) + "\n"


def verdict(whole):
    lines = ["| row | " + " | ".join(VARIANTS[v][0] for v in LOOKING) + " |", "|---" * len(VARIANTS) + "|"]
    lines += [f"| {name} | " + " | ".join(f"{sum(seed[v]['closed'] for seed in whole[name])} of {len(whole[name])}" for v in LOOKING) + " |"
              for name in ROWS if name in whole]
    return "\n".join(lines) + "\n"


def main():
    a = table.parse(table.parser(__doc__, "closing", ROWS), ROWS)
    found = {}
    for name in a.rows:
        title, measure, data = ROWS[name]
        if data and not (a.data / data).exists():
            print(f"{name}: {a.data / data} is absent; the row is left as it is", file=sys.stderr)
            continue
        found[name] = [measure(a, seed) for seed in table.WORLD_SEEDS]
        table.put_json(a, "closing", found)  # a run that is cut off keeps what it has
    whole = table.put_json(a, "closing", found)
    document = ["# Maps that close", "", "Written by `./dev bench closing --write` (bench/closing_table.py), whose head says what is run. "
                "Of five seeds, in how many the map closes; loops and ATE are means over the seeds (of the last three rows: over those that "
                "closed). ATE is that of the frames that are in the map: what comes after a loss of tracking waits for a loop.", "",
                verdict(whole)] + [section(name, whole[name]) for name in ROWS if name in whole]
    table.put(a, table.RESULTS / "closing.md", "\n".join(document))
    return 1 if any(v["false"] for row in found.values() for seed in row for v in seed.values()) else 0


if __name__ == "__main__":
    sys.exit(main())
