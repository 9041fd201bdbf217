#!/usr/bin/env python3
"""Runs tests that were built to count what they execute, and says per module how many lines that is.

build/coverage/html has every line with its count, build/coverage/missed.txt the lines that nothing reached.
"""
import argparse
import collections
import json
import os
import pathlib
import shutil
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parents[1]
MODULES = ("core", "loopclosure", "backend", "frontend", "data", "apps")
BOUND = {"core": 90, "loopclosure": 90, "backend": 90}  # [% of lines]


def run_tests(build, programs):
    profiles = build / "profiles"
    shutil.rmtree(profiles, ignore_errors=True)
    profiles.mkdir()
    failed = []
    for program in programs:
        print(f"running {program.name}", flush=True)
        environment = dict(os.environ, LLVM_PROFILE_FILE=f"{profiles}/%p.profraw")
        with open(build / f"{program.name}.log", "w") as log:
            if subprocess.run([program], cwd=program.parent, env=environment, stdout=log, stderr=subprocess.STDOUT).returncode:
                failed.append(program.name)
    merged = build / "merged.profdata"
    subprocess.run(["llvm-profdata", "merge", "-sparse", "-o", merged, *profiles.glob("*.profraw")], check=True)
    return merged, failed


def cov(command, merged, programs, *options):
    objects = [word for program in programs[1:] for word in ("-object", program)]
    ignored = "-ignore-filename-regex=(/usr/|/build/|/tests/)"
    return subprocess.run(["llvm-cov", command, *options, ignored, f"-instr-profile={merged}", programs[0], *objects],
                          check=True, capture_output=True, text=True).stdout


def missed_lines(build, text):
    """Lines with the count 0 of `llvm-cov show`, in ranges, by file; the same into missed.txt."""
    missed, file = collections.defaultdict(list), None
    for line in text.splitlines():
        if line.startswith("/") and line.endswith(":"):
            file = pathlib.Path(line[:-1])
            continue
        parts = line.split("|", 2)
        if file is None or len(parts) < 3 or parts[1].strip() != "0":
            continue
        number = int(parts[0])
        if missed[file] and missed[file][-1][1] == number - 1:
            missed[file][-1][1] = number
        else:
            missed[file].append([number, number])
    spans = {str(file.relative_to(ROOT)): " ".join(f"{a}" if a == b else f"{a}-{b}" for a, b in ranges)
             for file, ranges in sorted(missed.items())}
    (build / "missed.txt").write_text("".join(f"{file}: {lines}\n" for file, lines in spans.items()))
    return spans


def module_of(file):
    parts = pathlib.Path(file).relative_to(ROOT).parts
    return parts[0]


def main():
    parser = argparse.ArgumentParser(prog="./dev coverage", description=__doc__.split("\n")[0])
    parser.add_argument("build", type=pathlib.Path, help=argparse.SUPPRESS)
    parser.add_argument("modules", nargs="*", help=f"whose tests to run: {' '.join(MODULES)} (default: core loopclosure backend)")
    parser.add_argument("--targets", action="store_true", help=argparse.SUPPRESS)  # what is to be built
    arguments = parser.parse_intermixed_args()
    build = arguments.build.resolve()
    modules = arguments.modules or ["core", "loopclosure", "backend"]
    for name in modules:
        if name not in MODULES:
            parser.error(f"there is no module '{name}'; modules are {' '.join(MODULES)}")
    if arguments.targets:
        print(*(f"tutti_{name}_tests" for name in modules))
        return 0
    programs = [build / "tests" / name / f"tutti_{name}_tests" for name in modules]
    merged, failed = run_tests(build, programs)
    lines, files = collections.Counter(), []
    covered = collections.Counter()
    for file in json.loads(cov("export", merged, programs, "-summary-only"))["data"][0]["files"]:
        module, count = module_of(file["filename"]), file["summary"]["lines"]
        lines[module] += count["count"]
        covered[module] += count["covered"]
        files.append((count["percent"], str(pathlib.Path(file["filename"]).relative_to(ROOT))))
    missed = missed_lines(build, cov("show", merged, programs))
    cov("show", merged, programs, "-format=html", f"-output-dir={build}/html")
    table = ["| module | lines that can run | reached by its tests | |", "|---|---:|---:|---|"]
    short = False
    for name in modules:
        percent = 100 * covered[name] / max(lines[name], 1)
        below = percent < BOUND.get(name, 0)
        short |= below
        table.append(f"| {name} | {lines[name]:,} | {percent:.1f} % | {f'below {BOUND[name]} %' if below else ''} |")
    worst = [f"| `{name}` | {percent:.1f} % | {missed[name]} |" for percent, name in sorted(files)
             if module_of(ROOT / name) in modules and name in missed]
    text = "\n".join(table + ["", "What nothing reached, the least covered file first:", "", "| file | reached | lines that are not |",
                              "|---|---:|---|"] + worst) + "\n"
    print(text)
    print(f"lines that nothing reached: {build / 'missed.txt'}; all of them with counts: {build / 'html' / 'index.html'}")
    if failed:
        print(f"FAILED: {' '.join(failed)}; see the logs in {build}", file=sys.stderr)
    return 1 if failed or short else 0


if __name__ == "__main__":
    sys.exit(main())
