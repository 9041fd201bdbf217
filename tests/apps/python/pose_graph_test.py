"""PoseGraph: building, files, solutions, interruption."""
import os
import signal
import threading
import time

import numpy as np
import pytest

import tutti


def square(false_loop=True):
    """The graph of examples/04: a square whose odometry does not close, a true loop and a false one."""
    graph = tutti.PoseGraph()
    pose = np.eye(4)
    graph.add_pose(0, pose, fixed=True)
    for k in range(1, 41):
        turn = np.pi / 2 - 0.0174533 if k % 10 == 0 else 0.0
        step = np.eye(4)
        step[:2, :2] = [[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]]
        step[0, 3] = 1.01
        pose = pose @ step
        graph.add_pose(k, pose)
        graph.add_edge(k - 1, k, step, sigmas=(0.03, 0.01))
    graph.add_edge(0, 40, [0, 0, 0, 0, 0, 0, 1], np.diag([400.0] * 3 + [2500.0] * 3))
    if false_loop:
        graph.add_edge(5, 25, np.eye(4), sigmas=(0.05, 0.02))
    return graph


def test_a_false_loop_is_found_and_the_square_closes():
    graph = square()
    before = np.linalg.norm(graph.poses[-1, :3])
    report = graph.optimize(robust="gnc")
    assert report.success and report.termination == "converged" and report.reason == ""
    assert np.linalg.norm(graph.poses[-1, :3]) < 0.1 < before
    assert report.weights.shape == report.chi2.shape == report.down_weighted.shape == (42,)
    assert report.down_weighted.tolist() == [False] * 41 + [True]
    assert report.costs["chi2log"] > 0 and report.objective < report.initial_objective


def test_edges_and_poses_are_columns():
    graph = square()
    assert graph.kind == "se3" and graph.ids.tolist() == list(range(41))
    assert graph.poses.shape == (41, 7) and (graph.scales == 1).all()
    edges = graph.edges
    assert edges["loop"].tolist() == [False] * 40 + [True, True]
    assert (edges["from"][-1], edges["to"][-1]) == (5, 25)
    np.testing.assert_allclose(edges["measurement"][0], [1.01, 0, 0, 0, 0, 0, 1])
    np.testing.assert_allclose(tutti.pose_matrices(graph.poses)[7], graph.pose(7), atol=1e-12)
    graph.set_pose(7, [1, 2, 3, 0, 0, 0, 2])
    np.testing.assert_allclose(graph.poses[7], [1, 2, 3, 0, 0, 0, 1])


def test_a_file_has_the_same_graph(tmp_path):
    graph = square()
    graph.write_g2o(tmp_path / "graph.g2o")
    again = tutti.PoseGraph.read_g2o(str(tmp_path / "graph.g2o"))
    np.testing.assert_allclose(again.poses, graph.poses, atol=1e-12)
    assert again.costs() == pytest.approx(graph.costs(), rel=1e-9)


def test_edges_between_neighbours_among_the_ids_are_odometry_whenever_the_nodes_came():
    graph = tutti.PoseGraph("se2")
    for id in (100, 300, 200):
        graph.add_pose(id, [0, 0, 0])
        if id == 300:
            graph.add_edge(100, 300, [2, 0, 0], sigmas=(0.1, 0.1))  # 200 comes between them later
    graph.add_edge(100, 200, [1, 0, 0], sigmas=(0.1, 0.1))
    graph.add_edge(200, 300, [1, 0, 0], sigmas=(0.1, 0.1))
    assert graph.edges["loop"].tolist() == [True, False, False]


def test_landmarks_and_large_ids_of_a_file_are_kept(tmp_path):
    file = tmp_path / "graph.g2o"
    file.write_text("EDGE_SE2 6989586621679009792 6989586621679009793 1 0 0 1 0 0 1 0 1\n"
                    "EDGE_SE2_XY 6989586621679009792 7 1 2 1 0 1\nRANGE 1 2\n")
    with pytest.raises(tutti.InputError, match="RANGE"):
        tutti.PoseGraph.read_g2o(file)
    with pytest.warns(RuntimeWarning, match="RANGE"):
        graph = tutti.PoseGraph.read_g2o(file, ignore_unknown=True)
    assert graph.ids.tolist() == [6989586621679009792, 6989586621679009793]
    assert graph.optimize().success and graph.landmark_ids.tolist() == [7]
    np.testing.assert_allclose(graph.landmarks, [[1, 2, 0]], atol=1e-9)
    graph.write_g2o(file)
    assert "VERTEX_XY 7 " in file.read_text() and "EDGE_SE2_XY 6989586621679009792 7 1 2" in file.read_text()


def test_a_solution_is_certified():
    graph = square(false_loop=False)
    graph.optimize(objective="chi2log")
    certificate = graph.certify()
    assert certificate.available and certificate.certified and certificate.reason == ""
    assert certificate.relative_gap < 1e-6


def test_planar_graphs_and_graphs_with_scale():
    planar = tutti.PoseGraph("se2")
    planar.add_pose(0, [0, 0, 0])
    planar.add_pose(1, [1, 0, 0.5])
    planar.add_edge(0, 1, [1, 0, 0], np.eye(3))
    assert planar.optimize().success
    np.testing.assert_allclose(planar.pose(1), [[1, 0, 0, 1], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]], atol=1e-6)
    scaled = tutti.PoseGraph("sim3")
    scaled.add_pose(0, np.eye(4))
    scaled.add_pose(1, [1, 0, 0, 0, 0, 0, 1, 2])
    scaled.add_edge(0, 1, np.diag([3.0, 3, 3, 1]), np.eye(7))
    assert scaled.scales.tolist() == [1, 2]
    assert scaled.optimize().success
    assert scaled.scales[1] == pytest.approx(3)
    assert not scaled.certify().available and "scale" in scaled.certify().reason


def test_what_is_no_graph_is_refused(tmp_path):
    graph = square()
    for call, error, words in [
            (lambda: tutti.PoseGraph("so3"), ValueError, "se2, se3, sim3"),
            (lambda: graph.add_pose(0, np.eye(4)), tutti.InputError, "0"),
            (lambda: graph.add_pose(99, np.zeros((4, 4))), tutti.InputError, "node 99: the matrix is no pose"),
            (lambda: graph.add_pose(99, [0, 0, 0]), ValueError, "x, y, z, qx, qy, qz, qw"),
            (lambda: graph.add_pose(99, [0, 0, 0, 0, 0, 0, 0]), tutti.InputError, "length 0"),
            (lambda: graph.add_pose(99, 2 * np.eye(4)), tutti.InputError, "no pose"),
            (lambda: graph.add_pose(99, "x"), TypeError, "numbers"),
            (lambda: graph.add_edge(0, 77, np.eye(4), np.eye(6)), tutti.InputError, "77"),
            (lambda: graph.add_edge(0, 2, np.eye(4), np.eye(7)), ValueError, "information"),
            (lambda: graph.add_edge(0, 2, np.eye(4), -np.eye(6)), tutti.InputError, "positive"),
            (lambda: graph.add_edge(0, 2, np.eye(4)), TypeError, "sigmas"),
            (lambda: graph.pose(77), tutti.InputError, "77"),
            (lambda: graph.optimize(robst="gnc"), TypeError, "did you mean 'robust'"),
            (lambda: graph.optimize(robust="gcn"), tutti.InputError, "gnc"),
            (lambda: tutti.PoseGraph.read_g2o(tmp_path / "none.g2o"), OSError, "none.g2o"),
    ]:
        with pytest.raises(error, match=words):
            call()


def endless_graph(n=1000):
    """Measurements that contradict each other: the objective falls by ever less, for more iterations than anybody waits."""
    rng = np.random.default_rng(5)
    graph = tutti.PoseGraph()
    for k in range(n):
        graph.add_pose(k, [*rng.normal(size=3) * 10, *rng.normal(size=4)])
    for k in range(1, n):
        graph.add_edge(k - 1, k, [1, 0, 0, *rng.normal(size=4)], sigmas=(0.1, 0.1))
    for a, b in rng.integers(0, n, (500, 2)):
        if abs(a - b) > 1:
            graph.add_edge(a, b, [0, 0, 0, *rng.normal(size=4)], sigmas=(0.1, 0.1))
    return graph


@pytest.mark.parametrize("solver", ["ceres", "block"])
def test_ctrl_c_ends_a_long_solution(solver):
    graph = endless_graph()
    poses = graph.poses
    timer = threading.Timer(0.7, lambda: os.kill(os.getpid(), signal.SIGINT))
    began = time.monotonic()
    timer.start()
    with pytest.raises(KeyboardInterrupt):
        graph.optimize(init="file", solver=solver, max_iterations=100000, function_tolerance=1e-30)
    assert time.monotonic() - began < 60
    assert (graph.poses == poses).all()
