#!/usr/bin/env python3
"""Do the tests notice? Changes constants and signs of loopclosure and backend, one at a time, and runs their tests.

usage: ./dev bench mutation [--count 50] [--seed 1] [--write]
In a copy of the sources (a git worktree below --out). A change is drawn among all numbers and operators of the modules' .cc
files; it counts if it compiles and changes the machine code. It is caught if a test of its module fails, crashes, or takes
five times as long as the whole module does else.
"""
import contextlib
import hashlib
import os
import random
import re
import subprocess
import sys
import tempfile
import time

import table

MODULES = ("loopclosure", "backend")
SHARDS = 2  # a module's tests are split over so many processes
OPERATORS = {" + ": " - ", " - ": " + ", " < ": " >= ", " > ": " <= ", " <= ": " > ", " >= ": " < ", " == ": " != ", " != ": " == ",
             " && ": " || ", " || ": " && ", " += ": " -= ", " -= ": " += ", " * ": " / "}
NUMBER = re.compile(r"(?<![\w.\"'])(\d+\.\d*(?:e[-+]?\d+)?f?|\d+e[-+]?\d+f?|\d+)(?![\w.\"'])", re.IGNORECASE)


def changed_number(text):
    if re.fullmatch(r"\d+", text):
        return {"0": "1", "1": "2"}.get(text, str(int(text) // 2 if int(text) > 3 else int(text) + 1))
    suffix = "f" if text[-1] in "fF" else ""
    value = float(text.rstrip("fF"))
    return f"{1.0 if value == 0 else 2 * value!r}{suffix}"


def places(source):
    """All (file, line number, column, old, new) that can be changed."""
    found = []
    for module in MODULES:
        for file in sorted((source / module).rglob("*.cc")):
            for number, line in enumerate(file.read_text().splitlines()):
                code = line.split("//")[0]
                if re.match(r"\s*(#|static_assert|using |template)", code) or '"' in code or "Assert" in code:
                    continue
                if ".reserve(" in code:  # room for more or for less: the results are the same
                    continue
                for old, new in OPERATORS.items():
                    start = code.find(old)
                    while start >= 0:
                        found.append((file, number, start, old, new))
                        start = code.find(old, start + 1)
                for match in NUMBER.finditer(code):
                    found.append((file, number, match.start(), match.group(), changed_number(match.group())))
    return found


def apply(place):
    file, number, column, old, new = place
    lines = file.read_text().splitlines(keepends=True)
    line = lines[number]
    assert line[column:column + len(old)] == old
    lines[number] = line[:column] + new + line[column + len(old):]
    file.write_text("".join(lines))


def build(folder, module):
    command = ["cmake", "--build", folder, "-j", str(os.cpu_count()), "--target", f"tutti_{module}_tests"]
    return subprocess.run(command, capture_output=True).returncode == 0


def program(folder, module):
    return folder / "tests" / module / f"tutti_{module}_tests"


def digest(folder, module):
    return hashlib.sha256(program(folder, module).read_bytes()).hexdigest()


def failure(process, output):
    """Name of a test that failed in a shard that has ended, or None."""
    output.seek(0)
    text = output.read().decode(errors="replace")
    failed = re.findall(r"\[  FAILED  \] (\S+?)[, ]", text)
    begun = re.findall(r"\[ RUN      \] (\S+)", text)
    return failed[0] if failed else f"{begun[-1] if begun else '?'} (crashed)" if process.returncode else None


def test(folder, module, patience_s):
    """Name of the first test that failed, or None."""
    exe = program(folder, module)
    end = time.monotonic() + patience_s
    with contextlib.ExitStack() as stack:
        running = []
        for index in range(SHARDS):
            environment = dict(os.environ, GTEST_TOTAL_SHARDS=str(SHARDS), GTEST_SHARD_INDEX=str(index), GTEST_FAIL_FAST="1")
            output = stack.enter_context(tempfile.TemporaryFile())
            process = subprocess.Popen([exe], cwd=exe.parent, env=environment, stdout=output, stderr=subprocess.DEVNULL)
            running.append((process, output))
            stack.callback(process.wait)
            stack.callback(process.kill)  # of no effect on one that has ended
        while running:
            for process, output in [one for one in running if one[0].poll() is not None]:
                running.remove((process, output))
                if (name := failure(process, output)) is not None:
                    return name
            if time.monotonic() > end:
                return "(takes too long)"
            time.sleep(0.1)
    return None


def main():
    parser = table.parser(__doc__, "mutation")
    parser.add_argument("--count", type=int, default=50, help="changes that are tried")
    parser.add_argument("--seed", type=int, default=1)
    a = table.parse(parser)
    source, folder = a.out / "tree", a.out / "build"
    subprocess.run(["git", "-C", table.ROOT, "worktree", "remove", "--force", source], capture_output=True)
    subprocess.run(["git", "-C", table.ROOT, "worktree", "prune"], check=True)
    subprocess.run(["git", "-C", table.ROOT, "worktree", "add", "--detach", source, "HEAD"], check=True, capture_output=True)
    os.environ["TUTTI_DATA"] = str(a.data)
    # Files one by one: a change compiles one of them, not all of its folder.
    subprocess.run(["cmake", "-S", source, "-B", folder, "-G", "Ninja", "-DCMAKE_BUILD_TYPE=Release", "-DCMAKE_CXX_FLAGS_RELEASE=-O2",
                    "-DBUILD_TESTING=ON", "-DTUTTI_WERROR=OFF", "-DTUTTI_REPORTS=OFF"], check=True, stdout=subprocess.DEVNULL)
    usual = {}
    for module in MODULES:
        if not build(folder, module):
            sys.exit(f"{module} does not build")
        begin = time.monotonic()
        if (failed := test(folder, module, 3600)) is not None:
            sys.exit(f"{failed} fails without any change")
        usual[module] = time.monotonic() - begin
        print(f"{module}: tests take {usual[module]:.0f} s", flush=True)
    original = {module: digest(folder, module) for module in MODULES}
    candidates = places(source)
    random.Random(a.seed).shuffle(candidates)
    rows, rejected = [], 0
    for place in candidates:
        if len(rows) == a.count:
            break
        file, number, _, old, new = place
        text, module = file.read_text(), file.relative_to(source).parts[0]
        apply(place)
        if build(folder, module) and digest(folder, module) != original[module]:
            caught = test(folder, module, 5 * usual[module] + 60)
            rows.append((f"{file.relative_to(source)}:{number + 1}", old.strip(), new.strip(), text.splitlines()[number].strip(), caught))
            print(f"{len(rows):3} {rows[-1][0]}: {old.strip()} -> {new.strip()}: {caught or 'NOT CAUGHT: ' + rows[-1][3]}", flush=True)
        else:
            rejected += 1
        file.write_text(text)
    caught = sum(1 for row in rows if row[4])
    lines = ["# Do the tests notice?", "",
             f"{len(rows)} constants and operators of loopclosure and backend, drawn among {len(candidates):,} (seed {a.seed}) and changed one",
             f"at a time; {rejected} more did not compile, or changed no machine code. **{caught} ({100 * caught / max(len(rows), 1):.0f} %) were caught** by a test of",
             "their own module. `./dev bench mutation`.", "", "Not caught:", "", "| where | change | line |", "|---|---|---|"]
    lines += [f"| `{where}` | `{old}` to `{new}` | `{line}` |".replace("||", "\\|\\|") for where, old, new, line, by in rows if not by]
    lines += ["", "Caught:", "", "| where | change | by |", "|---|---|---|"]
    lines += [f"| `{where}` | `{old}` to `{new}` | {by} |".replace("||", "\\|\\|") for where, old, new, _, by in rows if by]
    table.put(a, table.RESULTS / "mutation.md", "\n".join(lines))
    return 0 if caught >= 0.8 * len(rows) else 1


if __name__ == "__main__":
    sys.exit(main())
