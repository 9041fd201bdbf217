#!/usr/bin/env python3
"""Does a run that went wrong say so? The word of `tutti run` (good, doubtful, failed) against the error of its trajectory.

usage: ./dev bench health [--draw N] [--runs N] [--jobs N] [--write]

A cut is a short part of a generated world or of real data. It is run as it is, and with two of these damages: wrong focal length or
distortion, blur, darkness, a covered lens, missing frames, fewer frames a second, half the image size, late depth, right and left
exchanged. The draw (worlds, first frames, damages) depends on --draw alone. The limits of apps/run/run_signs.cc were set on draw 6
(--draw 6 --signs shows every sign of every run); draw 7 judges them, and --write writes that draw. A run takes about 5 s of processor
time; --reuse goes on with the runs in --out, or with those in docs/results/health.json. Without data the real cuts are left out.
"""
import argparse
import concurrent.futures
import itertools
import json
import math
import random
import shutil
import subprocess
import sys
import threading

import table

GOOD_PERCENT, FAILED_PERCENT = 1, 5  # ATE, of the path
POSED = 0.95  # a run that has lost more than that is not good, whatever the rest of its trajectory is like
TWICE = 2  # the error of a damaged run over that of the same cut undamaged, from which on the damage counts
FLAGGED_FAILED, FLAGGED_GOOD, FLAGGED_TWICE = 97, 3, 70  # %, at least, at most, at least
LEAST = 100  # good runs, failed ones, and ones with twice the error
JUDGED = 7  # the draw; its rows are known by now: after a change of limits, judge on a higher one
REFUSED = "refused"
BATCH = 24  # runs between two looks at whether there are enough
MAKING = threading.Lock()  # of worlds
DAMAGES_A_CUT = 2
SLOW, LONGER = 0.2, 3  # share of the cuts that lose frames at regular intervals, and how much longer they are
TRUTH_M = 0.005  # that the ground truth of RedKitchen may be off: smaller differences mean nothing there
TURNS_DEG = 5  # a stereo cut that turns less looks the same with every focal length

SMALL = ["--supersample", 1, "--threads", 1]
TOWN = ["--world", "town", "--sensor", "stereo", "--width", 320, "--height", 160, "--block", 45, "--frames", 400, *SMALL]
ROOM = ["--world", "room", "--sensor", "rgbd", "--width", 320, "--height", 240, "--laps", 1.3, *SMALL]
CORRIDOR = ["--world", "corridor", "--sensor", "rgbd", "--width", 320, "--height", 240, "--speed", 1, "--frames", 400, *SMALL]
WORLDS = {"town": TOWN, "room": ROOM, "shaken room": [*ROOM, "--shake", 120, "--blur", 0.01], "corridor": CORRIDOR}
STRAIGHT = ["kitti_00_head", "corridor"]  # a cut hardly turns: a wrong camera does it no harm, and is not drawn
REAL = {"kitti_00_head": "kitti_00-02_mono", "redkitchen": "7scenes"}

# source: world or real data, sensor, frames, every n-th, weight in the draw
SOURCES = {
    "town, stereo": ("town", "stereo", 80, 1, 3),
    "town, one camera": ("town", "mono", 80, 1, 3),
    "room, RGB-D": ("room", "rgbd", 80, 1, 3),
    "room, one camera": ("room", "mono", 90, 1, 3),
    "shaken room, RGB-D": ("shaken room", "rgbd", 70, 1, 1),
    "shaken room, one camera": ("shaken room", "mono", 80, 1, 1),
    "corridor, RGB-D": ("corridor", "rgbd", 70, 1, 1),
    "corridor, one camera": ("corridor", "mono", 80, 1, 1),
    "KITTI 00, one camera": ("kitti_00_head", "mono", 60, 1, 2),
    "RedKitchen, RGB-D": ("redkitchen", "rgbd", 70, 2, 1),
    "RedKitchen, one camera": ("redkitchen", "mono", 70, 2, 1),
}

# damage: what it does to the camera, to the frames, to the images; for which sensors; weight in the draw
ALL, DEPTH, STEREO, SEEN = {"mono", "stereo", "rgbd"}, {"rgbd"}, {"stereo"}, {"mono", "rgbd"}
DAMAGES = {
    "focal length 1 to 5 % off": ({"focal": (1.01, 1.05)}, ALL, 4), "focal length 10 to 15 % off": ({"focal": (1.1, 1.15)}, ALL, 1),
    "focal length 25 to 40 % off": ({"focal": (1.25, 1.4)}, ALL, 6),
    "distortion that is not there": ({"k1": -0.2}, SEEN, 1), "distortion of the wrong sign": ({"k1": 0.1}, SEEN, 1),
    "blur": ({"change": "blur:2"}, SEEN, 1), "dark": ({"change": "dark:2"}, SEEN, 2),
    "half the image size": ({"change": "half", "size": 0.5}, {"mono"}, 1),
    "every 2nd or 3rd frame": ({"stride": (2, 3)}, ALL, 2), "every 5th frame": ({"stride": (5, 5)}, ALL, 1),
    "every 10th frame": ({"stride": (10, 10)}, {"mono"}, 3), "10 % of the frames missing": ({"missing": 0.1}, ALL, 1),
    "5 to 20 frames missing": ({"gap": (5, 20)}, ALL, 2), "20 frames covered": ({"covered": 20}, ALL, 1),
    "depth 0.2 s late": ({"late": 0.2}, DEPTH, 1), "depth 0.5 s late": ({"late": 0.5}, DEPTH, 2),
    "left and right exchanged": ({"exchanged": True}, STEREO, 2),
}


def drawn_damage(rng, name):
    """The damage with its figures."""
    damage = dict(DAMAGES[name][0])
    if "focal" in damage:
        factor = rng.uniform(*damage["focal"])
        damage["focal"] = round(factor if rng.random() < 0.5 else 1 / factor, 4)
    for key in ("stride", "gap"):
        if key in damage:
            damage[key] = rng.randint(*damage[key])
    return damage


def draw_runs(draw, sources):
    """Endless: number of the cut, source, world seed, place of the first frame 0..1, frames, name of the damage or None, and its figures."""
    rng = random.Random(f"tutti health {draw}")
    names = [s for s in sources for _ in range(SOURCES[s][4])]
    for cut in itertools.count():
        source, slow = rng.choice(names), rng.random() < SLOW
        damages = [d for d in DAMAGES for _ in range(DAMAGES[d][2]) if SOURCES[source][1] in DAMAGES[d][1] and
                   ("stride" in DAMAGES[d][0]) == slow and
                   not (SOURCES[source][0] in STRAIGHT and {"focal", "k1"} & set(DAMAGES[d][0])) and
                   not ("size" in DAMAGES[d][0] and SOURCES[source][0] not in REAL)]
        place = {"cut": cut, "source": source, "seed": 10 * draw + rng.randrange(4), "at": round(rng.random(), 6),
                 "frames": SOURCES[source][2] * (LONGER if slow else 1)}
        yield {**place, "damage": None}
        done = []
        for name in sorted(damages, key=lambda _: rng.random()):  # each of them once, at most
            if name in done or len(done) == DAMAGES_A_CUT:
                continue
            done.append(name)
            yield {**place, "damage": name, **drawn_damage(rng, name)}


def frames_of(folder):
    """Of a data set: the files of each frame by folder, its time and its pose (KITTI), in order."""
    if (folder / "image_0").exists():
        kinds = [k for k in ("image_0", "image_1") if (folder / k).exists()]
        files = {k: sorted((folder / k).iterdir()) for k in kinds}
        times, poses = ((folder / name).read_text().splitlines() for name in ("times.txt", "poses.txt"))
        return [({k: files[k][i] for k in kinds}, times[i], poses[i]) for i in range(len(times))]
    rows = {k: [line.split() for line in open(folder / f"{k}.txt") if not line.startswith("#")] for k in ("rgb", "depth")}
    depth = {stamp: name for stamp, name in rows["depth"]}
    return [({"rgb": folder / name, "depth": folder / depth[stamp]}, stamp, None) for stamp, name in rows["rgb"] if stamp in depth]


def write_cut(a, folder, source, frames, damage, size):
    """A data set of these frames alone, damaged."""
    shutil.rmtree(folder, ignore_errors=True)
    for kind in frames[0][0]:
        (folder / kind).mkdir(parents=True)
    middle = len(frames) // 2
    if "gap" in damage:
        frames = frames[:middle] + frames[middle + damage["gap"]:]
    if "missing" in damage:
        rng = random.Random(0)
        frames = [frame for frame in frames if rng.random() >= damage["missing"]]
    main = "image_0" if "image_0" in frames[0][0] else "rgb"
    changed = {}
    if "change" in damage:
        table.link_numbered({i: files[main] for i, (files, _, _) in enumerate(frames)}, folder / "before")
        subprocess.run([a.tutti, "generate", "--from-images", folder / "before", "--change", damage["change"], "--out", folder / "after"],
                       check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        changed = {i: folder / "after" / f"{i:06d}.png" for i in range(len(frames))}
    if "covered" in damage:
        (folder / "grey.pgm").write_bytes(b"P5 %d %d 255\n" % size + b"\x60" * (size[0] * size[1]))  # read by content, whatever the name
        changed = {i: folder / "grey.pgm" for i in range(middle, middle + damage["covered"])}
    lists = {kind: [] for kind in frames[0][0]}
    for i, (files, stamp, _) in enumerate(frames):
        for kind, file in files.items():
            to = folder / kind / f"{i:06d}{file.suffix}"
            if damage.get("exchanged"):
                file = files["image_1" if kind == "image_0" else "image_0"]
            to.symlink_to(changed.get(i, file) if kind != "depth" else file)
            late = damage.get("late", 0) if kind == "depth" else 0
            lists[kind].append(f"{float(stamp) + late:.6f} {kind}/{to.name}\n")
    if main == "image_0":
        (folder / "times.txt").write_text("".join(stamp + "\n" for _, stamp, _ in frames))
        (folder / "poses.txt").write_text("".join(pose + "\n" for _, _, pose in frames))
    else:
        for kind, lines in lists.items():
            (folder / f"{kind}.txt").write_text("".join(lines))
        shutil.copy(source / "groundtruth.txt", folder)


def turned_deg(frames):
    """How far a cut turns from its first frame at most, if the poses are KITTI's [deg]."""
    poses = [list(map(float, pose.split())) for _, _, pose in frames if pose]
    cosines = [(sum(poses[0][4 * i + j] * p[4 * i + j] for i in range(3) for j in range(3)) - 1) / 2 for p in poses]
    return round(math.degrees(math.acos(max(-1, min(1, min(cosines))))), 1) if poses else None


def camera_of(config):
    """The figures of the section camera."""
    words = (line.split("#")[0].split(":") for line in config.read_text().splitlines())
    return {w[0].strip(): float(w[1]) for w in words if len(w) == 2 and w[0].strip() in ("fx", "fy", "cx", "cy", "width", "height")}


def camera_options(camera, damage):
    """What the run is told of its camera, beside its configuration."""
    size = damage.get("size", 1)
    told = {f: camera[f] * size * damage.get("focal", 1) for f in ("fx", "fy")}
    if size != 1:  # resized images have pixel centres elsewhere
        told.update({c: (camera[c] + 0.5) * size - 0.5 for c in ("cx", "cy")}, **{s: int(camera[s] * size) for s in ("width", "height")})
    more = [f"camera.{key}={value}" for key, value in told.items()] if size != 1 or "focal" in damage else []
    if "k1" in damage:
        more += ["camera.distortion=radtan", f"camera.coefficients=[{damage['k1']}, 0, 0, 0, 0]"]
    return more


def world(a, source, seed):
    """Folder and configuration."""
    where = SOURCES[source][0]
    if where in REAL:
        return a.data / where, table.ROOT / "data/configs" / f"{REAL[where]}.yaml"
    data = table.generate(a.tutti, a.out / "worlds" / f"{where.replace(' ', '-')}-{seed}", [*WORLDS[where], "--seed", seed])
    return data, data / "config.yaml"


def measure(a, folder, row):
    """One run of draw_runs: what it says and what is true."""
    _, sensor, _, step, _ = SOURCES[row["source"]]
    with MAKING:
        data, config = world(a, row["source"], row["seed"])
    frames = frames_of(data)
    first = int(row["at"] * max(0, len(frames) - row["frames"] * step))
    frames = frames[first:first + row["frames"] * step:step][::row.get("stride", 1)]
    camera = camera_of(config)
    write_cut(a, folder / "cut", data, frames, row, (int(camera["width"]), int(camera["height"])))
    run = subprocess.run([a.tutti, "run", "--quiet", "--no-report", "--no-map", "--threads", "1", "--ground-truth", "none", "--config",
                          config, "--dataset", folder / "cut", "--out", folder / "run", "--set", f"dataset.sensor={sensor}",
                          "run.odometry_pass=false", *camera_options(camera, row)], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    summary = folder / "run" / "summary.json"
    if not summary.exists():  # bad input: nothing to judge
        print(f"health: {row['source']}, {row['damage']}: refused: {run.stderr.strip()}", file=sys.stderr)
        return {**row, "word": REFUSED}
    summary = json.loads(summary.read_text())
    # The run is not told its ground truth, so that its word can't come from it.
    errors = table.errors(argparse.Namespace(tutti=a.tutti, out=folder), folder / "cut", folder / "run" / "trajectory.txt",
                          "sim3" if sensor == "mono" else "se3")
    path = errors and errors["path_length_m"]
    shutil.rmtree(folder)
    ate = errors["ate"]["rmse"] if path else None
    return {**row, "path_m": path and round(path, 3), "ate_m": path and round(ate, 5), "ate_percent": path and round(100 * ate / path, 3), "first": first, "turned_deg": turned_deg(frames), "lens_check": summary.get("lens_check"),
            "posed": round(summary["frames"]["tracked"] / summary["frames"]["total"], 4),
            "word": summary["health"]["word"], "signs": {k: round(v, 4) for k, v in summary["health"]["signs"].items()}}


def is_right(row):
    return (row["word"] != REFUSED and row["ate_percent"] is not None and row["ate_percent"] <= GOOD_PERCENT and row["posed"] >= POSED and
            not row["twice"])


def is_good(row):
    return is_right(row) and not is_wrong_camera(row)


def is_lucky(row):
    return is_right(row) and is_wrong_camera(row)


def is_failed(row):
    return row["word"] != REFUSED and (row["ate_percent"] is None or row["ate_percent"] > FAILED_PERCENT)


def is_wrong_camera(row):
    return bool(row["damage"]) and bool({"focal", "k1"} & set(DAMAGES[row["damage"]][0]))


def is_untellable(row):
    """Stereo that drives straight ahead with a wrong focal length: depths and way are wrong by one factor, and all images agree."""
    return (is_wrong_camera(row) and SOURCES[row["source"]][1] == "stereo" and "focal" in DAMAGES[row["damage"]][0] and
            row["turned_deg"] < TURNS_DEG)


def mark_twice(rows):
    """Whether a damaged run has TWICE the error of the same cut undamaged, beyond what the ground truth may be off, or no trajectory."""
    undamaged = {r["cut"]: r for r in rows if not r["damage"]}
    for row in rows:
        before, row["twice"] = undamaged[row["cut"]], False
        if row["damage"] and REFUSED not in (row["word"], before["word"]) and before["ate_m"] is not None:
            least = TRUTH_M if SOURCES[row["source"]][0] == "redkitchen" else 0
            row["twice"] = row["ate_m"] is None or row["ate_m"] > max(TWICE * before["ate_m"], before["ate_m"] + least)


def enough(rows):
    mark_twice(rows)
    kinds = [is_good, lambda r: is_failed(r) and not is_untellable(r), lambda r: r["twice"] and not is_untellable(r)]
    return min(sum(map(kind, rows)) for kind in kinds) >= LEAST


def flagged(rows):
    """[%]"""
    return 100 * sum(r["word"] != "good" for r in rows) / max(1, len(rows))


def share(rows):
    return f"{sum(r['word'] != 'good' for r in rows)} of {len(rows)} ({flagged(rows):.1f} %)" if rows else "none"


def document(rows, draw):
    mark_twice(rows)
    few = "" if enough(rows) else f" **Fewer than {LEAST} of a kind:** `./dev bench health --reuse --write` measures the rest."
    rows = [r for r in rows if r["word"] != REFUSED]
    good, all_failed = [r for r in rows if is_good(r)], [r for r in rows if is_failed(r)]
    failed, twice = [[r for r in of if not is_untellable(r)] for of in (all_failed, [r for r in rows if r["twice"]])]
    met = ["yes" if ok else "**no**" for ok in (flagged(failed) >= FLAGGED_FAILED, flagged(good) <= FLAGGED_GOOD, flagged(twice) >= FLAGGED_TWICE)]
    text = ["# Does a run in doubt say so?", "", f"Written by `./dev bench health --write` (bench/health_table.py), draw {draw}: {len(rows)} "
            "short runs. Each is a cut of a generated world or of real data, as it is or damaged. The limits of the signs "
            "(`apps/run/run_signs.cc`) were set on another draw of such runs, with other worlds, first frames and damages; no row of this "
            "draw has set one. Flagged: the run calls itself doubtful or failed. Failed: ATE over "
            f"{FAILED_PERCENT} % of the path, or no trajectory. Twice: at least {TWICE} times the ATE of the same cut undamaged, or no "
            f"trajectory. Good: ATE of at most {GOOD_PERCENT} %, at least {100 * POSED:.0f} % of the frames posed, not twice, and with the right "
            f"camera. Good by luck: the same with a wrong camera; a flag tells the truth there. Other runs are between. Every run is in `health.json`.{few}", "",
            f"Counted apart: stereo that turns by less than {TURNS_DEG} deg in all, with a wrong focal length. Depths and distances are "
            "wrong by one factor then, and all images agree with each other: no sign can show it.", "",
            "| runs | flagged | bound | met |", "|---|---|---|---|",
            f"| failed | {share(failed)} | >= {FLAGGED_FAILED} % | {met[0]} |",
            f"| good | {share(good)} | <= {FLAGGED_GOOD} % | {met[1]} |",
            f"| twice | {share(twice)} | >= {FLAGGED_TWICE} % | {met[2]} |",
            f"| twice, and not failed | {share([r for r in twice if not is_failed(r)])} | | |",
            f"| failed, and no image can tell | {share([r for r in all_failed if is_untellable(r)])} | | |",
            f"| good, not damaged | {share([r for r in good if not r['damage']])} | | |",
            f"| good by luck | {share([r for r in rows if is_lucky(r)])} | | |",
            f"| between | {share([r for r in rows if not (is_good(r) or is_lucky(r) or is_failed(r) or r['twice'])])} | | |", ""]
    for title, key, names in (("source", "source", SOURCES), ("damage", "damage", [None, *DAMAGES])):
        text += [f"| {title} | failed: flagged | good: flagged | twice, not failed: flagged | between: flagged |", "|---|---|---|---|---|"]
        for name in names:
            of = [r for r in rows if r[key] == name]
            kinds = [is_failed, is_good, lambda r: r["twice"] and not is_failed(r), lambda r: not (is_failed(r) or is_right(r) or r["twice"])]
            if of:
                text.append(f"| {name or 'none'} | " + " | ".join(share(list(filter(kind, of))) for kind in kinds) + " |")
        text.append("")
    return "\n".join(text)


def main():
    p = table.parser(__doc__, "health")
    p.add_argument("--draw", type=int, default=JUDGED, help="which runs are drawn")
    p.add_argument("--runs", type=int, default=600, help=f"at most; it ends earlier with {LEAST} good ones, failed ones and ones of twice the error")
    p.add_argument("--jobs", type=int, default=2, help="runs at a time")
    p.add_argument("--signs", action="store_true", help="print every run with its signs")
    a = table.parse(p)
    if a.write and a.draw != JUDGED:
        p.error(f"--write: the limits are judged on draw {JUDGED} alone")
    sources = [s for s in SOURCES if SOURCES[s][0] not in REAL or (a.data / SOURCES[s][0]).exists()]
    kept = a.out / f"draw-{a.draw}.json"
    before = [f for f in [kept, *([table.RESULTS / "health.json"] if a.draw == JUDGED else [])] if f.exists()]
    rows = [r for r in json.loads(before[0].read_text()) if "cut" in r] if a.reuse and before else []  # not those of draws before 6
    with concurrent.futures.ThreadPoolExecutor(a.jobs) as pool:
        drawn = itertools.islice(draw_runs(a.draw, sources), len(rows), a.runs)
        numbered = enumerate(drawn, len(rows))
        while batch := list(itertools.islice(numbered, BATCH)):
            if enough(rows):
                break
            rows += pool.map(lambda job: measure(a, a.out / f"run-{a.draw}-{job[0]}", job[1]), batch)
            kept.write_text(json.dumps(rows))
            print(f"health: {len(rows)} runs", file=sys.stderr)
    lines = [json.dumps(row) for row in rows]
    if a.signs:
        print("\n".join(lines))
    if a.write:
        (table.RESULTS / "health.json").write_text("[\n" + ",\n".join(lines) + "\n]\n")
    table.put(a, table.RESULTS / "health.md", document(rows, a.draw))
    return 0


if __name__ == "__main__":
    sys.exit(main())
