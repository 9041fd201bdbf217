#!/usr/bin/env python3
"""Draws two decisions for docs/loop-closure.md: a loop at dusk that the second word finds, and a look-alike that is refused.

usage: ./dev bench decisions [--write]   (or bench/decision_pictures.py --build build/release)

Generates development worlds (seeds 101 and 102), runs `tutti loops --dump` on them, and chooses the images by rule: of the loops that
are accepted late and true the one whose probability rose the most; of the false places the most probable. Needs nothing but Python 3.
"""
import base64
import csv
import pathlib
import sys
import tempfile

import loop_sets
import table

COLOURS = {"surf": "#1b6ca8", "sift": "#2a8f4f", "orb": "#c8641b"}
WIDTH, IMAGE, CHART, GAP = 860, 250, 150, 24  # [px]


def rows_of(file):
    with open(file, newline="") as f:
        return list(csv.DictReader(f))


class Drawing:
    def __init__(self):
        self.parts, self.height = [], 0

    def text(self, x, y, words, size=12, anchor="start", colour="#333"):
        self.parts.append(f'<text x="{x:.1f}" y="{y:.1f}" font-size="{size}" text-anchor="{anchor}" fill="{colour}">{words}</text>')

    def image(self, x, y, file, title):
        """Returns the height; all are IMAGE wide."""
        data = pathlib.Path(file).read_bytes()
        width, height = (int.from_bytes(data[at:at + 4], "big") for at in (16, 20))  # PNG's header
        shown = IMAGE * height / width
        self.text(x, y - 6, title)
        self.parts.append(f'<image x="{x}" y="{y}" width="{IMAGE}" height="{shown:.0f}" '
                          f'href="data:image/png;base64,{base64.b64encode(data).decode()}"/>')
        return shown

    def line(self, points, colour, width):
        self.parts.append(f'<polyline fill="none" stroke="{colour}" stroke-width="{width}" points="' +
                          " ".join(f"{x:.1f},{y:.1f}" for x, y in points) + '"/>')

    def svg(self):
        return (f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {self.height:.0f}" font-family="sans-serif">\n'
                f'<rect width="{WIDTH}" height="{self.height:.0f}" fill="white"/>\n' + "\n".join(self.parts) + "\n</svg>\n")


def curves(drawing, top, rows, first, last):
    """H of the members and of all over images, and when which loop was accepted."""
    left, width = 40, WIDTH - 60

    def at(image, value):
        return left + (image - first + .5) * width / (last - first + 1), top + CHART * (1 - value)

    shown = [r for r in rows if first <= int(r["image"]) <= last]
    drawing.parts.append(f'<rect x="{left}" y="{top}" width="{width}" height="{CHART}" fill="none" stroke="#999"/>')
    for name, colour in COLOURS.items():
        drawing.line([at(int(r["image"]), float(r[f"{name}_hypothesis"])) for r in shown], colour, 1)
    drawing.line([at(int(r["image"]), float(r["hypothesis"])) for r in shown], "#222", 2.2)
    for r in shown:
        if r["accepted"] != "1":
            continue
        x, y = at(int(r["image"]), float(r["probability"]))
        late = r["late"] == "accepted"
        drawing.parts.append(f'<circle cx="{x:.1f}" cy="{y:.1f}" r="4" stroke="#c02020" stroke-width="1.6" '
                             f'fill="{"white" if late else "#c02020"}"/>')
    drawing.text(left - 6, top + 10, "1", anchor="end")
    drawing.text(left - 6, top + CHART, "0", anchor="end")
    drawing.text(left, top + CHART + 16, f"image {first}")
    drawing.text(left + width, top + CHART + 16, f"image {last}", anchor="end")
    x = left
    for name, colour in [*COLOURS.items(), ("all together", "#222")]:
        drawing.text(x, top - 8, f"H of {name.upper() if name in COLOURS else name}", colour=colour)
        x += 110
    drawing.text(x + 20, top - 8, "accepted: ● at once, ○ five images later", colour="#c02020")


def dusk(tutti, out):
    arguments = loop_sets.development_world(tutti, "indoor-dusk", 101, out)
    folder = out / "dusk"
    loop_sets.quiet([tutti, "loops", *arguments, "--out", folder, "--dump"])
    rows = rows_of(folder / "hypotheses.csv")
    late = [r for r in rows if r["late"] == "accepted" and r["truth"] == "loop"]
    if not late:
        raise SystemExit("no loop was accepted late: nothing to draw")
    chosen = min(late, key=lambda r: float(r["hypothesis"]))
    image, place = int(chosen["image"]), int(chosen["verified_candidate"])
    images = pathlib.Path(arguments[1])
    drawing = Drawing()
    top = 2 * GAP
    height = drawing.image(40, top, images / rows[image]["file"], f"image {image}, at dusk")
    drawing.image(40 + IMAGE + GAP, top, images / rows[place]["file"], f"image {place}, by day: the place that was found")
    for k, words in enumerate([f"at once: H = {float(chosen['hypothesis']):.2f} with all members,",
                               *[f"   {float(chosen[m + '_hypothesis']):.2f} with {m.upper()}" for m in COLOURS],
                               f"five images later: P = {float(chosen['probability']):.3f}",
                               f"{chosen['inliers']} of {chosen['matches']} matches fit one motion"]):
        drawing.text(40 + 2 * (IMAGE + GAP), top + 16 + 20 * k, words)
    curves(drawing, top + height + 2 * GAP, rows, max(0, image - 40), min(len(rows) - 1, image + 40))
    drawing.height = top + height + 2 * GAP + CHART + 30
    return drawing


def look_alike(tutti, out):
    arguments = loop_sets.development_world(tutti, "loop-free-300", 102, out)
    folder = out / "alike"
    loop_sets.quiet([tutti, "loops", *arguments, "--out", folder, "--dump"])
    rows = rows_of(folder / "hypotheses.csv")
    refused = [r for r in rows if r["proposed"] == "1" and r["accepted"] != "1"]
    chosen = max(refused, key=lambda r: float(r["probability"]))
    image = int(chosen["image"])
    tried = [r for r in rows_of(folder / "dump_verification.csv") if int(r["image"]) == image]
    place = max(tried, key=lambda r: int(r["inliers"]))
    images = pathlib.Path(arguments[1])
    drawing = Drawing()
    top = 2 * GAP
    height = drawing.image(40, top, images / rows[image]["file"], f"image {image}")
    drawing.image(40 + IMAGE + GAP, top, images / rows[int(place["candidate"])]["file"], f"image {place['candidate']}: another street")
    for k, words in enumerate([f"H = {float(chosen['hypothesis']):.2f} with all members,",
                               *[f"   {float(chosen[m + '_hypothesis']):.2f} with {m.upper()}" for m in COLOURS],
                               f"{place['inliers']} of {place['matches']} matches fit one motion:",
                               f"chance explains them at 10^{float(place['log_nfa']):.0f}",
                               f"M = {float(place['mass']):.2f}: too little belief,",
                               f"P = {float(chosen['probability']):.3f}: refused"]):
        drawing.text(40 + 2 * (IMAGE + GAP), top + 14 + 19 * k, words)
    drawing.height = top + max(height, 160) + GAP
    return drawing


def main():
    a = table.parse(table.parser(__doc__, "decisions"))
    for name, draw in (("second_word.svg", dusk), ("look_alike.svg", look_alike)):
        with tempfile.TemporaryDirectory() as out:
            drawing = draw(a.tutti, pathlib.Path(out))
        file = (table.ROOT / "docs" / "images" if a.write else a.out) / name
        file.write_text(drawing.svg())
        print(f"written: {table.shown(file)}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
