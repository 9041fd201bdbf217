"""TrajectoryCloser and close: the truth of the town, with a heading and a scale that drift."""
import warnings

import numpy as np
import pytest

import tutti

CONFIG = {"odometry": {"features": 600}}


def disturbed(truth, seed=3):
    """The steps of a trajectory (N, 8) with a random walk of yaw."""
    rng = np.random.default_rng(seed)
    given = tutti.pose_matrices(truth)
    out = [given[0]]
    for before, after in zip(given, given[1:]):
        step = np.linalg.inv(before) @ after
        yaw = np.radians(0.5) * np.linalg.norm(step[:3, 3]) ** 0.5 * rng.normal()
        turn = np.eye(4)
        turn[0, [0, 2]], turn[2, [0, 2]] = [np.cos(yaw), np.sin(yaw)], [-np.sin(yaw), np.cos(yaw)]
        out.append(out[-1] @ step @ turn)
    return np.column_stack([truth[:, 0], tutti.poses_of_matrices(np.array(out))])


def drift(truth, estimate):
    """Of the last pose, seen from the earlier one that is nearest to it in truth [m]."""
    t, e = tutti.pose_matrices(truth), tutti.pose_matrices(estimate)
    near = np.argmin(np.linalg.norm(t[:75, :3, 3] - t[-1, :3, 3], axis=1))
    seen = [np.linalg.inv(p[near]) @ p[-1] for p in (t, e)]
    return np.linalg.norm(seen[0][:3, 3] - seen[1][:3, 3])


@pytest.fixture(scope="module")
def odometry(stereo):
    return disturbed(stereo.ground_truth())


@pytest.fixture(scope="module")
def closed(stereo, odometry):
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        closer = tutti.close(odometry, stereo, tutti.Config(**CONFIG))
    return closer, [str(warning.message) for warning in said]


def test_close_removes_the_drift_of_an_odometry(stereo, odometry, closed):
    closer, said = closed
    truth = stereo.ground_truth()
    corrected = closer.corrected(odometry)
    assert corrected.shape == odometry.shape and (corrected[:, 0] == odometry[:, 0]).all()
    assert drift(truth, corrected) < 0.2 * drift(truth, odometry)
    assert closer.corrections > 0 and sum(loop.accepted for loop in closer.loops) > 1
    assert len(closer.keyframes()) == len(closer.graph().ids)
    by_map = closer.T_map_odom @ tutti.pose_matrices(odometry)[-1]
    assert np.linalg.norm(by_map[:3, 3] - corrected[-1, 1:4]) < 0.05


def test_the_images_say_that_the_odometry_is_worse_than_configured(closed):
    assert any("the images contradict the odometry" in words for words in closed[1])


def test_pushing_frame_by_frame_is_the_same(stereo, odometry, closed):
    closer = tutti.TrajectoryCloser(stereo.rig, **CONFIG)
    for frame, pose in zip(stereo, tutti.pose_matrices(odometry)):
        assert closer.push(frame, pose).state == "tracking"
    closer.finish()
    difference = np.abs(closer.corrected(odometry) - closed[0].corrected(odometry)).max()
    assert difference < 1e-6  # poses as matrices and as quaternions round differently


def test_what_can_not_be_used_is_refused(stereo, odometry):
    with pytest.raises(tutti.InputError, match="no pose for any image"):
        tutti.close(odometry + [1e6, 0, 0, 0, 0, 0, 0, 0], stereo)
    with pytest.raises(ValueError, match="odometry"):
        tutti.close(odometry[:, :5], stereo)
    with pytest.raises(TypeError, match="did you mean"):
        tutti.TrajectoryCloser(stereo.rig, odometri={})
    closer = tutti.TrajectoryCloser(stereo.rig, **CONFIG)
    with pytest.raises(tutti.InputError, match="T_odom_body"):
        closer.push(stereo[0], np.full((4, 4), np.nan))
    with pytest.raises(tutti.InputError, match="standard deviation"):
        closer.push(stereo[0], np.eye(4), sigma=(-1, 0))
    closer.push(stereo[0], np.eye(4), sigma=(0.01, 0.001))
    with pytest.raises(tutti.InputError, match="does not grow"):
        closer.push(stereo[0], np.eye(4))
