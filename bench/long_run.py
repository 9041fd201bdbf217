#!/usr/bin/env python3
"""Drives round and round one synthetic block and samples the memory: it must follow the map, not the frames.

usage: ./dev bench memory [--frames 20000] [--laps 4] [--write]   (or bench/long_run.py --build build/release)
Renders --laps laps (stereo, 400x200), which are then played one after the other until there are --frames: every --laps-th lap
shows the same bytes again. `trajectory_odometry.txt` is left out (run.odometry_pass: false): an odometry without loops does
not know that it is the same block. Its table is in docs/results/timing.md. Needs nothing but Python 3 and /proc.
"""
import json
import pathlib
import re
import shutil
import subprocess
import sys

import table
from performance import DOCUMENT


def render(tutti, folder, laps):
    if (folder / "times.txt").exists():
        return
    subprocess.run([tutti, "generate", "--sensor", "stereo", "--blocks-x", "1", "--width", "400", "--height", "200",
                    "--supersample", "1", "--seed", "3", "--laps", str(laps), "--out", folder], check=True)


def repeat(laps, folder, frames):
    """A data set of `frames` frames that are links to the rendered ones, with their times and poses."""
    shutil.rmtree(folder, ignore_errors=True)
    names = sorted(p.name for p in (laps / "image_0").iterdir())
    times = [float(t) for t in (laps / "times.txt").read_text().split()]
    poses = (laps / "poses.txt").read_text().splitlines()
    period = times[-1] + times[1] - times[0]
    for camera in ("image_0", "image_1"):
        (folder / camera).mkdir(parents=True)
        for i in range(frames):
            (folder / camera / f"{i:06d}.png").symlink_to(laps / camera / names[i % len(names)])
    (folder / "times.txt").write_text(
        "".join(f"{times[i % len(times)] + period * (i // len(times)):.6f}\n" for i in range(frames)))
    (folder / "poses.txt").write_text("".join(poses[i % len(poses)] + "\n" for i in range(frames)))
    shutil.copy(laps / "calib.txt", folder)
    config = (laps / "config.yaml").read_text()
    (folder / "config.yaml").write_text(config + "run:\n  odometry_pass: false\n")


def resident_mb(pid):
    status = pathlib.Path(f"/proc/{pid}/status").read_text()
    return int(re.search(r"VmRSS:\s+(\d+)", status).group(1)) / 1024


def run(tutti, folder, out):
    """Frames done and memory [MB] at each tenth, and the summary."""
    samples = []
    process = subprocess.Popen([tutti, "run", "--config", folder / "config.yaml", "--dataset", folder, "--out", out],
                               stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True)
    for line in process.stderr:
        sys.stderr.write(line)
        done = re.search(r"(\d+)/\d+ frames", line)
        if done:
            samples.append((int(done.group(1)), resident_mb(process.pid)))
    if process.wait() != 0:
        sys.exit(f"tutti run failed with exit status {process.returncode}")
    return samples, json.loads((out / "summary.json").read_text())


def main():
    parser = table.parser(__doc__, "memory")
    parser.add_argument("--frames", type=int, default=20000)
    parser.add_argument("--laps", type=int, default=4)
    a = table.parse(parser)
    render(a.tutti, a.out / "laps", a.laps)
    repeat(a.out / "laps", a.out / "data", a.frames)
    samples, summary = run(a.tutti, a.out / "data", a.out / "result")
    frames, loops = summary["frames"], summary["loops"]
    text = [f"{frames['tracked']} of {frames['total']} frames tracked, {summary['keyframes']} keyframes, {loops['accepted']} loops; "
            f"ATE {summary['evaluation']['slam']['ate_rmse_m']:.3f} m; "
            f"{1e3 * summary['timing']['cpu_s'] / frames['total']:.1f} CPU-ms per frame.", "",
            "| frames | " + " | ".join(str(n) for n, _ in samples) + " |", "|---|" + "---|" * len(samples),
            "| resident memory, MB | " + " | ".join(f"{mb:.0f}" for _, mb in samples) + " |"]
    table.put_between(a, DOCUMENT, "long", "\n".join(text))


if __name__ == "__main__":
    main()
