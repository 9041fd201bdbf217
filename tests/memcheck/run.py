#!/usr/bin/env python3
"""Commands of tutti under valgrind's memcheck: reads of what was never written, of what was freed, blocks that are lost.

As users run them, optimised; on a synthetic town that is small enough for a program fifty times as slow.
"""
import argparse
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import time

ROOT = pathlib.Path(__file__).resolve().parents[2]
HERE = ROOT / "tests" / "memcheck"
TOWN = "--sensor stereo --blocks-x 1 --block 15 --laps 1.3 --rate 5 --width 240 --height 120 --supersample 1".split()
# A loop is closed in the first; the others read what it left.
COMMANDS = (("run", "--dataset TOWN --out OUT/run --threads 2 --require failed"),
            ("localize", "--map OUT/run/map.tutti --dataset TOWN --start 30 --end 50 --out OUT/localized"),
            ("loops", "TOWN/image_0 --stride 2 --out OUT/loops"),
            ("optimize", "OUT/run/graph.g2o --out OUT/optimized.g2o"),
            ("evaluate", "--run OUT/run"))


def errors_of(log):
    """What memcheck reported, each with its first lines."""
    reports = re.split(r"^==\d+== \n", log.read_text(errors="replace"), flags=re.MULTILINE)
    return [report for report in reports if re.search(r"^==\d+==    at ", report, re.MULTILINE)]


def preload(out):
    """libhwy (under OpenCV's image readers) asks for the time stamp counter by an instruction that valgrind refuses where
    the processor does not list it, and the program ends before it has begun: this function answers instead."""
    source, library = HERE / "time_stamp_counter.cc", out / "time_stamp_counter.so"
    subprocess.run([os.environ.get("CXX", "c++"), "-shared", "-fPIC", "-o", library, source], check=True)
    return library


def main():
    parser = argparse.ArgumentParser(prog="./dev memcheck", description=__doc__.split("\n")[0])
    parser.add_argument("tutti", type=pathlib.Path, help=argparse.SUPPRESS)
    parser.add_argument("commands", nargs="*", help=f"which: {' '.join(name for name, _ in COMMANDS)} (default: all)")
    a = parser.parse_args()
    names = [name for name, _ in COMMANDS]
    for name in a.commands:
        if name not in names:
            parser.error(f"there is no command '{name}' here; there are {' '.join(names)}")
    if not shutil.which("valgrind"):
        sys.exit("./dev memcheck: there is no valgrind; run:  apt-get install -y valgrind")
    out = pathlib.Path(tempfile.mkdtemp(prefix="tutti-memcheck-"))
    town, tutti = out / "town", a.tutti.resolve()
    subprocess.run([tutti, "generate", "--out", town, *TOWN], check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    environment = dict(os.environ, LD_PRELOAD=str(preload(out)))
    found = 0
    for name, text in COMMANDS:
        words = [name, *text.replace("TOWN", str(town)).replace("OUT", str(out)).split()]
        checked = not a.commands or name in a.commands
        if not checked:  # only for what it leaves
            subprocess.run([tutti, *words], check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
            continue
        begin = time.monotonic()
        with open(out / f"{name}.txt", "w") as said:
            status = subprocess.run(["valgrind", "--tool=memcheck", "-q", "--trace-children=yes", "--leak-check=full", "--num-callers=30",
                                     "--show-leak-kinds=definite", "--errors-for-leak-kinds=definite", "--error-exitcode=99",
                                     f"--suppressions={HERE / 'third_parties.supp'}", f"--log-file={out / name}.%p.log", tutti, *words],
                                    env=environment, stdout=said, stderr=subprocess.STDOUT).returncode
        took = time.monotonic() - begin
        errors = [error for log in sorted(out.glob(f"{name}.*.log")) for error in errors_of(log)]
        found += len(errors) + (1 if status and not errors else 0)
        print(f"tutti {name:10} {took:4.0f} s, status {status}, {len(errors)} errors", flush=True)
        for error in errors[:5]:
            print(error)
        if status and not errors:
            print((out / f"{name}.txt").read_text()[-2000:])
    if not found:
        shutil.rmtree(out)
    else:
        print(f"{found} findings; all of them are in {out}", file=sys.stderr)
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
