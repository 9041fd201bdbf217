#!/usr/bin/env python3
"""What did the ensemble buy? `tutti compare` on every row; BENCHMARK.md.

usage: ./dev bench ensemble [ROW...] [--write]   (or bench/benchmark.py --build build/release [ROW...] [--write])

Each variant runs five times on each row, on an odometry that is tracked once for all variants. What varies: on real data the
first frame (0 to 4) and noise of two grey levels, on generated ones the world, its route as well. --write rewrites
BENCHMARK.md and its data, docs/results/benchmark.json; rows that are not run, or whose data is absent, keep what is there.
Needs nothing but Python 3.
"""
import json
import subprocess
import sys

import table

VARIANTS = ["odometry", "surf", "sift", "orb", "naive", "product", "majority", "mean", "log-pool", "standardised-mean", "ensemble"]
SMALL_TOWN = ["--sensor", "stereo", "--world", "town", "--laps", "1.25", "--rate", "5", "--width", "512", "--height", "256",
              "--supersample", "1", "--noise"]
HARD_TOWN = ["1.5" if word == "1.25" else word for word in SMALL_TOWN]
NOISE = 2

ROWS = {
    "redkitchen": {"title": "7-Scenes RedKitchen, RGB-D, 500 frames", "config": "7scenes.yaml", "data": "redkitchen"},
    "kitti_00_head": {"title": "KITTI 00, frames 0 to 1699, mono", "config": "kitti_00-02_mono.yaml", "data": "kitti_00_head"},
    "town": {"title": "Synthetic towns, stereo, 1.25 laps", "generate": SMALL_TOWN, "routes": table.TOWN_ROUTES},
    "town_alike": {"title": "Synthetic towns whose houses look alike, stereo, 1.25 laps",
                   "generate": SMALL_TOWN + ["--repeat", "1", "--facades", "5", "--signs", "0"], "routes": table.TOWN_ROUTES},
    "town_dusk": {"title": "Synthetic towns, the second lap at dusk (dark, noisy, lamps are lit), stereo, 1.5 laps",
                  "generate": HARD_TOWN + ["--dusk"], "routes": table.TOWN_ROUTES},
    "town_changed": {"title": "Synthetic towns, the second lap with other parked cars and behind lorries (30 % of the image), "
                              "stereo, 1.5 laps", "generate": HARD_TOWN + ["--other-cars", "--occlusion", "0.3"],
                     "routes": table.TOWN_ROUTES},
    "room": {"title": "Synthetic rooms, RGB-D with the noise of a Kinect, 1.5 laps",
             "generate": ["--sensor", "rgbd", "--world", "room", "--laps", "1.5", "--rate", "8", "--width", "480", "--height", "360",
                          "--supersample", "1", "--kinect-noise"], "routes": [()] * 5},
}

INTRO = """`./dev bench ensemble --write` writes this file and its data, [docs/results/benchmark.json](docs/results/benchmark.json).
`tutti compare` runs every variant on an odometry that is tracked once for all of them, so that only the loop closure differs
([docs/evaluation.md](docs/evaluation.md) explains the columns). Ground truth serves the evaluation alone.

Each figure is over n runs. On real data the first frame and the image noise vary, on generated data the world and its route. ATE:
mean +- half of the 95 % confidence interval, and the worst run. p: paired t-test of the ATE against the ensemble's. Mono is aligned
by Sim(3), the rest by SE(3). In `redkitchen` colour and depth are not synchronised, so that differences of ATE below about half a
centimetre mean nothing there. `tutti run --timing` prints where the time of a run goes.
"""


def summary(whole):
    """What the ensemble buys and where it does not, in a few lines."""
    rows = [whole[r]["variants"] for r in ROWS if r in whole]

    def ate(v, name):
        return v[name]["ate_mean_m"]
    members, odometry = ("surf", "sift", "orb"), sum(ate(v, "ensemble") < ate(v, "odometry") for v in rows)
    equal = sum(min(ate(v, m) for m in members) <= 1.02 * ate(v, "ensemble") for v in rows)
    worse = sum(max(ate(v, m) for m in members) > 1.05 * ate(v, "ensemble") for v in rows)
    rings = json.loads((table.RESULTS / "closing.json").read_text())["ring"]
    closed = {m: sum(run[m]["closed"] for run in rings) for m in (*members, "ensemble")}
    return (f"# What did the ensemble buy?\n\n**Robustness more than accuracy.** Loop closure with the ensemble has a lower ATE than the odometry in "
            f"{odometry} of {len(rows)} rows below. In {equal} of them the best single member is within 2 % of the ensemble; in {worse}, the "
            f"worst single member is more than 5 % above it, and which one that is differs from row to row. Where places change it decides whether the "
            f"map closes: of five rings of corridors by day and at dusk, SURF alone closes {closed['surf']}, SIFT {closed['sift']}, ORB {closed['orb']}, the "
            f"ensemble {closed['ensemble']} ([closing](docs/results/closing.md)).\n\n**Where it does not help**: where every member finds the loops "
            "(`kitti_00_head`), and where the odometry hardly drifts (`redkitchen`). It costs the time of three feature extractors.\n")


def run_row(name, a):
    """The comparison as `tutti compare` wrote it; None if the data is absent."""
    row, folder = ROWS[name], a.out / name
    if "generate" in row:
        datasets = [table.generate(a.tutti, a.out / f"{name}-world-{seed}", [*row["generate"], "--seed", seed, *route])
                    for seed, route in zip(table.WORLD_SEEDS, row["routes"])]
        config, varied = datasets[0] / "config.yaml", ["--runs", "1"]
    else:
        datasets = [a.data / row["data"]]
        config, varied = table.ROOT / "data" / "configs" / row["config"], ["--runs", "5", "--noise", str(NOISE)]
        if not datasets[0].exists():
            print(f"{name}: {datasets[0]} is absent; the row is left as it is", file=sys.stderr)
            return None
    if not (a.reuse and (folder / "comparison.json").exists()):
        done = subprocess.run([a.tutti, "compare", "--config", config, "--out", folder, "--variants", ",".join(VARIANTS), *varied,
                               "--dataset", *datasets])
        if done.returncode not in (0, 1):  # 1: a run failed, and the table says so
            raise subprocess.CalledProcessError(done.returncode, done.args)
    return json.loads((folder / "comparison.json").read_text())["datasets"][0]


def slim(comparison):
    """Of a comparison, what the document shows; paths are of this machine and stay out."""
    out = {"varies": comparison["varies"], "variants": {}}
    for v in comparison["variants"]:
        out["variants"][v["variant"]] = {
            "n": v["ate_rmse_m"]["count"], "failed": len(v["failures"]), "ate_m": [s["ate_rmse_m"] for s in v["samples"]],
            "ate_mean_m": v["ate_rmse_m"]["mean"], "ate_half_width_m": v["ate_rmse_m"]["half_width_95"],
            "ate_worst_m": v["ate_rmse_m"]["largest"],
            "p": None if v["variant"] == "ensemble" else v["ate_minus_ensemble"].get("p"),
            "proposed": v["loops_proposed"]["mean"], "accepted": v["loops_accepted"]["mean"],
            "false": v["loops_false"]["mean"]}
    return out


def number(value, decimals):
    return "-" if value is None else f"{value:.{decimals}f}"


def section(name, found):
    made = f"`tutti generate {' '.join(ROWS[name]['generate'])}`, five seeds. " if "generate" in ROWS[name] else ""
    n = max(v["n"] for v in found["variants"].values())
    lines = [f"## {ROWS[name]['title']}", "", f"{made}n = {n}; what varies: {found['varies']}.", "",
             "| variant | proposed | accepted | false | ATE [m] | worst ATE [m] | p |",
             "|---|--:|--:|--:|--:|--:|--:|"]
    for variant, v in found["variants"].items():
        ate = number(v["ate_mean_m"], 4) + (f" +- {v['ate_half_width_m']:.4f}" if v["ate_half_width_m"] is not None else "")
        failed = f" ({v['failed']} failed)" if v["failed"] else ""
        lines.append(f"| {variant}{failed} | {number(v['proposed'], 1)} | {number(v['accepted'], 1)} | {number(v['false'], 1)} | {ate} "
                     f"| {number(v['ate_worst_m'], 4)} | {number(v['p'], 3)} |")
    return "\n".join(lines) + "\n"


def verdict(whole):
    """One line for each row: where the ensemble helped, and where it did not."""
    lines = ["## Where the ensemble helped, and where it did not", "",
             "| row | odometry, ATE | ensemble, ATE | best variant | false loops of the ensemble | did the ensemble help? |",
             "|---|---|---|---|---|---|"]
    for name in [r for r in ROWS if r in whole]:
        variants = whole[name]["variants"]
        ate = {v: variants[v]["ate_mean_m"] for v in variants if variants[v]["ate_mean_m"] is not None}
        if "ensemble" not in ate or "odometry" not in ate:
            lines.append(f"| {name} | - | - | - | - | a run failed |")
            continue
        best = min(ate, key=ate.get)
        better = [v for v in ate if v != "ensemble" and ate[v] < ate["ensemble"]]
        p = variants["odometry"]["p"]
        sure = "" if p is None else f" (p = {p:.3f} against the odometry)" if p >= 0.001 else " (p < 0.001 against the odometry)"
        if ate["ensemble"] >= ate["odometry"]:
            said = "no: not better than the odometry alone"
        elif better:
            said = f"over the odometry{sure}; not over {', '.join(better)}"
        else:
            said = f"yes, none is better{sure}"
        lines.append(f"| {name} | {ate['odometry']:.4f} m | {ate['ensemble']:.4f} m | {best} ({ate[best]:.4f} m) "
                     f"| {variants['ensemble']['false'] or 0:.1f} | {said} |")
    return "\n".join(lines) + "\n"


def main():
    a = table.parse(table.parser(__doc__, "ensemble", ROWS), ROWS)
    found, failed = {}, False
    for name in a.rows:
        try:
            comparison = run_row(name, a)
        except subprocess.CalledProcessError as error:
            print(f"{name}: FAILED: {error}", file=sys.stderr)
            failed = True
            continue
        if comparison is not None:
            found[name] = slim(comparison)
            table.put_json(a, "benchmark", found)  # a run that is cut off keeps what it has
    whole = table.put_json(a, "benchmark", found)
    document = [summary(whole), verdict(whole), INTRO] + [section(name, whole[name]) for name in ROWS if name in whole]
    table.put(a, table.ROOT / "BENCHMARK.md", "\n".join(document))
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
