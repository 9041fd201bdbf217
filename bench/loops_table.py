#!/usr/bin/env python3
"""Measures loop closure alone, every rule and every member, and writes docs/loop-closure-results.md.

usage: bench/loops_table.py --tutti build/release/apps/tutti/tutti [--data DIR] [--out DIR] [--rule RULE] [--no-doc] [ROW...]
Rows: corridor kitti_stride5 kitti_stride2 kitti_stride1 redkitchen (default: all whose data is there).
The document is made of the results.json files that lie under --out after the run, also of rows run before; what is
not there is named as missing. --rule runs one rule alone instead of all (no test of significance). Needs nothing
but Python 3. The data folder is --data, else TUTTI_DATA, else ../shared/data.
"""
import argparse
import json
import os
import pathlib
import shutil
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent
DOCUMENT = ROOT / "docs" / "loop-closure-results.md"
RULES = ["joint", "mean", "log-pool", "product", "majority", "naive", "surf", "sift", "orb", "seed"]
SEED = ["--preset", "standardised-mean", "--rule", "mean"]  # the method as it was first

# title, images, ground truth, further arguments. A loop of KITTI is the default rule of `tutti loops` (6 m, 30 deg,
# 10 s older, ignored up to 15 m), by which its stride-5 matrix was made as well.
ROWS = {
    "corridor": ("corridor walked twice", "corridor", "corridor/ground_truth.bmp", []),
    "kitti_stride5": ("KITTI 00, frames 0 to 1699, every 5th", "kitti_00_head/image_0",
                      "kitti_00_head/loop_gt_stride5.png", ["--stride", "5"]),
    "kitti_stride2": ("KITTI 00, frames 0 to 1699, every 2nd", "kitti_00_head/image_0", "kitti_00_head/poses.txt",
                      ["--stride", "2"]),
    "kitti_stride1": ("KITTI 00, frames 0 to 1699", "kitti_00_head/image_0", "kitti_00_head/poses.txt", []),
    "redkitchen": ("7-Scenes RedKitchen, every 3rd", "redkitchen/rgb", "redkitchen/groundtruth.txt",
                   ["--stride", "3", "--gt-distance", "0.3", "--gt-angle", "25", "--gt-ignore", "0.6",
                    "--gt-exclude-s", "10"]),
}


def run_row(name, tutti, data, out, rule, more):
    """Fills out/name/<rule>/; False if the data is absent."""
    _, images, truth, arguments = ROWS[name]
    for path in (data / images, data / truth):
        if not path.exists():
            print(f"{name}: {path} is absent; the row is left as it is", file=sys.stderr)
            return False
    folder = out / name
    command = [tutti, "loops", "--images", data / images, "--ground-truth", data / truth, *arguments, *more]
    for table in folder.glob("table.*"):  # of another run than the one that starts now
        table.unlink()
    if rule:
        subprocess.run(command + (SEED if rule == "seed" else ["--rule", rule]) + ["--out", folder / rule], check=True)
        return True
    shutil.rmtree(folder, ignore_errors=True)
    subprocess.run(command + ["--table", "--out", folder], check=True)
    subprocess.run(command + SEED + ["--out", folder / "seed"], check=True)
    return True


def results_of(name, out):
    """{rule: results.json} of what lies under out/name, in the order of RULES, then any other.

    Files from before refused images left the verified ranking mean something else by the same keys: not taken."""
    found = {f.parent.name: json.loads(f.read_text()) for f in sorted((out / name).glob("*/results.json"))}
    for rule in [r for r in found if "recall_at_100_precision_ranked" not in found[r]]:
        print(f"{name}, {rule}: its results.json is of an older tutti; run the row again", file=sys.stderr)
        del found[rule]
    order = [r for r in RULES if r in found] + [r for r in found if r not in RULES]
    return {r: found[r] for r in order}


def percent(value):
    return f"{100 * value:.1f}"


def both(result, key, inner=None):
    values = [result[key], result[key + "_posterior"]]
    return " / ".join(percent(v[inner] if inner else v) for v in values)


def calibration(result, suffix):
    error = result["calibration_error" + suffix]
    return "-" if error is None else f"{percent(error)} (n = {result['calibration_images' + suffix]})"


def overview(all_results):
    rules = [r for r in RULES if any(r in results for results in all_results.values())]
    lines = ["| images | with a loop | " + " | ".join(rules) + " |", "|---" * (len(rules) + 2) + "|"]
    for name, results in all_results.items():
        if not results:
            continue
        some = next(iter(results.values()))
        cells = [both(results[r], "recall_at_100_precision") if r in results else "-" for r in rules]
        lines.append(f"| {ROWS[name][0]}: {some['images']} | {some['rows_with_loop']} | " + " | ".join(cells) + " |")
    return lines


def p_text(p):
    return f"{p:.1e}" if p < 1e-4 else f"{p:.4f}"


def t_text(t):
    return "infinite" if t is None else f"{t:.2f}"


def significance(table):
    lines = ["| a against b | ranking | only a | only b | McNemar p | paired t | p |", "|---|---|---|---|---|---|---|"]
    for test in table["significance"]:
        m, t = test["mcnemar"], test["t_test"]
        lines.append(f"| {test['a']} against {test['b']} | {test['ranking']} | {m['only_a']} | {m['only_b']} "
                     f"| {p_text(m['p'])} ({m['method']}) | {t_text(t['t'])} | {p_text(t['p'])} |")
    return lines


def section(name, results, out, data):
    lines = [f"## {ROWS[name][0]}", ""]
    if not results:
        return lines + [f"Not run (`bench/loops_table.py {name}`).", ""]
    some = next(iter(results.values()))
    protocol = some["protocol"]
    lines += [f"Images: {some['images']} of {protocol['image_folder']}, stride {protocol['stride']}, "
              f"{some['rows_with_loop']} with a loop. Ground truth: {protocol['ground_truth']}; tolerance "
              f"{protocol['tolerance_frames']} frames. Exclusion: {protocol['exclusion']}. Threshold: "
              f"{protocol['threshold']} (probability >= {some['at_default_threshold']['threshold']:g}, `seed`: whatever geometry accepts).", ""]
    lines = [line.replace(str(data) + "/", "") for line in lines]
    lines += ["| rule | recall at 100 % precision | the same, ranked | area | best F1 | precision at the default "
              "| recall at the default | F1 at the default | calibration error | true / false "
              "| ms per image, median / p99 |", "|---|---|---|---|---|---|---|---|---|---|---|"]
    for rule, r in results.items():
        lines.append(f"| {rule} | {both(r, 'recall_at_100_precision')} "
                     f"| {percent(r['recall_at_100_precision_ranked'])} | {both(r, 'area_under_curve')} "
                     f"| {both(r, 'best_f1')} | {both(r, 'at_default_threshold', 'precision')} "
                     f"| {both(r, 'at_default_threshold', 'recall')} | {both(r, 'f1_at_default')} "
                     f"| {calibration(r, '')} / {calibration(r, '_posterior')} "
                     f"| {r['accepted']['true']} / {r['accepted']['false']} "
                     f"| {r['ms_per_image']['median']:.0f} / {r['ms_per_image']['p99']:.0f} |")
    lines.append("")
    table = out / name / "table.json"
    if table.exists():
        lines += ["Over the images with a loop, each found at its rule's own threshold of 100 % precision or not:", ""]
        lines += significance(json.loads(table.read_text())) + [""]
    return lines


def over_the_sets(tutti, out):
    """The paper's t-test over the sets that have a full table."""
    names = [name for name in ROWS if (out / name / "table.json").exists() and results_of(name, out)]
    lines = ["## Paired t-test over the sets", ""]
    if len(names) < 2:
        return lines + ["Needs the full table of two sets or more.", ""]
    outcome = out / "compare.json"
    subprocess.run([tutti, "compare-loops", *[out / n / "table.json" for n in names], "--out", outcome], check=True)
    lines += [f"Recall at 100 % precision of {', '.join(names)}; best single: each set's own best member.", "",
              "| a against b | ranking | mean difference | t | p |", "|---|---|---|---|---|"]
    for test in json.loads(outcome.read_text()):
        lines.append(f"| {test['a']} against {test['b']} | {test['ranking']} | {percent(test['mean_difference'])} "
                     f"| {t_text(test['t'])} | {p_text(test['p'])} |")
    return lines + [""]


def document(tutti, out, data):
    all_results = {name: results_of(name, out) for name in ROWS}
    lines = ["# Loop closure alone: results", "",
             "Written by `bench/loops_table.py` from the results.json of each run; do not edit. Figures in %, with "
             "verification / posterior only, by the protocol of `tutti loops`: ties together, a hypothesis on an ignored "
             "pair dropped, its image kept in the denominator. With verification: the accepted images alone, ranked by "
             "probability; an image that geometry refused is missed. Posterior only: every image, ranked by H. "
             "Ranked: the refused ones behind the accepted; no loop can be closed with these. Calibration error: of "
             "the accepted ones' probability / of H from the threshold on, over n images.", "",
             "## Recall at 100 % precision", ""]
    lines += overview(all_results) + [""]
    for name, results in all_results.items():
        lines += section(name, results, out, data)
    return "\n".join(lines + over_the_sets(tutti, out))


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--tutti", required=True, help="the executable")
    parser.add_argument("--data", default=os.environ.get("TUTTI_DATA", ROOT.parent / "shared" / "data"))
    parser.add_argument("--out", default="/tmp/tutti-loops", help="folder for the runs (kept)")
    parser.add_argument("--rule", help="one rule alone instead of the table")
    parser.add_argument("--threads", help="of tutti loops")
    parser.add_argument("--document", default=DOCUMENT, help="file to write")
    parser.add_argument("--no-doc", action="store_true", help="print the document instead of writing it")
    parser.add_argument("rows", nargs="*", metavar="ROW", help=" ".join(ROWS))
    a = parser.parse_args()
    for name in a.rows:
        if name not in ROWS:
            parser.error(f"unknown row '{name}'; rows are {' '.join(ROWS)}")
    out, data, tutti = (pathlib.Path(p).resolve() for p in (a.out, a.data, a.tutti))
    out.mkdir(parents=True, exist_ok=True)
    failed = False
    for name in a.rows or ROWS:
        try:
            run_row(name, tutti, data, out, a.rule, ["--threads", a.threads] if a.threads else [])
        except subprocess.CalledProcessError as e:
            print(f"{name}: FAILED: {e}", file=sys.stderr)
            failed = True
    text = document(tutti, out, data)
    if a.no_doc:
        print(text)
    else:
        pathlib.Path(a.document).write_text(text)
        print(f"written: {a.document}")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
