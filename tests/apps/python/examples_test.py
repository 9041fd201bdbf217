"""The scripts of apps/examples/python, run as their first lines say."""
import os
import re
import subprocess
import sys

import numpy as np
import pytest

import tutti


def run(source, name, *arguments):
    command = [sys.executable, source / "apps" / "examples" / "python" / name, *map(str, arguments)]
    result = subprocess.run(command, capture_output=True, text=True, timeout=300)
    assert result.returncode == 0, result.stderr
    return result.stdout


def loops_of(output):
    return [(int(query), int(place)) for query, place in re.findall(r"image (\d+) is where image (\d+) was", output)]


def test_loop_closure_on_a_folder(source, town, results, tmp_path):
    said = run(source, "loop_closure_on_a_folder.py", town / "image_0")
    assert loops_of(said) == [(r.query, r.candidate) for r in results if r.accepted]
    assert said.splitlines()[-1] == f"151 images, {len(loops_of(said))} loops"


def test_the_posterior_as_a_picture(source, town, tmp_path):
    pytest.importorskip("matplotlib", reason="skipped: no matplotlib (Debian: python3-matplotlib)")
    folder = tmp_path / "few"
    folder.mkdir()
    for i in range(15):
        os.symlink(town / "image_0" / f"{i:06}.png", folder / f"{i}.png")
    said = run(source, "loop_closure_on_a_folder.py", folder, tmp_path / "posterior.png")
    assert "picture: " in said
    assert (tmp_path / "posterior.png").read_bytes().startswith(b"\x89PNG")


def test_slam(source, tmp_path):
    room = tmp_path / "room"
    subprocess.run([os.environ["TUTTI_EXECUTABLE"], "generate", "--out", room, "--sensor", "rgbd", "--world", "room",
                    "--width", "320", "--height", "240", "--frames", "30"], check=True, capture_output=True)
    said = run(source, "slam.py", room, tmp_path / "trajectory.txt")
    assert said.startswith("30 of 30 frames")
    assert float(re.search(r"ATE ([\d.]+) m", said)[1]) < 0.05
    assert tutti.read_trajectory(tmp_path / "trajectory.txt").shape == (30, 8)


def test_dense_map(source, tmp_path):
    room = tmp_path / "room"
    subprocess.run([os.environ["TUTTI_EXECUTABLE"], "generate", "--out", room, "--sensor", "rgbd", "--world", "room",
                    "--width", "160", "--height", "120", "--frames", "10"], check=True, capture_output=True)
    said = run(source, "dense_map.py", room / "config.yaml", room, room / "groundtruth.txt", tmp_path / "mesh.ply",
               tmp_path / "grid")
    assert int(said.split()[0]) > 1000
    assert (tmp_path / "mesh.ply").exists() and (tmp_path / "grid" / "map.yaml").exists()


def test_evaluate_trajectories(source, town, tmp_path):
    truth = tutti.Dataset(town).ground_truth()
    rng = np.random.default_rng(1)
    for name, sigma in [("good", 0.01), ("bad", 1.0)]:
        estimate = truth.copy()
        estimate[:, 1:4] += sigma * rng.normal(size=(len(truth), 3))
        tutti.write_trajectory(tmp_path / name, estimate)
    tutti.write_trajectory(tmp_path / "truth", truth)
    said = run(source, "evaluate_trajectories.py", tmp_path / "truth", tmp_path / "good", tmp_path / "bad")
    good, bad = (float(line.split()[1]) for line in said.splitlines()[1:])
    assert good == pytest.approx(0.01 * 3 ** 0.5, rel=0.2) and bad == pytest.approx(3 ** 0.5, rel=0.2)


def test_own_odometry(source, town, tmp_path):
    tutti.write_trajectory(tmp_path / "odometry.txt", tutti.Dataset(town).ground_truth())
    said = run(source, "own_odometry.py", town / "config.yaml", town, tmp_path / "odometry.txt", tmp_path / "corrected.txt")
    assert int(re.search(r"(\d+) keyframes, (\d+) loops", said)[2]) > 1
    assert tutti.read_trajectory(tmp_path / "corrected.txt").shape == (151, 8)


def test_own_descriptors(source, town):
    said = run(source, "own_descriptors.py", town / "image_0")
    loops = loops_of(said)
    truth = tutti.Dataset(town).ground_truth()
    assert len(loops) >= 3
    for query, place in loops:
        assert np.linalg.norm(truth[query, 1:4] - truth[place, 1:4]) < 6
