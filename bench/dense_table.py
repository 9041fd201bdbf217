#!/usr/bin/env python3
"""Depth L1 of meshes at frames that were held out: tutti's and that of Open3D's ScalableTSDFVolume, same poses and voxels.

usage: dense_table.py EXAMPLE_09 CONFIG.yaml DATASET [VOXEL_M]     # a data set of TUM's layout with groundtruth.txt

Every tenth frame is left out of the integration; the meshes are compared with its depth image, along its rays. Depth that
either mesh does not cover is left out for both, and counted. EXAMPLE_09 (2 cm voxels) is build/.../example_09_dense_map.
"""
import pathlib
import subprocess
import sys
import tempfile

import numpy as np
import open3d as o3d
from PIL import Image
from scipy.spatial import cKDTree

HELD_OUT, UNITS, MOST_M, BAND, STEP = 10, 5000.0, 10.0, 4, 3


def rows(file):
    return [line.split() for line in file.read_text().splitlines() if line and not line.startswith("#")]


def frames(folder):
    """(stamp, colour file, depth file, pose as a TUM row) of frames whose depth and pose are within 20 ms."""
    def nearest(table, stamp):
        row = min(table, key=lambda r: abs(float(r[0]) - stamp))
        return row if abs(float(row[0]) - stamp) < 0.02 else None

    depth, truth = rows(folder / "depth.txt"), rows(folder / "groundtruth.txt")
    for row in rows(folder / "rgb.txt"):
        d, t = nearest(depth, float(row[0])), nearest(truth, float(row[0]))
        if d and t:
            yield row[0], folder / row[1], folder / d[1], [float(x) for x in t[1:]]


def matrix(pose):
    x, y, z, w = np.array(pose[3:]) / np.linalg.norm(pose[3:])
    out = np.eye(4)
    out[:3, :3] = [[1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                   [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                   [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]]
    out[:3, 3] = pose[:3]
    return out


def camera_of(config):
    values = {}
    for line in pathlib.Path(config).read_text().splitlines():
        key, _, value = line.strip().partition(":")
        if key in ("width", "height", "fx", "fy", "cx", "cy"):
            values[key] = float(value.split("#")[0])
    return values


def metres(file):
    return np.asarray(Image.open(file)).astype(np.float32) / UNITS


def open3d_mesh(train, camera, voxel):
    volume = o3d.pipelines.integration.ScalableTSDFVolume(
        voxel_length=voxel, sdf_trunc=BAND * voxel, color_type=o3d.pipelines.integration.TSDFVolumeColorType.RGB8)
    intrinsic = o3d.camera.PinholeCameraIntrinsic(int(camera["width"]), int(camera["height"]), camera["fx"], camera["fy"],
                                                  camera["cx"], camera["cy"])
    for _, colour, depth, pose in train:
        image = np.array(Image.open(colour).convert("RGB"))
        rgbd = o3d.geometry.RGBDImage.create_from_color_and_depth(
            o3d.geometry.Image(image), o3d.geometry.Image(metres(depth)), depth_scale=1.0, depth_trunc=MOST_M,
            convert_rgb_to_intensity=False)
        volume.integrate(rgbd, intrinsic, np.linalg.inv(matrix(pose)))
    return volume.extract_triangle_mesh()


def seen_from(mesh, depth, pose, camera):
    """z depth of the mesh along the rays of pixels that have depth: of the plane through the nearest vertex; NaN where none
    is within two voxels."""
    v, u = np.nonzero(depth)
    T = matrix(pose)
    rays = np.stack([(u * STEP - camera["cx"]) / camera["fx"], (v * STEP - camera["cy"]) / camera["fy"], np.ones(u.shape)], -1)
    rays = rays @ T[:3, :3].T
    tree, vertices, normals = mesh
    away, nearest = tree.query(T[:3, 3] + depth[v, u][:, None] * rays)
    at, n = vertices[nearest], normals[nearest]
    slope = (n * rays).sum(1)
    z = (n * (at - T[:3, 3])).sum(1) / np.where(np.abs(slope) < 0.1, np.nan, slope)
    return np.where(away < 0.04, z, np.nan), depth[v, u]


def searchable(mesh):
    mesh.compute_vertex_normals()
    vertices = np.asarray(mesh.vertices)
    return cKDTree(vertices), vertices, np.asarray(mesh.vertex_normals)


def main(example, config, folder, voxel=0.02):
    all_frames = list(frames(pathlib.Path(folder)))
    held = all_frames[HELD_OUT // 2::HELD_OUT]
    train = [f for i, f in enumerate(all_frames) if i % HELD_OUT != HELD_OUT // 2]
    camera = camera_of(config)
    with tempfile.TemporaryDirectory() as work:
        trajectory, mesh_file = pathlib.Path(work) / "train.txt", pathlib.Path(work) / "mesh.ply"
        trajectory.write_text("".join(" ".join([stamp, *map(repr, pose)]) + "\n" for stamp, _, _, pose in train))
        said = subprocess.run([example, config, folder, trajectory, mesh_file, pathlib.Path(work) / "grid"], check=True,
                              capture_output=True, text=True).stdout
        print(said.splitlines()[-1])
        ours = o3d.io.read_triangle_mesh(str(mesh_file))
    theirs = open3d_mesh(train, camera, float(voxel))
    meshes = [searchable(ours), searchable(theirs)]
    errors, covered, measured = [[], []], [0, 0], 0
    for *_, depth_file, pose in held:
        depth = metres(depth_file)[::STEP, ::STEP]
        depth[depth > MOST_M] = 0
        (a, z), (b, _) = (seen_from(mesh, depth, pose, camera) for mesh in meshes)
        both = np.isfinite(a) & np.isfinite(b)
        measured += len(z)
        for k, mesh in enumerate((a, b)):
            covered[k] += np.isfinite(mesh).sum()
            errors[k].append(np.abs(mesh - z)[both])
    for name, e, c in zip(("tutti", "Open3D"), errors, covered):
        e = np.concatenate(e)
        print(f"{name}: Depth L1 {100 * e.mean():.3f} cm, median {100 * np.median(e):.3f} cm; covers {100 * c / measured:.1f} %")
    ratio = np.concatenate(errors[0]).mean() / np.concatenate(errors[1]).mean()
    print(f"ratio {ratio:.3f} over {len(held)} frames")


if __name__ == "__main__":
    if not 4 <= len(sys.argv) <= 5:
        sys.exit(__doc__)
    main(*sys.argv[1:])
