#!/usr/bin/env python3
"""Draws the pictures of docs/loop-closure.md.

usage: ./dev bench pictures [PICTURE...] [--write]

`posteriors`: of the members and of all together over a revisit, in a corridor whose doors and posters repeat (240x192, walked three
times). `second_word`: a loop at dusk that the second word finds. `look_alike`: two places that look alike, and why they are no loop.
All are of development worlds (seeds 101 and 102). A rule chooses the images of the last two: of the loops that are accepted late and
true the one that was least believed at once; of the rejected places the most probable. --write puts them into docs/images.
"""
import base64
import collections
import csv
import pathlib
import sys
import tempfile

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent / "bench"))
import loop_sets  # noqa: E402
import table  # noqa: E402

COLOURS = {"surf": "#1b6ca8", "sift": "#2a8f4f", "orb": "#c8641b", "combined": "#222"}
MEMBERS = ["surf", "sift", "orb"]
IMAGE, GAP = 250, 24  # [px]
FIRST, LAST, PLACES = 192, 262, 100  # images and places that are drawn
FAINTEST, DARKEST = 0.005, 0.3  # probabilities below are white, above of full colour


def rows_of(file):
    with open(file, newline="") as f:
        return list(csv.DictReader(f))


def h_of(row, name):
    return float(row["hypothesis" if name == "combined" else f"{name}_hypothesis"])


class Drawing:
    def __init__(self, width):
        self.parts, self.width, self.height = [], width, 0

    def add(self, part):
        self.parts.append(part)

    def text(self, x, y, words, anchor="start", colour="#333"):
        self.add(f'<text x="{x:.1f}" y="{y:.1f}" font-size="12" text-anchor="{anchor}" fill="{colour}">{words}</text>')

    def texts(self, x, y, lines):
        for k, words in enumerate(lines):
            self.text(x, y + 19 * k, words)

    def image(self, x, y, file, title):
        """A PNG, IMAGE wide; returns its height."""
        data = pathlib.Path(file).read_bytes()
        width, height = (int.from_bytes(data[at:at + 4], "big") for at in (16, 20))
        self.text(x, y - 6, title)
        self.add(f'<image x="{x}" y="{y}" width="{IMAGE}" height="{IMAGE * height / width:.0f}" '
                 f'href="data:image/png;base64,{base64.b64encode(data).decode()}"/>')
        return IMAGE * height / width

    def chart(self, left, top, width, height, rows, names):
        """H over images, a line for each name; returns where (image, value) is."""
        first, last = int(rows[0]["image"]), int(rows[-1]["image"])

        def at(image, value):
            return left + (image - first + .5) * width / (last - first + 1), top + height * (1 - value)
        self.add(f'<rect x="{left}" y="{top}" width="{width}" height="{height}" fill="none" stroke="#999"/>')
        for name in names:
            points = " ".join("{:.1f},{:.1f}".format(*at(int(r["image"]), h_of(r, name))) for r in rows)
            self.add(f'<polyline fill="none" stroke="{COLOURS[name]}" stroke-width="{1.8 if name == "combined" else 1}" points="{points}"/>')
        self.text(left, top + height + 15, f"image {first}")
        self.text(left + width, top + height + 15, last, "end")
        return at

    def svg(self):
        return (f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {self.width} {self.height:.0f}" font-family="sans-serif">\n'
                f'<rect width="{self.width}" height="{self.height:.0f}" fill="white"/>\n' + "\n".join(self.parts) + "\n</svg>\n")


def posteriors(tutti, out):
    loop_sets.quiet([tutti, "loops", *loop_sets.development_world(tutti, "indoor", 101, out), "--keep-posterior", "--out", out / "loops"])
    pairs = [r for r in rows_of(out / "loops" / "posteriors.csv") if FIRST <= int(r["image"]) <= LAST and int(r["location"]) < PLACES]
    shown = [r for r in rows_of(out / "loops" / "hypotheses.csv") if FIRST <= int(r["image"]) <= LAST]
    names, top, drawing = [*MEMBERS, "combined"], GAP, Drawing(GAP + 4 * (IMAGE + GAP))
    for k, name in enumerate(names):
        left, shades = GAP + k * (IMAGE + GAP), collections.defaultdict(str)
        wide, high = IMAGE / PLACES, IMAGE / (LAST - FIRST + 1)
        for r in pairs:
            cell = f"M{left + int(r['location']) * wide:.1f} {top + (int(r['image']) - FIRST) * high:.1f}h{wide:.1f}v{high:.1f}h-{wide:.1f}z"
            if r["truth"] == "255":
                shades[0] += cell
            if float(r[name]) >= FAINTEST:
                shades[max(1, min(10, round(10 * (float(r[name]) / DARKEST) ** 0.5)))] += cell
        # What is white on red leaves a border round the true pairs.
        drawing.add(f'<path stroke="#d03030" stroke-width="1.4" d="{shades[0]}"/><path fill="white" d="{shades.pop(0)}"/>')
        for shade, path in sorted(shades.items()):
            drawing.add(f'<path fill="{COLOURS[name]}" fill-opacity="{shade / 10}" d="{path}"/>')
        drawing.add(f'<rect x="{left}" y="{top}" width="{IMAGE}" height="{IMAGE}" fill="none" stroke="#999"/>')
        drawing.text(left, top - 7, f"{name.upper() if name in MEMBERS else 'all together'}: image (down), earlier place (across)")
        drawing.text(left, top + IMAGE + 15, "H")
        drawing.chart(left, top + IMAGE + GAP, IMAGE, 70, shown, [name])
    drawing.height = top + IMAGE + 70 + 2 * GAP
    return drawing


def second_word(tutti, out):
    arguments = loop_sets.development_world(tutti, "indoor-dusk", 101, out)
    loop_sets.quiet([tutti, "loops", *arguments, "--out", out / "loops", "--dump"])
    rows, images = rows_of(out / "loops" / "hypotheses.csv"), pathlib.Path(arguments[1])
    late = [r for r in rows if r["late"] == "accepted" and r["truth"] == "loop"]
    if not late:
        raise SystemExit("no loop was accepted late: nothing to draw")
    chosen = min(late, key=lambda r: h_of(r, "combined"))
    image, place, drawing, top = int(chosen["image"]), int(chosen["verified_candidate"]), Drawing(860), 2 * GAP
    height = drawing.image(40, top, images / rows[image]["file"], f"image {image}, at dusk")
    drawing.image(40 + IMAGE + GAP, top, images / rows[place]["file"], f"image {place}, by day: the place that was found")
    drawing.texts(40 + 2 * (IMAGE + GAP), top + 16, [
        f"at once: H = {h_of(chosen, 'combined'):.2f} with all members,", *[f"   {h_of(chosen, m):.2f} with {m.upper()}" for m in MEMBERS],
        f"five images later: P = {float(chosen['probability']):.3f}", f"{chosen['inliers']} of {chosen['matches']} matches fit one motion"])
    top += height + 2 * GAP
    shown = rows[max(0, image - 40):image + 41]
    at = drawing.chart(40, top, 800, 150, shown, [*MEMBERS, "combined"])
    for r in (r for r in shown if r["accepted"] == "1"):
        x, y = at(int(r["image"]), float(r["probability"]))
        drawing.add(f'<circle cx="{x:.1f}" cy="{y:.1f}" r="4" stroke="#c02020" fill="{"white" if r["late"] == "accepted" else "#c02020"}"/>')
    for k, (name, colour) in enumerate(COLOURS.items()):
        drawing.text(40 + 110 * k, top - 8, f"H of {name.upper() if name in MEMBERS else 'all together'}", colour=colour)
    drawing.text(520, top - 8, "P where accepted: ● at once, ○ five images later", colour="#c02020")
    drawing.height = top + 150 + GAP
    return drawing


def look_alike(tutti, out):
    arguments = loop_sets.development_world(tutti, "loop-free-300", 102, out)
    loop_sets.quiet([tutti, "loops", *arguments, "--out", out / "loops", "--dump"])
    rows, images = rows_of(out / "loops" / "hypotheses.csv"), pathlib.Path(arguments[1])
    chosen = max((r for r in rows if r["proposed"] == "1" and r["accepted"] != "1"), key=lambda r: float(r["probability"]))
    image, drawing, top = int(chosen["image"]), Drawing(860), 2 * GAP
    place = max((r for r in rows_of(out / "loops" / "dump_verification.csv") if int(r["image"]) == image), key=lambda r: int(r["inliers"]))
    height = drawing.image(40, top, images / rows[image]["file"], f"image {image}")
    drawing.image(40 + IMAGE + GAP, top, images / rows[int(place["candidate"])]["file"], f"image {place['candidate']}: another street")
    drawing.texts(40 + 2 * (IMAGE + GAP), top + 14, [
        f"H = {h_of(chosen, 'combined'):.2f} with all members,", *[f"   {h_of(chosen, m):.2f} with {m.upper()}" for m in MEMBERS],
        f"{place['inliers']} of {place['matches']} matches fit one motion:", f"chance explains them at 10^{float(place['log_nfa']):.0f}",
        f"M = {float(place['mass']):.2f}: too little belief,", f"P = {float(chosen['probability']):.3f}: rejected"])
    drawing.height = top + max(height, 160) + GAP
    return drawing


PICTURES = {"posteriors": posteriors, "second_word": second_word, "look_alike": look_alike}


def main():
    a = table.parse(table.parser(__doc__, "pictures", PICTURES), PICTURES)
    for name in a.rows:
        with tempfile.TemporaryDirectory() as out:
            drawing = PICTURES[name](a.tutti, pathlib.Path(out))
        file = (table.ROOT / "docs" / "images" if a.write else a.out) / f"{name}.svg"
        file.write_text(drawing.svg())
        print(f"written: {table.shown(file)}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
