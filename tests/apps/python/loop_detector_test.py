"""LoopDetector: detection, options, saving."""
import copy
import gc
import pickle
import re
import threading

import numpy as np
import pytest

import tutti


def summary(result):
    return (result.query, result.accepted, result.candidate, result.probability, result.hypothesis, result.reason,
            result.verification.inliers, [member.hypothesis for member in result.members])


def test_a_place_that_is_seen_again_is_a_loop(results, town):
    truth = tutti.Dataset(town).ground_truth()
    accepted = [result for result in results if result.accepted]
    assert len(accepted) >= 5
    for result in accepted:
        apart = np.linalg.norm(truth[result.query, 1:4] - truth[result.candidate, 1:4])
        assert apart < 6 and result.query - result.candidate > 50
        assert result.probability >= 0.975 and result.reason == ""
        assert result.verification.accepted and result.verification.candidate == result.candidate
        assert result.verification.type in ("fundamental", "essential")
    assert not any(result.accepted for result in results[:100])
    assert all(result.reason for result in results if not result.accepted)


def test_members_have_opinions_and_the_posterior_is_a_distribution(results):
    result = next(result for result in results if result.accepted)
    assert [member.name for member in result.members] == ["surf", "sift", "orb"]
    assert result.locations.dtype == np.int64 and result.posteriors.dtype == np.float64
    assert result.locations.shape == result.posteriors.shape and len(result.locations) > 100
    assert result.posteriors.sum() == pytest.approx(result.hypothesis, abs=1e-6)
    assert result.locations[result.posteriors.argmax()] == result.best
    assert result.posteriors.max() == pytest.approx(result.posterior)
    member = result.members[0]
    assert member.took_part and member.features > 50 and member.words > 1000
    assert member.evidence.dtype.names == ("location", "score", "likelihood", "posterior")
    assert (member.evidence["location"] == result.evidence["location"]).all()
    pixels = result.verification.query_pixels
    assert pixels.shape == (result.verification.inliers, 2) == result.verification.candidate_pixels.shape
    assert (pixels >= 0).all() and (pixels[:, 0] < 320).all() and (pixels[:, 1] < 160).all()


def test_without_keep_posterior_there_are_no_arrays(images):
    result = tutti.LoopDetector().detect(images[0])
    assert len(result.locations) == len(result.posteriors) == len(result.evidence) == 0


def test_arrays_outlive_their_result_and_are_read_only(images):
    detector = tutti.LoopDetector(keep_evidence=True, members=["orb"])
    for image in images[:14]:
        result = detector.detect(image)
    arrays = [result.posteriors, result.locations, result.members[0].evidence["posterior"],
              result.members[0].posteriors, result.verification.query_pixels]
    before = [array.copy() for array in arrays]
    assert len(before[0]) > 0
    member = result.members[0]
    del result, detector
    gc.collect()
    np.full(100000, 7.0)  # what was freed would be written over
    for array, value in zip(arrays, before):
        assert (array == value).all()
        with pytest.raises(ValueError, match="read-only"):
            array[...] = 0
    assert member.name == "orb"


def test_colour_is_blue_green_red_unless_rgb(images):
    rng = np.random.default_rng(1)
    tint = rng.uniform(0.5, 1.0, 3)
    bgr = [(image[:, :, None] * tint).astype(np.uint8) for image in images[:20]]
    detectors = [tutti.LoopDetector() for _ in range(3)]
    for image in bgr:
        as_bgr = detectors[0].detect(image)
        as_rgb = detectors[1].detect(np.ascontiguousarray(image[:, :, ::-1]), rgb=True)
        wrong = detectors[2].detect(np.ascontiguousarray(image[:, :, ::-1]))
        assert summary(as_bgr) == summary(as_rgb)
    assert [m.words for m in as_bgr.members] == [m.words for m in as_rgb.members]
    assert [m.words for m in as_bgr.members] != [m.words for m in wrong.members]


def test_views_of_arrays_are_as_good_as_copies(images):
    plain, padded, flipped = (tutti.LoopDetector() for _ in range(3))
    for image in images[:12]:
        wide = np.zeros((image.shape[0], image.shape[1] + 13), np.uint8)
        wide[:, 5:-8] = image
        upside_down = np.ascontiguousarray(image[::-1, ::-1])
        a, b, c = plain.detect(image), padded.detect(wide[:, 5:-8]), flipped.detect(upside_down[::-1, ::-1])
        assert summary(a) == summary(b) == summary(c)


def test_nothing_of_an_image_is_kept(images):
    given, copied = tutti.LoopDetector(), tutti.LoopDetector()
    buffer = np.empty_like(images[0])
    for image in images[::3]:
        buffer[...] = image
        a, b = given.detect(buffer), copied.detect(image)
        buffer[...] = 0
        assert summary(a) == summary(b)


@pytest.mark.parametrize("image, error, words", [
    (np.zeros((10, 10), np.float32), TypeError, "must be uint8 .*not float32 of shape .10, 10."),
    (np.zeros((10, 10), np.int64), TypeError, "not int64"),
    (np.zeros((10, 10, 4), np.uint8), ValueError, r"not uint8 of shape \(10, 10, 4\)"),
    (np.zeros((10, 10, 3), np.uint16), ValueError, "uint16"),
    (np.zeros(10, np.uint8), ValueError, "shape"),
    (np.zeros((0, 10), np.uint8), ValueError, "shape"),
    (np.zeros((10, 10, 128), np.uint8), ValueError, r"not uint8 of shape \(10, 10, 128\)"),
    ("image.png", TypeError, "image must be a numpy array.*not str"),
    (None, TypeError, "image is None, which cv2.imread returns for a file that it can't read"),
])
def test_a_wrong_image_is_refused_in_words(image, error, words):
    detector = tutti.LoopDetector()
    with pytest.raises(error, match=words):
        detector.detect(image)
    assert detector.last_id == -1


def test_hard_images_are_no_error():
    detector = tutti.LoopDetector()
    for image in [np.zeros((40, 40), np.uint8), np.full((1, 1), 9, np.uint8), np.zeros((5, 300, 3), np.uint8),
                  np.full((64, 64), 60000, np.uint16)]:
        assert not detector.detect(image).accepted


def test_nothing_to_look_at_is_no_image():
    detector = tutti.LoopDetector()
    for look in (detector.detect, detector.locate):
        with pytest.raises(TypeError, match="image is None"):
            look()


@pytest.mark.parametrize("copy_of", [copy.deepcopy, lambda value: pickle.loads(pickle.dumps(value))])
def test_results_and_cameras_are_pickled(results, copy_of):
    before = next(result for result in results if result.accepted)
    after = copy_of(before)
    assert summary(after) == summary(before) and repr(after) == repr(before)
    assert (after.posteriors == before.posteriors).all() and (after.evidence == before.evidence).all()
    assert (after.verification.query_pixels == before.verification.query_pixels).all()
    assert repr(copy_of(before.members[0])) == repr(before.members[0])
    camera = tutti.Camera(width=320, height=240, fx=200, fy=201, cx=160, cy=120, distortion="radtan",
                          coefficients=[-0.2, 0.1, 0, 0, 0])
    assert repr(copy_of(camera)) == repr(camera) and copy_of(camera).coefficients == camera.coefficients
    prior = copy_of(tutti.PosePrior((1, 2, 3), frame=4))
    assert list(prior.position_m) == [1, 2, 3] and prior.frame == 4
    assert copy_of(tutti.Config(run={"threads": 1})).options("run")["threads"] == 1


def test_a_damaged_pickle_is_refused(results):
    made = results[0].__reduce_ex__(2)
    for state in ((made[2][0], made[2][1][:-3]), (made[2][0], made[2][1] + b"x"), ("0.0", made[2][1]), (), (1, 2)):
        with pytest.raises(ValueError, match="pickle|damaged|tutti"):
            tutti.LoopResult.__new__(tutti.LoopResult).__setstate__(state)


def test_ids_must_grow(images):
    detector = tutti.LoopDetector()
    detector.detect(images[0], 7)
    assert detector.detect(images[1]).query == 8
    with pytest.raises(tutti.InputError, match="location 8: ids must grow") as caught:
        detector.detect(images[2], id=8)
    assert isinstance(caught.value, ValueError) and isinstance(caught.value, tutti.Error)
    assert detector.last_id == 8 and detector.num_locations == 2 and detector.num_long_term == 0


def test_options_are_those_of_the_configuration():
    detector = tutti.LoopDetector(stm_size=20, members=["orb"], extraction={"features": np.int64(300)},
                                  verification={"enabled": np.bool_(False)}, loop_threshold=1)
    options = detector.options
    assert options["stm_size"] == 20 and options["members"] == ["orb"] and options["loop_threshold"] == 1
    assert options["extraction"]["features"] == 300 and options["verification"]["enabled"] is False
    defaults = tutti.LoopDetector().options
    assert tutti.LoopDetector(**defaults).options == defaults
    assert tutti.LoopDetector(preset="paper-2013", stm_size=7).options["stm_size"] == 7


@pytest.mark.parametrize("options, error, words", [
    ({"stm_siz": 20}, TypeError, r"LoopDetector: unknown key 'stm_siz'; did you mean 'stm_size'\?"),
    ({"features": 300}, TypeError, r"unknown key 'features'; did you mean 'extraction.features'\?"),
    ({"extraction": {"feature": 3}}, TypeError, r"in extraction: unknown key 'feature'; did you mean 'features'\?"),
    ({"extraction": 3}, ValueError, "extraction needs a dict"),
    ({"stm_size": 0}, ValueError, "stm_size must be at least 1, not 0"),
    ({"stm_size": 2.5}, ValueError, "stm_size: '2.5' is not a whole number"),
    ({"stm_size": True}, ValueError, "stm_size: 'true' is not a whole number"),
    ({"loop_threshold": float("nan")}, ValueError, "finite"),
    ({"rule": "jont"}, ValueError, "joint"),
    ({"members": ["surf", "soft"]}, ValueError, "sift"),
    ({"members": object()}, ValueError, "no number, text"),
    ({"preset": "paper"}, ValueError, "paper-2013"),
])
def test_a_wrong_option_names_the_right_one(options, error, words):
    with pytest.raises(error, match=words):
        tutti.LoopDetector(**options)


def test_a_saved_detector_goes_on_as_the_one_that_was_saved(images, tmp_path):
    first = tutti.LoopDetector()
    for image in images[:60]:
        first.detect(image)
    first.save(tmp_path / "places.tutti")
    second = tutti.LoopDetector()
    second.load(str(tmp_path / "places.tutti"))
    for image in images[60:100]:
        assert summary(first.detect(image)) == summary(second.detect(image))


def test_errors_of_files_are_oserrors(tmp_path):
    detector = tutti.LoopDetector()
    with pytest.raises(OSError, match=re.escape(str(tmp_path / "none"))) as caught:
        detector.load(tmp_path / "none")
    assert isinstance(caught.value, tutti.FileError)
    with pytest.raises(tutti.FileError):
        detector.save(tmp_path / "no" / "folder")
    damaged = tmp_path / "damaged"
    damaged.write_bytes(b"nothing")
    with pytest.raises(tutti.InputError) as caught:
        detector.load(damaged)
    assert not isinstance(caught.value, OSError)


def test_locate_says_where_and_changes_nothing(images):
    detector = tutti.LoopDetector()
    for image in images[:40]:
        detector.detect(image)
    found = detector.locate(images[10])
    assert found.accepted and abs(found.candidate - 10) <= 1
    assert detector.num_locations == 40 and detector.last_id == 39


def test_depth_gives_a_metric_pose():
    rng = np.random.default_rng(3)
    small = rng.integers(0, 255, (40, 60)).astype(np.uint8)
    image = np.kron(small, np.ones((8, 8), np.uint8))
    camera = tutti.Camera(width=480, height=320, fx=300, fy=300, cx=239.5, cy=159.5)
    depth = 3 + 2 * rng.random((40, 60)).astype(np.float32)
    depth = np.kron(depth, np.ones((8, 8), np.float32))
    detector = tutti.LoopDetector(stm_size=1)
    for other in [image, *rng.integers(0, 255, (3, 320, 480)).astype(np.uint8)]:
        detector.detect(other, camera=camera, depth=depth)
    found = detector.locate(image, camera=camera, depth=depth)
    assert found.accepted and found.verification.type == "rigid"
    np.testing.assert_allclose(found.verification.S_candidate_query, np.eye(4), atol=0.01)
    assert found.verification.information.shape == (6, 6)
    with pytest.raises(TypeError, match="depth must be metres as float32"):
        detector.detect(image, camera=camera, depth=(1000 * depth).astype(np.uint16))
    with pytest.raises(tutti.InputError, match="as large as the image"):
        detector.detect(image, camera=camera, depth=depth[::2])


def own_features(image, rng_seed=0):
    """Random patches: the same seed looks at the same pixels."""
    rng = np.random.default_rng(rng_seed)
    keypoints = np.column_stack([rng.uniform(20, image.shape[1] - 20, 200), rng.uniform(20, image.shape[0] - 20, 200)])
    patches = [image[int(y) - 8:int(y) + 8:2, int(x) - 8:int(x) + 8:2].astype(np.float32).ravel() for x, y in keypoints]
    return keypoints, np.array(patches) / 255


def test_own_features_are_a_member(images):
    detector = tutti.LoopDetector(members=["orb", "mine", "whole"], external_members=["mine", "whole"],
                                  dense_members=["whole"])
    assert detector.options["external_members"] == ["mine", "whole"]
    for image in images[:30]:
        whole = image[::10, ::10].astype(np.float32).ravel()
        keypoints, descriptors = own_features(image)
        result = detector.detect(image, member_features={"mine": (keypoints, descriptors), "whole": whole})
        descriptors[...] = 0  # they are copied
    assert [m.name for m in result.members] == ["orb", "mine", "whole"]
    assert result.members[1].features == 200 and result.members[1].words > 1000 and result.members[2].features == 1
    with pytest.raises(tutti.InputError, match="mine"):
        detector.detect(images[30])
    with pytest.raises(TypeError, match=r"member_features\['mine'\] must be \(keypoints, descriptors\)"):
        detector.detect(images[30], member_features={"mine": 3, "whole": whole})
    with pytest.raises(TypeError, match="descriptors must be uint8 or float32"):
        detector.detect(images[30], member_features={"mine": (keypoints, descriptors.astype(float)), "whole": whole})


def test_a_mask_hides_features(images):
    mask = np.zeros(images[0].shape, bool)
    mask[:, :160] = True
    seen, hidden = tutti.LoopDetector(), tutti.LoopDetector()
    for image in images[:3]:
        all_of_it, half = seen.detect(image), hidden.detect(image, mask=mask)
    assert half.members[2].features < all_of_it.members[2].features
    with pytest.raises(tutti.InputError):
        hidden.detect(images[3], mask=mask[::2])


def test_a_pose_prior_is_checked(images):
    detector = tutti.LoopDetector()
    detector.detect(images[0], pose_prior=tutti.PosePrior((0, 0, 0), sigma_m=2))
    with pytest.raises(tutti.InputError, match="pose_prior needs a finite position"):
        detector.detect(images[1], pose_prior=tutti.PosePrior((0, float("nan"), 0)))


def test_threads_take_turns(images):
    """Ids are given by the detector: each is given once, and other threads run meanwhile."""
    detector = tutti.LoopDetector(members=["orb"])
    queries, ticks, done = [], [], threading.Event()

    def work():
        for image in images[:15]:
            queries.append(detector.detect(image).query)

    threads = [threading.Thread(target=work) for _ in range(3)]
    for thread in threads:
        thread.start()
    while any(thread.is_alive() for thread in threads):
        ticks.append(detector.last_id)
        done.wait(0.001)
    assert sorted(queries) == list(range(45)) and len(ticks) > 5
