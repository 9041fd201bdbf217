#!/usr/bin/env python3
"""A camera in a hand that shakes: motion blur and a rolling shutter, in an RGB-D room with the noise of a Kinect.

usage: ./dev bench fast [ROW...] [--write]

Rows: `both`, `readout` alone, `blur` alone and `steady` light (neither). Each room is generated at 30 Hz, 400x300 pixels, with
turns of up to 200 deg/s about each axis; exposure and readout take 30 ms. What varies is the room and the route (five seeds).
With loops. ATE after SE(3) alignment, of the largest submap; a step is the motion between two consecutive frames, compared with the
true one. `--without-readout` tells the runs nothing of the readout.
"""
import json
import math
import statistics
import subprocess
import sys

import table

ROWS = {"both": ["--blur", "0.03", "--readout", "0.03"], "readout": ["--readout", "0.03"], "blur": ["--blur", "0.03"], "steady": []}
WORLD = ["--sensor", "rgbd", "--world", "room", "--kinect-noise", "--rate", "30", "--width", "400", "--height", "300",
         "--supersample", "1", "--shake", "200", "--frames", "390"]
ATE_SHARE, ATE_MORE_M, STEP_M = 0.005, 0.01, 0.03  # bounds: share of the path and more; of a step


def poses(file):
    """{stamp rounded to 10 us: [x, y, z, qx, qy, qz, qw]} of a TUM trajectory."""
    lines = (line.split() for line in file.read_text().splitlines() if line and not line.startswith("#"))
    return {round(float(p[0]), 5): [float(v) for v in p[1:]] for p in lines}


def seen_from(a, b):
    """Position of pose b in the frame of pose a."""
    x, y, z, w = a[3:]
    rows = [[1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]]
    return [sum(rows[i][j] * (b[i] - a[i]) for i in range(3)) for j in range(3)]


def largest_step_error(estimate, truth):
    """Of frames that follow each other in both [m]."""
    stamps = sorted(truth)
    pairs = [(s, t) for s, t in zip(stamps, stamps[1:]) if s in estimate and t in estimate]
    return max(math.dist(seen_from(estimate[s], estimate[t]), seen_from(truth[s], truth[t])) for s, t in pairs)


def run(a, row, seed):
    dataset = table.generate(a.tutti, a.out / f"{row}-{seed}", [*WORLD, "--seed", seed, *ROWS[row]])
    folder = a.out / f"{row}-{seed}-run{'-without' if a.without_readout else ''}"
    if not (a.reuse and (folder / "summary.json").exists()):
        subprocess.run([a.tutti, "run", "--quiet", "--require", "failed", "--no-report", "--config", dataset / "config.yaml", "--dataset", dataset, "--out",
                        folder, *(["--set", "camera.readout_s=0"] if a.without_readout else [])], check=True)
    summary, truth = json.loads((folder / "summary.json").read_text()), poses(dataset / "groundtruth.txt")
    estimate = poses(folder / "trajectory.txt")
    return {"seed": seed, "frames": len(truth), "posed": len(estimate), "ate_m": summary["evaluation"]["slam"]["ate_rmse_m"],
            "path_m": sum(math.dist(truth[s][:3], truth[t][:3]) for s, t in zip(sorted(truth), sorted(truth)[1:])),
            "step_m": largest_step_error(estimate, truth)}


def document(results):
    text = ["# A camera in a hand that shakes", "", "Written by `./dev bench fast --write` (bench/fast_table.py). RGB-D rooms with the "
            "noise of a Kinect, 30 Hz, turns of up to 200 deg/s about each axis.",
            f"Bounds: every frame has a pose, ATE <= {100 * ATE_SHARE} % of the path + {100 * ATE_MORE_M:.0f} cm, each step within "
            f"{100 * STEP_M:.0f} cm of the true one. "
            "Median and worst of five routes; of frames that have a pose in the largest submap.", "",
            "| images | frames without a pose, worst | ATE, median | worst | largest error of a step, median | worst | routes within "
            "all bounds |", "|---|---|---|---|---|---|---|"]
    names = {"both": "exposure and readout of 30 ms", "readout": "readout of 30 ms", "blur": "exposure of 30 ms", "steady": "neither"}
    for key, runs in results.items():
        row, _, without = key.partition("-")
        good = sum(r["posed"] == r["frames"] and r["ate_m"] <= ATE_SHARE * r["path_m"] + ATE_MORE_M and r["step_m"] <= STEP_M
                   for r in runs)
        text.append(f"| {names[row]}{', `camera.readout_s` not told' if without else ''} | {max(r['frames'] - r['posed'] for r in runs)} "
                    f"| {statistics.median(r['ate_m'] for r in runs):.3f} m | {max(r['ate_m'] for r in runs):.3f} m "
                    f"| {100 * statistics.median(r['step_m'] for r in runs):.1f} cm | {100 * max(r['step_m'] for r in runs):.1f} cm "
                    f"| {good} of {len(runs)} |")
    return "\n".join(text)


def main():
    parser = table.parser(__doc__, "fast", ROWS)
    parser.add_argument("--without-readout", action="store_true", help="camera.readout_s: 0 in the runs")
    a = table.parse(parser, ROWS)
    data = table.RESULTS / "fast.json"
    results = json.loads(data.read_text()) if data.exists() else {}
    for row in a.rows:
        results[row + ("-without" if a.without_readout else "")] = [run(a, row, seed) for seed in table.WORLD_SEEDS]
    if a.write:
        data.write_text(json.dumps(results, indent=1) + "\n")
    table.put(a, table.RESULTS / "fast.md", document(results))
    return 0


if __name__ == "__main__":
    sys.exit(main())
