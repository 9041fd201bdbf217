#!/usr/bin/env python3
"""The README's results: what `tutti run` reaches on each data set, and whether that is what it must.

usage: ./dev bench readme [ROW...] [--write]     (or bench/run_table.py --build build/release [ROW...] [--write])

Each row is run five times. What varies: on real data the first frame (0 to 4 are skipped), on generated ones the world, its
route as well. Figures are the median, and the worst in brackets; bounds are on the median, but no run may close a false loop.
--write puts the table into docs/results/runs.md, its short form into README.md, its data into docs/results/readme.json. Rows whose data
is absent keep what is there. Exit status 1 if a bound is missed. Needs nothing but Python 3.
"""
import csv
import json
import statistics
import subprocess
import sys

import table

RUNS = 5
HEADER = ("| run | frames tracked | odometry alone, ATE | with the ensemble, ATE | loops true / false | time | must reach |\n"
          "|---|---|---|---|---|---|---|")
# What other systems reach, and who says so: (figure, source).
OTHERS = {"redkitchen": ("stella_vslam: 0.054 m, 498 of 500 frames, no loop", "our run, 2 cores"),
          "kitti": ("stella_vslam: 2.54 m, 1691 of 1700 frames", "our run, 2 cores, fed by the time stamps")}
BIG_TOWN = [("--blocks-x", 4), ("--blocks-x", 3), ("--blocks-x", 3, "--blocks-y", 2), ("--blocks-x", 2, "--blocks-y", 2),
            ("--blocks-x", 5)]


class Row:
    def __init__(self, title, must, bounds, config=None, data=None, world=None, routes=None, extra=None):
        self.title, self.must, self.bounds, self.config, self.data = title, must, bounds, config, data
        self.world, self.routes, self.extra = world, routes, extra or (lambda runs, which: "")


def middle(runs, key):
    return statistics.median(r[key] for r in runs)


def kitti_metric(runs, which):
    path = f" over {middle(runs, 'path_m'):.0f} m" if which == "odometry" else ""
    return f"; {middle(runs, which + '_t_rel'):.2f} %, {middle(runs, which + '_r_rel'):.4f} deg/m{path}"


def share_of_path(runs, which):
    return f"; {statistics.median(100 * r[which + '_ate'] / r['path_m'] for r in runs):.2f} % of the path"


# A bound: what it says, and the figure (of the runs) with its limit.
ROWS = {
    "redkitchen": Row(
        "`redkitchen`, RGB-D", "at most 5 frames not tracked, a true loop, odometry <= 0.055 m, ATE <= 0.048 m, 50 s",
        [("frames not tracked", lambda r: max(x["lost"] for x in r), 5), ("loops", lambda r: -middle(r, "true"), -1),
         ("odometry", lambda r: middle(r, "odometry_ate"), 0.055), ("ATE", lambda r: middle(r, "slam_ate"), 0.048),
         ("time", lambda r: middle(r, "wall_s"), 50)], "7scenes.yaml", "redkitchen"),
    "kitti": Row(
        "`kitti_00_head`, mono", "at most 5 frames not tracked, the loop at its end, odometry <= 15 m, ATE <= 2 m, 170 s, "
        "70 CPU-ms a frame",
        [("frames not tracked", lambda r: max(x["lost"] for x in r), 5), ("the loop", lambda r: -middle(r, "end_closed"), -1),
         ("odometry", lambda r: middle(r, "odometry_ate"), 15), ("ATE", lambda r: middle(r, "slam_ate"), 2),
         ("time", lambda r: middle(r, "wall_s"), 170), ("processor time", lambda r: middle(r, "cpu_ms"), 70)],
        "kitti_00-02_mono.yaml", "kitti_00_head"),
    "euroc": Row(
        "`euroc_v101_head`, stereo, at rest", "all pairs tracked, ATE <= 0.002 m",
        [("frames not tracked", lambda r: max(x["lost"] for x in r), 0), ("ATE", lambda r: middle(r, "slam_ate"), 0.002),
         ("row error", lambda r: middle(r, "row_error_px"), 0.5), ("matches", lambda r: -middle(r, "matches"), -100)],
        "euroc_stereo.yaml", "euroc_v101_head",
        extra=lambda r, which: f"; rows {middle(r, 'row_error_px'):.2f} px, {middle(r, 'matches'):.0f} matches" if which == "odometry" else ""),
    "town": Row(
        "five synthetic stereo towns, 2 laps", "KITTI metric: odometry <= 0.5 %, <= 0.002 deg/m; with the ensemble <= 0.25 %",
        [("odometry, translation", lambda r: middle(r, "odometry_t_rel"), 0.5), ("rotation", lambda r: middle(r, "odometry_r_rel"), 0.002),
         ("with the ensemble, translation", lambda r: middle(r, "slam_t_rel"), 0.25)],
        world=["--sensor", "stereo", "--laps", "2"], routes=BIG_TOWN, extra=kitti_metric),
    "room": Row(
        "five synthetic RGB-D rooms, Kinect noise", "odometry <= 1 % of the path, ATE <= 0.5 %",
        [("odometry", lambda r: statistics.median(x["odometry_ate"] / x["path_m"] for x in r), 0.01),
         ("ATE", lambda r: statistics.median(x["slam_ate"] / x["path_m"] for x in r), 0.005)],
        world=["--sensor", "rgbd", "--world", "room", "--kinect-noise"], routes=[()] * RUNS, extra=share_of_path),
}


def figures(folder, **what):
    """Of one run, the numbers that the table needs."""
    s = json.loads((folder / "summary.json").read_text())
    e = s["evaluation"]
    if "error" in e["slam"] or "error" in e["odometry"]:
        raise ValueError(f"{folder}: no evaluation: {e['slam'].get('error', e['odometry'].get('error'))}")
    with open(folder / "loops.csv", newline="") as f:
        loops = [r for r in csv.DictReader(f) if r["accepted"] == "1"]
    out = dict(what, total=s["frames"]["total"], lost=s["frames"]["total"] - s["frames"]["tracked"], true=s["loops"]["true"],
               false=s["loops"]["false"], path_m=e["path_m"], wall_s=s["timing"]["wall_s"],
               cpu_ms=1000 * s["timing"]["cpu_s"] / s["frames"]["total"],
               end_closed=int(any(int(r["query"]) >= 1564 and int(r["candidate"]) <= 230 for r in loops)))
    for which in ("odometry", "slam"):
        out[which + "_ate"] = e[which]["ate_rmse_m"]
        out[which + "_t_rel"] = e[which].get("kitti_translation_percent")
        out[which + "_r_rel"] = e[which].get("kitti_rotation_deg_per_m")
    if "stereo" in s:
        out.update(row_error_px=s["stereo"]["row_error_px"], matches=s["stereo"]["matches"])
    return out


def run_row(a, name):
    """The figures of its runs; None if the data is absent."""
    row, runs = ROWS[name], []
    if row.data and not (a.data / row.data).exists():
        print(f"{name}: {a.data / row.data} is absent; the row is left as it is", file=sys.stderr)
        return None
    for k in range(RUNS):
        folder = a.out / name / f"run_{k + 1}"
        if row.data:
            config, dataset, what = table.ROOT / "data" / "configs" / row.config, a.data / row.data, {"start": k}
        else:
            options = [*row.world, "--seed", table.WORLD_SEEDS[k], *row.routes[k]]
            dataset = table.generate(a.tutti, a.out / f"{name}-world-{k + 1}", options)
            config, what = dataset / "config.yaml", {"world": " ".join(map(str, options))}
        if not (a.reuse and (folder / "summary.json").exists()):
            subprocess.run([a.tutti, "run", "--require", "failed", "--config", config, "--dataset", dataset, "--out", folder, "--start",
                            str(what.get("start", 0))], check=True)
        runs.append(figures(folder, **what))
    return runs


def missed(row, runs):
    out = [f"{what}: {abs(figure(runs)):.4g} where {abs(limit):.4g} is wanted" for what, figure, limit in row.bounds
           if not figure(runs) <= limit]
    return out + ([f"{sum(r['false'] for r in runs)} false loops"] if any(r["false"] for r in runs) else [])


def metres(value):
    return f"{value:.4f}" if value < 1 else f"{value:.2f}"


def spread(runs, key):
    return f"{metres(middle(runs, key))} m ({metres(max(r[key] for r in runs))} m)"


def line(name, runs):
    row, lost = ROWS[name], max(r["lost"] for r in runs)
    wanted = row.must + "".join(f"; **missed: {m}**" for m in missed(row, runs))
    return (f"| {row.title} | {'all' if lost == 0 else f'all but {lost} at most'} of {runs[0]['total']} "
            f"| {spread(runs, 'odometry_ate')}{row.extra(runs, 'odometry')} | {spread(runs, 'slam_ate')}{row.extra(runs, 'slam')} "
            f"| {middle(runs, 'true'):.0f} / {max(r['false'] for r in runs)} "
            f"| {middle(runs, 'wall_s'):.0f} s, {middle(runs, 'cpu_ms'):.0f} CPU-ms a frame | {wanted} |")


def short_line(name, runs):
    return (f"| {ROWS[name].title}, {runs[0]['total']} frames | {metres(middle(runs, 'slam_ate'))} m, without loops {metres(middle(runs, 'odometry_ate'))} m "
            f"| {' | '.join(OTHERS[name])} |")


def main():
    a = table.parse(table.parser(__doc__, "readme", ROWS), ROWS)
    found, failed = {}, False
    for name in a.rows:
        try:
            runs = run_row(a, name)
        except (subprocess.CalledProcessError, ValueError) as error:
            print(f"{name}: FAILED: {error}", file=sys.stderr)
            failed = True
            continue
        if runs is None:
            continue
        found[name] = runs
        bad = missed(ROWS[name], runs)
        failed = failed or bool(bad)
        print(f"{name}: {'reached' if not bad else 'MISSED: ' + '; '.join(bad)}")
    whole = table.put_json(a, "readme", found)
    table.put(a, table.RESULTS / "runs.md", "\n".join(
        ["# What a run reaches", "", "Written by `./dev bench readme --write` (bench/run_table.py): the median of five runs, and the worst in brackets.", "",
         HEADER] + [line(name, whole[name]) for name in ROWS if name in whole]))
    table.put_between(a, table.ROOT / "README.md", "results", "\n".join(
        ["| data set | tutti, ATE | another system | source |", "|---|---|---|---|"] + [short_line(name, whole[name]) for name in OTHERS if name in whole]))
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
