#!/usr/bin/env python3
"""Towns whose houses look alike: does SLAM close a loop that is none?

usage: ./dev bench alike [ROW...] [--write]

Ten generated towns: every house has one of five facades, no house has a sign, six road surfaces; the route is another one in
each. Each is driven once round and a quarter, so that true loops come at the end, after a whole round of places that resemble
others. `tutti run` with stereo and with the left images alone, as it is by default. A false loop in any of them is a failure.
"""
import csv
import statistics
import sys

import table

TOWN = ["--sensor", "stereo", "--world", "town", "--laps", "1.25", "--rate", "6", "--width", "400", "--height", "200", "--supersample",
        "1", "--noise", "--repeat", "1", "--facades", "5", "--signs", "0"]
ROUTES = [(), ("--blocks-x", 3), ("--blocks-x", 1), ("--blocks-x", 2, "--blocks-y", 2), ("--block", 50)]
SEEDS = range(101, 111)
ROWS = {"stereo": "stereo", "mono": "one camera"}


def run(a, row, seed):
    dataset = table.generate(a.tutti, a.out / f"town-{seed}", [*TOWN, "--seed", seed, *ROUTES[seed % len(ROUTES)]])
    folder = a.out / f"{row}-{seed}"
    summary = table.run(a, folder, dataset / "config.yaml", dataset, "--no-map", "--set", f"dataset.sensor={row}")
    with open(folder / "loops.csv", newline="") as file:
        loops = list(csv.DictReader(file))
    accepted = [loop for loop in loops if loop["accepted"] == "1"]
    doubted = [loop for loop in accepted if loop["verified"] == "0"]  # that entered because another one agreed
    evaluation = summary["evaluation"]
    return {"seed": seed, "proposed": len(loops), "accepted": len(accepted), "witnessed": len(doubted),
            "true": summary["loops"]["true"], "false": summary["loops"]["false"],
            "odometry_m": evaluation["odometry"].get("ate_rmse_m"), "slam_m": evaluation["slam"].get("ate_rmse_m")}


def line(title, runs):
    def middle(key):
        values = [r[key] for r in runs if r[key] is not None]
        return statistics.median(values) if values else float("nan")
    return (f"| {title} | {len(runs)} | {sum(r['proposed'] for r in runs)} | {sum(r['accepted'] for r in runs)} "
            f"| {sum(r['witnessed'] for r in runs)} | {sum(r['false'] for r in runs)} "
            f"| {sum(r['true'] > 0 for r in runs)} | {middle('odometry_m'):.3f} m | {middle('slam_m'):.3f} m |")


def main():
    a = table.parse(table.parser(__doc__, "alike", ROWS), ROWS)
    found = {row: [run(a, row, seed) for seed in SEEDS] for row in a.rows}
    whole = table.put_json(a, "alike", found)
    text = ["# Towns whose houses look alike", "", "Written by `./dev bench alike --write` (bench/alike_table.py): ten generated towns, "
            f"`tutti generate {' '.join(TOWN)}`, seeds {SEEDS[0]} to {SEEDS[-1]} and other routes. \"By a witness\": loops that the detector "
            "doubts, and that entered because another one or the map agreed. ATE: median.", "",
            "| camera | towns | proposed | accepted | of these by a witness | **false** | towns with a true loop | odometry, ATE | SLAM, ATE |",
            "|---|--:|--:|--:|--:|--:|--:|--:|--:|"]
    text += [line(ROWS[row], whole[row]) for row in ROWS if row in whole]
    table.put(a, table.RESULTS / "alike.md", "\n".join(text))
    return 1 if any(r["false"] for row in a.rows for r in found[row]) else 0


if __name__ == "__main__":
    sys.exit(main())
