#!/usr/bin/env python3
"""One camera in a hand: the colour images of redkitchen alone, as they are and as H.264 videos.

usage: ./dev bench hand-held [--write]

Runs of `tutti run` with loops, over the images (JPEG, 15 a second) and over videos that ffmpeg makes of them, at 15 Hz and with
every second frame (7.5 Hz), from the first frame and from five others. ATE after Sim(3) alignment; posed are the frames of the
largest piece of the map. Without ffmpeg the videos' rows are left out, without the data set all.
"""
import json
import shutil
import statistics
import subprocess
import sys

import table

STARTS = [0, 50, 100, 150, 200, 250]
IMAGES = {"images": None, "H.264, crf 18": 18, "H.264, crf 28": 28}
STRIDES = {"15 Hz": 1, "7.5 Hz": 2}
RATE_HZ = 15
ATE_M, POSED = 0.10, 0.98  # at most, at least, of every run


def video(a, data, crf):
    """The colour images in the order of rgb.txt as an H.264 file, which is made once."""
    out = a.out / f"redkitchen-crf{crf}.mp4"
    if out.exists():
        return out
    order = a.out / "order"
    table.link_numbered(dict(enumerate(table.tum_images(data))), order)
    part = out.with_suffix(".part.mp4")
    subprocess.run(["ffmpeg", "-loglevel", "error", "-y", "-framerate", str(RATE_HZ), "-i", order / "%06d.jpg", "-c:v", "libx264",
                    "-crf", str(crf), "-pix_fmt", "yuv420p", part], check=True)
    part.rename(out)
    return out


def run(a, data, image, rate, start):
    folder = a.out / f"{image}-{rate}-{start}".replace(" ", "").replace(",", "-")
    if not (a.reuse and (folder / "summary.json").exists()):
        crf = IMAGES[image]
        source = ["--dataset", data] if crf is None else [
            "--dataset", video(a, data, crf), "--ground-truth", data / "groundtruth.txt", "--set", "dataset.type=auto", "--set",
            f"dataset.rate_hz={RATE_HZ}"]
        subprocess.run([a.tutti, "run", "--quiet", "--require", "failed", "--no-report", "--no-map", "--config", table.ROOT / "data/configs/7scenes.yaml",
                        *source, "--set", "dataset.sensor=mono", "--set", f"dataset.stride={STRIDES[rate]}", "--set",
                        "run.odometry_pass=false", "--start", str(start), "--out", folder], check=True, stdout=subprocess.DEVNULL)
    summary = json.loads((folder / "summary.json").read_text())
    frames, loops = summary["frames"], summary["loops"]
    return {"image": image, "rate": rate, "start": start, "ate_m": summary["evaluation"]["slam"]["ate_rmse_m"],
            "path_m": summary["evaluation"]["path_m"], "posed": frames["tracked"] / frames["total"], "true": loops["true"],
            "false": loops["false"]}


def document(runs):
    text = ["# One hand-held camera", "", "Written by `./dev bench hand-held --write` (bench/hand_held_table.py). The colour images of "
            f"`redkitchen` alone, with loops, ATE after Sim(3) alignment. From frame 0 the path is {runs[0]['path_m']:.1f} m; cut-outs "
            f"start at frames {', '.join(map(str, STARTS[1:]))}. The data set has every second frame of a Kinect's 30 Hz. Of every run: "
            f"ATE <= {ATE_M:.2f} m, {100 * POSED:.0f} % of the frames posed, no false loop.", "",
            "| images | rate | ATE from frame 0 | cut-outs, median | worst | frames posed, least | loops true / false |",
            "|---|---|---|---|---|---|---|"]
    for image in IMAGES:
        for rate in STRIDES:
            rows = [r for r in runs if r["image"] == image and r["rate"] == rate]
            if not rows:
                continue
            cuts = [r["ate_m"] for r in rows if r["start"]]
            worst, posed, false = max(r["ate_m"] for r in rows), min(r["posed"] for r in rows), sum(r["false"] for r in rows)
            missed = " (**missed**)" if worst > ATE_M or posed < POSED or false else ""
            text.append(f"| {image} | {rate} | {rows[0]['ate_m']:.3f} m | {statistics.median(cuts):.3f} m | {max(cuts):.3f} m | "
                        f"{100 * posed:.1f} %{missed} | {sum(r['true'] for r in rows)} / {false} |")
    return "\n".join(text)


def main():
    a = table.parse(table.parser(__doc__, "hand-held"))
    data = a.data / "redkitchen"
    if not data.exists():
        print(f"hand-held: {data} is absent; nothing is measured", file=sys.stderr)
        return 0
    images = list(IMAGES)
    if shutil.which("ffmpeg") is None:
        print("hand-held: ffmpeg is absent; the rows of videos are left out", file=sys.stderr)
        images = [image for image in images if IMAGES[image] is None]
    runs = [run(a, data, image, rate, start) for image in images for rate in STRIDES for start in STARTS]
    if a.write:
        (table.RESULTS / "hand-held.json").write_text(json.dumps(runs, indent=1) + "\n")
    table.put(a, table.RESULTS / "hand-held.md", document(runs))
    return 0


if __name__ == "__main__":
    sys.exit(main())
