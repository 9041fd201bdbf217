#!/usr/bin/env python3
"""Runs fuzzers and says what they found: run.py BUILD [--minutes N] [--jobs N] [FUZZER...].

BUILD/seeds/<fuzzer> holds the seeds; what was found to reach new code stays in BUILD/corpus/<fuzzer>, an input that
broke something in BUILD/<fuzzer>-crash-...  Run it again with: BUILD/tests/fuzz/tutti_fuzz_<fuzzer> FILE
"""
import argparse
import concurrent.futures
import os
import pathlib
import re
import subprocess
import sys

# Longest inputs [bytes], where libFuzzer's 4096 are too few to hold a seed.
MAX_LENGTH = {"detector_state": 16384, "memory": 16384, "map": 262144, "bag": 16384}


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
              "corpus": number(r" corp: (\d+)"), "failed": code != 0}
    print(f"{fuzzer:15} {result['inputs']:>9} inputs, {result['edges']:>6} edges, {result['corpus']:>5} in the corpus"
          + (f"   FOUND something: {log}" if code else ""), flush=True)
    return result


def main():
    parser = argparse.ArgumentParser(prog="./dev fuzz", description="Feeds damaged and random input to the readers of files "
                                     "and to the live view, until the time is over or something breaks.")
    parser.add_argument("build", type=pathlib.Path, help=argparse.SUPPRESS)
    parser.add_argument("fuzzers", nargs="*", metavar="FUZZER", help="default: all")
    parser.add_argument("--minutes", type=float, default=10, help="for each (default 10)")
    parser.add_argument("--jobs", type=int, default=os.cpu_count(), help="at a time (default: all cores)")
    arguments = parser.parse_intermixed_args()
    build = arguments.build.resolve()
    there = sorted(p.name[len("tutti_fuzz_"):] for p in (build / "tests" / "fuzz").glob("tutti_fuzz_*") if p.is_file())
    unknown = [name for name in arguments.fuzzers if name not in there]
    if unknown:
        parser.error(f"there is no fuzzer '{unknown[0]}'; fuzzers are {' '.join(there)}")
    with concurrent.futures.ThreadPoolExecutor(max(arguments.jobs, 1)) as pool:
        results = list(pool.map(lambda name: run(build, name, max(1, round(60 * arguments.minutes))),
                                arguments.fuzzers or there))
    for left in pathlib.Path("/dev/shm").glob("tutti_fuzz_*"):
        subprocess.run(["rm", "-rf", left])
    return 1 if any(r["failed"] for r in results) else 0


if __name__ == "__main__":
    sys.exit(main())
