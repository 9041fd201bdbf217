"""evaluate, and trajectories as files and arrays."""
import json
import os
import subprocess

import numpy as np
import pytest

import tutti


def circle(n=200):
    """(N, 8): once around, 10 m wide, looking ahead."""
    angle = np.linspace(-np.pi, np.pi, n)
    zero = np.zeros(n)
    return np.column_stack([0.1 * np.arange(n), 10 * np.cos(angle), 10 * np.sin(angle), zero,
                            zero, zero, np.sin(angle / 2), np.cos(angle / 2)])


def noisy(trajectory, sigma=0.05):
    other = trajectory.copy()
    other[:, 1:4] += np.random.default_rng(2).normal(size=(len(other), 3)) * sigma
    return other


def test_a_moved_copy_has_no_error():
    truth = circle()
    moved = truth.copy()
    moved[:, 1:4] += [3, -2, 1]
    result = tutti.evaluate(truth, moved)
    assert result["pairs"] == 200 and result["ate"]["rmse"] < 1e-9
    np.testing.assert_allclose(result["alignment"]["translation"], [-3, 2, -1], atol=1e-9)
    assert tutti.evaluate(truth, moved, "none")["ate"]["rmse"] == pytest.approx(np.sqrt(14))


def test_scale_is_taken_out_by_sim3_alone():
    truth = circle()
    small = truth.copy()
    small[:, 1:4] /= 4
    assert tutti.evaluate(truth, small)["ate"]["rmse"] > 1
    result = tutti.evaluate(truth, small, alignment="sim3")
    assert result["ate"]["rmse"] < 1e-9 and result["alignment"]["scale"] == pytest.approx(4)


def test_the_errors_are_lists_of_plain_numbers():
    truth = circle()
    result = tutti.evaluate(truth, noisy(truth), "none")
    errors = result["errors"]
    assert {len(values) for values in errors.values()} == {200}
    assert result["ate"]["rmse"] == pytest.approx(np.sqrt(np.mean(np.square(errors["translation"]))))
    json.dumps(result)  # nothing of numpy's
    assert "errors" not in tutti.evaluate(truth, truth, errors=False)


def test_it_says_what_the_command_says(tmp_path):
    truth, estimate = circle(), noisy(circle())
    tutti.write_trajectory(tmp_path / "truth.txt", truth)
    tutti.write_trajectory(tmp_path / "estimate.csv", estimate, format="euroc")
    out = tmp_path / "result.json"
    subprocess.run([os.environ["TUTTI_EXECUTABLE"], "evaluate", "--reference", tmp_path / "truth.txt", "--estimate",
                    tmp_path / "estimate.csv", "--rpe-delta", "2", "--rpe-unit", "metres", "--json", out],
                   check=True, capture_output=True)
    said = json.loads(out.read_text())
    mine = tutti.evaluate(tmp_path / "truth.txt", str(tmp_path / "estimate.csv"), rpe_delta=2, rpe_unit="metres",
                          errors=False)
    assert mine == {key: value for key, value in said.items() if key not in ("reference", "estimate", "name")}


@pytest.mark.parametrize("format", ["tum", "euroc", "kitti"])
def test_files_have_the_same_trajectory(tmp_path, format):
    truth = circle()
    file = tmp_path / "file"
    tutti.write_trajectory(file, truth, format)
    again = tutti.read_trajectory(file, times=truth[:, 0] if format == "kitti" else [])
    np.testing.assert_allclose(again[:, :4], truth[:, :4], atol=1e-6)
    np.testing.assert_allclose(tutti.pose_matrices(again), tutti.pose_matrices(truth), atol=1e-6)


def test_what_a_file_is_taken_for_is_a_warning(tmp_path):
    tutti.write_trajectory(tmp_path / "truth", circle())
    lines = (tmp_path / "truth").read_text().splitlines()
    (tmp_path / "twice").write_text("\n".join(lines[:3] + lines[2:]))
    with pytest.warns(RuntimeWarning, match="twice:4"):
        assert tutti.read_trajectory(tmp_path / "twice").shape == (200, 8)
    with pytest.warns(RuntimeWarning, match="twice:4"):
        assert tutti.evaluate(tmp_path / "truth", tmp_path / "twice")["ate"]["rmse"] < 1e-9


def test_matrices_and_poses_are_the_same():
    truth = circle()
    matrices = tutti.pose_matrices(truth)
    assert matrices.shape == (200, 4, 4)
    np.testing.assert_allclose(matrices, tutti.pose_matrices(truth[:, 1:]))
    poses = tutti.poses_of_matrices(matrices)
    assert poses.shape == (200, 7)
    np.testing.assert_allclose(abs(poses[:, 3:]), abs(truth[:, 4:]), atol=1e-9)  # q and -q are the same
    np.testing.assert_allclose(tutti.pose_matrices(poses), matrices, atol=1e-9)
    # x of the body looks away from the centre
    np.testing.assert_allclose(matrices[:, :3, 0], truth[:, 1:4] / 10, atol=1e-9)
    assert (tutti.poses_of_matrices(matrices[:, :3]) == poses).all()


def test_what_is_no_trajectory_is_refused(tmp_path):
    truth = circle()
    for call, error, words in [
            (lambda: tutti.evaluate(truth, truth[:, :7]), ValueError, r"estimate must be of shape \(N, 8\)"),
            (lambda: tutti.evaluate(truth, truth[::-1]), tutti.InputError, "estimate, row 1: time stamps must grow"),
            (lambda: tutti.evaluate(truth, truth * np.nan), tutti.InputError, "estimate, row 0"),
            (lambda: tutti.evaluate(truth, truth + np.eye(8)[0] * 100), tutti.InputError, "estimate against reference"),
            (lambda: tutti.evaluate(truth, truth, "se4"), tutti.InputError, "se3"),
            (lambda: tutti.evaluate(truth, truth, rpe_delta=-1), tutti.InputError, "rpe_delta|delta"),
            (lambda: tutti.evaluate(truth, None), TypeError, "estimate must be an array"),
            (lambda: tutti.evaluate(truth, tmp_path / "none.txt"), OSError, "none.txt"),
            (lambda: tutti.write_trajectory(tmp_path / "no" / "file", truth), OSError, "file"),
            (lambda: tutti.pose_matrices(truth[:, :4]), ValueError, "shape"),
            (lambda: tutti.poses_of_matrices(np.zeros((2, 4, 4))), tutti.InputError, "matrices, 0"),
    ]:
        with pytest.raises(error, match=words):
            call()


def test_files_may_have_nanoseconds_named_columns_and_positions_alone(tmp_path):
    truth, estimate = circle(), noisy(circle())
    ate = tutti.evaluate(truth, estimate)["ate"]["rmse"]
    rows = [",".join(f"{v:.9f}" for v in row[1:4]) for row in estimate]
    file = tmp_path / "leica.csv"
    file.write_text("time,x,y,z\n" + "".join(f"{round(1e9 * s)},{row}\n" for s, row in zip(estimate[:, 0], rows)))
    with pytest.warns(RuntimeWarning, match="nanoseconds"):
        alone = tutti.read_trajectory(file, format="tum")
    np.testing.assert_allclose(alone[:, :4], estimate[:, :4], atol=1e-8)
    assert not alone[:, 4:].any()
    for one in (file, alone):
        result = tutti.evaluate(truth, one)
        assert result["ate"]["rmse"] == pytest.approx(ate, abs=1e-7)
        assert result["rotations"] is False and result["ate_rotation_deg"] is None
    tutti.write_trajectory(tmp_path / "again.txt", alone)
    assert not tutti.read_trajectory(tmp_path / "again.txt")[:, 4:].any()
