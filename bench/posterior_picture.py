#!/usr/bin/env python3
"""Draws the members' posteriors and the ensemble's over a revisit, as docs/loop-closure.md shows them.

usage: ./dev bench picture [--first N] [--last N] [--write]   (or bench/posterior_picture.py --build build/release)

Generates a corridor with doors and posters that repeat (240x192, walked three times) and runs `tutti loops
--keep-posterior` on it. Needs nothing but Python 3.
"""
import collections
import csv
import pathlib
import subprocess
import sys
import tempfile

import table

PANEL, GAP, LEFT, TOP, CURVE = 250, 22, 46, 30, 70  # [px]
FAINTEST, DARKEST = 0.005, 0.3  # posteriors below are white, above of full colour
COLOURS = {"surf": "#1b6ca8", "sift": "#2a8f4f", "orb": "#c8641b", "combined": "#222222"}


def read_posteriors(file):
    """({column: {(image, location): probability}}, columns, {(image, location) of a true loop})"""
    values, pairs = collections.defaultdict(dict), set()
    with open(file, newline="") as f:
        reader = csv.DictReader(f)
        columns = reader.fieldnames[3:]
        for row in reader:
            if row["truth"] == "255":
                pairs.add((int(row["image"]), int(row["location"])))
            for name in columns:
                values[name][int(row["image"]), int(row["location"])] = float(row[name])
    return values, columns, pairs


def read_hypotheses(file):
    """Rows of hypotheses.csv by image."""
    with open(file, newline="") as f:
        return {int(row["image"]): row for row in csv.DictReader(f)}


class Picture:
    """One panel for each member and the ensemble, a curve of H below each."""

    def __init__(self, first, last, locations):
        self.first, self.last, self.locations = first, last, locations
        self.cell_x = PANEL / locations
        self.cell_y = PANEL / (last - first + 1)
        self.parts = []

    def text(self, x, y, words, size=11, anchor="middle", extra=""):
        self.parts.append(f'<text x="{x:.1f}" y="{y:.1f}" font-size="{size}" text-anchor="{anchor}"{extra}>{words}</text>')

    def cells(self, left, posterior, colour):
        by_shade = collections.defaultdict(list)
        for (image, location), p in posterior.items():
            if p < FAINTEST or not self.first <= image <= self.last or location >= self.locations:
                continue
            by_shade[max(1, min(10, round(10 * (p / DARKEST) ** 0.5)))].append((image, location))
        for shade, cells in sorted(by_shade.items()):
            path = "".join(f"M{left + x * self.cell_x:.1f} {TOP + (y - self.first) * self.cell_y:.1f}"
                           f"h{self.cell_x:.1f}v{self.cell_y:.1f}h-{self.cell_x:.1f}z" for y, x in sorted(cells))
            self.parts.append(f'<path fill="{colour}" fill-opacity="{shade / 10}" d="{path}"/>')

    def truth(self, left, pairs):
        """The border of the true pairs."""
        path = ""
        for y, x in sorted(pairs):
            px, py = left + x * self.cell_x, TOP + (y - self.first) * self.cell_y
            if (y - 1, x) not in pairs:
                path += f"M{px:.1f} {py:.1f}h{self.cell_x:.1f}"
            if (y + 1, x) not in pairs:
                path += f"M{px:.1f} {py + self.cell_y:.1f}h{self.cell_x:.1f}"
            if (y, x - 1) not in pairs:
                path += f"M{px:.1f} {py:.1f}v{self.cell_y:.1f}"
            if (y, x + 1) not in pairs:
                path += f"M{px + self.cell_x:.1f} {py:.1f}v{self.cell_y:.1f}"
        self.parts.append(f'<path fill="none" stroke="#d03030" stroke-width="0.7" d="{path}"/>')

    def curve(self, left, values, colour):
        top = TOP + PANEL + GAP
        points = " ".join(f"{left + (i - self.first + 0.5) * PANEL / (self.last - self.first + 1):.1f},"
                          f"{top + CURVE * (1 - h):.1f}" for i, h in sorted(values.items()) if self.first <= i <= self.last)
        self.frame(left, top, CURVE)
        self.parts.append(f'<polyline fill="none" stroke="{colour}" stroke-width="1.4" points="{points}"/>')
        self.text(left, top + CURVE + 13, self.first, anchor="start")
        self.text(left + PANEL, top + CURVE + 13, self.last, anchor="end")
        self.text(left + PANEL / 2, top + CURVE + 13, "image")

    def frame(self, left, top, height):
        self.parts.append(f'<rect x="{left}" y="{top}" width="{PANEL}" height="{height}" fill="none" stroke="#999" '
                          f'stroke-width="0.7"/>')

    def panel(self, k, title, posterior, pairs, hypotheses, colour):
        left = LEFT + k * (PANEL + GAP)
        self.cells(left, posterior, colour)
        self.truth(left, pairs)
        self.frame(left, TOP, PANEL)
        self.text(left + PANEL / 2, TOP - 9, title, 14, extra=' font-weight="bold"')
        self.text(left + PANEL / 2, TOP + PANEL + 14, f"earlier place, 0 to {self.locations - 1}")
        self.curve(left, hypotheses, colour)
        if k == 0:
            self.text(LEFT - 6, TOP + 10, self.first, anchor="end")
            self.text(LEFT - 6, TOP + PANEL, self.last, anchor="end")
            self.text(14, TOP + PANEL / 2, "image", extra=f' transform="rotate(-90 14 {TOP + PANEL / 2:.0f})"')
            self.text(LEFT - 6, TOP + PANEL + GAP + CURVE / 2 + 4, "H", anchor="end")

    def svg(self, panels):
        width, height = LEFT + panels * (PANEL + GAP), TOP + PANEL + GAP + CURVE + 22
        return (f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" font-family="sans-serif" '
                f'fill="#333">\n<rect width="{width}" height="{height}" fill="white"/>\n' + "\n".join(self.parts) +
                "\n</svg>\n")


WORLD = ["--seed", "101", "--frames", "388", "--sensor", "mono", "--world", "corridor", "--width", "240", "--height", "192",
         "--corridor", "42", "--speed", "0.65", "--rate", "1", "--laps", "3", "--repeat", "0.3", "--noise", "2",
         "--moving-objects", "2"]


def run(tutti, out):
    world = pathlib.Path(out) / "world"
    subprocess.run([tutti, "generate", "--out", world, *WORLD], check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    subprocess.run([tutti, "loops", "--images", world / "image_0", "--ground-truth", world / "poses.txt", "--gt-distance", "1.5",
                    "--gt-angle", "30", "--gt-ignore", "4", "--gt-exclude-s", "30", "--keep-posterior", "--out", out], check=True,
                   stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


def main():
    parser = table.parser(__doc__, "picture")
    parser.add_argument("--first", type=int, default=192, help="first image drawn (from 0)")
    parser.add_argument("--last", type=int, default=262, help="last image drawn")
    parser.add_argument("--locations", type=int, default=100, help="places drawn, from 0")
    a = table.parse(parser)
    with tempfile.TemporaryDirectory() as out:
        run(a.tutti, out)
        posteriors, columns, pairs = read_posteriors(pathlib.Path(out) / "posteriors.csv")
        hypotheses = read_hypotheses(pathlib.Path(out) / "hypotheses.csv")
    members = [c for c in columns if c != "combined"]
    picture = Picture(a.first, a.last, a.locations)
    pairs = {(i, j) for i, j in pairs if a.first <= i <= a.last and j < a.locations}
    for k, name in enumerate(members + ["combined"]):
        column = "hypothesis" if name == "combined" else f"{name}_hypothesis"
        h = {i: float(row[column]) for i, row in hypotheses.items()}
        title = "all together" if name == "combined" else name.upper()
        picture.panel(k, title, posteriors[name], pairs, h, COLOURS.get(name, "#7a3b9c"))
    file = (table.ROOT / "docs" / "images" if a.write else a.out) / "posteriors.svg"
    file.write_text(picture.svg(len(members) + 1))
    print(f"written: {table.shown(file)}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
