#!/usr/bin/env python3
"""Runs SLAM on real sequences and generated towns, saves, loads and uses their maps, and writes docs/results/map-file.md.

usage: ./dev bench map [ROW...] [--reuse] [--write]   (or bench/map_table.py --build build/release)

Rows: town redkitchen kitti (size and time); kitchen kitti-places wrong-map start driven
pruned going-on merged-kitti merged-kitchen dusk (what a map is good for). Those whose
data is absent are left out. Needs nothing but Python 3.
"""
import json
import os
import platform
import subprocess
import sys

import map_sessions
import map_use
import table

USES = {**map_use.ROWS, **map_sessions.ROWS}
DOCUMENT = table.RESULTS / "map-file.md"
TOWN = ["--sensor", "stereo", "--blocks-x", 1, "--laps", 1.3]
# name: what it is, configuration, data set; the town is generated.
ROWS = {"town": ("generated town, stereo", None, None),
        "redkitchen": ("`redkitchen`, RGB-D", "7scenes.yaml", "redkitchen"),
        "kitti": ("`kitti_00_head`, mono", "kitti_00-02_mono.yaml", "kitti_00_head")}
PARTS = ["keyframes", "images", "landmarks", "views", "vocabularies", "detector's rest", "rest"]
LIMITS = {"kb": 250, "save_ms": 10, "load_ms": 1.5, "searchable_s": 15}
LONG = 10000  # keyframes


def measure(a, name):
    """Figures of bench/map_file for the map of a run; None without data."""
    _, config, dataset = ROWS[name]
    folder = a.out / name
    if dataset is None:
        dataset = table.generate(a.tutti, a.out / "world", TOWN)
        config = dataset / "config.yaml"
    else:
        dataset, config = a.data / dataset, table.ROOT / "data" / "configs" / config
        if not dataset.exists():
            print(f"{name}: {dataset} is absent; its row is left as it is", file=sys.stderr)
            return None
    if not (a.reuse and (folder / "map.tutti").exists()):
        subprocess.run([a.tutti, "run", "--require", "failed", "--config", config, "--dataset", dataset, "--out", folder], check=True,
                       stdout=subprocess.DEVNULL)
    load = os.getloadavg()[0]
    out = subprocess.run([a.build / "bench" / "map_file", folder / "map.tutti"], check=True, capture_output=True, text=True)
    row = json.loads(out.stdout)
    row["load"] = round(load, 1)
    row["searchable_s"] = LONG * row["load_ms"] / 1000
    return row


def use(a, name):
    """Lines of a row of the second table; None without data."""
    _, data, measure_use = USES[name]
    absent = [a.data / dataset for _, dataset in data if not (a.data / dataset).exists()]
    if absent:
        print(f"{name}: {absent[0]} is absent; its row is left as it is", file=sys.stderr)
        return None
    return measure_use(a)


def against(row, figure, digits):
    mark = "" if row[figure] <= LIMITS[figure] else " (!)"
    return f"{row[figure]:.{digits}f}{mark}"


def use_table(rows):
    lines = ["## What a map is good for", "",
             "One run each; all is deterministic but times. Poses are compared in the map's frame of reference, without any "
             "alignment but the one that is named. (!): missed.", "",
             "| | what | bound | measured |", "|---|---|---|---|"]
    for name, (title, _, _) in USES.items():
        for i, (what, bound, figure, kept) in enumerate(rows.get(name, [])):
            lines.append(f"| {title if i == 0 else ''} | {what} | {bound} | {figure}{'' if kept else ' (!)'} |")
    return lines


def document(rows):
    lines = ["# Map files: size, time and use", "",
             "Written by `./dev bench map --write`. What `tutti run` leaves as `map.tutti` is loaded and saved again five times "
             "(`bench/map_file`; medians). The file is in the page cache when it is loaded; a save waits until the disk has it. "
             f"Goals: at most {LIMITS['kb']} kB, {LIMITS['save_ms']} ms to save and {LIMITS['load_ms']} ms to load, each per "
             f"keyframe; {LONG:,} keyframes searchable after {LIMITS['searchable_s']} s. (!): missed.", "",
             "| | keyframes | kB per keyframe | save, ms per keyframe | load, ms per keyframe | "
             f"{LONG:,} keyframes loaded, s (extrapolated) | load of the machine |",
             "|---|---|---|---|---|---|---|"]
    for name in ROWS:
        if name not in rows:
            continue
        r = rows[name]
        lines.append(f"| {ROWS[name][0]} | {r['keyframes']} | {against(r, 'kb', 0)} "
                     f"| {against(r, 'save_ms', 2)}, processor {r['save_cpu_ms']:.2f} "
                     f"| {against(r, 'load_ms', 2)}, processor {r['load_cpu_ms']:.2f} | {against(r, 'searchable_s', 1)} | {r['load']} |")
    lines += ["", f"The last but one column is {LONG:,} times the load of one keyframe: no map so long was made. "
              f"{os.cpu_count()} cores, {platform.machine()}.", "",
              "## By part, kB per keyframe", "",
              "In the file, and (in brackets) of content before it is packed.", "",
              "| | " + " | ".join(PARTS) + " |", "|---|" + "---|" * len(PARTS)]
    for name in ROWS:
        if name not in rows:
            continue
        cells = []
        for part in PARTS:
            p = rows[name]["parts"].get(part, {"kb": 0, "content_kb": 0})
            cells.append(f"{p['kb']:.1f} ({p['content_kb']:.1f})")
        lines.append(f"| {ROWS[name][0]} | " + " | ".join(cells) + " |")
    lines += ["", "A view's descriptors are most of it. What views share with the odometry's keyframes, and words with views, is "
              "stored once.", "", *use_table(rows)]
    return "\n".join(lines)


def main():
    all_rows = [*ROWS, *USES]
    a = table.parse(table.parser(__doc__, "map", all_rows), all_rows)
    measured = {name: measure(a, name) if name in ROWS else use(a, name) for name in a.rows}
    rows = table.put_json(a, "map-file", {name: row for name, row in measured.items() if row is not None})
    table.put(a, DOCUMENT, document(rows))


if __name__ == "__main__":
    main()
