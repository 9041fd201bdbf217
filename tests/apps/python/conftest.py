"""A small town with a loop, rendered once, for all tests of the Python module.

TUTTI_EXECUTABLE is the program that renders it, TUTTI_SOURCE the source tree.
"""
import os
import pathlib
import subprocess

import numpy as np
import pytest

import tutti


@pytest.fixture(scope="session")
def town(tmp_path_factory):
    """Folder in KITTI's layout: 151 stereo pairs of 320 x 160; the last 25 or so are where the first were."""
    folder = tmp_path_factory.mktemp("data") / "town"
    command = [os.environ["TUTTI_EXECUTABLE"], "generate", "--out", folder, "--sensor", "stereo", "--blocks-x", "1",
               "--blocks-y", "1", "--width", "320", "--height", "160", "--block", "26", "--laps", "1.2", "--rate", "4"]
    subprocess.run(command, check=True, capture_output=True)
    return folder


@pytest.fixture(scope="session")
def stereo(town):
    """It as a data set with both cameras."""
    return tutti.Dataset(town, tutti.Config(town / "config.yaml"))


@pytest.fixture(scope="session")
def source():
    return pathlib.Path(os.environ["TUTTI_SOURCE"])


@pytest.fixture(scope="session")
def images(town):
    """Its left images, as arrays of their own."""
    return [np.array(frame.image) for frame in tutti.Dataset(town)]


@pytest.fixture(scope="session")
def results(images):
    """What a detector that keeps everything says of them."""
    detector = tutti.LoopDetector(keep_evidence=True)
    return [detector.detect(image) for image in images]
