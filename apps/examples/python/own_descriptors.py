#!/usr/bin/env python3
"""Features of your own as members of the ensemble, in numpy. ORB is taken from the image by tutti; "mine" is whatever you
extract: here corners with a normalised patch of grey values, in your program perhaps a network. "whole" describes the
image by one vector, as place-recognition networks do.

usage: own_descriptors.py DIR
"""
import sys

import numpy as np

import tutti


def corners(grey, count=300, border=12):
    """(N, 2): x, y of the pixels where grey values change most in both directions, one in each 8 x 8 cell."""
    y_step, x_step = np.gradient(grey.astype(np.float32))
    products = np.stack([x_step * x_step, y_step * y_step, x_step * y_step])
    sums = sum(np.roll(products, (dy, dx), (1, 2)) for dy in range(-2, 3) for dx in range(-2, 3))
    strength = sums[0] * sums[1] - sums[2] ** 2 - 0.05 * (sums[0] + sums[1]) ** 2
    strength[:border], strength[-border:], strength[:, :border], strength[:, -border:] = 0, 0, 0, 0
    height, width = (8 * (size // 8) for size in grey.shape)
    cells = strength[:height, :width].reshape(height // 8, 8, width // 8, 8).swapaxes(1, 2).reshape(-1, 64)
    best = cells.argmax(axis=1)
    row, column = np.divmod(np.arange(len(cells)), width // 8)
    xy = np.column_stack([8 * column + best % 8, 8 * row + best // 8])
    strongest = np.argsort(-cells.max(axis=1), kind="stable")[:count]
    return xy[strongest[cells.max(axis=1)[strongest] > 0]]


def mine(grey):
    """Keypoints (N, 2) and descriptors (N, 64): uint8 (compared by Hamming distance) or float32 (Euclidean)."""
    xy = corners(grey)
    patches = np.array([grey[y - 12:y + 12, x - 12:x + 12].reshape(8, 3, 8, 3).mean(axis=(1, 3)).ravel() for x, y in xy])
    if len(patches) == 0:
        return xy, np.zeros((0, 64), np.float32)  # none at all is fine: the member sits this image out
    patches -= patches.mean(axis=1, keepdims=True)  # neither brightness nor contrast matters
    length = np.linalg.norm(patches, axis=1)
    keep = length > 1
    return xy[keep], (patches[keep] / length[keep, None]).astype(np.float32)


def whole(grey):
    """One vector of float32, as long for each image."""
    rows, columns = (np.linspace(0, size, n + 1).astype(int)[:-1] for size, n in zip(grey.shape, (18, 24)))
    small = np.add.reduceat(np.add.reduceat(grey.astype(np.float32), rows, axis=0), columns, axis=1).ravel()
    return small - small.mean()


def main():
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    detector = tutti.LoopDetector(members=["orb", "mine", "whole"], external_members=["mine", "whole"],
                                  dense_members=["whole"])
    images = loops = 0
    for frame in tutti.Dataset(sys.argv[1], type="images"):
        result = detector.detect(frame.image, member_features={"mine": mine(frame.image), "whole": whole(frame.image)})
        images += 1
        if result.accepted:
            loops += 1
            beliefs = " ".join(f"{member.name}: {member.hypothesis:.2f}" for member in result.members)
            print(f"image {result.query} is where image {result.candidate} was; hypotheses {beliefs}")
    print(f"{images} images, {loops} loops")


if __name__ == "__main__":
    main()
