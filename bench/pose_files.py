"""Trajectories that table scripts read and write, and poses as lists of numbers: no numpy is needed."""
import math


def read_tum(file):
    """Time stamp: (position, quaternion x y z w) of a TUM trajectory, in the order of its lines."""
    out = {}
    for line in file.read_text().splitlines():
        if line and not line.startswith("#"):
            v = [float(word) for word in line.split()]
            out[round(v[0], 6)] = (v[1:4], v[4:8])
    return out


def read_kitti(file, count=None):
    """4x4 matrices of a KITTI trajectory, of all its lines or the first ones."""
    lines = file.read_text().splitlines()[:count]
    return [[v[0:4], v[4:8], v[8:12], [0, 0, 0, 1]] for v in ([float(word) for word in line.split()] for line in lines)]


def write_kitti(file, matrices):
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text("".join(" ".join(f"{v:.12g}" for row in m[:3] for v in row) + "\n" for m in matrices))


def matrix(pose):
    """4x4 matrix of a (position, quaternion x y z w)."""
    norm = math.sqrt(sum(v * v for v in pose[1]))
    (px, py, pz), (x, y, z, w) = pose[0], (v / norm for v in pose[1])
    return [[1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w), px],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w), py],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y), pz], [0, 0, 0, 1]]


def times(a, b):
    """Product of two 4x4 matrices."""
    return [[sum(a[i][k] * b[k][j] for k in range(4)) for j in range(4)] for i in range(4)]


def inverse(m):
    """Of the 4x4 matrix of a pose."""
    r = [[m[j][i] for j in range(3)] for i in range(3)]
    return [[*r[i], -sum(r[i][k] * m[k][3] for k in range(3))] for i in range(3)] + [[0, 0, 0, 1]]


def seen_from(a, b):
    """Position of pose b in the frame of pose a, both 4x4 matrices."""
    return [row[3] for row in times(inverse(a), b)[:3]]
