#!/usr/bin/env python3
"""Runs the protocol of Salameh et al., Tables 1 and 2, on Lip6 Indoor, Lip6 Outdoor and City Centre.

usage: ./dev bench paper [--images FOLDER] [--stand-ins] [--only SET] [--write]   (or bench/reproduce_paper.py)
The images are not part of tutti; data/README.md says where to get them and where to put them. A set whose images
are absent is skipped, or with --stand-ins replaced by a synthetic one of as many images. What is measured on a
stand-in says nothing about the real set: it proves the command, and gives a fixed world to compare rules in.
Needs nothing but Python 3.
"""
import dataclasses
import json
import os
import pathlib
import subprocess
import sys

import table

RULES = ["surf", "sift", "orb", "naive", "mean", "log-pool", "joint", "seed"]
COLUMNS = ["SURF", "SIFT", "ORB", "naive", "mean", "log-pool", "joint (ours)", "seed (the paper's method)"]
SEED = ["--preset", "standardised-mean", "--rule", "mean"]
IMAGE_TYPES = {".ppm", ".pgm", ".png", ".jpg", ".jpeg", ".bmp", ".webp"}
TRUTH_TYPES = {".mat", ".txt", ".png", ".bmp"}


@dataclasses.dataclass
class DataSet:
    title: str
    images: int  # that the detector sees: City Centre's are pairs
    folders: list  # names of the folder inside of --images; the first is ours, the others as the archives unpack
    truths: list  # file names of the ground truth, best first
    table1: list  # recall [%] at 100 % precision: SURF, SIFT, ORB, naive, ensemble (its mean)
    rival: str  # the best of the paper's Table 2
    generate: list  # options of the stand-in
    truth_rule: list  # the stand-in's ground truth from its poses
    pairs: bool = False


# Frames of the walks are a second apart, those of the drive 1.5 m, as in the real sets.
SETS = {
    "lip6_indoor": DataSet(
        "Lip6 Indoor", 388, ["lip6_indoor", "Lip6IndoorDataSet"], ["Lip6IndoorGroundTruth.mat"],
        [74.77, 38.49, 2.21, 73.45, 80.53], "98 (RTAB-Map, tuned SURF)",
        ["--sensor", "mono", "--world", "corridor", "--width", "240", "--height", "192", "--corridor", "42",
         "--speed", "0.65", "--rate", "1", "--laps", "3", "--repeat", "0.3", "--noise", "2", "--moving-objects", "2"],
        ["--gt-distance", "1.5", "--gt-angle", "30", "--gt-ignore", "4", "--gt-exclude-s", "30"]),
    "lip6_outdoor": DataSet(
        "Lip6 Outdoor", 1063, ["lip6_outdoor", "Lip6OutdoorDataSet"], ["Lip6OutdoorGroundTruth.mat"],
        [95.3, 24.16, 59.86, 96.3, 97.79], "95 (RTAB-Map)",
        ["--sensor", "mono", "--world", "town", "--width", "240", "--height", "192", "--focal", "190", "--blocks-x", "3",
         "--blocks-y", "3", "--speed", "1.4", "--rate", "1", "--laps", "4", "--facades", "300", "--repeat", "0.05",
         "--roads", "300", "--noise", "3", "--lighting-change", "--moving-objects", "8"],
        ["--gt-distance", "3", "--gt-angle", "30", "--gt-ignore", "8", "--gt-exclude-s", "30"]),
    "city_centre": DataSet(
        "City Centre", 1237, ["city_centre", "CityCentre"],
        ["CityCentreGroundTruth.mat", "city_GT_final.mat", "city_centre_htmap.mat"],
        [86.36, 85.02, 64.39, 73.44, 87.92], "81 (RTAB-Map)",
        ["--sensor", "sides", "--world", "town", "--width", "320", "--height", "240", "--blocks-x", "5", "--blocks-y", "4",
         "--speed", "6", "--rate", "4", "--laps", "4", "--facades", "100", "--repeat", "0.3", "--signs", "0.6",
         "--roads", "40", "--noise", "3", "--lighting-change", "--moving-objects", "10"],
        ["--gt-distance", "3", "--gt-angle", "30", "--gt-ignore", "8", "--gt-exclude-s", "10"], pairs=True),
}


class Absent(Exception):
    """The images or the ground truth of a set are not where they should be."""


def has_images(folder):
    return folder.is_dir() and any(f.suffix.lower() in IMAGE_TYPES for f in folder.iterdir())


def find_real(data, s):
    """(options for images and ground truth) of the real set. Raises Absent."""
    tried = []
    for name in s.folders if data else []:
        root = data / name
        tried.append(str(root))
        images = next((f for f in (root / "Images", root / "images", root) if has_images(f)), None)
        if images is None:
            continue
        truth = next((root / t for t in s.truths if (root / t).is_file()), None)
        if truth is None:
            raise Absent(f"{root} has images, but none of {', '.join(s.truths)}")
        return ["--images", images, "--ground-truth", truth] + (["--join-pairs"] if pairs_in(images, s) else [])
    raise Absent("no images in " + (", ".join(tried) if tried else "--data, which is not given"))


def pairs_in(images, s):
    """City Centre may have been joined beforehand; then there are half as many images."""
    count = sum(f.suffix.lower() in IMAGE_TYPES for f in images.iterdir())
    expected = s.images * (2 if s.pairs else 1)
    if count not in (expected, s.images):
        print(f"{s.title}: {count} images, {expected} expected; is the archive complete?", file=sys.stderr)
    return s.pairs and count != s.images


def stand_in(tutti, out, s, name):
    folder = table.generate(tutti, out / f"{name}-stand-in", ["--seed", "1", "--frames", str(s.images), *s.generate])
    images = folder / ("images" if s.pairs else "image_0")
    return ["--images", images, "--ground-truth", folder / "poses.txt", *s.truth_rule] + \
        (["--join-pairs"] if s.pairs else [])


def run_rules(tutti, given, out):
    """({rule: its figures}, protocol), by `tutti loops --table`, and the paper's own method beside it."""
    subprocess.run([tutti, "loops", *given, "--table", "--out", out], check=True, stdout=subprocess.DEVNULL)
    rules = json.loads((out / "table.json").read_text())
    subprocess.run([tutti, "loops", *given, *SEED, "--out", out / "seed"], check=True, stdout=subprocess.DEVNULL)
    seed = json.loads((out / "seed" / "results.json").read_text())
    return {**rules["rules"], "seed": seed}, rules["protocol"]


def percent(value):
    return f"{100 * value:.2f}"


def table1_lines(s, label, results):
    """Recall at 100 % precision, the paper's figures above ours."""
    published = [f"{v:.2f}" for v in s.table1]
    cells = " | ".join(published[:-1] + ["-", "-", "-", published[-1]])
    lines = [f"| {s.title}: the paper | {cells} |"]
    for key, what in (("recall_at_100_precision_posterior", "ours"),
                      ("recall_at_100_precision", "ours, verified geometrically"),
                      ("recall_at_100_precision_ranked", "ours, refused ranked behind verified")):
        lines.append(f"| {label}: {what} | " + " | ".join(percent(results[r][key]) for r in RULES) + " |")
    lines.append(f"| {label}: ours, precision / recall at the fixed threshold | " + " | ".join(
        f"{percent(results[r]['at_default_threshold']['precision'])} / "
        f"{percent(results[r]['at_default_threshold']['recall'])}" for r in RULES) + " |")
    return lines


def note(label, results, protocol):
    first = results[RULES[0]]
    return (f"* {label}: {first['images']} images, {first['rows_with_loop']} with a loop; ground truth: "
            f"{protocol['ground_truth']}; tolerance {protocol['tolerance_frames']} frames; "
            f"excluded: {protocol['exclusion']}; threshold: {protocol['threshold']}")


def report(runs):
    lines = ["## Table 1: recall [%] at 100 % precision", "", "| | " + " | ".join(COLUMNS) + " |", "|---" * (1 + len(COLUMNS)) + "|"]
    for s, label, results, _ in runs:
        lines += table1_lines(s, label, results)
    lines += ["", "Verified geometrically: the accepted images alone; one that geometry refused is missed. Ranked: those "
              "stay, behind the accepted ones."]
    lines += [""] + [note(label, results, protocol) for _, label, results, protocol in runs]
    lines += ["", "## Table 2: ensemble and best rival, recall [%] at 100 % precision", "",
              "| | the paper's ensemble | best rival in the paper | our ensemble | ours, verified |", "|---" * 5 + "|"]
    for s, label, results, _ in runs:
        ours = results["joint"]
        lines.append(f"| {label} | {s.table1[-1]:.2f} | {s.rival} | {percent(ours['recall_at_100_precision_posterior'])} "
                     f"| {percent(ours['recall_at_100_precision'])} |")
    if any(label != s.title for s, label, _, _ in runs):
        lines += ["", "A stand-in is a synthetic world of as many images; its figures can't be compared with the paper's."]
    return "\n".join(lines) + "\n"


def main():
    parser = table.parser(__doc__, "paper")
    parser.add_argument("--images", help="folder of the image sets (default: $TUTTI_PAPER_DATA)",
                        default=os.environ.get("TUTTI_PAPER_DATA"))
    parser.add_argument("--stand-ins", action="store_true", help="synthetic sets for those whose images are absent")
    parser.add_argument("--only", action="append", choices=list(SETS), help="this set (may be repeated)")
    a = table.parse(parser)
    tutti, out = a.tutti, a.out
    data = pathlib.Path(a.images).resolve() if a.images else None
    runs, failed = [], False
    for name in a.only or SETS:
        s = SETS[name]
        try:
            given, label = find_real(data, s), s.title
        except Absent as absent:
            print(f"{s.title}: {absent} (data/README.md says where to get them)", file=sys.stderr)
            if not a.stand_ins:
                continue
            given, label = stand_in(tutti, out, s, name), f"{s.title} stand-in"
        folder = out / label.lower().replace(" ", "_").replace("-", "_")
        print(f"== {label}", file=sys.stderr)
        try:
            runs.append((s, label, *run_rules(tutti, given, folder)))
        except subprocess.CalledProcessError as e:  # tutti has said why
            print(f"{label}: FAILED: {' '.join(str(w) for w in e.cmd)}", file=sys.stderr)
            failed = True
    if not runs:
        if not failed:
            print("nothing to run: give --images FOLDER, or --stand-ins", file=sys.stderr)
        return 1
    text = report(runs)
    sets = " ".join(f"--only {name}" for name in a.only or [])
    command = f"./dev bench paper --stand-ins {sets}".strip()
    table.put(a, table.RESULTS / "stand-ins.md", f"# The paper's tables\n\nWritten by `{command} --write`; do not edit.\n\n{text}")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
