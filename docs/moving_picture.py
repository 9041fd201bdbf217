#!/usr/bin/env python3
"""Draws docs/images/moving.png, the README's animation: images with tracked landmarks beside the map that grows.

usage: docs/moving_picture.py OUT.png   (after ./dev build; Debian: python3-pil)

A generated town is driven through one and a half times with one camera. Tracks are the newest keyframe's landmarks in the present
image, with their last positions; the map is what the system has then, so that a loop shows as a jump.
"""
import pathlib
import subprocess
import sys
import tempfile

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent / "bench"))
import table  # noqa: E402

WORLD = ["--sensor", "mono", "--blocks-x", "2", "--width", "400", "--height", "200", "--laps", "1.25", "--seed", "5"]
EVERY, MS = 8, 110  # frames of the run for one of the animation, and how long it is shown
MAP, TRAIL, GREYS, COLOURS = 200, 7, 26, {"paper": "#ffffff", "point": "#b9c4cf", "path": "#1b6ca8", "camera": "#c8641b", "loop": "#2a8f4f", "track": "#ffd23f"}


def frames(folder):
    """(image, pixels of tracks, landmarks, camera centres so far, loops so far as pairs of stamps) for each frame that is drawn."""
    import numpy as np
    import tutti
    run = tutti.run(folder, quiet=True, run={"threads": 2})
    camera, trail = run.dataset.rig.camera, []
    for result in run:
        if result.T_world_camera is None:
            continue
        T = result.T_world_camera
        # the keyframe that sees most of the same: near, and looking the same way
        others = tutti.pose_matrices(run.slam.keyframe_trajectory())
        away = np.linalg.norm(others[:, :3, 3] - T[:3, 3], axis=1) - 20 * np.minimum(0, others[:, :3, 2] @ T[:3, 2] - 0.8)
        keyframe = run.slam.keyframe(run.slam.keyframe_ids[int(np.argmin(away))])
        known = keyframe.landmarks >= 0
        world = keyframe.points[known] @ keyframe.T_world_camera[:3, :3].T + keyframe.T_world_camera[:3, 3]
        p = (world - T[:3, 3]) @ T[:3, :3]
        ids, p = keyframe.landmarks[known][p[:, 2] > 0.1], p[p[:, 2] > 0.1]
        pixels = p[:, :2] / p[:, 2:] * [camera.fx, camera.fy] + [camera.cx, camera.cy]
        trail = (trail + [dict(zip(ids.tolist(), pixels.tolist()))])[-TRAIL:]
        if run.frame.index % EVERY == 0:
            loops = [(loop.query_stamp, loop.candidate_stamp) for loop in run.slam.loops if loop.accepted]
            yield np.array(run.frame.image), list(trail), run.slam.landmarks(), run.slam.trajectory(), loops


def palette():
    """Greys and the colours: frames share them, so that what stays the same costs nothing."""
    from PIL import Image
    greys = [round(255 * k / (GREYS - 1)) for k in range(GREYS)]
    picture = Image.new("P", (1, 1))
    picture.putpalette([x for g in greys for x in (g, g, g)] + [int(c[i:i + 2], 16) for c in COLOURS.values() for i in (1, 3, 5)] * 3)
    return picture


def drawn(all_frames):
    from PIL import Image, ImageDraw
    import numpy as np
    all_frames = list(all_frames)
    last = all_frames[-1][3][:, [1, 3]]
    low, high = last.min(0), last.max(0)
    scale = (MAP - 40) / (high - low).max()
    for image, trail, landmarks, path, loops in all_frames:
        picture = Image.new("RGB", (image.shape[1] + MAP, image.shape[0]), COLOURS["paper"])
        picture.paste(Image.fromarray(image), (0, 0))
        draw = ImageDraw.Draw(picture)
        for landmark, at in trail[-1].items():
            line = [tuple(step[landmark]) for step in trail if landmark in step]
            if 0 <= at[0] < image.shape[1] - 3 and 0 <= at[1] < image.shape[0]:
                if len(line) > 1 and all(x < image.shape[1] for x, _ in line):
                    draw.line(line, fill=COLOURS["track"])
                draw.ellipse([at[0] - 1.5, at[1] - 1.5, at[0] + 1.5, at[1] + 1.5], fill=COLOURS["track"])

        def place(points):
            middle = (low + high) / 2
            return [(image.shape[1] + MAP / 2 + scale * (x - middle[0]), MAP / 2 - scale * (z - middle[1])) for x, z in np.asarray(points).reshape(-1, 2)]
        for x, y in place(landmarks[::3][:, [0, 2]]):
            if image.shape[1] + 2 < x < picture.width and 0 <= y < picture.height:
                picture.putpixel((int(x), int(y)), tuple(int(COLOURS["point"][i:i + 2], 16) for i in (1, 3, 5)))
        steps = place(path[:, [1, 3]])
        draw.line(steps, fill=COLOURS["path"], width=2)
        for ends in loops:
            draw.line([steps[int(np.argmin(abs(path[:, 0] - stamp)))] for stamp in ends], fill=COLOURS["loop"], width=2)
        x, y = steps[-1]
        draw.ellipse([x - 3, y - 3, x + 3, y + 3], fill=COLOURS["camera"])
        yield picture


def main():
    if len(sys.argv) != 2 or sys.argv[1].startswith("-"):
        print(__doc__)
        return 2
    build = table.ROOT / "build" / "release"
    sys.path.insert(0, str(build / "apps" / "python"))
    with tempfile.TemporaryDirectory() as work:
        folder = pathlib.Path(work) / "town"
        subprocess.run([build / "apps" / "tutti" / "tutti", "generate", "--out", folder, *WORLD], check=True, stdout=subprocess.DEVNULL)
        pictures = [picture.quantize(palette=palette(), dither=0) for picture in drawn(frames(folder))]
    pictures[0].save(sys.argv[1], save_all=True, append_images=pictures[1:], duration=MS, loop=0, optimize=True)
    print(f"written: {sys.argv[1]}, {len(pictures)} pictures, {pathlib.Path(sys.argv[1]).stat().st_size / 1e6:.1f} MB")
    return 0


if __name__ == "__main__":
    sys.exit(main())
