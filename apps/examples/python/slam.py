#!/usr/bin/env python3
"""SLAM on a recording in a few lines: a folder of a data set or of images, a video, a bag.

usage: slam.py RECORDING TRAJECTORY.txt [CONFIG.yaml]
"""
import sys

import tutti

if len(sys.argv) not in (3, 4):
    sys.exit(__doc__)
run = tutti.run(sys.argv[1], *sys.argv[3:])  # without a configuration, layout, sensor and camera are recognised
for result in run:
    if result.state == "lost":
        print(f"frame {run.frame.index}: {result.reason}")
run.write_trajectory(sys.argv[2])
print(f"{len(run.trajectory())} of {len(run.dataset)} frames, {sum(loop.accepted for loop in run.loops)} loops")
if run.dataset.ground_truth_file:
    errors = run.evaluate(max_time_difference_s=0.02)
    print(f"ATE {errors['ate']['rmse']:.4f} m over {errors['path_length_m']:.1f} m")
