#!/usr/bin/env python3
"""What LoopDetector.detect costs from Python, over C++: processor time on the same images, in turns.

usage: ./dev bench python [--runs N] [--stride N]     (needs TUTTI_DATA/kitti_00_head and -DTUTTI_BUILD_PYTHON=ON)
"""
import argparse
import os
import pathlib
import statistics
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent
BUILD = ROOT / "build" / "release"

IN_PYTHON = """
import sys, time
import numpy as np
import tutti
images = [np.array(f.image) for f in tutti.Dataset(sys.argv[1], type="images", stride=int(sys.argv[2]))]
detector = tutti.LoopDetector()
results = []
before = time.process_time()
for image in images:
    results.append(detector.detect(image))
print(f"{1e3 * (time.process_time() - before) / len(images):.4f}")
for r in results:
    print(r.query, r.candidate, "%.17g" % r.probability)
"""


# Arguments are taken over, the lock is released, and the detector refuses the id: all that a call costs but for detection.
CALL_ALONE = """
import time
import numpy as np
import tutti
detector, image = tutti.LoopDetector(), np.zeros((376, 1241), np.uint8)
detector.detect(image)
before = time.process_time()
for _ in range(5000):
    try:
        detector.detect(image, 0)
    except tutti.InputError:
        pass
print(f"{1e3 * (time.process_time() - before) / 5000:.4f}")
"""


def run(command, env):
    said = subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True, env=env).stdout.splitlines()
    return float(said[0]), said[1:]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=5, help="repetitions of each")
    parser.add_argument("--stride", type=int, default=5, help="every n-th image")
    parser.add_argument("--end", type=int, default=1700, help="of the first so many")
    parser.add_argument("--call", action="store_true", help="measure a call without detection alone")
    parser.add_argument("--write", action="store_true", help="as other tables have it; this one is printed only")
    options = parser.parse_args()
    python = "/usr/bin/python3"
    env = dict(os.environ, PYTHONPATH=str(BUILD / "apps" / "python"))
    print(f"a call that is refused at once: {run([python, '-c', CALL_ALONE], env)[0]:.4f} ms of processor time")
    if options.call:
        return
    folder = pathlib.Path(os.environ.get("TUTTI_DATA", ROOT.parent / "shared" / "data")) / "kitti_00_head" / "image_0"
    files = sorted(folder.iterdir())[:options.end:options.stride]
    in_python = IN_PYTHON.replace("stride=", f"end={options.end}, stride=")
    costs = {"C++": [], "Python": []}
    for _ in range(options.runs):
        for name, command in [("C++", [BUILD / "bench" / "detect_cost", *files]),
                              ("Python", [python, "-c", in_python, folder, str(options.stride)])]:
            cost, results = run(command, env)
            costs[name].append(cost)
            if name == "C++":
                expected = results
            elif results != expected:
                sys.exit("Python and C++ differ in their results")
    ratios = [p / c for p, c in zip(costs["Python"], costs["C++"])]
    print(f"{len(files)} images, the same results; processor time per image, {options.runs} runs in turns:")
    for name, values in costs.items():
        print(f"  {name:7} median {statistics.median(values):.2f} ms ({min(values):.2f} to {max(values):.2f})")
    print(f"  Python / C++: median of the ratios {statistics.median(ratios):.4f} ({min(ratios):.4f} to {max(ratios):.4f}), "
          f"ratio of the smallest {min(costs['Python']) / min(costs['C++']):.4f}")


if __name__ == "__main__":
    main()
