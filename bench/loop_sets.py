"""Sets of images on which loops are judged: real ones, real ones changed, worlds; with their ground truth.

bench/ensemble_protocol draws seeds of its own for worlds and changes. The seeds here belong to development sets, on which
constants were chosen: no table of the protocol shows them.
"""
import os
import shutil
import subprocess
import sys

KITCHEN_TRUTH = ["--gt-distance", "0.3", "--gt-angle", "25", "--gt-ignore", "0.6", "--gt-exclude-s", "10"]
REAL = {  # images, ground truth, further arguments; the first three are changed, too
    "corridor": ("corridor", "corridor/ground_truth.bmp", []),
    "kitti5": ("kitti_00_head/image_0", "kitti_00_head/loop_gt_stride5.png", ["--stride", "5"]),
    "kitchen3": ("redkitchen/rgb", "redkitchen/groundtruth.txt", ["--stride", "3"] + KITCHEN_TRUTH),
    "kitti2": ("kitti_00_head/image_0", "kitti_00_head/poses.txt", ["--stride", "2"]),
    "kitti1": ("kitti_00_head/image_0", "kitti_00_head/poses.txt", []),
}
CHANGED = ["corridor", "kitti5", "kitchen3"]
KITCHEN_CAMERA = "520,520,318,236"  # of the images in ../shared/data
ROOM_CAMERA = "393.6,393.6,239.5,179.5"  # as `tutti generate` has it at 480x360
OVERLAP_TRUTH = ["--ground-truth-overlap", "0.3", "--gt-exclude-s", "10"]
WORLD_TRUTH = ["--gt-angle", "30", "--gt-exclude-s", "30"]
WORLDS = {  # options of generate, of the ground truth
    "indoor": (["--frames", "388", "--sensor", "mono", "--world", "corridor", "--width", "240", "--height", "192", "--corridor",
                "42", "--speed", "0.65", "--rate", "1", "--laps", "3", "--repeat", "0.3", "--noise", "2", "--moving-objects", "2"],
               WORLD_TRUTH + ["--gt-distance", "1.5", "--gt-ignore", "4"]),
    "outdoor": (["--frames", "1063", "--sensor", "mono", "--world", "town", "--width", "240", "--height", "192", "--focal", "190",
                 "--blocks-x", "3", "--blocks-y", "3", "--speed", "1.4", "--rate", "1", "--laps", "4", "--facades", "300",
                 "--repeat", "0.05", "--roads", "300", "--noise", "3", "--lighting-change", "--moving-objects", "8"],
                WORLD_TRUTH + ["--gt-distance", "3", "--gt-ignore", "8"]),
    "city": (["--frames", "1237", "--sensor", "sides", "--world", "town", "--width", "320", "--height", "240", "--blocks-x", "5",
              "--blocks-y", "4", "--speed", "6", "--rate", "4", "--laps", "4", "--facades", "100", "--repeat", "0.3", "--signs",
              "0.6", "--roads", "40", "--noise", "3", "--lighting-change", "--moving-objects", "10"],
             ["--gt-angle", "30", "--gt-exclude-s", "10", "--gt-distance", "3", "--gt-ignore", "8", "--join-pairs"]),
    "loop-free": (["--sensor", "mono", "--world", "town", "--width", "400", "--height", "240", "--blocks-x", "5", "--blocks-y", "4",
                   "--speed", "6", "--rate", "4", "--laps", "0.9", "--facades", "60", "--repeat", "0.3", "--noise", "3",
                   "--moving-objects", "6"],
                  ["--gt-angle", "30", "--gt-exclude-s", "10", "--gt-distance", "3", "--gt-ignore", "8"]),
}


def _with(kind, *more):
    """The options and ground truth of a world, with other values, or options that it has not."""
    options, truth = list(WORLDS[kind][0]), WORLDS[kind][1]
    for k in range(0, len(more), 2):
        if more[k] in options:
            options[options.index(more[k]) + 1] = more[k + 1]
        else:
            options.extend(x for x in more[k:k + 2] if x)
    return options, truth


# Words that do not agree across light, few loops, and streets that look alike.
WORLDS["indoor-dusk"] = _with("indoor", "--dusk", "")
WORLDS["city-few"] = _with("city", "--frames", "500", "--blocks-x", "4", "--blocks-y", "3", "--speed", "7.25", "--laps", "1.2")
WORLDS["loop-free-6"] = _with("loop-free", "--roads", "6")
WORLDS["loop-free-300"] = _with("loop-free", "--roads", "300")
del WORLDS["loop-free"]
# A camera in a hand, with a rolling shutter: judged by overlap, with one camera or RGB-D.
WORLDS["room"] = (["--sensor", "rgbd", "--world", "room", "--width", "480", "--height", "360", "--rate", "4", "--laps", "2.5",
                   "--shake", "200", "--readout", "0.03", "--blur", "0.02", "--noise", "2", "--kinect-noise"], OVERLAP_TRUTH)
DEVELOPMENT_CHANGE = {"corridor": 40, "kitchen3": 60, "kitti5": 300}  # the first image that is changed
DEVELOPMENT_CHANGE_SEEDS = [7]


def quiet(command):
    subprocess.run([str(word) for word in command], check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


def real(data, name):
    """Arguments of `tutti loops` (and of the programs of bench that read the same)."""
    images, truth, more = REAL[name]
    return ["--images", data / images, "--ground-truth", data / truth, *more]


def kitchen_by_overlap(data, camera):
    """The same of redkitchen, judged by overlap; `camera`: as camera_options has it."""
    folder = data / "redkitchen"
    return ["--images", folder / "rgb", "--ground-truth", folder / "groundtruth.txt", "--stride", "3", *OVERLAP_TRUTH,
            *camera_options(KITCHEN_CAMERA, camera)]


def camera_options(intrinsics, camera):
    """"one": motions up to their scale; "rgbd": motions in metres; both need the camera of the depth images."""
    return ["--gt-camera", intrinsics, *(["--camera", intrinsics] if camera == "one" else ["--rgbd"])]


def world(kind, folder, camera="one"):
    """The same for a world that lies in `folder`; `camera`: of a room."""
    truth = WORLDS[kind][1]
    if kind == "room":
        return ["--images", folder / "rgb", "--ground-truth", folder / "groundtruth.txt", *truth, *camera_options(ROOM_CAMERA, camera)]
    return ["--images", folder / ("images" if "--join-pairs" in truth else "image_0"), "--ground-truth", folder / "poses.txt", *truth]


def generate(tutti, folder, options):
    """Fills `folder` unless that was done before; what a killed run left is made anew."""
    if (folder / ".done").exists():
        return
    shutil.rmtree(folder, ignore_errors=True)
    print(f"generating {folder.name}", file=sys.stderr, flush=True)
    command = [str(x) for x in (tutti, "generate", "--out", folder, "--threads", "1", *options)]
    child = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    _, status, usage = os.wait4(child.pid, 0)
    child.returncode = os.waitstatus_to_exitcode(status)
    if child.returncode != 0:
        raise RuntimeError(f"{' '.join(command)}: failed")
    (folder / ".done").write_text(f"{usage.ru_utime + usage.ru_stime:.1f}\n")


def seconds_of(folder):
    """Of a processor, that a world took."""
    return float((folder / ".done").read_text() or 0) if (folder / ".done").exists() else 0.0


def generate_world(tutti, kind, seed, folder):
    generate(tutti, folder, ["--seed", seed, *WORLDS[kind][0]])


def development_world(tutti, kind, seed, out, camera="one"):
    """Arguments of `tutti loops` for a world, which is generated where it is absent."""
    folder = out / f"world-{kind}-{seed}"
    generate_world(tutti, kind, seed, folder)
    return world(kind, folder, camera)


def development_changed(tutti, data, name, change, change_seed, out):
    """The same for changed real images."""
    images, truth, more = REAL[name]
    folder = out / f"images-{name}-{change}-{change_seed}".replace(":", "-")
    stride, rest = 1, list(more)
    if "--stride" in rest:  # the images that are written are the chosen ones already
        at = rest.index("--stride")
        stride = rest[at + 1]
        del rest[at:at + 2]
    generate(tutti, folder, ["--from-images", data / images, "--stride", stride, "--change", change, "--change-from",
                             DEVELOPMENT_CHANGE[name], "--seed", change_seed])
    for matrix in folder.glob("ground_truth*"):  # lies among the images
        matrix.unlink()
    return ["--images", folder, "--ground-truth", data / truth, *rest]
