"""Dataset and SlamSystem."""
import gc
import pickle
import shutil

import numpy as np
import pytest

import tutti

CONFIG = {"odometry": {"features": 600}}


@pytest.fixture(scope="module")
def run(stereo):
    """All frames of the town, tracked."""
    slam = tutti.SlamSystem(stereo.rig, **CONFIG)
    results = [slam.track(frame) for frame in stereo]
    slam.finish()
    return slam, results


def test_a_data_set_gives_its_frames(stereo, town):
    dataset = stereo
    assert len(dataset) == 151 and dataset.rig.sensor == "stereo" and dataset.rig.baseline_m == pytest.approx(0.54)
    frames = list(dataset)
    assert [frame.index for frame in frames] == list(range(151))
    assert frames[4].stamp == dataset.stamp(4) == dataset[4].stamp == dataset.ground_truth()[4, 0]
    frame = dataset[-1]
    assert frame.index == 150 and frame.depth is None
    assert frame.image.shape == frame.right.shape == (160, 320) and frame.image.dtype == np.uint8
    assert dataset.colour(3).shape == (160, 320, 3)
    assert dataset.ground_truth_file.name == "poses.txt"
    with pytest.raises(IndexError, match="151"):
        dataset[151]
    assert [frame.index for frame in tutti.Dataset(town, start=5, end=12, stride=3)] == [5, 8, 11]


def test_pixels_outlive_frame_and_data_set(town):
    dataset = tutti.Dataset(town)
    iterator = iter(dataset)
    del dataset
    gc.collect()
    image = next(iterator).image
    before = image.copy()
    del iterator
    gc.collect()
    np.zeros((500, 320, 160), np.uint8)
    assert (image == before).all() and not image.flags.writeable


def test_a_frame_that_cannot_be_read_is_left_out_with_a_warning(town, tmp_path):
    copy = tmp_path / "town"
    shutil.copytree(town, copy)
    (copy / "image_0" / "000003.png").write_bytes(b"no image")
    dataset = tutti.Dataset(copy, end=6)
    with pytest.warns(RuntimeWarning, match="000003.png"):
        assert [frame.index for frame in dataset] == [0, 1, 2, 4, 5]
    with pytest.raises(OSError, match="000003.png"):
        dataset[3]


def test_what_is_no_data_set_is_refused(town, tmp_path):
    with pytest.raises(OSError, match="nowhere"):
        tutti.Dataset(tmp_path / "nowhere")
    with pytest.raises(tutti.InputError):
        tutti.Dataset(tmp_path)
    with pytest.raises(TypeError, match="did you mean 'stride'"):
        tutti.Dataset(town, strid=2)
    with pytest.raises(tutti.InputError, match="stride must be at least 1, not 0"):
        tutti.Dataset(town, stride=0)


def test_slam_follows_the_camera_and_closes_the_loop(run, town):
    slam, results = run
    assert [r.state for r in results] == ["tracking"] * 151
    trajectory = slam.trajectory()
    assert trajectory.shape == (151, 8)
    error = tutti.evaluate(tutti.Dataset(town).ground_truth(), trajectory)
    assert error["ate"]["rmse"] < 0.6
    accepted = [loop for loop in slam.loops if loop.accepted]
    assert accepted and accepted[0].query > 100 > accepted[0].candidate
    assert accepted[0].S_candidate_query.shape == (4, 4)
    assert [member.name for member in accepted[0].members] == ["surf", "sift", "orb"]
    assert all(loop.reason for loop in slam.loops if not loop.accepted)
    assert not slam.appearance_only and slam.stage_ms and slam.take_warnings() == []


def test_keyframes_and_landmarks_are_arrays(run):
    slam, results = run
    ids = slam.keyframe_ids
    assert ids == [r.keyframe for r in results if r.keyframe >= 0]
    assert slam.keyframe_trajectory().shape == (len(ids), 8)
    keyframe = slam.keyframe(ids[3])
    n = len(keyframe.pixels)
    assert n > 100 and keyframe.descriptors.shape == (n, 32) and keyframe.points.shape == (n, 3)
    assert keyframe.landmarks.shape == (n,) and keyframe.T_world_camera.shape == (4, 4)
    assert slam.landmarks().shape[1] == 3 and len(slam.landmarks()) > 500
    with pytest.raises(IndexError, match="no keyframe 12345"):
        slam.keyframe(12345)
    graph = slam.graph()
    assert graph.ids.tolist() == ids and graph.optimize().success


def test_frames_from_arrays_are_as_good(stereo):
    a, b = (tutti.SlamSystem(stereo.rig, **CONFIG) for _ in range(2))
    buffer = np.empty((160, 320), np.uint8)
    for frame in [stereo[i] for i in range(12)]:
        buffer[...] = frame.image
        made = tutti.Frame(buffer, frame.stamp, frame.index, right=frame.right)
        buffer[...] = 0
        a.track(frame), b.track(made)
    a.finish(), b.finish()
    assert (a.trajectory() == b.trajectory()).all()


def test_frames_carry_the_measurements_of_an_imu(stereo):
    imu = np.column_stack([np.arange(5) * 0.005, np.tile([0.1, 0.2, 0.3, 0, 0, 9.8], (5, 1))])
    frame = tutti.Frame(stereo[0].image, 0.02, right=stereo[0].right, imu=imu)
    assert (frame.imu == imu).all() and (pickle.loads(pickle.dumps(frame)).imu == imu).all()
    assert stereo[0].imu.shape == (0, 7)
    mounted = tutti.Rig(stereo.rig.camera, "stereo", baseline_m=0.5, T_camera_imu=[0, 0, 0.1, 0, 0, 0, 1])
    assert mounted.T_camera_imu[2, 3] == 0.1 and stereo.rig.T_camera_imu is None
    assert pickle.loads(pickle.dumps(mounted)).T_camera_imu[2, 3] == 0.1
    with pytest.raises(ValueError, match="imu"):
        tutti.Frame(stereo[0].image, 0.02, imu=imu[:, :4])


def test_a_saved_map_goes_on_and_locates(stereo, tmp_path):
    frames = [stereo[i] for i in range(40)]
    slam = tutti.SlamSystem(stereo.rig, **CONFIG)
    for frame in frames[:30]:
        slam.track(frame)
    slam.save(tmp_path / "map.tutti")
    again = tutti.SlamSystem.load(tmp_path / "map.tutti", threads=1)
    for frame in frames[30:40]:
        slam.track(frame), again.track(frame)
    slam.finish(), again.finish()
    assert (slam.trajectory() == again.trajectory()).all()
    again.begin_localization()
    states = [again.track(frame).state for frame in frames[15:25]]
    assert states[-1] == "tracking"


def test_what_does_not_fit_is_refused(town, tmp_path):
    camera = tutti.Camera(width=320, height=160, fx=180, fy=180, cx=160, cy=80)
    with pytest.raises(tutti.InputError, match="baseline"):
        tutti.SlamSystem(tutti.Rig(camera, "stereo"))
    with pytest.raises(tutti.InputError, match="mono, stereo, rgbd"):
        tutti.Rig(camera, "lidar")
    with pytest.raises(TypeError, match="did you mean 'run.threads'|did you mean 'threads'"):
        tutti.SlamSystem(tutti.Rig(camera), run={"thread": 1})
    with pytest.raises(OSError, match="none"):
        tutti.SlamSystem.load(tmp_path / "none")
    with pytest.raises(ValueError, match="right must be as large as image"):
        tutti.Frame(np.zeros((10, 10), np.uint8), 0.0, right=np.zeros((9, 10), np.uint8))


def test_a_configuration_is_a_file_and_keywords(town, tmp_path):
    config = tutti.Config(town / "config.yaml", run={"threads": 1})
    assert config.options("run")["threads"] == 1 and config.options("camera")["width"] == 320
    assert len(tutti.Dataset(town, config)) == 151
    bad = tmp_path / "bad.yaml"
    bad.write_text("run:\n  thread: 1\n")
    with pytest.raises(tutti.InputError, match=r"bad.yaml:2: unknown key 'thread'.*did you mean 'threads'"):
        tutti.Config(bad)
    with pytest.raises(OSError, match="none.yaml"):
        tutti.Config(tmp_path / "none.yaml")
    assert "threads = 2: most threads" in tutti.describe("run")


def test_what_a_run_gives_is_pickled(run, stereo):
    slam, results = run
    after = pickle.loads(pickle.dumps((slam.trajectory(), results, slam.loops, stereo.rig, stereo[3])))
    assert (after[0] == slam.trajectory()).all()
    assert [repr(result) for result in after[1]] == [repr(result) for result in results]
    assert [repr(loop) for loop in after[2]] == [repr(loop) for loop in slam.loops] and after[2]
    assert after[3].baseline_m == stereo.rig.baseline_m and repr(after[3].camera) == repr(stereo.rig.camera)
    assert (after[4].image == stereo[3].image).all() and (after[4].right == stereo[3].right).all()


def test_a_frame_of_a_missing_image_is_refused():
    with pytest.raises(TypeError, match="image is None, which cv2.imread returns"):
        tutti.Frame(None, 0.0)


def test_a_frame_of_another_size_is_refused(stereo):
    slam = tutti.SlamSystem(stereo.rig)
    with pytest.raises(tutti.InputError, match="frame 0: image must have 320x160 pixels, and has 100x100"):
        slam.track(tutti.Frame(np.zeros((100, 100), np.uint8), 0.0))
