#!/usr/bin/env python3
"""Runs `tutti run --timing` on real sequences and writes the tables of docs/results/timing.md between their markers.

usage: ./dev bench performance [ROW...] [--reuse] [--remark TEXT] [--write]   (or bench/performance.py --build build/release)

Rows: kitti redkitchen. Rows that are not run keep what the document says. Needs nothing but Python 3.
"""
import json
import os
import platform
import subprocess
import sys

import table

DOCUMENT = table.RESULTS / "timing.md"
ROWS = {"kitti": ("`kitti_00_head`, mono", "kitti_00-02_mono.yaml", "kitti_00_head"),
        "redkitchen": ("`redkitchen`, RGB-D", "7scenes.yaml", "redkitchen")}


def summary_of(tutti, name, data, out, reuse):
    """summary.json of a run, with the load of the machine before it."""
    _, config, dataset = ROWS[name]
    folder = out / name
    if not (reuse and (folder / "summary.json").exists()):
        if not (data / dataset).exists():
            print(f"{name}: {data / dataset} is absent; the table is left as it is", file=sys.stderr)
            return None
        load = os.getloadavg()[0]
        subprocess.run([tutti, "run", "--require", "failed", "--config", table.ROOT / "data" / "configs" / config, "--dataset", data / dataset,
                        "--out", folder, "--timing", "--trace", out / f"{name}.json"], check=True)
        (out / f"{name}-load.txt").write_text(f"{load:.1f}")
    summary = json.loads((folder / "summary.json").read_text())
    load = out / f"{name}-load.txt"
    summary["load"] = load.read_text() if load.exists() else "unknown"
    return summary


def section(name, s, remark):
    timing, frames = s["timing"], s["frames"]["total"]
    lines = [f"### {ROWS[name][0]}", "",
             f"{frames} frames in {timing['wall_s']:.0f} s; {1e3 * timing['cpu_s'] / frames:.1f} CPU-ms per frame, all threads; "
             f"tracking median {timing['frame_ms']['median']:.1f} ms, p99 {timing['frame_ms']['p99']:.1f} ms. "
             f"Load of the machine before the run: {s['load']}; {os.cpu_count()} cores, {platform.machine()}." +
             (f" {remark}" if remark else ""), "",
             "| | stage | calls | median, ms | p99, ms | CPU, ms | share of wall time | share of processor time |",
             "|---|---|---|---|---|---|---|---|"]
    for stage in timing["stages"]:
        cpu, share = "-", "-"  # of the detector's stages, which have helpers, it is not known
        if stage["cpu_ms"] is not None:
            cpu, share = f"{stage['cpu_ms']:.0f}", f"{stage['cpu_ms'] / (10 * timing['cpu_s']):.1f} %"
        lines.append(f"| {stage['lane']} | {stage['name']} | {stage['calls']} | {stage['median_ms']:.2f} "
                     f"| {stage['p99_ms']:.1f} | {cpu} | {100 * stage['share']:.1f} % | {share} |")
    return "\n".join(lines)


def main():
    parser = table.parser(__doc__, "performance", ROWS)
    parser.add_argument("--remark", default="", help="a sentence beside the figures")
    a = table.parse(parser, ROWS)
    for name in a.rows:
        summary = summary_of(a.tutti, name, a.data, a.out, a.reuse)
        if summary is not None:
            table.put_between(a, DOCUMENT, name, section(name, summary, a.remark))


if __name__ == "__main__":
    main()
