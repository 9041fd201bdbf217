#!/usr/bin/env python3
"""One camera in a hand: the colour images of redkitchen alone, as they are and as H.264 videos; and focal lengths that are measured.

usage: ./dev bench hand-held [--write]

Runs of `tutti run` with loops, over the images (JPEG, 15 a second) and over videos that ffmpeg makes of them, at 15 Hz and with
every second frame (7.5 Hz), from the first frame and from five others. ATE after Sim(3) alignment; posed are the frames of the
largest piece of the map. Without ffmpeg the videos' rows are left out, without the data set all.

The focal length is measured by `tutti run` without a camera, on cuts of 300 frames: five of redkitchen, three of kitti_00_head, two
worlds that are made here, each as images and as H.264 (crf 23).
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
CUT = 300  # frames
ATE_M, POSED = 0.10, 0.98  # at most, at least, of every run
COST = 0.5  # of measuring a focal length, at most, as a share of the SLAM's processor time


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


def cuts(a):
    """(name, true focal length [px], images, rate [Hz]) of each cut."""
    kitchen = table.tum_images(a.data / "redkitchen")
    for start in STARTS[:5]:
        yield f"redkitchen, from {start}", 520, kitchen[start:start + CUT], RATE_HZ
    for start in (0, 400, 1000):
        yield f"kitti_00_head, from {start}", 718.856, sorted((a.data / "kitti_00_head/image_0").iterdir())[start:start + CUT], 10
    for world, seed, focal, rate in (("room", 7, 524.8, 15), ("town", 8, 371.2, 10)):
        folder = a.out / world
        table.generate(a.tutti, folder, ["--sensor", "mono", "--world", world, "--seed", str(seed), "--laps", "1", "--frames", str(CUT)])
        yield world, focal, sorted((folder / "image_0").iterdir()), rate


def measured(a, name, truth, images, rate, coded):
    place = a.out / ("focal-" + name.replace(" ", "").replace(",", "-"))
    folder = place.with_name(place.name + ("-video" if coded else "-images") + "-run")
    if not (a.reuse and (folder / "summary.json").exists()):
        table.link_numbered(dict(enumerate(images)), place)
        source = place
        if coded:
            source = place.with_suffix(".mp4")
            subprocess.run(["ffmpeg", "-loglevel", "error", "-y", "-framerate", str(rate), "-i", place / f"%06d{images[0].suffix}", "-vf",
                            "pad=ceil(iw/2)*2:ceil(ih/2)*2", "-c:v", "libx264", "-pix_fmt", "yuv420p", source], check=True)
        subprocess.run([a.tutti, "run", source, "--quiet", "--no-report", "--no-map", "--set", "run.odometry_pass=false", "--out", folder],
                       check=False, stdout=subprocess.DEVNULL)
    summary = json.loads((folder / "summary.json").read_text())
    cpu, total = summary["timing"]["focal_length_cpu_s"], summary["timing"]["cpu_s"]
    row = {"cut": name, "form": "H.264" if coded else "images", "cost": cpu / (total - cpu)}
    for when in ("first_frames", "map"):
        found = summary["focal_length"][when]
        row[when] = {"measured": found["measured"], "error": found["px"] / truth - 1, "sigma": found["sigma"]}
    return row


def focal_lengths(rows):
    def told(found):
        return f"{100 * found['error']:+.1f} %, give or take {100 * found['sigma']:.1f}" if found["measured"] else "not measured"

    def within(when):
        known = [r[when] for r in rows if r[when]["measured"]]
        return f"{sum(abs(f['error']) <= 2 * f['sigma'] for f in known)} of {len(known)}"
    text = ["", "## Focal lengths that are measured", "", f"Cuts of {CUT} frames without a camera. Error within two standard deviations: "
            f"{within('first_frames')} by the first third of the frames, {within('map')} by the whole map. Cost: processor time over that of "
            f"the SLAM that follows; it should be at most {100 * COST:.0f} %.", "", "| cut | form | first third | whole map | cost |", "|---|---|---|---|---|"]
    return text + [f"| {r['cut']} | {r['form']} | {told(r['first_frames'])} | {told(r['map'])} | {100 * r['cost']:.0f} %{' (**missed**)' if r['cost'] > COST else ''} |"
                   for r in rows]


def document(runs, focal):
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
    return "\n".join(text + focal_lengths(focal))


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
    rows = [measured(a, *cut, coded) for cut in cuts(a) for coded in ((False, True) if shutil.which("ffmpeg") else (False,))]
    if a.write:
        (table.RESULTS / "hand-held.json").write_text(json.dumps(runs, indent=1) + "\n")
    table.put(a, table.RESULTS / "hand-held.md", document(runs, rows))
    return 0


if __name__ == "__main__":
    sys.exit(main())
