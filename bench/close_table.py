#!/usr/bin/env python3
"""Loops for other odometries: `tutti close` on trajectories that are given as files.

usage: ./dev bench close [ROW...] [--write]

Rows: `own`, the trajectory that `tutti run` has without loops on kitti_00_head, beside `tutti run` with them; `walk`, the ground
truth of kitti_00_head with a random walk of yaw and scale (1 sigma after one metre) from fixed seeds; `kitchen`, the same of
redkitchen; `published`, ORB-SLAM's and S-PTAM's trajectories of KITTI 00, the frames of kitti_00_head. Drift at the loop: error
of the last pose, seen from the earlier pose that is nearest to it in truth. ATE is after SE(3) alignment, of own and ORB-SLAM's
after Sim(3).
"""
import json
import math
import random
import subprocess
import sys

import table
from pose_files import inverse, matrix, read_kitti, read_tum, seen_from, times, write_kitti

ROWS = ["own", "walk", "kitchen", "published"]
WALKS = [(0.02, 0.02), (0.05, 0.05), (0.1, 0.1)]  # yaw [deg], scale [%], after one metre
SEED = 1
REMOVED = 0.8  # of the drift at the loop, at least


def disturbed(poses, yaw_deg, scale_percent):
    """The steps of `poses` with a random walk."""
    draw = random.Random(SEED)
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


def drift(truth, estimate):
    """Of the last pose, seen from the earlier one that is nearest to it in truth [m]."""
    place = lambda p: [p[i][3] for i in range(3)]
    end = len(truth) - 1
    near = min(range(end // 2), key=lambda i: math.dist(place(truth[i]), place(truth[end])))
    return math.dist(seen_from(truth[near], truth[end]), seen_from(estimate[near], estimate[end]))


def way(poses):
    """Length of the path."""
    return sum(math.dist([p[i][3] for i in range(3)], [q[i][3] for i in range(3)]) for p, q in zip(poses, poses[1:]))


def scale_by(poses, factor):
    for pose in poses:
        for i in range(3):
            pose[i][3] *= factor


def close(a, name, data, config, trajectory, more=()):
    """Summary and corrected poses."""
    out = a.out / name
    if not (a.reuse and (out / "summary.json").exists()):
        subprocess.run([a.tutti, "close", "--quiet", "--no-report", "--trajectory", trajectory, "--images", data, "--config", config,
                        "--out", out, *map(str, more)], check=True, stdout=subprocess.DEVNULL)
    summary = json.loads((out / "summary.json").read_text())
    said = summary["evaluation"]
    return {"name": name, "before_ate_m": said["odometry"]["ate_rmse_m"], "ate_m": said["slam"]["ate_rmse_m"],
            "true": summary["loops"]["true"], "false": summary["loops"]["false"]}, [matrix(p) for p in read_tum(out / "trajectory.txt").values()]


def kitti(a):
    return a.data / "kitti_00_head", table.ROOT / "data" / "configs" / "kitti_00-02_mono.yaml"


def own(a):
    data, config = kitti(a)
    out = a.out / "own-run"
    if not (a.reuse and (out / "summary.json").exists()):
        subprocess.run([a.tutti, "run", "--quiet", "--no-report", "--no-map", "--config", config, "--dataset", data, "--out", out],
                       check=True, stdout=subprocess.DEVNULL)
    run = json.loads((out / "summary.json").read_text())["evaluation"]["slam"]["ate_rmse_m"]
    row, _ = close(a, "own", data, config, out / "trajectory_odometry.txt")
    return [dict(row, run_ate_m=run)]


def walk(a):
    data, config = kitti(a)
    truth = read_kitti(data / "poses.txt")
    others = read_kitti(a.data / "trajectories" / "KITTI_00_ORB.txt", len(truth))
    scale_by(others, way(truth) / way(others))
    rows = []
    for yaw, scale in WALKS:
        given = disturbed(truth, yaw, scale)
        file = a.out / f"walk-{yaw}-{scale}.txt"
        write_kitti(file, given)
        row, corrected = close(a, f"walk-{yaw}-{scale}", data, config, file)
        rows.append(dict(row, before_m=drift(truth, given), after_m=drift(truth, corrected),
                         before_by_other_m=drift(others, given), after_by_other_m=drift(others, corrected)))
    return rows


def kitchen(a):
    data, config = a.data / "redkitchen", table.ROOT / "data" / "configs" / "7scenes.yaml"
    read = read_tum(data / "groundtruth.txt")
    truth = [matrix(p) for p in read.values()]
    stamps = a.out / "kitchen-times.txt"
    stamps.parent.mkdir(parents=True, exist_ok=True)
    stamps.write_text("".join(f"{s:.9f}\n" for s in read))
    rows = []
    for yaw, scale in [(1, 1), (3, 3)]:  # 7 m are short
        given = disturbed(truth, yaw, scale)
        file = a.out / f"kitchen-{yaw}-{scale}.txt"
        write_kitti(file, given)
        row, corrected = close(a, f"kitchen-{yaw}-{scale}", data, config, file, ["--times", stamps])
        rows.append(dict(row, before_m=drift(truth, given), after_m=drift(truth, corrected)))
    return rows


def published(a):
    data, config = kitti(a)
    truth = read_kitti(data / "poses.txt")
    rows = []
    for name in ("ORB", "SPTAM"):
        file = a.out / f"{name}.txt"
        given = read_kitti(a.data / "trajectories" / f"KITTI_00_{name}.txt", len(truth))
        write_kitti(file, given)
        row, corrected = close(a, name, data, config, file)
        rows.append(dict(row, from_truth_m=drift(truth, given), moved_m=drift(given, corrected)))
    return rows


def verdict(r):
    """Bound of a row, what it reached, and whether that holds."""
    if "before_m" in r:
        removed = 1 - r["after_m"] / r["before_m"]
        return f">= {100 * REMOVED:.0f} % of the drift removed", f"{100 * removed:.0f} %", removed >= REMOVED
    if "run_ate_m" in r:
        more = r["ate_m"] / r["run_ate_m"] - 1
        return f"ATE within 20 % of `tutti run`, {r['run_ate_m']:.3f} m", f"{100 * more:+.0f} %", more <= 0.2
    return "ATE not worse than given", f"{100 * (r['ate_m'] / r['before_ate_m'] - 1):+.1f} %", r["ate_m"] <= r["before_ate_m"]


def document(results):
    text = ["# Loops for other odometries", "", "Written by `./dev bench close --write` (bench/close_table.py): `tutti close` on "
            "trajectories that are given as files, with its defaults. `ATE` after Sim(3) alignment where the camera is one "
            "(kitti_00_head), else SE(3). Drift at the loop: error of the last pose, seen from the earlier pose that is nearest to it "
            "in truth. `walk-A-B`, `kitchen-A-B`: ground truth with a random walk of A degrees of yaw and B % of scale after one "
            "metre. No row may have a false loop.", "",
            "| trajectory | ATE, given | closed | drift at the loop, given | closed | loops true / false | bound | reached | |",
            "|---|---|---|---|---|---|---|---|---|"]
    for r in [r for row in ROWS for r in results.get(row, [])]:
        drifts = f"{r['before_m']:.3f} m | {r['after_m']:.3f} m" if "before_m" in r else "| "
        bound, reached, holds = verdict(r)
        text.append(f"| `{r['name']}` | {r['before_ate_m']:.3f} m | {r['ate_m']:.3f} m | {drifts} | {r['true']} / {r['false']} | "
                    f"{bound} | {reached} | {'holds' if holds and r['false'] == 0 else '**fails**'} |")
    for r in [r for r in results.get("published", []) if r["name"] == "ORB"]:
        text += ["", f"The ground truth of kitti_00_head (GPS and inertial) is not exact at the loop: ORB-SLAM's trajectory, which has closed "
                 f"it, is {r['from_truth_m']:.2f} m from it there, and the loops found here move that trajectory by {r['moved_m']:.2f} m. "
                 "So two measurements from images agree with each other and not with the ground truth; a drift or an ATE below that "
                 "distance can't be told from an error of the ground truth."]
    walks = [r for r in results.get("walk", []) if "after_by_other_m" in r]
    if walks:
        text += ["", "So the same walks, with ORB-SLAM's trajectory (in the ground truth's scale) for the truth at the loop:", "",
                 "| trajectory | drift at the loop, given | closed | removed |", "|---|---|---|---|"]
        text += [f"| `{r['name']}` | {r['before_by_other_m']:.3f} m | {r['after_by_other_m']:.3f} m | "
                 f"{100 * (1 - r['after_by_other_m'] / r['before_by_other_m']):.0f} % |" for r in walks]
    return "\n".join(text)


def main():
    a = table.parse(table.parser(__doc__, "close", ROWS), ROWS)
    data = table.RESULTS / "close.json"
    results = json.loads(data.read_text()) if data.exists() else {}
    for row in a.rows:
        results[row] = {"own": own, "walk": walk, "kitchen": kitchen, "published": published}[row](a)
        if a.write:
            data.write_text(json.dumps(results, indent=1) + "\n")
    table.put(a, table.RESULTS / "close.md", document(results))
    return 0


if __name__ == "__main__":
    sys.exit(main())
