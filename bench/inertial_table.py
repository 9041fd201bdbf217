#!/usr/bin/env python3
"""What an IMU gives a run, and that a bad one takes nothing: flights of EuRoC, rendered along their true poses, with their real IMU.

usage: ./dev bench inertial [ROW...] [--write]

`gyro`: the examination alone, against the true poses, of every sequence in TUTTI_DATA/euroc_imu. `found`: what runs with two cameras
find out, with the IMU's stamps right and late. `wrong`: measurements that contradict themselves or the images; ATE over that of the
run without IMU. `blur`: images exposed for 20 ms, stereo and RGB-D. `blackout`: half a second of black images every ten seconds.
`rest`: a vehicle at rest. `up`: tilt of the finished map against the truth. Runs are without loops (the odometry's own ATE) but for `up`.
"""
import json
import math
import random
import re
import shutil
import statistics
import struct
import subprocess
import sys
import zlib

import table

FLIGHTS = ("V103", "V202")
PART = ("--frames", 800)  # of those of 20 Hz
DRAWS = (1, 2, 3)
BLACK_EVERY, BLACK = 200, 10  # frames: half a second of ten
G = 9.80665


def flight(a, name, *options, sensor="stereo", part=PART, lens=("--lens", "euroc")):
    source = a.data / "euroc_imu"
    hall = ("--world", "hall") if name.startswith("MH") else ("--world", "room")
    folder = a.out / "-".join(str(o).strip("-") for o in ("flight", name, sensor, *options, *part))
    return table.generate(a.tutti, folder, ["--sensor", sensor, *hall, "--trajectory", source / f"{name}_body.tum", "--imu-file",
                                            source / f"{name}_imu.csv", *lens, "--supersample", 1, *part, *options])


def csv(file):
    return [line.split(",") for line in file.read_text().splitlines() if line and not line.startswith("#")]


def linked(source, folder, but=()):
    """The flight anew, its folders by links but for those in `but`."""
    shutil.rmtree(folder, ignore_errors=True)
    (folder / "mav0").mkdir(parents=True)
    shutil.copy(source / "config.yaml", folder)
    for part in (source / "mav0").iterdir():
        if part.name not in but:
            (folder / "mav0" / part.name).symlink_to(part)
    return folder


def with_imu(source, folder, rows):
    """The flight with other measurements: (stamp [ns], six numbers)."""
    linked(source, folder, ("imu0",))
    (folder / "mav0/imu0").mkdir()
    shutil.copy(source / "mav0/imu0/sensor.yaml", folder / "mav0/imu0")
    (folder / "mav0/imu0/data.csv").write_text("#timestamp [ns],w,w,w,a,a,a\n" + "".join(
        ",".join([str(t), *(f"{x:.9g}" for x in values)]) + "\n" for t, values in rows))
    return folder


def measurements(folder):
    return [(int(row[0]), [float(x) for x in row[1:7]]) for row in csv(folder / "mav0/imu0/data.csv")]


def black_image(width, height):
    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
    rows = zlib.compress(bytes((width + 1) * height))
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0)) + chunk(b"IDAT", rows) + chunk(b"IEND", b"")


def with_blackouts(source, folder):
    cameras = ("cam0", "cam1")
    linked(source, folder, cameras)
    for camera in cameras:
        data = folder / "mav0" / camera / "data"
        data.mkdir(parents=True)
        for file in (source / "mav0" / camera).glob("*.*"):
            shutil.copy(file, data.parent)
        for number, image in enumerate(sorted((source / "mav0" / camera / "data").iterdir())):
            if BLACK_EVERY // 2 <= number % BLACK_EVERY < BLACK_EVERY // 2 + BLACK:
                (data / image.name).write_bytes(black_image(752, 480))
            else:
                (data / image.name).symlink_to(image)
    return folder


def ran(a, dataset, name, *options):
    """ATE [m], frames without a pose, largest error of a step [m], submaps, what the IMU said."""
    folder = a.out / "runs" / name
    config = dataset / "config.yaml"
    if not config.exists():
        config = table.ROOT / "data" / "configs" / "euroc_stereo.yaml"
    summary = table.run(a, folder, config, dataset, "--no-loops", "--no-map", *options)
    file = a.out / "errors.json"
    subprocess.run([a.tutti, "evaluate", "--run", folder, "--json", file], check=True, stdout=subprocess.DEVNULL)
    return {"ate": summary["evaluation"]["odometry"]["ate_rmse_m"], "unposed": summary["frames"]["total"] - summary["frames"]["tracked"],
            "step": json.loads(file.read_text())["estimates"][0]["rpe"]["translation"]["max"], "submaps": 1 + len(summary["frames"]["other_pieces"]),
            "imu": summary.get("imu"), "cpu_s": summary["timing"]["cpu_s"]}


def checked(a, dataset, poses):
    """What `tutti calibrate-check` says against poses: the figures of its last line of each kind."""
    text = subprocess.run([a.tutti, "calibrate-check", dataset, "--poses", poses], capture_output=True, text=True).stdout

    def last(pattern):
        return [float(x) for x in re.findall(pattern, text)[-1].split()] if re.search(pattern, text) else [float("nan")]
    return {"step_deg": last(r"leaves ([\d.]+) deg a step")[0], "mounting_deg": last(r"([\d.]+) deg from the calibration")[0]}


def named(run):
    return run["imu"]["findings"][0]["measured"] if run["imu"]["findings"] else "nothing"


def gyro_row(a):
    for name in sorted(f.name[:-len("_imu.csv")] for f in (a.data / "euroc_imu").glob("*_imu.csv")):
        tiny = flight(a, name, "--width", 64, "--height", 48, sensor="mono", part=(), lens=())
        said = checked(a, tiny, a.data / "euroc_imu" / f"{name}_body.tum")
        yield f"`{name}`: gyroscope against the true poses", f"{said['step_deg']:.4f} deg a step of 50 ms", "<= .02"


def found_row(a):
    for name in FLIGHTS:
        true = flight(a, name)
        wrong = []
        for late_ms in (0, 5, 20, 50):
            rows = [(t + late_ms * 1000000, values) for t, values in measurements(true)]
            said = ran(a, with_imu(true, a.out / f"late-{name}", rows), f"late-{name}-{late_ms}")["imu"]["images_say"]
            wrong.append(1000 * said["time_offset_s"] + late_ms)
        mounting = checked(a, true, a.out / "runs" / f"late-{name}-0" / "trajectory.txt")["mounting_deg"]
        yield (f"`{name}`, stereo: mounting; time offset with stamps late by 0, 5, 20, 50 ms", f"{mounting:.2f} deg off; "
               f"{', '.join(f'{w:.1f}' for w in wrong)} ms off", "<= .3; <= 2")


def up_row(a):
    for name in ("V103", "V202", "MH04"):
        for sensor in ("stereo", "mono"):
            whole = flight(a, name)
            folder = a.out / "runs" / f"up-{name}-{sensor}"
            table.run(a, folder, whole / "config.yaml", whole, "--no-map", "--set", f"dataset.sensor={sensor}")
            yield f"`{name}`, {sensor}: tilt of the finished map at its last frame", f"{tilt_deg(folder, whole):.2f} deg", "<= 1"


def rotated_z(q):
    """The body's or camera's (x y z w) view of the world's z axis, in its own axes."""
    x, y, z, w = q
    return (2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y))


def tilt_deg(folder, dataset):
    """Angle between up as the last pose of trajectory.txt has it and as the truth has it, both of the body."""
    last = [float(x) for x in (folder / "trajectory.txt").read_text().split("\n")[-2].split()]
    truth = min(csv(dataset / "mav0/state_groundtruth_estimate0/data.csv"), key=lambda r: abs(1e-9 * int(r[0]) - last[0]))
    w, x, y, z = map(float, truth[4:8])
    a, b = rotated_z(last[4:8]), rotated_z((x, y, z, w))
    return math.degrees(math.acos(max(-1.0, min(1.0, sum(p * q for p, q in zip(a, b))))))


def wrong_row(a):
    true = flight(a, "V103")
    rows, other = measurements(true), measurements(flight(a, "V202"))
    plain, seed = ran(a, true, "wrong-none", "--no-imu"), random.Random(1)
    bad = {"accelerations in g": [(t, v[:3] + [x / G for x in v[3:]]) for t, v in rows],
           "gravity taken out": [(t, v[:3] + [v[3] - 9.2, v[4], v[5] + 3.2]) for t, v in rows],
           "deg/s": [(t, [x * 57.29578 for x in v[:3]] + v[3:]) for t, v in rows],
           "two axes swapped": [(t, [v[1], v[0], v[2], v[4], v[3], v[5]]) for t, v in rows],
           "axes turned round": [(t, [v[1], v[2], v[0], v[4], v[5], v[3]]) for t, v in rows],
           "stamps late by 100 ms": [(t + 100000000, v) for t, v in rows],
           "10 % missing": [row for row in rows if seed.random() > 0.1],
           "stuck from the 4000th on": [(t, v if k < 4000 else rows[4000][1]) for k, (t, v) in enumerate(rows)],
           "another recording's": [(t - other[0][0] + rows[0][0], v) for t, v in other]}
    for what, measured in bad.items():
        run = ran(a, with_imu(true, a.out / "wrong", measured), f"wrong-{what.replace(' ', '-').replace('/', '-').replace('%', 'percent')}")
        yield f"`V103`, {what}", f"{'used' if run['imu']['used'] else 'left out'}: {named(run)}; ATE {run['ate'] / plain['ate']:.3f} of that without", "left out, <= 1.02"


def both(a, dataset, name, *options):
    return ran(a, dataset, f"{name}-imu", *options), ran(a, dataset, f"{name}-none", "--no-imu", *options)


def blur_row(a):
    for name in FLIGHTS:
        for sensor in ("stereo", "rgbd"):
            blurred = flight(a, name, "--exposure-ms", 20, sensor=sensor)
            pairs = [both(a, blurred, f"blur-{name}-{sensor}-{draw}", "--set", "dataset.noise=1", f"dataset.noise_draw={draw}") for draw in DRAWS]
            ates = [[1000 * run["ate"] for run in pair] for pair in pairs]
            yield (f"`{name}`, {sensor}, exposed for 20 ms, three draws of noise", f"ATE {', '.join(f'{imu:.1f}' for imu, _ in ates)} mm, without IMU "
                   f"{', '.join(f'{none:.1f}' for _, none in ates)}: median {statistics.median(imu / none for imu, none in ates):.2f}; frames without a pose "
                   f"{max(p['unposed'] for p, _ in pairs)}, {max(p['unposed'] for _, p in pairs)}", "<= .8; half")


def blackout_row(a):
    for name in FLIGHTS:
        black = with_blackouts(flight(a, name), a.out / f"black-{name}")
        imu, none = both(a, black, f"black-{name}")
        yield (f"`{name}`, stereo, black for .5 s every 10 s", f"submaps {imu['submaps']}, without IMU {none['submaps']}; largest error of a step {100 * imu['step']:.1f} cm, "
               f"{100 * none['step']:.1f}; ATE {1000 * imu['ate']:.1f} mm, {1000 * none['ate']:.1f}", "1; <= 10 cm")


def rest_row(a):
    if (a.data / "euroc_v101_head").exists():
        imu, none = both(a, a.data / "euroc_v101_head", "rest")
        yield "`euroc_v101_head`, at rest", f"ATE {1000 * imu['ate']:.2f} mm, without IMU {1000 * none['ate']:.2f}", "<= 1.02"


def cost_row(a):
    imu, none = both(a, flight(a, "V103"), "cost", "--threads", 1)
    yield "`V103`, stereo, one thread: processor time", f"{imu['cpu_s'] / none['cpu_s']:.3f} of that without; ATE {imu['ate'] / none['ate']:.3f} of it", "<= 1.05"


ROWS = {name[:-4]: row for name, row in list(globals().items()) if name.endswith("_row")}


def main():
    a = table.parse(table.parser(__doc__, "inertial", ROWS), ROWS)
    if not (a.data / "euroc_imu").exists():
        sys.exit(f"inertial: {a.data / 'euroc_imu'} is absent")
    table.put_rows(a, "inertial", ROWS, "Inertial sensors", "Flights of EuRoC, rendered along their true poses, with their real IMU. `./dev bench inertial --write`.")


if __name__ == "__main__":
    main()
