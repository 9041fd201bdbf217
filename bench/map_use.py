"""What maps are good for: rows of the second table of map_table.py. Each takes the arguments of the table and returns a list
of (what, bound, figure as text, whether the bound is kept). Needs nothing but Python 3.

Those on maps of several recordings are in map_sessions.py.
"""
import bisect
import json
import math
import os
import shutil
import subprocess

import table
from pose_files import read_tum as poses

KITCHEN = ("7scenes.yaml", "redkitchen")
KITTI = ("kitti_00-02_mono.yaml", "kitti_00_head")
PASSES, MAPPED = 5, 250  # of the kitchen: times that its first frames are seen, and how many these are
LAPS = 10
SMALL_TOWN = ["--sensor", "stereo", "--width", 320, "--height", 160, "--block", 26, "--rate", 4.5, "--blocks-x", 1, "--laps", LAPS]
TOWN = ["--sensor", "stereo", "--blocks-x", 1, "--laps", 1]


def tutti(a, *words):
    """Exit status 1 of `localize` says that no frame was found, which is a result."""
    done = subprocess.run([a.tutti, *map(str, words)], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    if done.returncode not in (0, 1) or (done.returncode == 1 and words[0] != "localize"):
        raise RuntimeError(f"tutti {' '.join(map(str, words))}: {done.stderr.strip()}")
    return done


def where(a, source):
    """Configuration and folder of KITCHEN or KITTI, or of a folder with both."""
    if isinstance(source, tuple):
        return table.ROOT / "data" / "configs" / source[0], a.data / source[1]
    return source / "config.yaml", source


def run(a, name, source, *more):
    """Folder of a run, which is made if --reuse does not find it."""
    folder = a.out / name
    if not (a.reuse and (folder / "map.tutti").exists()):
        config, dataset = where(a, source)
        tutti(a, "run", "--require", "failed", "--config", config, "--dataset", dataset, "--out", folder, "--no-report", *more)
    return folder


def localize(a, name, map_file, source, *more):
    """Folder of the result, and what was said if there is none."""
    folder = a.out / name
    shutil.rmtree(folder, ignore_errors=True)
    config, dataset = where(a, source)
    done = tutti(a, "localize", "--map", map_file, "--config", config, "--dataset", dataset, "--out", folder, *more)
    return folder, done.stderr.strip()


def summary(folder):
    return json.loads((folder / "summary.json").read_text())


def map_info(a, file):
    done = subprocess.run([a.tutti, "map", "info", file, "--json"], check=True, capture_output=True, text=True)
    return json.loads(done.stdout)


def away(a, b):
    """Distance [m] and angle [deg] of two poses."""
    dot = min(1.0, abs(sum(x * y for x, y in zip(a[1], b[1]))))
    return math.dist(a[0], b[0]), math.degrees(2 * math.acos(dot))


def similarity(source, target):
    """Function of a point: the similarity that fits points to points best (Horn, JOSA A 4(4), 1987)."""
    n = len(source)
    cs, ct = ([sum(p[k] for p in points) / n for k in range(3)] for points in (source, target))
    s = [[p[k] - cs[k] for k in range(3)] for p in source]
    t = [[p[k] - ct[k] for k in range(3)] for p in target]
    m = [[sum(p[i] * q[j] for p, q in zip(s, t)) for j in range(3)] for i in range(3)]
    matrix = [[m[0][0] + m[1][1] + m[2][2], m[1][2] - m[2][1], m[2][0] - m[0][2], m[0][1] - m[1][0]],
              [m[1][2] - m[2][1], m[0][0] - m[1][1] - m[2][2], m[0][1] + m[1][0], m[2][0] + m[0][2]],
              [m[2][0] - m[0][2], m[0][1] + m[1][0], m[1][1] - m[0][0] - m[2][2], m[1][2] + m[2][1]],
              [m[0][1] - m[1][0], m[2][0] + m[0][2], m[1][2] + m[2][1], m[2][2] - m[0][0] - m[1][1]]]
    shift = sum(abs(x) for row in matrix for x in row)  # the largest eigenvalue is then that of the largest size
    q = [1.0, 0.1, 0.1, 0.1]
    for _ in range(20000):
        q = [sum(matrix[i][j] * q[j] for j in range(4)) + shift * q[i] for i in range(4)]
        norm = math.sqrt(sum(x * x for x in q))
        q = [x / norm for x in q]
    w, x, y, z = q
    turn = [[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]]

    def turned(p):
        return [sum(turn[i][j] * p[j] for j in range(3)) for i in range(3)]
    scale = sum(u * v for p, r in zip(t, s) for u, v in zip(p, turned(r))) / sum(u * u for r in s for u in r)
    return lambda p: [ct[k] + scale * v for k, v in enumerate(turned([p[k] - cs[k] for k in range(3)]))]


def rmse(errors):
    return math.sqrt(sum(e * e for e in errors) / max(1, len(errors)))


def ate(truth, trajectory):
    """Error of positions after the similarity that fits them best [m]."""
    stamps = sorted(set(truth) & set(trajectory))
    fit = similarity([trajectory[s][0] for s in stamps], [truth[s][0] for s in stamps])
    return rmse([math.dist(fit(trajectory[s][0]), truth[s][0]) for s in stamps])


def share(part, whole):
    return f"{part} of {whole} ({100 * part / max(1, whole):.1f} %)"


def against_full_run(a, name, map_file, full):
    """Row figures of the kitchen's frames after MAPPED in a map, against the poses of a run over all of them."""
    folder, _ = localize(a, name, map_file, KITCHEN, "--start", MAPPED)
    total = summary(folder)["frames"]["total"]
    errors = [away(pose, full[s]) for s, pose in poses(folder / "trajectory.txt").items()]
    good = sum(1 for distance, angle in errors if distance <= 0.05 and angle <= 2)
    worst = max((distance for distance, _ in errors), default=0)
    return folder, [("within 5 cm and 2 deg of the full run's poses", ">= 95 %", share(good, total), good >= 0.95 * total),
                    ("farthest from them", "<= 20 cm", f"{100 * worst:.1f} cm", worst <= 0.2)]


def kitchen(a):
    full = run(a, "kitchen_full", KITCHEN)
    part = run(a, "kitchen_map", KITCHEN, "--end", MAPPED)
    folder, rows = against_full_run(a, "kitchen_localized", part / "map.tutti", poses(full / "trajectory.txt"))
    again = run(a, "kitchen_rest", KITCHEN, "--start", MAPPED)
    loading = summary(localize(a, "kitchen_loaded", part / "map.tutti", KITCHEN, "--start", MAPPED, "--end", MAPPED + 1)[0])
    localizing = summary(folder)["time"]["cpu_s"] - loading["time"]["cpu_s"]
    running = summary(again)["timing"]["cpu_s"]
    rows.append(("processor time, of that of a run over the same frames", "<= 60 %",
                 f"{100 * localizing / running:.0f} % ({localizing:.1f} s, {running:.1f} s; without "
                 f"{loading['time']['cpu_s']:.1f} s for loading the map and finding the first frame)",
                 localizing <= 0.6 * running))
    return rows


def kitti(a):
    part = run(a, "kitti_map", KITTI, "--end", 1000)
    folder, _ = localize(a, "kitti_localized", part / "map.tutti", KITTI, "--start", 1560, "--end", 1641)
    stamps = [round(float(s), 6) for s in (a.data / KITTI[1] / "times.txt").read_text().split()]
    lines = [[float(v) for v in line.split()] for line in (a.data / KITTI[1] / "poses.txt").read_text().splitlines()]
    truth = {s: [v[3], v[7], v[11]] for s, v in zip(stamps, lines)}
    mapped, found = poses(part / "trajectory.txt"), poses(folder / "trajectory.txt")
    fit = similarity([p for p, _ in mapped.values()], [truth[s] for s in mapped])
    map_error = rmse([math.dist(fit(p), truth[s]) for s, (p, _) in mapped.items()])
    errors = [math.dist(fit(p), truth[s]) for s, (p, _) in found.items()]
    total = summary(folder)["frames"]["total"]
    return [("posed", ">= 95 %", share(len(found), total), len(found) >= 0.95 * total),
            ("error after the Sim(3) that aligns the map's trajectory", "<= 1.5 m",
             f"{rmse(errors):.2f} m (the map: {map_error:.2f} m)", bool(errors) and rmse(errors) <= 1.5)]


def wrong(a):
    rows = []
    town = [table.generate(a.tutti, a.out / f"town_{seed}", [*TOWN, "--seed", seed]) for seed in (1, 2)]
    for what, mapped, source, more in (("kitchen in KITTI's map", run(a, "kitti_map", KITTI, "--end", 1000), KITCHEN, []),
                                       ("a town in the map of another", run(a, "town_1_map", town[0]), town[1], ["--end", 250])):
        folder, said = localize(a, "wrong_localized", mapped / "map.tutti", source, *more)
        refused = not (folder / "summary.json").exists()
        posed = 0 if refused else summary(folder)["frames"]["localized"]
        total = 0 if refused else summary(folder)["frames"]["total"]
        if refused and "another camera" not in said:
            raise RuntimeError(said)
        text = "0: refused, since the camera is another one" if refused else share(posed, total)
        rows.append((f"posed frames, {what}", "0", text, posed == 0))
    return rows


def start(a):
    whole = run(a, "kitti_whole", KITTI)
    folder, _ = localize(a, "start_localized", whole / "map.tutti", KITTI, "--start", 800, "--end", 820)
    info = map_info(a, whole / "map.tutti")
    first = summary(folder)["time"].get("first_pose_s", math.inf)
    load = summary(folder)["time"]["load_s"]
    at_1000 = first + load * (1000 / info["keyframes"] - 1)
    return [(f"from start to the first pose, in a map of {info['keyframes']} keyframes", "<= 2 s for 1000",
             f"{first:.2f} s, {load:.2f} s of it to load ({at_1000:.2f} s for 1000, extrapolated)", at_1000 <= 2)]


def again_and_again(a, passes):
    """The first frames of the kitchen, so many times from the start: a data set of links."""
    folder, source = a.out / f"kitchen_{passes}_passes", a.data / KITCHEN[1]
    shutil.rmtree(folder, ignore_errors=True)
    lines = {name: [line.split() for line in (source / name).read_text().splitlines() if line and line[0] != "#"]
             for name in ("associations.txt", "groundtruth.txt")}
    truth_stamps = [float(words[0]) for words in lines["groundtruth.txt"]]
    order = list(range(MAPPED)) * passes
    text = {name: "" for name in lines}
    for k, frame in enumerate(order):
        stamp, words = f"{k / 15:.6f}", [f"{k / 15:.6f}"]
        for image in (lines["associations.txt"][frame][1], lines["associations.txt"][frame][3]):
            link = folder / os.path.dirname(image) / (stamp + os.path.splitext(image)[1])
            link.parent.mkdir(parents=True, exist_ok=True)
            link.symlink_to(source / image)
            words += [str(link.relative_to(folder)), stamp]
        text["associations.txt"] += " ".join(words[:4]) + "\n"
        near = min(bisect.bisect_left(truth_stamps, float(lines["associations.txt"][frame][0])), len(truth_stamps) - 1)
        text["groundtruth.txt"] += " ".join([stamp, *lines["groundtruth.txt"][near][1:]]) + "\n"
    for name, content in text.items():
        (folder / name).write_text(content)
    shutil.copy(table.ROOT / "data" / "configs" / KITCHEN[0], folder / "config.yaml")
    return folder


def pruned(a):
    """One run that sees the same part of the kitchen five times; its map pruned, against the map of the first time."""
    once = run(a, "kitchen_once", again_and_again(a, 1))
    often = run(a, "kitchen_often", again_and_again(a, PASSES))
    small = a.out / "pruned.tutti"
    tutti(a, "map", "prune", often / "map.tutti", "-o", small)
    tutti(a, "export", small, "--tum", a.out / "pruned.txt")
    counts = [map_info(a, file)["keyframes"] for file in (once / "map.tutti", often / "map.tutti", small)]
    truth = poses(a.out / f"kitchen_{PASSES}_passes" / "groundtruth.txt")
    errors = [ate(truth, poses(file)) for file in (often / "trajectory.txt", a.out / "pruned.txt")]
    rows = [("keyframes after pruning, of those of the first pass", "<= 1.3",
             f"{counts[2] / counts[0]:.2f} ({counts[0]} after one pass, {counts[1]} after {PASSES}, {counts[2]} pruned)",
             counts[2] <= 1.3 * counts[0]),
            ("error of the poses of all frames", "not worse", f"{100 * errors[1]:.2f} cm (before: {100 * errors[0]:.2f} cm)",
             errors[1] <= errors[0] + 5e-5)]
    full = poses(run(a, "kitchen_full", KITCHEN) / "trajectory.txt")
    part = a.out / "kitchen_part_pruned.tutti"
    tutti(a, "map", "prune", run(a, "kitchen_map", KITCHEN, "--end", MAPPED) / "map.tutti", "-o", part)
    _, located = against_full_run(a, "pruned_localized", part, full)
    return rows + [(f"frames {MAPPED} on in the pruned map of those before: " + what, *rest) for what, *rest in located]


def driven(a):
    """A small town driven ten times, pruned, against one lap."""
    town = table.generate(a.tutti, a.out / "town_driven", SMALL_TOWN)
    lap = len((town / "poses.txt").read_text().splitlines()) // LAPS
    once = map_info(a, run(a, "driven_once", town, "--end", lap) / "map.tutti")["keyframes"]
    often = run(a, "driven_often", town) / "map.tutti"
    small = a.out / "driven.tutti"
    tutti(a, "map", "prune", often, "-o", small)
    before, after = (map_info(a, file)["keyframes"] for file in (often, small))
    megabytes = [file.stat().st_size / 2**20 for file in (often, small)]
    return [("keyframes after pruning, of those of one lap", "<= 1.3",
             f"{after / once:.2f} ({once} after one lap, {before} after {LAPS}, {after} pruned; "
             f"{megabytes[0]:.1f} MB, {megabytes[1]:.1f} MB pruned)", after <= 1.3 * once)]


# name: title, data that it needs, function.
ROWS = {"kitchen": (f"`redkitchen`, map of frames 0 to {MAPPED - 1}, the rest located in it", [KITCHEN], kitchen),
        "kitti-places": ("`kitti_00_head`, mono, map of 0 to 999, 1560 to 1640 located in it", [KITTI], kitti),
        "wrong-map": ("wrong map", [KITCHEN, KITTI], wrong),
        "start": ("`kitti_00_head`", [KITTI], start),
        "driven": (f"small generated town, stereo, {LAPS} laps", [], driven),
        "pruned": (f"`redkitchen`, frames 0 to {MAPPED - 1} seen {PASSES} times", [KITCHEN], pruned)}
