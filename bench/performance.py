#!/usr/bin/env python3
"""Runs `tutti run --timing` on real sequences and writes the tables of docs/results/timing.md between their markers.

usage: ./dev bench performance [ROW...] [--write]

Rows: kitti redkitchen. Rows that are not run keep what the document says. Needs nothing but Python 3.
"""
import os
import platform
import sys

import table

ROWS = {"kitti": ("`kitti_00_head`, mono", "kitti_00-02_mono.yaml", "kitti_00_head"),
        "redkitchen": ("`redkitchen`, RGB-D", "7scenes.yaml", "redkitchen")}


def section(name, s, load):
    timing, frames = s["timing"], s["frames"]["total"]
    lines = [f"### {ROWS[name][0]}", "",
             f"{frames} frames in {timing['wall_s']:.0f} s; {1e3 * timing['cpu_s'] / frames:.1f} CPU-ms per frame, all threads; "
             f"tracking median {timing['frame_ms']['median']:.1f} ms, p99 {timing['frame_ms']['p99']:.1f} ms. "
             f"Load of the machine before the run: {load:.1f}; {os.cpu_count()} cores, {platform.machine()}.", "",
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
    a = table.parse(table.parser(__doc__, "performance", ROWS), ROWS)
    for name in a.rows:
        (_, config, dataset), load = ROWS[name], os.getloadavg()[0]
        if not (a.data / dataset).exists():
            print(f"{name}: {a.data / dataset} is absent; the table is left as it is", file=sys.stderr)
            continue
        summary = table.run(a, a.out / name, table.ROOT / "data" / "configs" / config, a.data / dataset, "--timing")
        table.put_between(a, table.RESULTS / "timing.md", name, section(name, summary, load))


if __name__ == "__main__":
    main()
