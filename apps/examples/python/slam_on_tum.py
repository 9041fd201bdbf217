#!/usr/bin/env python3
"""SLAM on an RGB-D data set of TUM in twenty lines.

usage: slam_on_tum.py CONFIG.yaml DIR TRAJECTORY.txt
"""
import sys

import tutti

config, folder, out = sys.argv[1:]
config = tutti.Config(config)
dataset = tutti.Dataset(folder, config)
slam = tutti.SlamSystem(dataset.rig, config)
for frame in dataset:
    result = slam.track(frame)
    if result.state == "lost":
        print(f"frame {frame.index}: {result.reason}")
slam.finish()
tutti.write_trajectory(out, slam.trajectory())
print(f"{len(slam.trajectory())} of {len(dataset)} frames, {sum(loop.accepted for loop in slam.loops)} loops")
if dataset.ground_truth_file:
    errors = tutti.evaluate(dataset.ground_truth(), slam.trajectory(), max_time_difference_s=0.02)
    print(f"ATE {errors['ate']['rmse']:.4f} m over {errors['path_length_m']:.1f} m")
