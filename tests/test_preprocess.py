import numpy as np

from capture.camera import Camera
from capture.cloud.preprocess import boundary, clean_depth, depth_jump
from tests.analytic_depth import plane, quantised

CAMERA = Camera(160, 120, 150.0, 150.0, 79.5, 59.5)


def two_walls():
    """A wall at 1.5 m with a piece of one at 1.0 m in front of it."""
    depth = np.full((120, 160), 1.5, dtype=np.float32)
    depth[30:90, 40:100] = 1.0
    return depth


def test_flying_pixels_between_two_surfaces_go():
    depth = two_walls()
    flying = depth.copy()
    flying[30:90, 100] = 1.25
    cleaned = clean_depth(flying, CAMERA)
    assert (cleaned[30:90, 100] == 0.0).all()
    kept = np.ones(depth.shape, dtype=bool)
    kept[30:90, 100] = False
    assert (cleaned[kept] == flying[kept]).mean() > 0.98


def test_clean_surfaces_stay_exactly_as_they_were():
    depth = two_walls()
    cleaned = clean_depth(depth, CAMERA)
    kept = cleaned > 0.0
    np.testing.assert_array_equal(cleaned[kept], depth[kept])
    assert kept.mean() > 0.98


def test_a_steep_surface_is_not_taken_for_a_jump():
    normal = np.array([np.sin(np.radians(75)), 0.0, -np.cos(np.radians(75))])
    depth = quantised(plane(CAMERA, normal, np.array([0.0, 0.0, 1.0])))
    depth[(depth < 0.5) | (depth > 1.5)] = 0.0
    assert (clean_depth(depth, CAMERA) > 0.0).sum() == (depth > 0.0).sum()


def test_specks_go_and_patches_stay():
    depth = np.zeros((120, 160), dtype=np.float32)
    depth[10:12, 10:12] = 1.0
    depth[50:80, 50:80] = 1.0
    cleaned = clean_depth(depth, CAMERA)
    assert (cleaned[:20] == 0.0).all()
    assert (cleaned[50:80, 50:80] == 1.0).all()


def test_an_image_without_readings_stays_without():
    empty = np.zeros((120, 160), dtype=np.float32)
    assert not clean_depth(empty, CAMERA).any()
    assert not boundary(empty, CAMERA).any()


def test_the_boundary_is_two_pixels_wide_at_edges_holes_and_jumps():
    depth = two_walls()
    depth[50:60, 60:70] = 0.0
    found = boundary(depth, CAMERA)
    assert found[0].all()
    assert found[1].all()
    assert not found[4, 5:-5].any()
    assert found[55, 58:60].all()
    assert not found[55, 55]
    assert found[55, 38:42].all()
    assert not found[55, [35, 45]].any()


def test_a_hole_of_a_pixel_is_no_boundary():
    depth = np.full((120, 160), 1.0, dtype=np.float32)
    depth[60, 80] = 0.0
    assert not boundary(depth, CAMERA)[50:70, 70:90].any()


def test_the_cut_of_a_region_is_a_boundary():
    depth = np.full((120, 160), 1.0, dtype=np.float32)
    inside = np.zeros(depth.shape, dtype=bool)
    inside[:, :80] = True
    found = boundary(depth, CAMERA, inside=inside)
    assert found[60, 78:80].all()
    assert not found[60, 70]
    assert not found[60, 80:].any()


def test_the_jump_grows_with_distance():
    jumps = depth_jump(np.array([[0.5, 1.0, 2.0]], dtype=np.float32), CAMERA)[0]
    assert (np.diff(jumps) > 0).all()
