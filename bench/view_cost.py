#!/usr/bin/env python3
"""What the live view costs a run, with a browser that looks at it and under attack.

usage: ./dev bench view [--frames N] [--rounds N] [--write]   (or bench/view_cost.py --build build/release)
Runs take turns, so that the machine's load reaches all alike. The attack, from this machine: 1,000 connections that are
opened again whenever they are closed, 50 clients that send a byte a second, up to 200 MB of garbage. After it a run beside a
loop that takes as much processor time as the attacker took: what it costs to share a machine with anything that busy.
`tracking`: the thread that tracks, per frame; `all`: every thread of the process. Needs Python 3 alone.
"""
import json
import os
import pathlib
import re
import select
import socket
import statistics
import subprocess
import threading
import time
import urllib.request

import table

DOCUMENT = table.RESULTS / "live-view.md"
WAYS = {"none": "without the view", "browser": "with a browser", "attack": "with a browser, under attack",
        "busy": "with a browser, beside a program as busy as the attacker"}
CONNECTIONS, SLOW, GARBAGE_MB = 1000, 50, 200


def read_stream(url, counter):
    try:
        with urllib.request.urlopen(url + "events") as stream:
            for line in stream:
                counter["messages"] += line.startswith(b"data:")
    except OSError:
        pass  # the run has ended


class Attack(threading.Thread):
    """Goes on until `end`; counts what reached the server."""

    def __init__(self, port, counter):
        super().__init__(daemon=True)
        self.port, self.counter, self.end = port, counter, threading.Event()

    def connect(self):
        client = socket.socket()
        client.setblocking(False)
        client.connect_ex(("127.0.0.1", self.port))  # the server need not take it
        self.counter["connections"] += 1
        return client

    @staticmethod
    def closed(client):
        """Whether the server hung up; reads what it said."""
        try:
            while client.recv(1 << 16):
                pass
            return True
        except BlockingIOError:
            return False
        except OSError:
            return True

    def held(self, clients, count):
        """As many connections: those of before that are open, and new ones."""
        kept = []
        for client in clients:
            if self.closed(client):
                client.close()
            else:
                kept.append(client)
        return kept + [self.connect() for _ in range(count - len(kept))]

    def run(self):
        idle, slow, garbage, next_byte = [], [], [], 0.0
        chunk = os.urandom(1 << 16)
        while not self.end.is_set():
            garbage, slow, idle = self.held(garbage, 8), self.held(slow, SLOW), self.held(idle, CONNECTIONS)
            if time.monotonic() > next_byte:
                next_byte = time.monotonic() + 1
                for client in slow:
                    self.send(client, b"G")
            if self.counter["garbage"] < GARBAGE_MB * 1_000_000:
                for client in select.select([], garbage, [], 0)[1]:
                    self.counter["garbage"] += self.send(client, chunk)
            time.sleep(0.01)
        for client in idle + slow + garbage:
            client.close()

    @staticmethod
    def send(client, data):
        try:
            return client.send(data)
        except OSError:
            return 0


class Busy(threading.Thread):
    """Takes a share of one processor, until `end`."""

    def __init__(self, share):
        super().__init__(daemon=True)
        self.share, self.end = share, threading.Event()

    def run(self):
        begin, used = time.monotonic(), time.thread_time()
        while not self.end.is_set():
            while time.thread_time() - used < self.share * (time.monotonic() - begin):
                pass
            time.sleep(0.01)


def run(a, way, share):
    """Figures of one run, and the bytes of its trajectory; `share` is that of one processor which Busy takes."""
    out = a.out / way
    command = [a.tutti, "run", "--require", "failed", "--config", table.ROOT / "data/configs/7scenes.yaml", "--dataset", a.data / "redkitchen", "--out", out,
               "--end", str(a.frames), "--timing", "--no-report", "--quiet"]
    if way != "none":
        command += ["--view", "--view-port", "0", "--view-wait", "30"]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    counter = {"messages": 0, "connections": 0, "garbage": 0}
    beside = None
    begin = time.monotonic(), time.process_time()
    if way != "none":
        url = re.search(r"look at (\S+)", process.stderr.readline()).group(1)
        if way == "attack":
            beside = Attack(int(re.search(r":(\d+)/", url).group(1)), counter)
        if way == "busy":
            beside = Busy(share)
        threading.Thread(target=read_stream, args=(url, counter), daemon=True).start()
        if beside:
            beside.start()
    said = process.stderr.read()
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if beside:
        beside.end.set()
        beside.join()
    share = min(0.95, (time.process_time() - begin[1]) / (time.monotonic() - begin[0]))
    if process.returncode != 0:
        raise SystemExit(f"tutti ended with {process.returncode}: {said}")
    timing = json.loads((out / "summary.json").read_text())["timing"]
    frame = next(s for s in timing["stages"] if s["name"] == "frame")
    return {"tracking": frame["cpu_ms"] / frame["calls"], "all": 1000 * timing["cpu_s"] / frame["calls"],
            "memory": usage.ru_maxrss / 1024, "share": share, "bytes": (out / "trajectory.txt").read_bytes(), **counter}


def main():
    parser = table.parser(__doc__, "view")
    parser.add_argument("--frames", type=int, default=300)
    parser.add_argument("--rounds", type=int, default=3)
    a = table.parse(parser)
    results = {way: [] for way in WAYS}
    for _ in range(a.rounds):
        share = 0
        for way in WAYS:  # "busy" as the attack before it
            results[way].append(run(a, way, share))
            share = results[way][-1]["share"]
    middle = {way: {key: statistics.median(r[key] for r in runs) for key in runs[0] if key != "bytes"}
              for way, runs in results.items()}
    lines = ["# What the live view costs", "",
             f"Medians of {a.rounds} runs each, taking turns, of redkitchen's first {a.frames} frames; `./dev bench view --write`. The",
             f"attack comes from the same machine: {CONNECTIONS:,} connections that are opened again whenever they are closed, {SLOW} clients",
             f"that send a byte a second, up to {GARBAGE_MB} MB of garbage (the table has what got through). The last row is beside a loop that",
             "takes as much processor time as the attacker: the view itself costs the difference between the last two rows.", "",
             "| | tracking, CPU-ms per frame | all threads | most memory, MB | beside it, of a processor | messages to the browser | connections | garbage, MB | same bytes |",
             "|---|---|---|---|---|---|---|---|---|"]
    off = middle["none"]
    for way, words in WAYS.items():
        m = middle[way]
        same = all(r["bytes"] == results["none"][0]["bytes"] for r in results[way])
        lines.append(f"| {words} | {m['tracking']:.2f} ({100 * (m['tracking'] / off['tracking'] - 1):+.1f} %) | {m['all']:.1f} "
                     f"({100 * (m['all'] / off['all'] - 1):+.1f} %) | {m['memory']:.0f} ({m['memory'] - off['memory']:+.0f}) | "
                     f"{100 * m['share']:.0f} % | {m['messages']:.0f} | {m['connections']:.0f} | {m['garbage'] / 1e6:.0f} | {'yes' if same else '**no**'} |")
    table.put(a, DOCUMENT, "\n".join(lines))


if __name__ == "__main__":
    main()
