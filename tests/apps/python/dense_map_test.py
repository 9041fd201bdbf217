"""tutti.DenseMap: arrays in, arrays out."""
import numpy as np
import pytest

import tutti

CAMERA = tutti.Camera(width=80, height=60, fx=70, fy=70, cx=39.5, cy=29.5)


@pytest.fixture(scope="module")
def wall():
    dense = tutti.DenseMap(voxel_m=0.02, threads=2)
    image = np.zeros((60, 80, 3), np.uint8)
    image[:] = (200, 100, 10)
    for _ in range(3):
        assert dense.integrate(np.ones((60, 80)), image, np.eye(4), CAMERA, rgb=True) is None
    return dense


def test_a_wall_is_a_mesh_and_a_cloud(wall, tmp_path):
    mesh, cloud = wall.mesh(), wall.cloud()
    assert mesh.triangles.shape[1] == 3 and mesh.triangles.max() < len(mesh.vertices.points)
    for surface in (mesh.vertices, cloud):
        assert len(surface.points) > 500
        np.testing.assert_allclose(surface.points[:, 2], 1, atol=1e-3)
        assert (surface.normals[:, 2] < -0.99).all()
        assert (surface.colours == (200, 100, 10)).all()
    for name, surface in (("mesh.ply", mesh), ("cloud.ply", cloud)):
        tutti.write_ply(tmp_path / name, surface)
        assert (tmp_path / name).read_bytes().startswith(b"ply\n")
    assert wall.memory_mb > 0


def test_the_space_before_it_is_free(wall, tmp_path):
    grid = wall.grid(low_m=-1, high_m=1)
    assert grid.cells.dtype == np.int8 and set(np.unique(grid.cells)) == {-1, 0, 100}
    assert grid.cell_m == 0.05 and grid.T_map_world.shape == (4, 4) and len(grid.origin) == 2
    tutti.write_grid(tmp_path, grid)
    assert (tmp_path / "map.pgm").read_bytes().startswith(b"P5\n")


def test_bad_frames_are_skipped_with_the_reason(wall):
    pose = np.eye(4)
    assert wall.integrate(np.zeros((60, 80)), None, pose, CAMERA) == "its depth image is empty"
    assert wall.integrate(np.ones((30, 40)), None, pose, CAMERA) == "the depth image is 40x30, the camera 80x60"
    assert "unit" in wall.integrate(np.full((60, 80), 1500.0), None, pose, CAMERA)


def test_wrong_options_are_refused():
    with pytest.raises(tutti.InputError, match="voxel_m"):
        tutti.DenseMap(voxel_m=0)
    with pytest.raises(TypeError, match="TriangleMesh"):
        tutti.write_ply("x.ply", 3)
