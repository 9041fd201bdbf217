#!/usr/bin/env python3
"""One camera on straight roads, where a drift of the scale and an error of the lens look alike.

usage: ./dev bench straight [ROW...] [--write]

Rows: `road`, 400 m of a generated street; `other`, drives that set no constant of the odometry, with and without
`odometry.keep_height`; and `kitti`, the straights of kitti_00_head (stretches of at least 70 m whose heading stays within 8
degrees). What varies on the road: the world, the first frame (0 to 4 are skipped), and the images' compression
(none, JPEG); once with a perfect lens, once with one whose k1 is 0.01 off. On KITTI each stretch is run with self-calibration
and without (lens_sigma: 0). Odometry alone; ATE after Sim(3) alignment. Needs ffmpeg for the JPEG images.
"""
import json
import math
import shutil
import statistics
import subprocess
import sys

import table

ROWS = ["road", "other", "kitti"]
STARTS = range(5)
WORLDS = [1, 2]
LENSES = {"perfect": [], "k1 0.01 off": ["--set", "camera.distortion=radtan", "--set", "camera.coefficients=[0.01, 0, 0, 0, 0]"]}
STREET = ["--block", "200", "--blocks-x", "4", "--frames", "505"]
TURNS = ["--block", "60", "--blocks-x", "2", "--blocks-y", "2", "--laps", "0.95"]
OTHER = {  # by the seed of its world
    21: ("another street", STREET), 22: ("and another", STREET),
    25: ("the camera looks 15 deg down", [*STREET, "--pitch", "15"]), 35: ("8 deg up", [*STREET, "--pitch", "-8"]),
    27: ("hills of 6 m", [*STREET, "--hills", "6"]), 30: ("15 m/s", [*STREET[:4], "--frames", "300", "--speed", "15"]),
    31: ("oncoming cars", [*STREET, "--moving-objects", "12"]), 32: ("320 x 240", [*STREET, "--width", "320", "--height", "240"]),
    33: ("turns", TURNS), 34: ("turns, hills of 8 m", [*TURNS, "--hills", "8"])}
OTHER_STARTS = range(3)
ROAD_BOUND = 0.12  # % of the path, the worst
HEADING_DEG, LENGTH_M = 8, 70


def compressed(folder):
    """A copy of a generated drive whose images are JPEG."""
    out = folder.with_name(folder.name + "-jpeg")
    done, world = out / "done", (folder / ".options").read_text()
    if not (done.exists() and done.read_text() == world):
        shutil.rmtree(out, ignore_errors=True)
        (out / "image_0").mkdir(parents=True)
        for file in folder.iterdir():
            if file.is_file():
                shutil.copy(file, out)
        subprocess.run(["ffmpeg", "-loglevel", "error", "-i", folder / "image_0" / "%06d.png", "-q:v", "3", "-start_number", "0",
                        out / "image_0" / "%06d.jpg"], check=True)
        done.write_text(world)
    return out


def ate(a, name, config, dataset, *options):
    """ATE and path of the odometry [m]."""
    folder = a.out / name
    if not (a.reuse and (folder / "summary.json").exists()):
        subprocess.run([a.tutti, "run", "--quiet", "--require", "failed", "--no-loops", "--no-report", "--config", config, "--dataset", dataset, "--out",
                        folder, *map(str, options)], check=True)
    summary = json.loads((folder / "summary.json").read_text())
    frames = summary["frames"]
    return {"ate_m": summary["evaluation"]["odometry"]["ate_rmse_m"], "path_m": summary["evaluation"]["path_m"],
            "without_pose": frames["total"] - frames["tracked"]}


def road(a):
    runs = []
    for world in WORLDS:
        plain = table.generate(a.tutti, a.out / f"road-{world}", ["--sensor", "mono", *STREET, "--seed", str(world)])
        for image, dataset in (("png", plain), ("jpeg", compressed(plain))):
            for lens, options in LENSES.items():
                for start in STARTS:
                    name = f"road/{world}-{image}-{lens.replace(' ', '-')}-{start}"
                    run = ate(a, name, dataset / "config.yaml", dataset, "--start", start, *options)
                    runs.append(dict(run, world=world, image=image, lens=lens, start=start))
    return runs


def other(a):
    runs = []
    for world, (what, options) in OTHER.items():
        dataset = table.generate(a.tutti, a.out / f"other-{world}", ["--sensor", "mono", *options, "--seed", str(world)])
        for start in OTHER_STARTS:
            cut = ["--start", start]
            name = f"other/{world}-{start}"
            free = ate(a, name + "-free", dataset / "config.yaml", dataset, *cut, "--set", "odometry.keep_height=false")
            run = ate(a, name, dataset / "config.yaml", dataset, *cut)
            runs.append(dict(run, world=world, what=what, start=start, free_ate_m=free["ate_m"]))
    return runs


def straights(data):
    """(first frame, frame after the last, length) of the longest straights, without overlap."""
    poses = [list(map(float, line.split())) for line in open(data / "poses.txt")]
    heading, way = [], [0.0]
    for p in poses:
        h = math.degrees(math.atan2(p[2], p[10]))
        heading.append(h + 360 * round((heading[-1] - h) / 360) if heading else h)
    for p, q in zip(poses, poses[1:]):
        way.append(way[-1] + math.dist((p[3], p[7], p[11]), (q[3], q[7], q[11])))
    found = []
    for i in range(len(poses)):
        low = high = heading[i]
        j = i
        while j + 1 < len(poses) and max(high, heading[j + 1]) - min(low, heading[j + 1]) <= HEADING_DEG:
            j += 1
            low, high = min(low, heading[j]), max(high, heading[j])
        found.append((way[j] - way[i], i, j + 1))
    taken = []
    for length, i, j in sorted(found, reverse=True):
        if length >= LENGTH_M and all(j <= b or i >= e for b, e, _ in taken):
            taken.append((i, j, length))
    return sorted(taken)


def kitti(a):
    data = a.data / "kitti_00_head"
    if not data.exists():
        print(f"kitti: {data} is absent; the row is left out", file=sys.stderr)
        return []
    config, runs = table.ROOT / "data" / "configs" / "kitti_00-02_mono.yaml", []
    for begin, end, _ in straights(data):
        cut = ["--start", begin, "--end", end]
        free = ate(a, f"kitti/{begin}-off", config, data, *cut, "--set", "odometry.lens_sigma=0")
        runs.append(dict(ate(a, f"kitti/{begin}", config, data, *cut), begin=begin, end=end, off_ate_m=free["ate_m"]))
    return runs


def document(results):
    text = ["# One camera on straight roads", "", "Written by `./dev bench straight --write` (" + "bench/straight_table.py). " +
            "Odometry alone, ATE after Sim(3) alignment.", ""]
    if results.get("road"):
        text += [f"## 400 m of a generated street\n\nWorlds {WORLDS}, first frames 0 to 4; the worst must be within {ROAD_BOUND} % of the "
                 "path.\n", "| images | lens | n | ATE, median | worst | worst [% of the path] | frames without a pose |",
                 "|---|---|---|---|---|---|---|"]
        for image in ("png", "jpeg"):
            for lens in LENSES:
                runs = [r for r in results["road"] if r["image"] == image and r["lens"] == lens]
                share = max(100 * r["ate_m"] / r["path_m"] for r in runs)
                text.append(f"| {image} | {lens} | {len(runs)} | {statistics.median(r['ate_m'] for r in runs):.2f} m | "
                            f"{max(r['ate_m'] for r in runs):.2f} m | {share:.3f}{'' if share <= ROAD_BOUND else ' (**missed**)'} | "
                            f"{max(r['without_pose'] for r in runs)} |")
    if results.get("other"):
        text += ["", f"## Drives that set no constant\n\nOne world each, first frames 0 to {OTHER_STARTS[-1]}; with the height above the "
                 "ground, and without (`odometry.keep_height: false`).\n",
                 "| drive | path | ATE, median | worst | without, median | worst | frames without a pose |", "|---|---|---|---|---|---|---|"]
        for world, (what, _) in OTHER.items():
            runs = [r for r in results["other"] if r["world"] == world]
            if runs:
                median, worst = ([f(r[key] for r in runs) for key in ("ate_m", "free_ate_m")] for f in (statistics.median, max))
                text.append(f"| {what} | {runs[0]['path_m']:.0f} m | {median[0]:.2f} m | {worst[0]:.2f} m | {median[1]:.2f} m | "
                            f"{worst[1]:.2f} m | {max(r['without_pose'] for r in runs)} |")
    if results.get("kitti"):
        text += ["", "## The straights of kitti_00_head\n\nWith self-calibration of the lens, and without (`lens_sigma: 0`); the "
                 "ratio must not exceed 1.1.\n", "| frames | path | ATE | without | ratio |", "|---|---|---|---|---|"]
        for r in results["kitti"]:
            ratio = r["ate_m"] / r["off_ate_m"]
            text.append(f"| {r['begin']} to {r['end'] - 1} | {r['path_m']:.0f} m | {r['ate_m']:.3f} m | {r['off_ate_m']:.3f} m | "
                        f"{ratio:.2f}{'' if ratio <= 1.1 else ' (**missed**)'} |")
    return "\n".join(text)


def main():
    a = table.parse(table.parser(__doc__, "straight", ROWS), ROWS)
    data = table.RESULTS / "straight.json"
    results = json.loads(data.read_text()) if data.exists() else {}
    for row in a.rows:
        results[row] = {"road": road, "other": other, "kitti": kitti}[row](a) or results.get(row, [])
    if a.write:
        data.write_text(json.dumps(results, indent=1) + "\n")
    table.put(a, table.RESULTS / "straight.md", document(results))
    return 0


if __name__ == "__main__":
    sys.exit(main())
