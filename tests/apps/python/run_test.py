"""tutti.run: what one call does on the command line."""
import subprocess
import os

import numpy as np
import pytest

import tutti


@pytest.fixture(scope="module")
def finished(town):
    return tutti.run(town, quiet=True, run={"threads": 2})


def test_it_is_the_run_of_the_command_line(town, finished, tmp_path):
    subprocess.run([os.environ["TUTTI_EXECUTABLE"], "run", town, "--out", tmp_path / "out", "--no-report", "--quiet"], check=True, capture_output=True)
    written = tmp_path / "python.txt"
    finished.write_trajectory(written)
    np.testing.assert_allclose(np.loadtxt(written), np.loadtxt(tmp_path / "out" / "trajectory.txt"), atol=1e-6)


def test_it_gives_a_result_for_each_frame(town):
    run = tutti.run(town, quiet=True, dataset={"end": 20})
    states = [(run.frame.index, result.state) for result in run]
    assert [index for index, _ in states] == list(range(20))
    assert states[-1][1] == "tracking"
    assert len(run.trajectory()) == 20


def test_it_is_judged_against_the_ground_truth_beside_it(finished):
    assert finished.evaluate()["ate"]["rmse"] < 0.5
    assert len(finished.loops) > 0 and len(finished.landmarks()) > 100
    assert len(finished.graph().ids) == len(finished.slam.keyframe_ids)


def test_what_was_recognised_is_said(town, capsys):
    run = tutti.run(town, dataset={"end": 3})
    assert any("stereo" in finding for finding in run.findings)
    assert "stereo" in capsys.readouterr().err


def test_a_map_goes_on_in_other_calls(finished, tmp_path):
    finished.save(tmp_path / "map.tutti")
    assert tutti.SlamSystem.load(tmp_path / "map.tutti").keyframe_ids == finished.slam.keyframe_ids


def test_a_table_and_a_picture(finished, tmp_path):
    pytest.importorskip("pandas", reason="skipped: no pandas (Debian: python3-pandas)")
    pytest.importorskip("matplotlib", reason="skipped: no matplotlib (Debian: python3-matplotlib)")
    assert list(finished.table().columns) == ["x", "y", "z", "qx", "qy", "qz", "qw"]
    finished.plot(tmp_path / "map.png")
    assert (tmp_path / "map.png").read_bytes().startswith(b"\x89PNG")


def test_wrong_input_is_said_in_python(town, finished, tmp_path):
    with pytest.raises(tutti.FileError, match="absent"):
        tutti.run(tmp_path / "absent")
    with pytest.raises(tutti.InputError, match="config"):
        tutti.run(town, town / "config.yaml", fov=70)
    with pytest.raises(TypeError, match="thread"):
        tutti.run(town, run={"thread": 1})
    with pytest.raises(tutti.InputError, match="no depth images"):
        finished.dense()
