#!/usr/bin/env python3
"""Draws what `tutti dense` made: dense_mesh.png and dense_grid.png.

usage: dense_pictures.py MESH.ply GRID TRAJECTORY.txt OUT [EYE TARGET]     # x,y,z in the world of the trajectory
"""
import pathlib
import re
import sys

import numpy as np
import open3d as o3d
from PIL import Image, ImageDraw

WIDTH, HEIGHT, FOCAL, SCALE = 800, 520, 560, 5


def mesh_picture(file, eye, target):
    """The mesh as points with a depth buffer: its vertices, the middles of its triangles, and the middles of their edges."""
    mesh = o3d.io.read_triangle_mesh(str(file))
    triangles = np.asarray(mesh.triangles)

    def dense(values):
        corners = np.asarray(values)[triangles]
        return np.concatenate([values, corners.mean(1), *(0.5 * (corners[:, i] + corners[:, i - 1]) for i in range(3))])

    points, normals, colours = (dense(v) for v in (mesh.vertices, mesh.vertex_normals, mesh.vertex_colors))
    forward = (target - eye) / np.linalg.norm(target - eye)
    right = np.cross([0, 1, 0], forward)
    right /= np.linalg.norm(right)
    R = np.stack([right, np.cross(forward, right), forward])
    at = (points - eye) @ R.T
    u, v = (np.rint(FOCAL * at[:, i] / at[:, 2] + size / 2).astype(int) for i, size in ((0, WIDTH), (1, HEIGHT)))
    seen = (at[:, 2] > 0.1) & (((eye - points) * normals).sum(1) > 0)
    colours = 255 * colours * (0.5 + 0.5 * np.abs(normals @ forward))[:, None]
    order = np.argsort(-at[:, 2])
    order = order[seen[order]]
    picture, nearest = np.full((HEIGHT, WIDTH, 3), 255, np.uint8), np.full((HEIGHT, WIDTH), np.inf)
    for du, dv in ((a, b) for a in (-1, 0, 1) for b in (-1, 0, 1)):
        x, y = u[order] + du, v[order] + dv
        inside = (x >= 0) & (x < WIDTH) & (y >= 0) & (y < HEIGHT)
        x, y, i = x[inside], y[inside], order[inside]
        in_front = at[i, 2] < nearest[y, x] - 0.005
        x, y, i = x[in_front], y[in_front], i[in_front]
        picture[y, x], nearest[y, x] = colours[i], at[i, 2]  # the last one, which is the nearest, stays
    return Image.fromarray(picture)


def grid_picture(folder, trajectory):
    yaml = (folder / "map.yaml").read_text()
    tx, ty, tz, x, y, z, w = (float(n) for n in re.search(r"qw: (.*)", yaml)[1].split())
    cell = float(re.search(r"resolution: (.*)", yaml)[1])
    left, bottom = (float(n) for n in re.search(r"origin: \[([^,]*), ([^,]*),", yaml).groups())
    grid = Image.open(folder / "map.pgm")
    picture = grid.resize((SCALE * grid.width, SCALE * grid.height), Image.NEAREST).convert("RGB")
    q = np.array([x, y, z])
    points = np.loadtxt(trajectory)[:, 1:4]
    points = points + 2 * np.cross(q, np.cross(q, points) + w * points) + [tx, ty, tz]
    pixels = np.stack([(points[:, 0] - left) / cell, grid.height - (points[:, 1] - bottom) / cell], 1) * SCALE
    margin = SCALE * 2 + np.ceil(np.maximum(0, np.maximum(-pixels, pixels - picture.size)).max(0)).astype(int)
    wide = Image.new("RGB", (picture.width + 2 * margin[0], picture.height + 2 * margin[1]), (205, 205, 205))
    wide.paste(picture, tuple(int(m) for m in margin))
    ImageDraw.Draw(wide).line([tuple(p) for p in pixels + margin], fill=(213, 94, 0), width=3)
    return wide


def main(mesh, grid, trajectory, out, eye="0,0,0", target="0,0,1"):
    eye, target = (np.array([float(n) for n in text.split(",")]) for text in (eye, target))
    mesh_picture(mesh, eye, target).save(pathlib.Path(out) / "dense_mesh.png", optimize=True)
    grid_picture(pathlib.Path(grid), trajectory).save(pathlib.Path(out) / "dense_grid.png", optimize=True)


if __name__ == "__main__":
    if len(sys.argv) not in (5, 7):
        sys.exit(__doc__)
    main(*sys.argv[1:])
