#!/usr/bin/env python3
"""Modules, and the folders of a module, include each other in one direction. A fault names the lines that break it.

usage: include_order_test.py ROOT
       include_order_test.py --self-test
"""
import collections
import contextlib
import io
import pathlib
import re
import sys
import tempfile

# a < b: b may include a, not the other way round. Names between two '<' do not include each other, nor do the parts
# before and after a ';'. Folders of a module that is not listed may have any order, but form no circle.
MODULES = "core < frontend loopclosure backend < apps"
FOLDERS = {
    "loopclosure": "store < features < vocabulary geometry < memory < filter < detector < evaluation",
    "backend": "graph < solver < uncertainty < robust < optimizer; evaluation",
}
PUBLIC = "include"  # the folder of public headers: every folder may include them, they include none
INCLUDE = re.compile(r'\s*#\s*include\s*["<]([^">]+)[">]')


def includes(root):
    """(source, line, target) of each include of one of our files, as paths from the root."""
    modules = re.findall(r"\w+", MODULES)
    files = sorted(file.relative_to(root) for module in modules for file in (root / module).rglob("*.*")
                   if file.suffix in (".h", ".cc"))
    known = {str(file): file for file in files}
    known.update({str(file).split(f"/{PUBLIC}/")[1]: file for file in files if PUBLIC in file.parts})  # tutti/...
    return [(file, number, known[found.group(1)]) for file in files
            for number, line in enumerate((root / file).read_text().splitlines(), 1)
            if (found := INCLUDE.match(line)) and found.group(1) in known]


def place(path):
    """(module, folder); a file beside the folders is in '.'."""
    return path.parts[0], path.parts[1] if len(path.parts) > 2 else "."


def wrong_way(order, a, b):
    """Why `a` must not include `b`; None if it may."""
    known = {name: (part, rank) for part, names in enumerate(order.split(";"))
             for rank, beside in enumerate(names.split("<")) for name in beside.split()}
    missing = [name for name in (a, b) if name not in known]
    if missing:
        return f"{missing[0]} has no place in the order {order}"
    below = known[a][0] == known[b][0] and known[b][1] < known[a][1]
    return None if below else f"{b} does not stand below {a} in the order {order}"


def circle(arrows):
    """A shortest circle [a, b, ..., a] of arrows (a, b); None if there is none."""
    found = []
    for start, _ in arrows:
        ways, seen = collections.deque([[start]]), set()
        while ways:
            way = ways.popleft()
            for b in sorted(b for a, b in arrows if a == way[-1] and b not in seen):
                seen.add(b)
                (found if b == start else ways).append(way + [b])
    return min(found, key=len, default=None)


def faults(lines):
    arrows = collections.defaultdict(lambda: collections.defaultdict(list))  # by module and folders: the lines
    for source, number, target in lines:
        (module, folder), (other, other_folder) = place(source), place(target)
        line, why = f"{source}:{number}: includes {target}", None
        if module != other:
            why = wrong_way(MODULES, module, other)
        elif folder != other_folder and module not in FOLDERS:
            arrows[module][folder, other_folder].append(line)
        elif folder != other_folder != PUBLIC:
            why = wrong_way(f"{PUBLIC} < {FOLDERS[module]}", folder, other_folder)
        if why:
            yield f"{line}, but {why}"
    for module, tied in arrows.items():
        while way := circle(tied):  # without the arrow of the fewest lines, until no circle is left
            thinnest = min(zip(way, way[1:]), key=lambda arrow: len(tied[arrow]))
            for line in tied.pop(thinnest):
                yield f"{line}, which closes the circle {' -> '.join(way)} in {module}"


def report(root):
    lines = includes(root)
    found = list(faults(lines))
    print("\n".join(found) or f"{len(lines)} includes run in one direction")
    return 1 if found or not lines else 0


# Trees {file: what it includes}, and the lines of the faults, by their beginnings.
CASES = [
    ({"loopclosure/memory/a.h": "loopclosure/features/b.h", "loopclosure/features/b.h": "core/c.h", "core/c.h": "",
      "apps/slam/d.cc": "tutti/loopclosure/e.h", "loopclosure/include/tutti/loopclosure/e.h": "tutti/core/f.h",
      "core/include/tutti/core/f.h": "", "backend/evaluation/g.cc": "tutti/backend/h.h",
      "backend/include/tutti/backend/h.h": "", "frontend/map/i.h": "frontend/map/j.h", "frontend/map/j.h": ""}, []),
    ({"core/a.h": "frontend/map/b.h", "frontend/map/b.h": ""}, ["core/a.h:2: includes frontend/map/b.h, but frontend"]),
    ({"frontend/map/a.h": "backend/graph/b.h", "backend/graph/b.h": "tutti/slam/c.h",
      "apps/slam/include/tutti/slam/c.h": ""}, ["backend/graph/b.h:2", "frontend/map/a.h:2"]),
    ({"frontend/map/a.h": "frontend/odometry/b.h", "frontend/map/c.h": "", "frontend/odometry/b.h": "frontend/map/c.h",
      "frontend/odometry/d.h": "frontend/map/c.h"},
     ["frontend/map/a.h:2: includes frontend/odometry/b.h, which closes the circle map -> odometry -> map"]),
    ({"apps/run/a.h": "apps/slam/b.h", "apps/slam/b.h": "apps/view/c.h", "apps/view/c.h": "apps/run/d.h",
      "apps/run/d.h": ""},
     ["apps/run/a.h:2: includes apps/slam/b.h, which closes the circle run -> slam -> view -> run in apps"]),
    ({"loopclosure/memory/a.cc": "loopclosure/filter/b.h", "loopclosure/filter/b.h": "loopclosure/memory/c.h",
      "loopclosure/memory/c.h": ""}, ["loopclosure/memory/a.cc:2: includes loopclosure/filter/b.h, but filter"]),
    ({"loopclosure/geometry/a.cc": "loopclosure/vocabulary/b.h", "loopclosure/vocabulary/b.h": ""},
     ["loopclosure/geometry/a.cc:2"]),
    ({"backend/evaluation/a.cc": "backend/graph/b.h", "backend/graph/b.h": ""}, ["backend/evaluation/a.cc:2"]),
    ({"backend/new/a.cc": "backend/graph/b.h", "backend/graph/b.h": ""},
     ["backend/new/a.cc:2: includes backend/graph/b.h, but new has no place"]),
    ({"backend/include/tutti/backend/a.h": "backend/graph/b.h", "backend/graph/b.h": ""},
     ["backend/include/tutti/backend/a.h:2"]),
]


def self_test():
    wrong = []
    for tree, expected in CASES:
        with tempfile.TemporaryDirectory() as name:
            root = pathlib.Path(name)
            for file, included in tree.items():
                (root / file).parent.mkdir(parents=True, exist_ok=True)
                (root / file).write_text(f'#include <vector>\n#include "{included}"\n' if included else "")
            found = list(faults(includes(root)))
            with contextlib.redirect_stdout(io.StringIO()):
                status = report(root)
        if len(found) != len(expected) or not all(map(str.startswith, found, expected)) or status != bool(expected):
            wrong.append(f"{tree}: wanted {expected}, found {found}, status {status}")
    print("\n".join(wrong) or f"{len(CASES)} trees are judged as they should be")
    return 1 if wrong else 0


def main():
    return self_test() if sys.argv[1] == "--self-test" else report(pathlib.Path(sys.argv[1]))


if __name__ == "__main__":
    sys.exit(main())
