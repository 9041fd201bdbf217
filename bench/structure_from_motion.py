"""Camera poses from images alone, by COLMAP (Schonberger and Frahm, CVPR 2016): a witness that is not of our making."""
import pathlib
import shutil
import subprocess

import table
from pose_files import inverse, matrix


def colmap(command, *options):
    done = subprocess.run(["colmap", command, *map(str, options)], capture_output=True, text=True, check=False)
    if done.returncode:
        raise RuntimeError(f"colmap {command}: {(done.stderr or done.stdout).strip().rpartition(chr(10))[2]}")


def poses(images, camera, out, reuse=False):
    """{number: 4x4 matrix T_world_camera} of those images ({number: file}) that COLMAP could place, in a scale of its own; `camera`:
    (fx, fy, cx, cy) in our convention, the centre of the top-left pixel at (0, 0). All pairs of images are matched on the
    processor: 10 to 20 minutes for 100 images on two cores. RuntimeError if COLMAP is missing or fails."""
    if not shutil.which("colmap"):
        raise RuntimeError("colmap is not installed (apt-get install colmap)")
    text = out / "images.txt"
    if not (reuse and text.exists()):
        shutil.rmtree(out, ignore_errors=True)
        table.link_numbered(images, out / "images")
        where = ("--database_path", out / "database.db")
        fx, fy, cx, cy = camera
        colmap("feature_extractor", *where, "--image_path", out / "images", "--ImageReader.single_camera", 1,
               "--ImageReader.camera_model", "PINHOLE", "--ImageReader.camera_params", f"{fx},{fy},{cx + 0.5},{cy + 0.5}",
               "--SiftExtraction.use_gpu", 0, "--SiftExtraction.max_num_features", 1500)
        colmap("exhaustive_matcher", *where, "--SiftMatching.use_gpu", 0)
        (out / "models").mkdir()
        colmap("mapper", *where, "--image_path", out / "images", "--output_path", out / "models",
               "--Mapper.ba_refine_focal_length", 0, "--Mapper.ba_refine_principal_point", 0, "--Mapper.ba_refine_extra_params", 0)
        largest = max((out / "models").iterdir(), key=lambda model: (model / "images.bin").stat().st_size, default=None)
        if largest is None:
            raise RuntimeError(f"colmap mapper: no model of the images in {out}")
        colmap("model_converter", "--input_path", largest, "--output_path", out, "--output_type", "TXT")
    lines = [line for line in text.read_text().splitlines() if not line.startswith("#")]
    placed = {}
    for line in lines[::2]:  # each second one has the image's points
        words = line.split()
        w, x, y, z, *position = map(float, words[1:8])
        placed[int(pathlib.Path(words[9]).stem)] = inverse(matrix((position, (x, y, z, w))))
    return dict(sorted(placed.items()))
