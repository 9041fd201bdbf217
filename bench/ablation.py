#!/usr/bin/env python3
"""Ablation of the loop-closure detector: runs `tutti loops` once per variant and data set and writes a table.

usage: ./dev bench ablation [--sets SET...] [--variants VARIANT...] [--write]   (or bench/ablation.py --build build/release)

A variant is a list of `tutti loops` arguments (--rule, --set key=value). Every figure of the table comes from
the results.json of its run; with --reuse, variants whose results.json exists in --out are not run again (unless an older
tutti wrote it). --write: docs/results/ablation.md.
"""

import json
import resource
import subprocess

import table

KITTI_RULE = ["--gt-distance", "6", "--gt-angle", "30", "--gt-ignore", "15", "--gt-exclude-s", "10"]
REDKITCHEN_RULE = ["--gt-distance", "0.3", "--gt-angle", "25", "--gt-ignore", "0.6", "--gt-exclude-s", "10"]

# Images and ground truth below the data folder, further arguments.
SETS = {
    "corridor": ("corridor", "corridor/ground_truth.bmp", []),
    "kitti, stride 5": ("kitti_00_head/image_0", "kitti_00_head/loop_gt_stride5.png", ["--stride", "5"]),
    "kitti, stride 2": ("kitti_00_head/image_0", "kitti_00_head/poses.txt", ["--stride", "2"] + KITTI_RULE),
    "kitti, stride 1": ("kitti_00_head/image_0", "kitti_00_head/poses.txt", KITTI_RULE),
    "redkitchen, stride 3": ("redkitchen/rgb", "redkitchen/groundtruth.txt",
                             ["--stride", "3"] + REDKITCHEN_RULE),
}

# What is changed against the defaults, and how.
VARIANTS = {
    "defaults": [],
    "surf alone": ["--rule", "surf"],
    "sift alone": ["--rule", "sift"],
    "orb alone": ["--rule", "orb"],
    "rule: mean": ["--rule", "mean"],
    "rule: log-pool": ["--rule", "log-pool"],
    "rule: product": ["--rule", "product"],
    "rule: majority": ["--rule", "majority"],
    "rule: naive": ["--rule", "naive"],
    "preset standardised-mean": ["--preset", "standardised-mean"],
    "the same, likelihood: similarity": ["--preset", "standardised-mean", "--set", "likelihood=similarity"],
    "300 features": ["--set", "extraction.features=300"],
    "no spreading": ["--set", "extraction.grid_columns=1"],
    "SURF: 3 octaves": ["--set", "extraction.surf_octaves=3"],
    "SIFT on a quarter of the pixels": ["--set", "extraction.sift_max_pixels=131072"],
    "2 kd-trees": ["--set", "vocabulary.trees=2"],
    "16 kd-tree checks": ["--set", "vocabulary.checks=16"],
    "FLANN's own kd-trees": ["--set", "vocabulary.float_index=flann"],
    "8 random tries": ["--set", "vocabulary.hash_tables=8"],
    "sequence: 2 consistent images": ["--set", "consistent_images=2"],
    "islands of 3 levels": ["--set", "island_levels=3"],
    "root-SIFT": ["--set", "extraction.root_sift=true"],
    "ORB's border not scaled": ["--set", "extraction.orb_border=1"],
    "a memory per member": ["--rule", "mean", "--set", "memory=per_member"],
    "rehearsal": ["--set", "rehearsal=true"],
    "preset paper-2013": ["--preset", "paper-2013"],
    "preset rtabmap-0.8.3": ["--preset", "rtabmap-0.8.3"],
    "five members": ["--set", "members=[surf, sift, orb, akaze, brisk]"],
}


def slug(text):
    return "".join(c if c.isalnum() else "_" for c in text)


def run(arguments, data_set, variant):
    """The results of one run, with the processor time per image in ms."""
    images, truth, more = SETS[data_set]
    folder = arguments.out / slug(data_set) / slug(variant)
    results = folder / "results.json"
    # Files from before refused images left the verified ranking mean something else by the same keys.
    if not arguments.reuse or not results.exists() or "recall_at_100_precision_ranked" not in json.loads(results.read_text()):
        command = [str(arguments.tutti), "loops", "--images", str(arguments.data / images), "--ground-truth",
                   str(arguments.data / truth), "--out", str(folder)] + more + VARIANTS[variant]
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        seconds = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
        folder.with_suffix(".cpu_s").write_text(f"{seconds}\n")
    figures = json.loads(results.read_text())
    figures["cpu_ms"] = 1000 * float(folder.with_suffix(".cpu_s").read_text()) / figures["images"]
    return figures


def table_of(arguments, data_set):
    lines = []
    for variant in arguments.variants:
        f = run(arguments, data_set, variant)
        settings = " ".join(VARIANTS[variant]) or "-"
        accepted = f["accepted"]
        lines.append(f"| {variant} | `{settings}` | {100 * f['recall_at_100_precision']:.1f} "
                     f"| {100 * f['recall_at_100_precision_ranked']:.1f} "
                     f"| {100 * f['recall_at_100_precision_posterior']:.1f} "
                     f"| {100 * f['at_default_threshold']['recall']:.1f} "
                     f"| {100 * f['f1_at_default']:.1f} "
                     f"| {accepted['true']} / {accepted['false']} / {accepted['ignored']} "
                     f"| {f['cpu_ms']:.0f} |")
        protocol = f["protocol"]
        count = f"{f['images']} images, {f['rows_with_loop']} with a loop"
    truth = protocol["ground_truth"].replace(str(arguments.data) + "/", "")
    head = [f"## {data_set}", "",
            f"{count}. Ground truth: {truth}; tolerance {protocol['tolerance_frames']} frames; excluded: "
            f"{protocol['exclusion']}. Seed {protocol['seed']}.", "",
            "| variant | arguments | recall at 100 % precision, verified | the same, ranked "
            "| the same, posterior alone | recall at the default threshold | F1 there "
            "| accepted: true / false / on ignored cells | CPU ms per image |",
            "|---|---|---|---|---|---|---|---|---|"]
    return head + lines + [""]


def main():
    parser = table.parser(__doc__, "ablation")
    parser.add_argument("--sets", nargs="+", choices=list(SETS), default=list(SETS))
    parser.add_argument("--variants", nargs="+", choices=list(VARIANTS), default=list(VARIANTS))
    arguments = table.parse(parser)
    text = ["# Loop closure: what each choice is worth", "",
            "Written by `./dev bench ablation --write`; do not edit. Each row changes the defaults by its arguments to "
            "`tutti loops`. CPU time is that of the whole program, image decoding included, over all threads.", ""]
    for data_set in arguments.sets:
        text += table_of(arguments, data_set)
    table.put(arguments, table.RESULTS / "ablation.md", "\n".join(text))


if __name__ == "__main__":
    main()
