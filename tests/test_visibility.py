"""What a sensor sees is what plain NumPy says it sees, with and without distortion; and one file decides it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from adapt.anatomy import Floats
from adapt.match.visibility import (
    Bools,
    face_the_sensors,
    is_on_outline,
    is_past,
    looked_past,
    on_outline,
    pixel_of,
    plainly_seen_or_hidden,
    visible_vertices,
)
from capture.camera import Camera
from capture.cloud.fuse import Cloud, View
from capture.projection import lens_of
from capture.rigid import apply, exp_so3, inverse, transform
from tests.test_projection import AZURE_KINECT, by_opencv

LENSES = [(), AZURE_KINECT, (-0.2, 0.0, 0.0, 0.0), (*AZURE_KINECT, 1e-3, 0.0, -1e-3, 0.0, 0.02, -0.03)]


def seen_and_hidden(view: View, vertices: Floats, normals: Floats, facing: float) -> tuple[Bools, Bools]:
    """The rule in plain NumPy, with OpenCV's projection."""
    sight = view.world_from_sensor[:3, 3] - vertices
    faces = np.einsum("ij,ij->i", normals, sight) > facing * np.linalg.norm(sight, axis=1)
    points = apply(inverse(view.world_from_sensor), vertices)
    near = np.hypot(*points[:, :2].T) <= np.sqrt(lens_of(view.camera).furthest) * points[:, 2]
    column, row = np.rint(by_opencv(view.camera, points)).T
    looked_at = faces & near & (column >= 0) & (column < view.camera.width) & (row >= 0) & (row < view.camera.height)
    pixel = np.where(looked_at, row, 0).astype(int), np.where(looked_at, column, 0).astype(int)
    hidden = looked_at & (view.depth[pixel] > 0.0) & (view.depth[pixel] < points[:, 2] - 0.03)
    return looked_at & ~hidden, hidden


def some_view(distortion: tuple[float, ...] = ()) -> View:
    """A sensor somewhere, with readings at all depths and holes."""
    rng = np.random.default_rng(7)
    depth = np.where(rng.random((60, 80)) < 0.7, rng.uniform(0.5, 1.5, (60, 80)), 0.0).astype(np.float32)
    camera = Camera(80, 60, 70.0, 72.0, 39.0, 31.0, distortion)
    return View("one", camera, transform(exp_so3(rng.normal(size=3)), rng.normal(size=3)), depth)


def some_skin(view: View, count: int) -> tuple[Floats, Floats]:
    """Vertices before a sensor, beside and behind it, and their unit normals."""
    rng = np.random.default_rng(8)
    normals = rng.normal(size=(count, 3))
    points = apply(view.world_from_sensor, rng.normal(0.0, 0.6, (count, 3)) + np.array([0.0, 0.0, 0.9]))
    return points, normals / np.linalg.norm(normals, axis=1, keepdims=True)


@pytest.mark.parametrize("distortion", LENSES, ids=["pinhole", "rational", "barrel", "tilted"])
@pytest.mark.parametrize("count", [0, 3, 256, 4000])  # of vertices: less than a block of the loop, one, many
def test_a_sensor_sees_what_plain_arrays_say(distortion: tuple[float, ...], count: int) -> None:
    view = some_view(distortion)
    points, normals = some_skin(view, count)
    np.testing.assert_array_equal(
        visible_vertices(view, points, normals), seen_and_hidden(view, points, normals, 0.2)[0]
    )
    seen, hidden = plainly_seen_or_hidden(view, points, normals)
    np.testing.assert_array_equal((seen, hidden), seen_and_hidden(view, points, normals, 0.3))
    assert count < 4000 or (0.05 < seen.mean() < 0.5 and 0.05 < hidden.mean() < 0.5)


def test_a_part_of_a_sensors_image_shows_what_the_whole_shows_there() -> None:
    whole = some_view(AZURE_KINECT)
    camera = replace(whole.camera, width=50, height=40, cx=whole.camera.cx - 20, cy=whole.camera.cy - 10)
    part = replace(whole, camera=camera, depth=whole.depth[10:50, 20:70])  # not contiguous in memory
    points, normals = some_skin(whole, 1000)
    row, column, _ = pixel_of(whole, points)
    inside = (row >= 10) & (row < 50) & (column >= 20) & (column < 70)
    expected = visible_vertices(whole, points, normals) & inside
    np.testing.assert_array_equal(visible_vertices(part, points, normals), expected)
    assert expected.any()


def test_a_vertex_far_aside_is_not_seen_where_the_lens_folds_over() -> None:
    view = replace(some_view((-0.2, 0.0, 0.0, 0.0)), world_from_sensor=np.eye(4), depth=np.zeros((60, 80), np.float32))
    aside = np.array([[2.236, 0.0, 1.0], [0.1, 0.0, 1.0]])
    towards = -aside / np.linalg.norm(aside, axis=1, keepdims=True)
    np.testing.assert_array_equal(visible_vertices(view, aside, towards), [False, True])


def test_the_outline_is_square_to_the_viewing_axis() -> None:
    view = some_view()
    _, normals = some_skin(view, 500)
    outline = on_outline(view, normals)
    angle = np.rad2deg(np.arccos(np.abs(normals @ view.world_from_sensor[:3, 2])))
    np.testing.assert_array_equal(outline, angle > 90.0 - 20.487)
    assert [is_on_outline(view.world_from_sensor, *normal) for normal in normals] == outline.tolist()


def test_a_sensor_looks_past_a_point_only_where_it_shows_no_surface_around() -> None:
    camera = Camera(80, 60, 70.0, 72.0, 39.0, 31.0)
    depth = np.zeros((60, 80), dtype=np.float32)
    depth[:, :20], depth[:, 60:] = 1.0, 1.1
    view = View("one", camera, np.eye(4), depth)
    column = np.array([10, 22, 30, 50, 57, 70, 200])
    points = np.column_stack([(column - 39.0) / 70.0, np.zeros(7), np.ones(7)])  # the last one outside the image
    np.testing.assert_array_equal(looked_past(view, points), [False, False, True, True, True, True, False])
    assert is_past(1.07, 1.0)
    assert not is_past(1.05, 1.0)


def test_normals_face_the_middle_of_all_sensors() -> None:
    views = tuple(replace(some_view(), world_from_sensor=transform(np.eye(3), [x, 0.0, -1.0])) for x in (-1.0, 1.0))
    still = np.zeros(2, dtype=bool)
    cloud = Cloud(np.zeros((2, 3)), np.zeros((2, 3)), still, still.astype(np.int64), views)
    normals = np.array([[[0.0, 0.0, -1.0], [0.0, 0.0, 1.0]], [[1.0, 0.0, 0.0], [0.9, 0.0, -0.43]]])
    np.testing.assert_array_equal(face_the_sensors(cloud, normals), [[True, False], [False, True]])
