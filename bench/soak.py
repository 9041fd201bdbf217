#!/usr/bin/env python3
"""A long run round and round one place: does memory, time per frame or anything else grow with the frames?

usage: ./dev bench soak [--frames 200000] [--laps 4] [--noise 2] [--prune 20] [--write]   (or bench/soak.py --build build/release)
Renders --laps laps of a block (stereo, 320x240), and plays them one after the other until there are --frames, each frame with
fresh noise (dataset.noise). Memory must follow the map, not the frames; --prune is run.prune_every (0: never). `trajectory_odometry.txt` is left out
(run.odometry_pass: false): an odometry without loops does not know that it is the same block. About 25 ms of a processor a
frame. Needs nothing but Python 3 and /proc.
"""
import json
import os
import pathlib
import re
import shutil
import subprocess
import sys

import table

DOCUMENT = table.RESULTS / "soak.md"


def render(tutti, folder, laps):
    if (folder / "times.txt").exists():
        return
    subprocess.run([tutti, "generate", "--sensor", "stereo", "--blocks-x", "1", "--width", "320", "--height", "240",
                    "--supersample", "1", "--seed", "3", "--laps", str(laps), "--out", folder], check=True)


def repeat(laps, folder, frames, noise, prune):
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
    assert re.search(r"^dataset:", config, re.M)
    config = re.sub(r"^dataset:\n", f"dataset:\n  noise: {noise}\n", config, flags=re.M)
    (folder / "config.yaml").write_text(config + f"run:\n  odometry_pass: false\n  prune_every: {prune}\n")


def sample(pid):
    """Resident memory [MB], processor time [s], open files."""
    process = pathlib.Path(f"/proc/{pid}")
    status = (process / "status").read_text()
    words = (process / "stat").read_text().rsplit(")", 1)[1].split()
    cpu_s = (int(words[11]) + int(words[12])) / os.sysconf("SC_CLK_TCK")
    return int(re.search(r"VmRSS:\s+(\d+)", status).group(1)) / 1024, cpu_s, len(list((process / "fd").iterdir()))


def run(tutti, folder, out):
    """(frames done, what `sample` says) at each tenth, and the summary."""
    samples = []
    process = subprocess.Popen([tutti, "run", "--require", "failed", "--config", folder / "config.yaml", "--dataset", folder, "--out", out, "--no-report"],
                               stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True)
    for line in process.stderr:
        sys.stderr.write(line)
        done = re.search(r" (\d+)/\d+  ", line)
        if done:
            samples.append((int(done.group(1)), *sample(process.pid)))
            print("{} frames: {:.0f} MB, {:.0f} CPU-s, {} files".format(*samples[-1]), flush=True)  # a run may be cut off
    if process.wait() != 0:
        sys.exit(f"tutti run failed with exit status {process.returncode}")
    return samples, json.loads((out / "summary.json").read_text())


def main():
    parser = table.parser(__doc__, "soak")
    parser.add_argument("--frames", type=int, default=200000)
    parser.add_argument("--laps", type=int, default=4)
    parser.add_argument("--noise", type=float, default=2)
    parser.add_argument("--prune", type=int, default=20)
    a = table.parse(parser)
    render(a.tutti, a.out / "laps", a.laps)
    repeat(a.out / "laps", a.out / "data", a.frames, a.noise, a.prune)
    samples, summary = run(a.tutti, a.out / "data", a.out / "result")
    frames, loops = summary["frames"], summary["loops"]
    rows = []
    before = (0, 0, 0, 0)
    for now in samples:
        rows.append(f"| {now[0]} | {now[1]:.0f} | {1e3 * (now[2] - before[2]) / (now[0] - before[0]):.1f} | {now[3]} |")
        before = now
    half = next(s for s in samples if s[0] >= a.frames / 2 - 1)
    growth = 1024 * (samples[-1][1] - half[1]) / (samples[-1][0] - half[0])
    text = ["# A long run", "",
            f"{a.frames} frames round one synthetic block (stereo, 320x240, {a.laps} rendered laps played over and over, fresh noise of "
            f"{a.noise:g} grey levels in each frame, run.prune_every {a.prune}); `./dev bench soak --frames {a.frames} --prune {a.prune} --write`.", "",
            f"{frames['tracked']} of {frames['total']} frames tracked, {summary['keyframes']} keyframes, {loops['accepted']} loops; ATE "
            f"{summary['evaluation']['slam']['ate_rmse_m']:.3f} m. In the second half memory grew by {growth:.2f} kB a frame.", "",
            "| frames | resident memory, MB | CPU-ms per frame | open files |", "|---|---|---|---|", *rows]
    table.put(a, DOCUMENT, "\n".join(text))


if __name__ == "__main__":
    main()
