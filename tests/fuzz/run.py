#!/usr/bin/env python3
"""Runs fuzzers and says what they found: run.py BUILD [--minutes N] [--jobs N] [--write FILE] [FUZZER...].

BUILD/seeds/<fuzzer> holds the seeds; what was found to reach new code stays in BUILD/corpus/<fuzzer>, an input that
broke something in BUILD/<fuzzer>-crash-...  Run it again with: BUILD/tests/fuzz/tutti_fuzz_<fuzzer> FILE
"""
import argparse
import concurrent.futures
import datetime
import os
import pathlib
import re
import subprocess
import sys

# Longest inputs [bytes], where libFuzzer's 4096 are too few to hold a seed.
MAX_LENGTH = {"detector_state": 16384, "memory": 16384, "map": 262144, "bag": 16384}
READERS = {
    "bag": "bags of ROS 1 and 2 (MCAP, SQLite)", "calibration": "calibrations of other programs, EuRoC's sensor.yaml",
    "config": "configurations of runs, `--set`", "dataset": "lists of images, calibrations, ground truths of KITTI, TUM, EuRoC",
    "detector_state": "saved loop detectors", "g2o": "pose graphs", "http": "requests to the live view",
    "image": "image files", "json": "summary.json, notes of maps", "loop_text": "loop matrices and pairs",
    "map": "saved maps", "memory": "long-term memories", "trajectory": "trajectories, lists of times",
}


def run(build, fuzzer, seconds):
    corpus, seeds = build / "corpus" / fuzzer, build / "seeds" / fuzzer
    for folder in (corpus, seeds):
        folder.mkdir(parents=True, exist_ok=True)
    log = build / f"{fuzzer}.log"
    print(f"{fuzzer:15} runs for {seconds} s", flush=True)
    command = [build / "tests" / "fuzz" / f"tutti_fuzz_{fuzzer}", f"-max_total_time={seconds}",
               f"-max_len={MAX_LENGTH.get(fuzzer, 4096)}", "-timeout=20", "-print_final_stats=1",
               f"-artifact_prefix={build}/{fuzzer}-", corpus, seeds]
    with open(log, "w") as out:
        code = subprocess.run(command, stdout=out, stderr=subprocess.STDOUT).returncode
    text = log.read_text(errors="replace")
    number = lambda pattern: int((re.findall(pattern, text) or ["0"])[-1])
    result = {"fuzzer": fuzzer, "inputs": number(r"number_of_executed_units: (\d+)"), "edges": number(r" cov: (\d+)"),
              "seeds": len(list(seeds.iterdir())), "corpus": number(r" corp: (\d+)"), "failed": code != 0}
    print(f"{fuzzer:15} {result['inputs']:>9} inputs, {result['edges']:>6} edges, {result['corpus']:>5} in the corpus"
          + (f"   FOUND something: {log}" if code else ""), flush=True)
    return result


def row(result, minutes, commit):
    return (f"| `{result['fuzzer']}` | {READERS.get(result['fuzzer'], '')} | {minutes:g} | {result['inputs']:,} | {result['edges']:,} "
            f"| {result['corpus']:,} | {'1' if result['failed'] else '0'} | {datetime.date.today()}, {commit} |")


def document(rows):
    lines = ["# Fuzzing the readers", "",
             "libFuzzer with the address and the undefined-behaviour sanitizer, for so many minutes or up to a finding, from the",
             "seeds that `tests/fuzz` makes and what earlier runs had found. `./dev fuzz --minutes 10 --write` makes all rows anew,",
             "`./dev fuzz --minutes 10 --write FUZZER...` those of the fuzzers that are named.", "",
             "An edge is a branch of the program that some input took; libraries of others are not counted. A finding is an",
             "input that crashed, hung for 20 s, took 2 GB, or broke what the fuzzer checks (`tests/fuzz/<fuzzer>_fuzzer.cc`).", "",
             "| fuzzer | reads | minutes | inputs tried | edges | corpus | findings | date, commit |",
             "|---|---|---:|---:|---:|---:|---:|---|"]
    return "\n".join(lines + [rows[fuzzer] for fuzzer in sorted(rows)]) + "\n"


def earlier_rows(file):
    text = file.read_text() if file.exists() else ""
    return {found[1]: found[0] for found in re.findall(r"^(\| `(\w+)` .*)$", text, re.MULTILINE)}


def main():
    parser = argparse.ArgumentParser(prog="./dev fuzz", description="Feeds damaged and random input to the readers of files "
                                     "and to the live view, until the time is over or something breaks.")
    parser.add_argument("build", type=pathlib.Path, help=argparse.SUPPRESS)
    parser.add_argument("fuzzers", nargs="*", metavar="FUZZER", help="default: all")
    parser.add_argument("--minutes", type=float, default=10, help="for each (default 10)")
    parser.add_argument("--jobs", type=int, default=os.cpu_count(), help="at a time (default: all cores)")
    parser.add_argument("--write", action="store_true", help="figures into docs/results/fuzz.md")
    arguments = parser.parse_intermixed_args()
    build = arguments.build.resolve()
    there = sorted(p.name[len("tutti_fuzz_"):] for p in (build / "tests" / "fuzz").glob("tutti_fuzz_*") if p.is_file())
    unknown = [name for name in arguments.fuzzers if name not in there]
    if unknown:
        parser.error(f"there is no fuzzer '{unknown[0]}'; fuzzers are {' '.join(there)}")
    root = pathlib.Path(__file__).resolve().parents[2]
    # Of what was built just now; an hour later there may be another.
    commit = subprocess.run(["git", "rev-parse", "--short", "HEAD"], cwd=root, capture_output=True, text=True).stdout.strip()
    with concurrent.futures.ThreadPoolExecutor(max(arguments.jobs, 1)) as pool:
        results = list(pool.map(lambda name: run(build, name, max(1, round(60 * arguments.minutes))),
                                arguments.fuzzers or there))
    if arguments.write:
        file = root / "docs" / "results" / "fuzz.md"
        rows = {**earlier_rows(file), **{r["fuzzer"]: row(r, arguments.minutes, commit) for r in results}}
        file.write_text(document({name: rows[name] for name in rows if name in READERS}))
    for left in pathlib.Path("/dev/shm").glob("tutti_fuzz_*"):
        subprocess.run(["rm", "-rf", left])
    return 1 if any(r["failed"] for r in results) else 0


if __name__ == "__main__":
    sys.exit(main())
