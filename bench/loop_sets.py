"""Sets of images on which loops are judged: real ones, real ones changed, worlds; with their ground truth.

bench/ensemble_protocol draws seeds of its own for worlds and changes. The seeds here belong to development sets, on which
constants were chosen: no table of the protocol shows them.
"""
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
DEVELOPMENT_CHANGE = {"corridor": 40, "kitchen3": 60, "kitti5": 300}  # the first image that is changed
DEVELOPMENT_CHANGE_SEED = 7


def quiet(command):
    subprocess.run([str(word) for word in command], check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


def real(data, name):
    """Arguments of `tutti loops` (and of the programs of bench that read the same)."""
    images, truth, more = REAL[name]
    return ["--images", data / images, "--ground-truth", data / truth, *more]


def world(kind, folder):
    """The same for a world that lies in `folder`."""
    truth = WORLDS[kind][1]
    return ["--images", folder / ("images" if "--join-pairs" in truth else "image_0"), "--ground-truth", folder / "poses.txt", *truth]


def generate(tutti, folder, options):
    """Fills `folder` unless that was done before; what a killed run left is made anew."""
    if (folder / ".done").exists():
        return
    shutil.rmtree(folder, ignore_errors=True)
    print(f"generating {folder.name}", file=sys.stderr, flush=True)
    quiet([tutti, "generate", "--out", folder, *options])
    (folder / ".done").write_text("")


def generate_world(tutti, kind, seed, folder):
    generate(tutti, folder, ["--seed", seed, *WORLDS[kind][0]])


def development_world(tutti, kind, seed, out):
    """Arguments of `tutti loops` for a world, which is generated where it is absent."""
    folder = out / f"world-{kind}-{seed}"
    generate_world(tutti, kind, seed, folder)
    return world(kind, folder)


def development_changed(tutti, data, name, change, out):
    """The same for changed real images."""
    images, truth, more = REAL[name]
    folder = out / f"images-{name}-{change}".replace(":", "-")
    stride, rest = 1, list(more)
    if "--stride" in rest:  # the images that are written are the chosen ones already
        at = rest.index("--stride")
        stride = rest[at + 1]
        del rest[at:at + 2]
    generate(tutti, folder, ["--from-images", data / images, "--stride", stride, "--change", change, "--change-from",
                             DEVELOPMENT_CHANGE[name], "--seed", DEVELOPMENT_CHANGE_SEED])
    for matrix in folder.glob("ground_truth*"):  # lies among the images
        matrix.unlink()
    return ["--images", folder, "--ground-truth", data / truth, *rest]
