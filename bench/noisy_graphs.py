"""Generated pose graphs with much noise: `sphere` and `torus`, wound round the surface, each pose tied to the one before and to the one
of the winding before (SE(3)); `streets`, a walk at random on a grid, tied where it comes back to a crossing (SE(2)).
"""
import math
import random

TRANSLATION_SIGMA = 0.05  # [m]


def mersenne_twister(seed):
    """random.Random in the state of C++'s std::mt19937(seed): the graphs are those of the tables since commit c39adc1e."""
    state = [seed]
    for i in range(1, 624):
        state.append((1812433253 * (state[-1] ^ (state[-1] >> 30)) + i) & 0xFFFFFFFF)
    generator = random.Random()
    generator.setstate((3, (*state, 624), None))
    return generator


def gauss3(generator):
    """Three standard normal numbers; z is drawn first."""
    u = [(generator.getrandbits(32) + 0.5) / 2**32 for _ in range(6)]
    return [math.sqrt(-2 * math.log(u[k])) * math.cos(2 * math.pi * u[k + 1]) for k in (4, 2, 0)]


# Quaternions are x y z w, poses (position, quaternion) of T_world_node.
def times(a, b):
    (ax, ay, az, aw), (bx, by, bz, bw) = a, b
    return [aw * bx + ax * bw + ay * bz - az * by, aw * by - ax * bz + ay * bw + az * bx,
            aw * bz + ax * by - ay * bx + az * bw, aw * bw - ax * bx - ay * by - az * bz]


def normalized(v):
    norm = math.sqrt(sum(x * x for x in v))
    return [x / norm for x in v]


def turn(vector):
    """Quaternion of a rotation vector."""
    angle = math.hypot(*vector)
    return [*(math.sin(angle / 2) / angle * x for x in vector), math.cos(angle / 2)] if angle > 1e-6 else normalized([*(x / 2 for x in vector), 1])


def quaternion(m):
    """Of a rotation matrix, from the largest of its four components."""
    i = max(range(4), key=lambda k: (m[0][0], m[1][1], m[2][2], m[0][0] + m[1][1] + m[2][2])[k])
    if i == 3:
        return normalized([m[2][1] - m[1][2], m[0][2] - m[2][0], m[1][0] - m[0][1], 1 + m[0][0] + m[1][1] + m[2][2]])
    j, k, q = (i + 1) % 3, (i + 2) % 3, [0.0] * 4
    q[i], q[j], q[k], q[3] = 1 + m[i][i] - m[j][j] - m[k][k], m[j][i] + m[i][j], m[k][i] + m[i][k], m[k][j] - m[j][k]
    return normalized(q)


def wound(torus, count):
    """Poses that look along the way, their down axis inwards, and the loops. Radii [m]: sphere 50; torus 50 and 20."""
    per_winding = round(math.sqrt(count))

    def position(k):
        around, along = 2 * math.pi * k / per_winding, k / count
        if torus:
            r = 50 + 20 * math.cos(around)
            return [r * math.cos(2 * math.pi * along), r * math.sin(2 * math.pi * along), 20 * math.sin(around)]
        latitude = math.pi * (0.9 * along - 0.45)
        return [50 * math.cos(latitude) * math.cos(around), 50 * math.cos(latitude) * math.sin(around), 50 * math.sin(latitude)]
    poses = []
    for k in range(count):
        here, onward = position(k), position(k + 0.1)
        middle = [50 * x for x in normalized([here[0], here[1], 0])] if torus else [0, 0, 0]
        ahead, inward = normalized([b - a for a, b in zip(here, onward)]), [b - a for a, b in zip(here, middle)]
        share = sum(a * b for a, b in zip(ahead, inward))
        down = normalized([b - share * a for a, b in zip(ahead, inward)])
        right = [down[1] * ahead[2] - down[2] * ahead[1], down[2] * ahead[0] - down[0] * ahead[2], down[0] * ahead[1] - down[1] * ahead[0]]
        poses.append((here, quaternion(list(zip(right, down, ahead)))))
    return poses, [(k - per_winding, k) for k in range(per_winding, count)]


def streets(count, generator):
    side, poses, loops, last_at = max(4, int(math.sqrt(count) / 4)), [], [], {}
    x = y = heading = 0
    for k in range(count):
        poses.append(([x, y, 0], turn([0, 0, math.pi / 2 * heading])))
        if (x, y) in last_at and last_at[x, y] + 2 < k:
            loops.append((last_at[x, y], k))
        last_at[x, y] = k
        if generator.getrandbits(32) % 4 == 0:
            heading += 1 if generator.getrandbits(32) % 2 == 0 else 3
        step = [(1, 0), (0, 1), (-1, 0), (0, -1)]
        while max(abs(x + step[heading % 4][0]), abs(y + step[heading % 4][1])) > side:
            heading += 1
        x, y = x + step[heading % 4][0], y + step[heading % 4][1]
    return poses, loops


def write(file, kind, count, sigma_deg, seed=1):
    """Writes a graph with the true poses as vertices (`--init file` starts from the truth); returns its number of edges."""
    generator, sigma = mersenne_twister(seed), math.radians(sigma_deg)
    poses, loops = streets(count, generator) if kind == "streets" else wound(kind == "torus", count)
    planar, edges = kind == "streets", [*((k - 1, k) for k in range(1, count)), *loops]
    name, (lengths, angles) = ("SE2", (2, 1)) if planar else ("SE3:QUAT", (3, 3))
    weights = [TRANSLATION_SIGMA ** -2] * lengths + [sigma ** -2] * angles
    information = [w if i == j else 0 for i, w in enumerate(weights) for j in range(i, len(weights))]

    def pose(position, q):
        return [position[0], position[1], 2 * math.atan2(q[2], q[3])] if planar else [*position, *q]

    def measured(a, b):
        (ta, qa), (tb, qb) = poses[a], poses[b]
        back = [-qa[0], -qa[1], -qa[2], qa[3]]
        seen = times(times(back, [*(v - u for u, v in zip(ta, tb)), 0]), qa)
        position = [v + TRANSLATION_SIGMA * g for v, g in zip(seen, gauss3(generator))]
        return pose(position, times(times(back, qb), turn([sigma * g for g in gauss3(generator)])))
    lines = [(f"VERTEX_{name}", k, *pose(*poses[k])) for k in range(count)] + [("FIX", 0)]
    lines += [(f"EDGE_{name}", a, b, *measured(a, b), *information) for a, b in edges]
    file.write_text("".join(" ".join(map(str, line)) + "\n" for line in lines))
    return len(edges)
