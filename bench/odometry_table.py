#!/usr/bin/env python3
"""Odometry where it is hard: one camera in a hand, an RGB-D camera that is shaken, one camera on straight roads, a slow one on a road.

usage: ./dev bench odometry [ROW...] [--write]

`hand`: the colour images of redkitchen (JPEG, 15 a second) and H.264 videos that ffmpeg makes of them, with every frame and with every
second one, from six first frames; with loops. `shake`: RGB-D rooms with the noise of a Kinect, 30 Hz, turns of up to 200 deg/s, five
rooms; with loops. `road`: drives of 400 m and more from three first frames (the street with two lenses: two worlds, five first frames);
without loops. `slow`: kitti_00_head with every first to fourth frame, and with 10 % of the frames missing at random (five draws);
600 frames from each of three places, three first frames each; without loops. ATE after Sim(3) alignment, with RGB-D SE(3); posed are the
frames of the largest submap; a step is the motion between two frames, compared with the true one. What is absent (kitti_00_head,
redkitchen, ffmpeg) is left out.
"""
import random
import shutil
import statistics
import subprocess
import sys

import table

RATE_HZ = 15  # of redkitchen
ROOM = ["--sensor", "rgbd", "--world", "room", "--kinect-noise", "--rate", "30", "--width", "400", "--height", "300", "--supersample", "1",
        "--shake", "200", "--frames", "390"]
LIGHT = {"exposure and readout of 30 ms": ["--blur", "0.03", "--readout", "0.03"], "readout of 30 ms": ["--readout", "0.03"],
         "exposure of 30 ms": ["--blur", "0.03"], "neither": []}
STREET = ["--block", "200", "--blocks-x", "4", "--frames", "505"]
TURNS = ["--block", "60", "--blocks-x", "2", "--blocks-y", "2", "--laps", "0.95"]
WRONG_LENS = ["--set", "camera.distortion=radtan", "camera.coefficients=[0.01, 0, 0, 0, 0]"]
DRIVES = {  # seeds of worlds, first frames, options of the world and of the runs
    "street": ([1, 2], 5, STREET, []), "street, k1 0.01 off": ([1, 2], 5, STREET, WRONG_LENS),
    "another street": ([21], 3, STREET, []), "and another": ([22], 3, STREET, []),
    "the camera looks 15 deg down": ([25], 3, [*STREET, "--pitch", "15"], []), "8 deg up": ([35], 3, [*STREET, "--pitch", "-8"], []),
    "hills of 6 m": ([27], 3, [*STREET, "--hills", "6"], []),
    "15 m/s": ([30], 3, [*STREET[:4], "--frames", "300", "--speed", "15"], []),
    "oncoming cars": ([31], 3, [*STREET, "--moving-objects", "12"], []),
    "320 x 240": ([32], 3, [*STREET, "--width", "320", "--height", "240"], []),
    "turns": ([33], 3, TURNS, []), "turns, hills of 8 m": ([34], 3, [*TURNS, "--hills", "8"], [])}


SLOW_STARTS, SLOW_FRAMES, SLOW_DRAWS, MISSING = (0, 600, 1100), 597, (0, 1, 2), 0.1
SLOW_STRIDES = {1: "10 Hz", 2: "5 Hz", 3: "3.3 Hz", 4: "2.5 Hz"}
SLOW_MISSING = f"10 Hz, {100 * MISSING:.0f} % of the frames missing"
SLOW_BOUNDS = {"10 Hz": 1, "5 Hz": 1.2, "3.3 Hz": 2, "2.5 Hz": 3, SLOW_MISSING: 1.3}  # median of the ATE, over that at 10 Hz


def figures(summary, which):
    loops, e = summary.get("loops", {}), summary["evaluation"]
    return {"posed": summary["frames"]["tracked"] / summary["frames"]["total"], "ate_m": e[which]["ate_rmse_m"], "path_m": e["path_m"],
            "true": loops.get("true"), "false": loops.get("false")}


def video(a, data, crf):
    """The colour images in the order of rgb.txt as an H.264 file, which is made once."""
    out, order = a.out / f"redkitchen-crf{crf}.mp4", a.out / "order"
    if not out.exists():
        table.link_numbered(dict(enumerate(table.tum_images(data))), order)
        part = out.with_suffix(".part.mp4")
        subprocess.run(["ffmpeg", "-loglevel", "error", "-y", "-framerate", str(RATE_HZ), "-i", order / "%06d.jpg", "-c:v", "libx264",
                        "-crf", str(crf), "-pix_fmt", "yuv420p", part], check=True)
        part.rename(out)
    return out


def hand(a):
    data, found = a.data / "redkitchen", {}
    if not data.exists():
        print(f"hand: {data} is absent; the row is left as it is", file=sys.stderr)
        return found
    for crf in (None, 18, 28) if shutil.which("ffmpeg") else (None,):
        source = [] if crf is None else ["--ground-truth", data / "groundtruth.txt", "--set", "dataset.type=auto", f"dataset.rate_hz={RATE_HZ}"]
        for stride in (1, 2):
            case = f"{'images' if crf is None else f'H.264, crf {crf}'}, {RATE_HZ / stride:g} Hz"
            found[case] = [dict(figures(table.run(
                a, a.out / f"hand-{crf}-{stride}-{start}", table.ROOT / "data/configs/7scenes.yaml", video(a, data, crf) if crf else data,
                "--no-map", "--start", start, *source, "--set", "dataset.sensor=mono", f"dataset.stride={stride}", "run.odometry_pass=false"),
                "slam"), start=start) for start in (0, 50, 100, 150, 200, 250)]
    return found


def shake(a):
    found = {}
    for light, options in LIGHT.items():
        for told in (True, False) if "--readout" in options else (True,):
            runs = found[light + ("" if told else ", `camera.readout_s` not told")] = []
            for seed in table.WORLD_SEEDS:
                dataset = table.generate(a.tutti, a.out / f"room-{len(options)}{options[0] if options else ''}-{seed}", [*ROOM, "--seed", seed, *options])
                folder = a.out / f"{dataset.name}-run{'' if told else '-not-told'}"
                summary = table.run(a, folder, dataset / "config.yaml", dataset, *([] if told else ["--set", "camera.readout_s=0"]))
                steps = table.errors(a, dataset, folder / "trajectory.txt", "se3")["rpe"]["translation"]
                runs.append(dict(figures(summary, "slam"), seed=seed, step_m=steps["max"]))
    return found


def road(a):
    found = {}
    for case, (seeds, starts, world, options) in DRIVES.items():
        runs = found[case] = []
        for seed in seeds:
            dataset = table.generate(a.tutti, a.out / f"drive-{seed}", ["--sensor", "mono", *world, "--seed", str(seed)])
            runs += [dict(figures(table.run(a, a.out / f"drive-{seed}-{start}{'-lens' if options else ''}", dataset / "config.yaml", dataset,
                                            "--no-loops", "--start", start, *options), "odometry"), seed=seed, start=start) for start in range(starts)]
    return found


def cut(data, folder, numbers):
    """A data set in KITTI's layout of these frames alone."""
    table.link_numbered({i: data / "image_0" / name for i, name in enumerate(image_names(data, numbers))}, folder / "image_0")
    for name in ("times.txt", "poses.txt"):
        lines = (data / name).read_text().splitlines()
        (folder / name).write_text("".join(lines[i] + "\n" for i in numbers))
    return folder


def image_names(data, numbers):
    names = sorted(f.name for f in (data / "image_0").iterdir())
    return [names[i] for i in numbers]


def slow(a):
    data, found = a.data / "kitti_00_head", {}
    if not data.exists():
        print(f"slow: {data} is absent; the row is left as it is", file=sys.stderr)
        return found

    def measure(case, start, draw, numbers):
        folder = a.out / f"slow-{case.replace(' ', '-').replace('%', 'percent')}-{start}-{draw}"
        config, frames = table.ROOT / "data/configs/kitti_00-02_mono.yaml", cut(data, folder / "cut", numbers)
        summary = table.run(a, folder / "run", config, frames, "--no-map", "--no-loops")
        found.setdefault(case, []).append(dict(figures(summary, "odometry"), start=start, draw=draw))

    for stride in SLOW_STRIDES:
        for start in SLOW_STARTS:
            for draw in SLOW_DRAWS:
                measure(SLOW_STRIDES[stride], start, draw, range(start + draw, start + draw + SLOW_FRAMES, stride))
    for start in SLOW_STARTS:
        for draw in range(5):
            rng = random.Random(draw)
            measure(SLOW_MISSING, start, draw, [i for i in range(start, start + SLOW_FRAMES) if rng.random() >= MISSING])
    usual = {start: statistics.median(r["ate_m"] for r in found[SLOW_STRIDES[1]] if r["start"] == start) for start in SLOW_STARTS}
    for case, runs in found.items():
        for r in runs:
            r.update(times=round(r["ate_m"] / usual[r["start"]], 3), bound=SLOW_BOUNDS[case])
    return found


# row: title, what measures it, bounds in words, and whether a run keeps them.
ROWS = {"hand": ("One camera in a hand", hand, "ATE <= 0.10 m, 98 % of the frames posed, no false loop",
                 lambda r: r["ate_m"] <= 0.1 and r["posed"] >= 0.98 and not r["false"]),
        "shake": ("A shaken RGB-D camera", shake, "all frames posed, ATE <= 0.5 % of the path + 1 cm, each step within 3 cm of the true one",
                  lambda r: r["posed"] == 1 and r["ate_m"] <= 0.005 * r["path_m"] + 0.01 and r["step_m"] <= 0.03),
        "road": ("One camera on straight roads", road, "all frames posed, ATE <= 0.12 % of the path",
                 lambda r: r["posed"] == 1 and r["ate_m"] <= 0.0012 * r["path_m"]),
        "slow": ("A slow camera on a road", slow, "98 % of the frames posed; the median ATE at most 1.2, 2, 3 times that of the same part at 10 Hz "
                 "where every second, third, fourth frame is left, and 1.3 times where 10 % are missing",
                 lambda r: r["posed"] >= 0.98 and r["times"] <= r["bound"])}


def section(name, found):
    title, _, bounds, keeps = ROWS[name]
    lines = [f"## {title}", "", f"Bounds of each run: {bounds}.", "",
             "| what | path | frames posed, least | ATE, median | worst | over that at 10 Hz: median, worst | error of a step, worst "
             "| loops true / false | runs within all bounds |",
             "|---|--:|--:|--:|--:|--:|--:|--:|--:|"]
    for case, runs in found.items():
        ates, steps = [r["ate_m"] for r in runs], [r["step_m"] for r in runs if r.get("step_m")]
        times = [r["times"] for r in runs if r.get("times")]
        loops = [f"{sum(r[k] for r in runs)}" for k in ("true", "false") if all(r.get(k) is not None for r in runs)]
        lines.append(f"| {case} | {max(r['path_m'] for r in runs):.0f} m | {100 * min(r['posed'] for r in runs):.1f} % "
                     f"| {statistics.median(ates):.3f} m | {max(ates):.3f} m "
                     f"| {f'{statistics.median(times):.2f}, {max(times):.2f}' if times else '-'} | {f'{100 * max(steps):.1f} cm' if steps else '-'} "
                     f"| {' / '.join(loops) or '-'} | {sum(map(keeps, runs))} of {len(runs)} |")
    return "\n".join(lines) + "\n"


def main():
    a = table.parse(table.parser(__doc__, "odometry", ROWS), ROWS)
    whole = table.put_json(a, "odometry", {name: found for name in a.rows if (found := ROWS[name][1](a))})
    table.put(a, table.RESULTS / "odometry.md", "\n".join(
        ["# Odometry where it is hard", "", "Written by `./dev bench odometry --write` (bench/odometry_table.py), whose head says what is run.", ""] +
        [section(name, whole[name]) for name in ROWS if name in whole]))
    return 0


if __name__ == "__main__":
    sys.exit(main())
