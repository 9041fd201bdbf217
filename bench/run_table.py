#!/usr/bin/env python3
"""Runs the rows of the README's results table, checks their targets, and rewrites the table between its markers.

usage: bench/run_table.py --tutti build/release/apps/tutti/tutti [--seeds N] [--data DIR] [--out DIR] [--no-readme] [ROW...]
Rows: redkitchen kitti euroc town room; each figure is the median over the seeds 1 to N. Rows that are not run, or whose data is absent, keep what the README says.
Exit status 1 if a target is missed. Needs nothing but Python 3.
"""
import argparse
import csv
import json
import os
import pathlib
import shutil
import statistics
import subprocess
import sys
import time

ROOT = pathlib.Path(__file__).resolve().parent.parent
BEGIN, END = "<!-- results:begin -->", "<!-- results:end -->"
HEADER = "| run | frames posed | odometry alone, ATE | with the ensemble, ATE | loops true / false | time | must reach |\n|---|---|---|---|---|---|---|"


class Checks:
    """Collects what a row misses."""

    def __init__(self):
        self.missed = []

    def that(self, fulfilled, what):
        if not fulfilled:
            self.missed.append(what)


def check_redkitchen(s, c):
    c.that(s["frames"]["tracked"] >= 495, "at least 495 frames posed")
    c.that(s["loops"]["true"] >= 1 and s["loops"]["false"] == 0, "a true loop closed, none false")
    c.that(s["evaluation"]["odometry"]["ate_rmse_m"] <= 0.055, "odometry ATE <= 0.055 m")
    c.that(s["evaluation"]["slam"]["ate_rmse_m"] <= 0.048, "ATE <= 0.048 m")
    c.that(s["timing"]["wall_s"] <= 50, "at most 50 s")


def check_kitti(s, c):
    odometry, slam = s["evaluation"]["odometry"]["ate_rmse_m"], s["evaluation"]["slam"]["ate_rmse_m"]
    c.that(s["frames"]["tracked"] >= 1695, "at least 1695 frames posed")
    loops = [r for r in s["loops_csv"] if r["accepted"] == "1"]
    closed = any(1564 <= int(r["query"]) <= 1660 and int(r["candidate"]) <= 230 for r in loops)
    c.that(closed and s["loops"]["false"] == 0, "the loop at 1564..1641 closed, none false")
    c.that(odometry <= 15, "odometry ATE <= 15 m")
    c.that(slam <= 2, "ATE <= 2 m")
    c.that(s["timing"]["wall_s"] <= 170, "at most 170 s")
    c.that(1000 * s["timing"]["cpu_s"] / s["frames"]["total"] <= 70, "at most 70 ms of processor time a frame")


def check_euroc(s, c):
    c.that(s["frames"]["tracked"] == 95, "all 95 pairs posed")
    c.that(s["evaluation"]["slam"]["ate_rmse_m"] <= 0.002, "ATE <= 0.002 m")
    c.that(s["stereo"]["row_error_px"] <= 0.5, "row error <= 0.5 px")
    c.that(s["stereo"]["matches"] >= 100, "at least 100 stereo matches")


def check_town(s, c):
    e = s["evaluation"]
    c.that(e["path_m"] >= 1000, "a path of 1 km")
    c.that(e["odometry"]["kitti_translation_percent"] <= 0.5, "odometry: translation within 0.5 %")
    c.that(e["odometry"]["kitti_rotation_deg_per_m"] <= 0.002, "odometry: rotation within 0.002 deg/m")
    c.that(e["slam"]["kitti_translation_percent"] <= 0.25, "with the ensemble: translation within 0.25 %")
    c.that(s["loops"]["false"] == 0, "no false loop")


def check_room(s, c):
    e = s["evaluation"]
    c.that(e["odometry"]["ate_rmse_m"] <= 0.01 * e["path_m"], "odometry: ATE within 1 % of the path")
    c.that(e["slam"]["ate_rmse_m"] <= 0.005 * e["path_m"], "ATE within 0.5 % of the path")
    c.that(s["loops"]["false"] == 0, "no false loop")


ROWS = {
    "redkitchen": ("`redkitchen`, RGB-D", "7scenes.yaml", "redkitchen", check_redkitchen,
                   ">= 495 of 500 posed, a true loop, odometry <= 0.055 m, ATE <= 0.048 m, 50 s"),
    "kitti": ("`kitti_00_head`, mono", "kitti_00-02_mono.yaml", "kitti_00_head", check_kitti,
              ">= 1695 of 1700 posed, odometry <= 15 m, ATE <= 2 m, 170 s, 70 CPU-ms a frame"),
    "euroc": ("`euroc_v101_head`, stereo, at rest", "euroc_stereo.yaml", "euroc_v101_head", check_euroc,
              "95 of 95 posed, ATE <= 0.002 m"),
    "town": ("synthetic stereo town, 2 laps", None, None, check_town,
             "KITTI metric: odometry <= 0.5 %, <= 0.002 deg/m; with the ensemble <= 0.25 %"),
    "room": ("synthetic RGB-D room, Kinect noise", None, None, check_room, "odometry <= 1 % of the path, ATE <= 0.5 %"),
}
WORLDS = {
    "town": ["--sensor", "stereo", "--laps", "2", "--blocks-x", "4", "--seed", "1"],
    "room": ["--sensor", "rgbd", "--world", "room", "--kinect-noise", "--seed", "1"],
}


def generate_world(tutti, folder, options):
    """A world is made once; it is deterministic."""
    done = folder / ".done-by-run_table"
    if not (done.exists() and done.read_text() == " ".join(options)):
        shutil.rmtree(folder, ignore_errors=True)
        subprocess.run([tutti, "generate", "--out", folder, *options], check=True, stdout=subprocess.DEVNULL)
        done.write_text(" ".join(options))
    return folder / "config.yaml", folder


def median_of(values):
    """Of numbers the lower median, of dictionaries that of each entry, of all else the first."""
    first = values[0]
    if isinstance(first, dict):
        return {key: median_of([v[key] for v in values if key in v]) for key in first}
    if isinstance(first, (int, float)) and not isinstance(first, bool):
        return statistics.median_low([v for v in values if v is not None])
    return first


def run_row(name, tutti, data, out, seed):
    _, config, dataset, _, _ = ROWS[name]
    if dataset is None:
        config, dataset = generate_world(tutti, out / f"{name}-data", WORLDS[name])
    else:
        config, dataset = ROOT / "data" / "configs" / config, data / dataset
        if not dataset.exists():
            print(f"{name}: {dataset} is absent; the row is left as it is", file=sys.stderr)
            return None
    folder = out / name / f"seed-{seed}"
    begin = time.time()
    subprocess.run([tutti, "run", "--config", config, "--dataset", dataset, "--out", folder, "--seed", str(seed)], check=True)
    summary = json.loads((folder / "summary.json").read_text())
    with open(folder / "loops.csv", newline="") as f:
        summary["loops_csv"] = list(csv.DictReader(f))
    summary["process_s"] = time.time() - begin
    return summary


def metres(value):
    return f"{value:.4f} m" if value < 1 else f"{value:.2f} m"


def kitti_metric(score):
    return f"; {score['kitti_translation_percent']:.2f} %, {score['kitti_rotation_deg_per_m']:.4f} deg/m"


def table_line(name, s, missed):
    e = s["evaluation"]
    wanted = ROWS[name][4] + ("" if not missed else " **missed: " + "; ".join(missed) + "**")
    if "error" in e["slam"]:
        return f"| {ROWS[name][0]} | {s['frames']['tracked']} / {s['frames']['total']} | - | - | - | - | {wanted} |"
    extra = more = ""
    if name == "town":
        extra, more = kitti_metric(e["odometry"]) + f" over {e['path_m']:.0f} m", kitti_metric(e["slam"])
    if name == "room":
        extra, more = (f"; {100 * e[k]['ate_rmse_m'] / e['path_m']:.2f} % of the path" for k in ("odometry", "slam"))
    if name == "euroc":
        extra = f"; rows {s['stereo']['row_error_px']:.2f} px, {s['stereo']['matches']:.0f} matches"
    return (f"| {ROWS[name][0]} | {s['frames']['tracked']} / {s['frames']['total']} "
            f"| {metres(e['odometry']['ate_rmse_m'])}{extra} | {metres(e['slam']['ate_rmse_m'])}{more} "
            f"| {s['loops']['true']} / {s['loops']['false']} | {s['timing']['wall_s']:.0f} s, {1000 * s['timing']['cpu_s'] / s['frames']['total']:.0f} CPU-ms "
            f"a frame | {wanted} |")


def rewrite_readme(lines):
    path = ROOT / "README.md"
    text = path.read_text()
    begin, end = text.index(BEGIN) + len(BEGIN), text.index(END)
    kept = {}
    for line in text[begin:end].splitlines():
        for name, row in ROWS.items():
            if line.startswith(f"| {row[0]} |"):
                kept[name] = line
    kept.update(lines)
    body = "\n".join([HEADER] + [kept[name] for name in ROWS if name in kept])
    path.write_text(text[:begin] + "\n" + body + "\n" + text[end:])


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--tutti", required=True, help="the executable")
    parser.add_argument("--data", default=os.environ.get("TUTTI_DATA", ROOT.parent / "shared" / "data"))
    parser.add_argument("--out", default="/tmp/tutti-bench", help="folder for the runs (kept)")
    parser.add_argument("--seeds", type=int, default=3, help="number of seeds")
    parser.add_argument("--no-readme", action="store_true", help="print only")
    parser.add_argument("rows", nargs="*", metavar="ROW", help=" ".join(ROWS))
    a = parser.parse_args()
    for name in a.rows:
        if name not in ROWS:
            parser.error(f"unknown row '{name}'; rows are {' '.join(ROWS)}")
    out = pathlib.Path(a.out).resolve()
    out.mkdir(parents=True, exist_ok=True)
    tutti = pathlib.Path(a.tutti).resolve()
    lines, failed = {}, False
    for name in a.rows or ROWS:
        try:
            runs = [run_row(name, tutti, pathlib.Path(a.data), out, seed + 1) for seed in range(a.seeds)]
        except subprocess.CalledProcessError as e:
            print(f"{name}: FAILED: {e}", file=sys.stderr)
            failed = True
            continue
        if None in runs:
            continue
        s = median_of(runs)
        checks = Checks()
        try:
            s["loops"]["false"] = max(run["loops"]["false"] for run in runs)  # of any seed
            ROWS[name][3](s, checks)
        except KeyError as e:
            checks.that(False, f"summary.json has no {e}")
        failed = failed or bool(checks.missed)
        lines[name] = table_line(name, s, checks.missed)
        print(f"{name}: {'reached' if not checks.missed else 'MISSED: ' + '; '.join(checks.missed)}")
        picture = {"kitti": "kitti_00_head.png", "town": "synthetic_town.png"}.get(name)
        if picture and not a.no_readme:
            images = ROOT / "docs" / "images"
            images.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(out / name / "seed-1" / "trajectory.png", images / picture)
    print("\n" + "\n".join([HEADER] + list(lines.values())))
    if not a.no_readme and lines:
        rewrite_readme(lines)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
