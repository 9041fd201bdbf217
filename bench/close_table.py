#!/usr/bin/env python3
"""Loops for other odometries: `tutti close` on trajectories that are given as files.

usage: ./dev bench close [ROW...] [--write]

Rows: `own`, the trajectory that `tutti run` has without loops on kitti_00_head, beside `tutti run` with them; `walk`, the ground
truth of kitti_00_head with a random walk of yaw and scale (1 sigma after one metre) from fixed seeds; `kitchen`, the same of
redkitchen, seen by COLMAP's poses of every fifth image, too (COLMAP takes 10 to 20 minutes; --reuse takes those that are there);
`published`, ORB-SLAM's and S-PTAM's trajectories of KITTI 00, the frames of kitti_00_head. Drift at the loop: error of a pose,
seen from the earlier one that is nearest to it in truth; median over all poses that come back to a place. ATE is after SE(3)
alignment, of own and ORB-SLAM's after Sim(3).
"""
import json
import math
import random
import statistics
import subprocess
import sys

import structure_from_motion
import table
from pose_files import inverse, matrix, read_kitti, read_tum, seen_from, times, write_kitti

ROWS = ["own", "walk", "kitchen", "published"]
WALKS = [(0.02, 0.02), (0.05, 0.05), (0.1, 0.1)]  # yaw [deg], scale [%], after one metre
SEEDS = (1, 2, 3)
BACK = {"kitti": (3, 300), "kitchen": (0.2, 150)}  # come back: to within so many metres of a pose so many frames before
EVERY = 5  # of the kitchen's images one goes to COLMAP
KITCHEN_CAMERA = (520, 520, 318, 236)  # fx, fy, cx, cy of data/configs/7scenes.yaml [px]
REMOVED = 0.8  # of the drift at the loop, at least


def disturbed(poses, yaw_deg, scale_percent, seed):
    """The steps of `poses` with a random walk."""
    draw = random.Random(seed)
    out, log_scale = [poses[0]], 0.0
    for before, after in zip(poses, poses[1:]):
        step = times(inverse(before), after)
        root = math.sqrt(math.sqrt(sum(step[i][3] ** 2 for i in range(3))))
        log_scale += 0.01 * scale_percent * root * draw.gauss(0, 1)
        yaw = math.radians(yaw_deg) * root * draw.gauss(0, 1)
        for i in range(3):
            step[i][3] *= math.exp(log_scale)
        c, s = math.cos(yaw), math.sin(yaw)
        out.append(times(out[-1], times(step, [[c, 0, s, 0], [0, 1, 0, 0], [-s, 0, c, 0], [0, 0, 0, 1]])))
    return out


def returns(truth, where, frames):
    """(earlier, later) for each pose of these frames that comes back to a place."""
    radius, gap = BACK[where]
    places = {k: [truth[k][i][3] for i in range(3)] for k in frames}
    near = ((min((i for i in frames if i < k - gap), key=lambda i: math.dist(places[i], places[k]), default=None), k) for k in frames)
    return [(i, k) for i, k in near if i is not None and math.dist(places[i], places[k]) < radius]


def drift(pairs, truth, estimate):
    """Median error of the later pose, seen from the earlier one [m]."""
    return statistics.median(math.dist(seen_from(truth[i], truth[k]), seen_from(estimate[i], estimate[k])) for i, k in pairs)


def way(poses):
    """Length of the path."""
    return sum(math.dist([p[i][3] for i in range(3)], [q[i][3] for i in range(3)]) for p, q in zip(poses, poses[1:]))


def in_scale_of(truth, poses):
    """{frame: pose}, scaled so that its path is as long as that of these frames in truth."""
    factor = way([truth[k] for k in poses]) / way(list(poses.values()))
    return {k: [[*row[:3], row[3] * factor] for row in pose[:3]] + [pose[3]] for k, pose in poses.items()}


def close(a, name, data, config, trajectory, more=()):
    """Summary and corrected poses."""
    out = a.out / name
    if not (a.reuse and (out / "summary.json").exists()):
        subprocess.run([a.tutti, "close", "--quiet", "--require", "failed", "--no-report", "--trajectory", trajectory, "--images", data, "--config", config,
                        "--out", out, *map(str, more)], check=True, stdout=subprocess.DEVNULL)
    summary = json.loads((out / "summary.json").read_text())
    said = summary["evaluation"]
    return {"name": name, "before_ate_m": said["odometry"]["ate_rmse_m"], "ate_m": said["slam"]["ate_rmse_m"],
            "true": summary["loops"]["true"], "false": summary["loops"]["false"]}, [matrix(p) for p in read_tum(out / "trajectory.txt").values()]


def kitti(a):
    return a.data / "kitti_00_head", table.ROOT / "data" / "configs" / "kitti_00-02_mono.yaml"


def run(a, data, config, out):
    if not (a.reuse and (out / "summary.json").exists()):
        subprocess.run([a.tutti, "run", "--quiet", "--require", "failed", "--no-report", "--no-map", "--config", config, "--dataset", data, "--out", out],
                       check=True, stdout=subprocess.DEVNULL)


def own(a):
    data, config = kitti(a)
    out = a.out / "own-run"
    run(a, data, config, out)
    of_run = json.loads((out / "summary.json").read_text())["evaluation"]["slam"]["ate_rmse_m"]
    row, _ = close(a, "own", data, config, out / "trajectory_odometry.txt")
    return [dict(row, run_ate_m=of_run)]


def walked(a, name, config, data, truth, walks, where, more, others):
    """A row per walk: of each seed the drift before and after, seen by the truth and by somebody else's {frame: pose}."""
    pairs, pairs_of_others, rows = returns(truth, where, range(len(truth))), returns(truth, where, list(others)), []
    for yaw, scale in walks:
        of_seeds = []
        for seed in SEEDS:
            given = disturbed(truth, yaw, scale, seed)
            file = a.out / f"{name}-{yaw}-{scale}-{seed}.txt"
            write_kitti(file, given)
            row, corrected = close(a, file.stem, data, config, file, more)
            row.update(before_m=drift(pairs, truth, given), after_m=drift(pairs, truth, corrected),
                       before_by_other_m=drift(pairs_of_others, others, given),
                       after_by_other_m=drift(pairs_of_others, others, corrected))
            of_seeds.append(row)
        rows.append({"name": f"{name}-{yaw}-{scale}", "seeds": of_seeds, "other_from_truth_m": drift(pairs_of_others, truth, others)})
    return rows


def walk(a):
    data, config = kitti(a)
    truth = read_kitti(data / "poses.txt")
    others = read_kitti(a.data / "trajectories" / "KITTI_00_ORB.txt", len(truth))
    return walked(a, "walk", config, data, truth, WALKS, "kitti", (), in_scale_of(truth, dict(enumerate(others))))


def kitchen(a):
    data, config = a.data / "redkitchen", table.ROOT / "data" / "configs" / "7scenes.yaml"
    read = read_tum(data / "groundtruth.txt")
    stamps = a.out / "kitchen-times.txt"
    stamps.parent.mkdir(parents=True, exist_ok=True)
    stamps.write_text("".join(f"{s:.9f}\n" for s in read))
    truth = [matrix(p) for p in read.values()]
    files = table.tum_images(data)
    if len(files) != len(truth):
        raise RuntimeError(f"{data}: {len(files)} images, {len(truth)} true poses")
    others = in_scale_of(truth, structure_from_motion.poses({k: files[k] for k in range(0, len(files), EVERY)}, KITCHEN_CAMERA,
                                                            a.out / "kitchen-colmap", a.reuse))
    # 7 m are short: larger walks, of which the last is farther off than the ground truth itself
    rows = []
    for name, more in (("kitchen", []), ("kitchen-adjusted", ["--set", "run.adjust_given=true"])):
        rows += walked(a, name, config, data, truth, [(1, 1), (3, 3), (10, 10)], "kitchen", ["--times", stamps, *more], others)
    return rows


def published(a):
    data, config = kitti(a)
    truth = read_kitti(data / "poses.txt")
    pairs, rows = returns(truth, "kitti", range(len(truth))), []
    for name in ("ORB", "SPTAM"):
        file = a.out / f"{name}.txt"
        given = read_kitti(a.data / "trajectories" / f"KITTI_00_{name}.txt", len(truth))
        write_kitti(file, given)
        row, corrected = close(a, name, data, config, file)
        rows.append(dict(row, from_truth_m=drift(pairs, truth, given), moved_m=drift(pairs, given, corrected)))
    return rows


def removed(row, by=""):
    """Shares of the drift at the loop that are gone, a seed each."""
    return [1 - r[f"after_{by}m"] / r[f"before_{by}m"] for r in row["seeds"]]


def range_of(values, form):
    """Median (lowest to highest)."""
    return f"{form(statistics.median(values))} ({form(min(values))} to {form(max(values))})"


def percent(share):
    return f"{100 * share:.0f} %"


def metres(length):
    return f"{length:.3f} m"


def verdict(r):
    """Bound of a row, what it reached, and whether that holds."""
    if "seeds" in r:
        shares = removed(r)
        return f">= {100 * REMOVED:.0f} % of the drift removed", range_of(shares, percent), min(shares) >= REMOVED
    if "run_ate_m" in r:
        more = r["ate_m"] / r["run_ate_m"] - 1
        return f"ATE within 20 % of `tutti run`, {r['run_ate_m']:.3f} m", f"{100 * more:+.0f} %", more <= 0.2
    return "ATE not worse than given", f"{100 * (r['ate_m'] / r['before_ate_m'] - 1):+.1f} %", r["ate_m"] <= r["before_ate_m"]


def cells(r):
    """ATE and drift, given and closed; loops."""
    if "seeds" not in r:
        return [f"{r['before_ate_m']:.3f} m", f"{r['ate_m']:.3f} m", "", "", f"{r['true']} / {r['false']}"]
    lengths = [range_of([s[key] for s in r["seeds"]], metres) for key in ("before_ate_m", "ate_m", "before_m", "after_m")]
    return [*lengths, f"{sum(s['true'] for s in r['seeds'])} / {sum(s['false'] for s in r['seeds'])}"]


def document(results):
    text = ["# Loops for other odometries", "", "Written by `./dev bench close --write` (bench/close_table.py): `tutti close` on "
            "trajectories that are given as files, with its defaults. `ATE` after Sim(3) alignment where the camera is one "
            "(kitti_00_head), else SE(3). Drift at the loop: error of a pose, seen from the earlier one that is nearest to it in truth; "
            f"median over all poses that come back to within {BACK['kitti'][0]} m (kitchen: {BACK['kitchen'][0]} m) of a place. "
            "`walk-A-B`, `kitchen-A-B`: ground truth with a random walk of A degrees of yaw and B % of scale after one "
            f"metre, {len(SEEDS)} seeds each: median (least to most), the loops of all together; a bound holds if it does for each seed. No row may have a "
            "false loop. `adjusted`: with `run.adjust_given`, bundle adjustment after loops.", "",
            "| trajectory | ATE, given | closed | drift at the loop, given | closed | loops true / false | bound | reached | |",
            "|---|---|---|---|---|---|---|---|---|"]
    for r in [r for row in ROWS for r in results.get(row, [])]:
        bound, reached, holds = verdict(r)
        false = sum(s["false"] for s in r.get("seeds", [r]))
        text.append(f"| `{r['name']}` | {' | '.join(cells(r))} | {bound} | {reached} | {'holds' if holds and false == 0 else '**fails**'} |")
    walks = [r for row in ("walk", "kitchen") for r in results.get(row, [])]
    moved = [r["moved_m"] for r in results.get("published", []) if r["name"] == "ORB"]
    if walks:
        text += ["", "A ground truth has errors of its own at the loop (GPS and inertial; the kitchen's is fitted to depth images). There "
                 "`image` below, a trajectory from the images alone, is as far from it as this table says: ORB-SLAM's of KITTI 00, "
                 f"COLMAP's of every {EVERY}th image of the kitchen, both in the ground truth's scale. What `tutti close` leaves is about as far from the ground truth, "
                 "whatever it was given; so the same drifts once more, seen by `image`."]
        text += [f"(The loops found here move ORB-SLAM's trajectory, which has closed them, by {m:.2f} m.)" if m > 0.005 else
                 "(ORB-SLAM's trajectory, which has closed these loops, is not moved by those found here.)" for m in moved]
        text += ["", "| trajectory | `image` from the ground truth, at the loop | drift at the loop by `image`, given | closed | removed | "
                 f">= {100 * REMOVED:.0f} % |", "|---|---|---|---|---|---|"]
        for r in walks:
            shares = removed(r, "by_other_")
            text.append(f"| `{r['name']}` | {r['other_from_truth_m']:.3f} m | "
                        f"{range_of([s['before_by_other_m'] for s in r['seeds']], metres)} | "
                        f"{range_of([s['after_by_other_m'] for s in r['seeds']], metres)} | {range_of(shares, percent)} | "
                        f"{'holds' if min(shares) >= REMOVED else '**fails**'} |")
    return "\n".join(text)


def main():
    a = table.parse(table.parser(__doc__, "close", ROWS), ROWS)
    data = table.RESULTS / "close.json"
    results = json.loads(data.read_text()) if data.exists() else {}
    # Rows of one walk alone, as they were before, are to be measured anew.
    results = {row: r for row, r in results.items() if row not in ("walk", "kitchen") or all("seeds" in each for each in r)}
    for row in a.rows:
        results[row] = {"own": own, "walk": walk, "kitchen": kitchen, "published": published}[row](a)
        if a.write:
            data.write_text(json.dumps(results, indent=1) + "\n")
    table.put(a, table.RESULTS / "close.md", document(results))
    return 0


if __name__ == "__main__":
    sys.exit(main())
