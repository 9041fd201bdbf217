#!/usr/bin/env python3
"""A mesh and a grid to navigate in, from depth images whose poses are known: of tutti, or of any other program.

usage: dense_map.py CONFIG.yaml DIR TRAJECTORY.txt MESH.ply GRID

The trajectory is that of the camera, in TUM's format.
"""
import sys

import numpy as np

import tutti

if len(sys.argv) != 6:
    sys.exit(__doc__)
config, folder, given, mesh_file, grid_folder = sys.argv[1:]
dataset = tutti.Dataset(folder, tutti.Config(config))
trajectory = tutti.read_trajectory(given)
poses = tutti.pose_matrices(trajectory)
dense = tutti.DenseMap(voxel_m=0.02, threads=4)
for frame in dataset:
    nearest = np.argmin(np.abs(trajectory[:, 0] - frame.stamp))
    if abs(trajectory[nearest, 0] - frame.stamp) > 1e-3:
        continue  # no pose
    problem = dense.integrate(frame.depth, frame.image, poses[nearest], dataset.rig.camera)
    if problem:
        print(f"frame {frame.index} is skipped: {problem}")
mesh = dense.mesh()
tutti.write_ply(mesh_file, mesh)
tutti.write_grid(grid_folder, dense.grid())
print(f"{len(mesh.triangles)} triangles, {dense.memory_mb:.0f} MB of voxels")
