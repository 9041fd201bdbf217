#!/usr/bin/env python3
"""What the live view costs: processor time of a run without it and with a browser's stream being read.

usage: ./dev bench view [--frames N] [--rounds N]   (or bench/view_cost.py --build build/release)
Runs take turns, so that the machine's load reaches both. `tracking`: the thread that tracks, per frame; `all`: every
thread of the process. Needs Python 3 alone.
"""
import json
import re
import statistics
import subprocess
import tempfile
import threading
import urllib.request

import table


def read_stream(url, counter):
    with urllib.request.urlopen(url + "events") as stream:
        for line in stream:
            counter[0] += line.startswith(b"data:")


def run(a, view):
    with tempfile.TemporaryDirectory() as out:
        command = [a.tutti, "run", "--config", table.ROOT / "data/configs/7scenes.yaml", "--dataset", a.data / "redkitchen", "--out", out,
                   "--end", str(a.frames), "--timing", "--no-report", "--quiet"]
        if view:
            command += ["--view", "--view-port", "0", "--view-wait", "30"]
        process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
        messages = [0]
        if view:
            url = re.search(r"look at (\S+)", process.stderr.readline()).group(1)
            reader = threading.Thread(target=read_stream, args=(url, messages), daemon=True)
            reader.start()
        process.communicate()
        if process.returncode != 0:
            raise SystemExit(f"tutti ended with {process.returncode}")
        timing = json.loads((pathlib.Path(out) / "summary.json").read_text())["timing"]
        frame = next(s for s in timing["stages"] if s["name"] == "frame")
        return frame["cpu_ms"] / frame["calls"], 1000 * timing["cpu_s"] / frame["calls"], messages[0]


def main():
    parser = table.parser(__doc__, "view")
    parser.add_argument("--frames", type=int, default=300)
    parser.add_argument("--rounds", type=int, default=3)
    a = table.parse(parser)
    results = {False: [], True: []}
    for _ in range(a.rounds):
        for view in (False, True):
            results[view].append(run(a, view))
    for k, name in enumerate(("tracking", "all")):
        off, on = (statistics.median(r[k] for r in results[view]) for view in (False, True))
        print(f"{name}: {off:.2f} ms per frame without, {on:.2f} ms with the view: {100 * (on / off - 1):+.1f} %")
    print(f"messages to the browser: {statistics.median(r[2] for r in results[True]):.0f} for {a.frames} frames")


if __name__ == "__main__":
    main()
