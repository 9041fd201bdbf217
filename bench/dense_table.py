#!/usr/bin/env python3
"""How good dense maps are: against geometry that is known, and against Open3D's on frames that were held out.

usage: ./dev bench dense [ROW...] [--write]

`room`, `kinect`, `poses`, `grid`, `town`: vertices against the walls of generated worlds of three seeds, with true poses or
(`poses`) with those of `tutti run`, aligned; the worst seed is in brackets. `cost`: a lap integrated once and five times.
`open3d`: Depth L1 along the rays of every tenth frame, which was left out, of tutti's mesh over that of Open3D's
ScalableTSDFVolume, same poses and voxels; depth that either does not cover is left out for both, and counted.
"""
import json
import pathlib
import statistics
import subprocess
import tempfile

try:
    import numpy as np
    import open3d as o3d
    from PIL import Image
    from scipy.spatial import cKDTree
except ImportError as missing:  # said when a row needs them; --help does not
    np, MISSING = None, missing

import table

HELD_OUT, UNITS, MOST_M, BAND, STEP = 10, 5000.0, 10.0, 4, 3
SEEDS = (1, 2, 3)


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


def held_out(a, name, folder, config, voxel=0.02):
    """The row of a data set in TUM's layout with groundtruth.txt."""
    all_frames = list(frames(folder))
    held = all_frames[HELD_OUT // 2::HELD_OUT]
    train = [f for i, f in enumerate(all_frames) if i % HELD_OUT != HELD_OUT // 2]
    camera = camera_of(config)
    with tempfile.TemporaryDirectory() as work:
        trajectory, mesh_file = pathlib.Path(work) / "train.txt", pathlib.Path(work) / "mesh.ply"
        trajectory.write_text("".join(" ".join([stamp, *map(repr, pose)]) + "\n" for stamp, _, _, pose in train))
        subprocess.run([a.build / "apps" / "examples" / "example_09_dense_map", config, folder, trajectory, mesh_file,
                        pathlib.Path(work) / "grid"], check=True, stdout=subprocess.DEVNULL)
        ours = o3d.io.read_triangle_mesh(str(mesh_file))
    meshes = [searchable(ours), searchable(open3d_mesh(train, camera, voxel))]
    errors, covered, measured = [[], []], [0, 0], 0
    for *_, depth_file, pose in held:
        depth = metres(depth_file)[::STEP, ::STEP]
        depth[depth > MOST_M] = 0
        (x, z), (y, _) = (seen_from(mesh, depth, pose, camera) for mesh in meshes)
        both = np.isfinite(x) & np.isfinite(y)
        measured += len(z)
        for k, mesh in enumerate((x, y)):
            covered[k] += np.isfinite(mesh).sum()
            errors[k].append(np.abs(mesh - z)[both])
    means = [100 * np.concatenate(e).mean() for e in errors]
    return (f"{name}, {len(held)} frames held out, {100 * voxel:.0f} cm", f"Depth L1 {means[0]:.3f} cm, Open3D {means[1]:.3f} cm; covers "
            f"{100 * covered[0] / measured:.1f} %, Open3D {100 * covered[1] / measured:.1f} %", f"ratio {means[0] / means[1]:.3f} <= 1.05")


def measured(a, *options, poses=None):
    """Figures of bench/dense_rows for each seed."""
    return [json.loads(subprocess.run([a.build / "bench" / "dense_rows", "--seed", str(seed), *map(str, options), *(poses(seed) if poses else [])],
                                      check=True, capture_output=True, text=True).stdout) for seed in SEEDS]


def both(rows, key, scale, digits, worst=max):
    values = [scale * row[key] for row in rows]
    return f"{statistics.median(values):.{digits}f} ({worst(values):.{digits}f})"


def surface(rows, voxel):
    return (f"RMS {both(rows, 'rms_m', 1000, 1)} mm = {both(rows, 'rms_m', 1 / voxel, 2)} voxels, worst vertex {both(rows, 'worst_m', 1 / voxel, 1)} "
            f"voxels, complete {both(rows, 'completeness', 100, 1, min)} %")


KINECT = ("--kinect-noise", "--laps", 1, "--supersample", 1)


def odometry_of(a):
    def poses(seed):
        world = table.generate(a.tutti, a.out / f"room{seed}", ["--world", "room", "--sensor", "rgbd", "--width", 640, "--height", 480, "--seed", seed, *KINECT])
        run = a.out / f"run{seed}"
        table.run(a, run, world / "config.yaml", world)
        return ["--poses", str(run / "trajectory.txt")]
    return poses


def poses_row(a):
    true, ours = measured(a, *KINECT), measured(a, *KINECT, poses=odometry_of(a))
    ratio = statistics.median(x["rms_m"] / y["rms_m"] for x, y in zip(ours, true))
    return [("room, Kinect noise, 2 cm, poses of `tutti run`", surface(ours, 0.02) + f"; RMS {ratio:.2f} of that with true poses", "<= 1.25 of it")]


def grid_row(a):
    lap = ("--grid", "--laps", 1, "--width", 320, "--height", 240, "--supersample", 1, "--stride", 3)
    for world in ("room", "corridor"):
        for sensor in ("rgbd", "stereo"):
            # Stereo as `tutti dense` takes it: up to 40 baselines of 0.12 m; voxels as docs/dense.md advises.
            more = ("--max-depth", 4.8, "--voxel", 0.05) if sensor == "stereo" else ()
            rows = measured(a, "--world", world, "--sensor", sensor, *lap, *more)
            yield f"grid, {world}, {sensor}{', 5 cm' if more else ', 2 cm'}", f"{both(rows, 'grid_right', 100, 1, min)} % of known cells right", ">= 97 %"


def cost_row(a):
    lap = ("--laps", 1, "--supersample", 1)
    once, five, space = measured(a, *lap), measured(a, *lap, "--rounds", 5), measured(a, *lap, "--grid")
    return [("a lap of a room, 640x480, 2 cm", f"{both(once, 'cpu_ms', 1, 1)} CPU-ms a frame, with free space {both(space, 'cpu_ms', 1, 1)}; {both(once, 'memory_mb', 1, 0)} MB, "
             f"with free space {both(space, 'memory_mb', 1, 0)}, after five laps {both(five, 'memory_mb', 1, 0)}", "<= 30 ms, <= 150 MB")]


def town_row(a):
    rows = measured(a, "--world", "town", "--sensor", "stereo", "--laps", 1, "--voxel", 0.1, "--most", 20, "--within", 0.2, "--max-depth", 20, "--stride", 2, "--supersample", 1)
    return [("town, stereo, 10 cm, up to 20 m", f"mean {both(rows, 'mean_m', 100, 1)} cm, complete within 20 cm {both(rows, 'completeness', 100, 1, min)} %", "<= 10 cm, >= 80 %")]


def open3d_row(a):
    room = table.generate(a.tutti, a.out / "clean", ["--world", "room", "--sensor", "rgbd", "--laps", 1, "--supersample", 1])
    yield held_out(a, "generated room without noise", room, room / "config.yaml")
    if (a.data / "redkitchen").exists():
        yield held_out(a, "redkitchen", a.data / "redkitchen", table.ROOT / "data" / "configs" / "7scenes.yaml")


ROWS = {
    "room": lambda a: [("room, exact depth, 1 cm", surface(measured(a, "--laps", 1, "--supersample", 1, "--voxel", 0.01, "--stride", 2), 0.01), "<= 0.4 voxel, >= 97 %")],
    "kinect": lambda a: [("room, Kinect noise, 2 cm", surface(measured(a, *KINECT), 0.02), "<= 10 mm")],
    "poses": poses_row, "grid": grid_row, "town": town_row, "cost": cost_row, "open3d": open3d_row,
}


def main():
    parser = table.parser(__doc__, "dense", ROWS)
    a = table.parse(parser, ROWS)
    if np is None:
        parser.error(f"{MISSING}; Debian: apt-get install python3-open3d python3-scipy python3-pil")
    table.put_rows(a, "dense", ROWS, "Dense maps", "Median of three worlds, the worst in brackets. `./dev bench dense --write`.")


if __name__ == "__main__":
    main()
