#!/usr/bin/env python3
"""Loops for an odometry that you have already: poses of a file here, as they would come from your VIO, wheels or LiDAR.

usage: own_odometry.py CONFIG.yaml DIR ODOMETRY.txt CORRECTED.txt

Trajectories are in TUM's format. `tutti.close(odometry, dataset, config)` does all of this in one call; the loop is for
those whose poses come one by one.
"""
import sys

import numpy as np

import tutti

if len(sys.argv) != 5:
    sys.exit(__doc__)
config, folder, given, out = sys.argv[1:]
config = tutti.Config(config)
dataset = tutti.Dataset(folder, config)
odometry = tutti.read_trajectory(given)
poses = tutti.pose_matrices(odometry)
closer = tutti.TrajectoryCloser(dataset.rig, config)
corrections = 0
for frame in dataset:
    nearest = np.argmin(np.abs(odometry[:, 0] - frame.stamp))
    if abs(odometry[nearest, 0] - frame.stamp) > 0.02:
        continue  # the odometry does not know where this image was taken
    closer.push(frame, poses[nearest])
    if closer.corrections > corrections:
        corrections = closer.corrections
        print(f"frame {frame.index}: map -> odom is at", *np.round(closer.T_map_odom[:3, 3], 3))
closer.finish()
for warning in closer.take_warnings():
    print(warning)
tutti.write_trajectory(out, closer.corrected(odometry))
print(f"{len(closer.keyframes())} keyframes, {sum(loop.accepted for loop in closer.loops)} loops, "
      f"{closer.corrections} corrections")
