#!/usr/bin/env python3
"""Measures how time and memory grow with the number of locations, (docs/results/loop-growth.md).

usage: ./dev bench growth [--locations N] [--limit N] [--saved N] [--reuse] [--remark TEXT] [--write]
       (or bench/growth_table.py --build build/release)

Runs bench/loop_growth three times: without a limit, with a limit of working memory and long-term memory in a file,
and with as many locations as are saved and loaded again. --reuse makes the document of the CSV files that an earlier
run left in --out. Needs nothing but Python 3; 20,000 locations without a limit need about 13 GB of memory.
"""
import csv
import platform
import subprocess
import sys
import tempfile

import table
COLUMNS = [("locations", "locations", 0), ("in_memory", "in STM and WM", 0), ("words", "words", 0),
           ("quantise_ms", "quantise", 1), ("likelihood_ms", "likelihood", 1), ("filter_ms", "filter", 1),
           ("memory_ms", "memory", 1), ("total_ms", "all", 1), ("total_p99_ms", "all, p99", 1),
           ("cpu_ms", "processor", 1), ("cpu_p99_ms", "processor, p99", 1), ("transferred", "to LTM", 0),
           ("retrieved", "back", 0), ("resident_mb", "MB", 0)]


def run(program, file, locations, limit, folder, reuse):
    """Rows of a run, and what it says of saving and loading."""
    if not (reuse and file.exists()):
        command = [program, str(locations), str(limit), "400"] + ([str(folder)] if folder else [])
        print("running:", *command, file=sys.stderr)
        partial = file.with_suffix(".part")
        with partial.open("w") as out:
            subprocess.run(command, check=True, stdout=out)
        partial.rename(file)
    lines = file.read_text().splitlines()
    rows = [{k: float(v) for k, v in row.items()} for row in csv.DictReader(l for l in lines if not l.startswith("#"))]
    pairs = next((l[2:].split(",") for l in lines if l.startswith("# save_s")), [])
    return rows, {k: float(v) for k, v in zip(pairs[::2], pairs[1::2])}


def table_of(rows):
    shown = [r for i, r in enumerate(rows) if i < 2 or (i + 1) % 5 == 0 or i == len(rows) - 1]
    lines = ["| " + " | ".join(title for _, title, _ in COLUMNS) + " |", "|---" * len(COLUMNS) + "|"]
    for row in shown:
        lines.append("| " + " | ".join(f"{row[key]:,.{digits}f}" for key, _, digits in COLUMNS) + " |")
    return lines


def kb_per_location(rows):
    """Between the first row and the last: without what the process needs for itself."""
    first, last = rows[0], rows[-1]
    return 1024 * (last["resident_mb"] - first["resident_mb"]) / (last["in_memory"] - first["in_memory"])


def document(free, limited, saving, limit, remark):
    last, full = free[-1], next(r for r in limited if r["locations"] >= limit + 1000)
    end = limited[-1]
    beyond = end["locations"] - full["locations"]
    lines = ["# How time and memory grow with the number of locations", "",
             "Written by `./dev bench growth --write`; do not edit. Synthetic "
             "signatures, three members of 400 features (`bench/loop_growth.cc` says what the walk is like). "
             "Milliseconds per image without extraction and verification, medians over the last 1,000 locations; "
             "`processor` is processor time of all threads (2 at most), which a busy machine changes less than the "
             f"time on the clock. Machine: {platform.machine()}. {remark}".rstrip(), "", "## Without a limit", ""]
    lines += table_of(free)
    lines += ["", f"At {last['locations']:,.0f} locations filter and vocabulary take "
              f"{last['quantise_ms'] + last['likelihood_ms'] + last['filter_ms']:.1f} ms "
              f"({last['cpu_ms']:.1f} ms of processor time with all else). One location in working memory takes "
              f"{kb_per_location(free):.0f} KB, features for verification included. Nearly all of the time goes into the "
              "search for words: [index.md](index.md) has other indices beside it.", "",
              f"## Working memory of {limit:,}, every image stored in a file", ""]
    lines += table_of(limited)
    lines += ["", f"The last 1,000 images against the 1,000 after the limit was reached: "
              f"{end['total_ms'] / full['total_ms']:.2f} of the time on the clock, "
              f"{end['cpu_ms'] / full['cpu_ms']:.2f} of the processor time. A location takes "
              f"{end['disk_kb_per_location']:.0f} KB on disk; one in long-term memory keeps "
              f"{1024 * (end['resident_mb'] - full['resident_mb']) / beyond if beyond else 0:.1f} KB "
              f"in memory (graph, weights, and what the allocator holds).", "", "## Save and Load", ""]
    return lines + [f"{saving['locations']:,.0f} locations: a file of {saving['file_mb']:.0f} MB; in processor time "
                    f"Save {saving['save_s']:.1f} s, Load {saving['load_s']:.1f} s, which is "
                    f"{100 * saving['load_s'] / saving['detect_s']:.1f} % of the {saving['detect_s']:.1f} s that "
                    "their detection took.", ""]


def main():
    parser = table.parser(__doc__, "growth")
    parser.add_argument("--locations", type=int, default=20000)
    parser.add_argument("--limit", type=int, default=1000)
    parser.add_argument("--saved", type=int, default=5000, help="locations of the detector that is saved and loaded")
    parser.add_argument("--remark", default="", help="a sentence about the machine or the runs, for the document")
    a = table.parse(parser)
    program = a.build / "bench" / "loop_growth"
    free, _ = run(program, a.out / "free.csv", a.locations, 0, None, a.reuse)
    with tempfile.TemporaryDirectory(dir=a.out) as folder:
        limited, _ = run(program, a.out / "limited.csv", a.locations, a.limit, folder, a.reuse)
    with tempfile.TemporaryDirectory(dir=a.out) as folder:
        rows, saving = run(program, a.out / "saved.csv", a.saved, 0, folder, a.reuse)
    saving["locations"] = rows[-1]["locations"]
    table.put(a, table.RESULTS / "loop-growth.md", "\n".join(document(free, limited, saving, a.limit, a.remark)))
    return 0


if __name__ == "__main__":
    sys.exit(main())
