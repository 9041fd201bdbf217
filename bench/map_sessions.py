"""Rows of the second table of map_table.py on maps of several recordings: as those of map_use.py."""
import subprocess

import table
from map_use import KITCHEN, KITTI, MAPPED, ate, map_info, run, tutti
from pose_files import read_tum as poses

SECOND = 1000  # first frame of KITTI's second recording
DUSK = ["--sensor", "stereo", "--blocks-x", 1, "--laps", 2, "--dusk"]


def kitti_truth(folder):
    """Poses of a data set in KITTI's layout by their time stamps; rotations are left out."""
    stamps = [round(float(s), 6) for s in (folder / "times.txt").read_text().split()]
    lines = [[float(v) for v in line.split()] for line in (folder / "poses.txt").read_text().splitlines()]
    return {s: ([v[3], v[7], v[11]], None) for s, v in zip(stamps, lines)}


def all_frames(a, name, map_file):
    """Poses of the frames of all recordings of a map."""
    file = a.out / f"{name}.txt"
    tutti(a, "export", map_file, "--tum", file)
    return poses(file)


def merged(a, name, first, second):
    """The map that two become, or none where they have no place in common."""
    out = a.out / f"{name}.tutti"
    out.unlink(missing_ok=True)
    done = subprocess.run([a.tutti, "merge", first, second, "-o", out], capture_output=True, text=True)
    return out if done.returncode == 0 else None


def going_on(a):
    """KITTI in two recordings, the second in the map of the first."""
    first = run(a, "kitti_map", KITTI, "--end", SECOND)
    both = run(a, "kitti_gone_on", KITTI, "--start", SECOND, "--map", first / "map.tutti")
    submaps = map_info(a, both / "map.tutti")["submaps"]
    error = ate(kitti_truth(a.data / KITTI[1]), all_frames(a, "kitti_gone_on", both / "map.tutti"))
    return [("submaps", "1", str(submaps), submaps == 1), ("error of all frames", "<= 1.5 m", f"{error:.2f} m", error <= 1.5)]


def both_orders(a, name, truth, maps, single, unit, bound):
    """Figures of two maps merged in both orders, against one run."""
    rows, errors = [], []
    scale, digits = (100, 2) if unit == "cm" else (1, 2)
    for order, (x, y) in (("the second into the first", maps), ("the first into the second", maps[::-1])):
        file = merged(a, f"{name}_merged_{len(rows)}", x / "map.tutti", y / "map.tutti")
        if file is None:
            rows.append((order, "one map", "no common place found", False))
            continue
        errors.append(ate(truth, all_frames(a, f"{name}_merged", file)))
        rows.append((f"error of all frames, {order}", f"<= {bound:.2f} times that of one run",
                     f"{scale * errors[-1]:.{digits}f} {unit} (one run: {scale * single:.{digits}f} {unit})",
                     errors[-1] <= bound * single))
    if len(errors) == 2:
        apart = max(errors) / min(errors)
        rows.append(("the two orders apart", "<= 1 %", f"{100 * (apart - 1):.1f} %", apart <= 1.01))
    return rows


def merged_kitti(a):
    truth = kitti_truth(a.data / KITTI[1])
    maps = (run(a, "kitti_map", KITTI, "--end", SECOND), run(a, "kitti_rest", KITTI, "--start", SECOND))
    single = ate(truth, poses(run(a, "kitti_whole", KITTI) / "trajectory.txt"))
    return both_orders(a, "kitti", truth, maps, single, "m", 1.05)


def merged_kitchen(a):
    lines = [line.split() for line in (a.data / KITCHEN[1] / "groundtruth.txt").read_text().splitlines() if line[0] != "#"]
    truth = {round(float(w[0]), 6): ([float(v) for v in w[1:4]], None) for w in lines}
    maps = (run(a, "kitchen_map", KITCHEN, "--end", MAPPED), run(a, "kitchen_rest", KITCHEN, "--start", MAPPED))
    single = ate(truth, poses(run(a, "kitchen_full", KITCHEN) / "trajectory.txt"))
    return both_orders(a, "kitchen", truth, maps, single, "cm", 1.05)


def dusk(a):
    """A town by day, and again at dusk."""
    town = table.generate(a.tutti, a.out / "town_dusk", DUSK)
    truth = kitti_truth(town)
    night = len(truth) // 2
    maps = (run(a, "dusk_day", town, "--end", night), run(a, "dusk_night", town, "--start", night))
    single = ate(truth, poses(run(a, "dusk_whole", town) / "trajectory.txt"))
    return both_orders(a, "dusk", truth, maps, single, "cm", 1.2)


# name: title, data that it needs, function.
ROWS = {"going-on": (f"`kitti_00_head`, mono, {SECOND} to 1699 as a second session in the map of 0 to {SECOND - 1}", [KITTI], going_on),
        "merged-kitti": ("the two as maps of their own, merged", [KITTI], merged_kitti),
        "merged-kitchen": (f"`redkitchen`, 0 to {MAPPED - 1} and {MAPPED} to 499, merged", [KITCHEN], merged_kitchen),
        "dusk": ("generated town, stereo, by day and at dusk, merged", [], dusk)}
