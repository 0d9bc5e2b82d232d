"""The compiled loops do what their twins in plain NumPy do."""

from __future__ import annotations

import numba
import numpy as np
import pytest
from scipy.spatial import cKDTree

from adapt.anatomy import Anatomy
from adapt.anatomy_file import load_anatomy
from adapt.match.point_grid import PointGrid
from adapt.match.skin_sample import sample_skin
from adapt.mirror import mirrored
from adapt.model.body import make_body, pose_skin, pose_skin_by_v_hat, pose_skin_varying, rest_theta, shaped_skin
from adapt.model.shape.handle_space import affine_set
from adapt.model.surface import incidence, vertex_normals
from adapt.search.coarse_cost import Placements, Scene, costs, costs_by_arrays
from capture.camera import Camera, backproject, ray_slopes
from capture.cloud.fuse import Cloud, Region, View, pixels_inside, spread
from capture.cloud.normals import radius_px, surface_at
from capture.cloud.patches import fit_patches, fit_patches_by_arrays
from capture.compiled import compiled, compiled_sums, inlined
from capture.rigid import apply, exp_so3, transform
from tests.toy_anatomy import toy_anatomy
from track.evaluation.benchmark.deformers import limbs_in_one
from track.evaluation.skin_of_blocks import skin_of_blocks_by_shape, skin_of_blocks_by_v_hat


def known_anatomy(name: str) -> Anatomy:
    toys = {"toy": toy_anatomy, "mirrored toy": lambda: mirrored(toy_anatomy())}
    return toys[name]() if name in toys else load_anatomy(name)


@pytest.mark.parametrize("name", ["toy", "mirrored toy", "upper-limb-right", "lower-limb-left"])
@pytest.mark.parametrize("spread", [0.0, 1e-6, 0.5, 2.5])  # far beyond the knots of a spline, too
def test_the_posed_skin_and_its_derivatives_are_those_of_the_model(name: str, spread: float) -> None:
    anatomy, rng = known_anatomy(name), np.random.default_rng(4)
    identity = affine_set(anatomy).identity
    v_hat = anatomy.skin_vertices + rng.normal(0.0, 0.002, anatomy.skin_vertices.shape)
    body = make_body(anatomy, shape=identity + rng.normal(0.0, 0.02, len(identity)), v_hat=v_hat)
    theta = rest_theta(body) + rng.uniform(-spread, spread, len(anatomy.coordinates))
    rows = rng.choice(len(v_hat), len(v_hat) // 3, replace=False)
    along = rng.normal(size=v_hat.shape)
    whole = skin_of_blocks_by_shape(body, theta, np.arange(len(v_hat)), along=along)
    fast = pose_skin_varying(body, theta, vertices=rows)
    np.testing.assert_allclose(pose_skin(body, theta), whole.value, atol=1e-12)
    np.testing.assert_allclose(pose_skin(body, theta, vertices=rows), whole.value[rows], atol=1e-12)
    np.testing.assert_allclose(fast.value, whole.value[rows], atol=1e-12)
    np.testing.assert_allclose(fast.d, whole.d[rows][:, :, : len(theta)], atol=1e-9)
    shaped = pose_skin_varying(body, theta, with_shape=True, vertices=rows)
    np.testing.assert_allclose(shaped.value, whole.value[rows], atol=1e-12)
    np.testing.assert_allclose(shaped.d, whole.d[rows][:, :, :-1], atol=1e-9)
    own = shaped_skin(body, rows, along=along[rows]).posed(theta, np.arange(len(rows)))
    np.testing.assert_allclose(own.d, whole.d[rows], atol=1e-9)
    by_v_hat = skin_of_blocks_by_v_hat(body, theta, rows).d[:, :, len(theta) :]
    np.testing.assert_allclose(pose_skin_by_v_hat(body, theta, vertices=rows).d, by_v_hat, atol=1e-9)


def test_a_limb_among_others_is_posed_as_alone_and_varies_with_its_own_coordinates_alone() -> None:
    leg, rng = load_anatomy("lower-limb-right"), np.random.default_rng(3)
    alone, several = make_body(leg), make_body(limbs_in_one(leg, 3))
    n, vertices = len(leg.coordinates), len(leg.skin_vertices)
    thetas = rest_theta(alone) + rng.uniform(-0.5, 0.5, (3, n))
    rows = rng.choice(3 * vertices, 900, replace=False)
    found = pose_skin_varying(several, thetas.ravel(), vertices=rows)
    for k in range(3):
        own = rows // vertices == k
        expected = pose_skin_varying(alone, thetas[k], vertices=rows[own] % vertices)
        np.testing.assert_allclose(found.value[own], expected.value, atol=1e-12)
        np.testing.assert_allclose(found.d[own][:, :, k * n : (k + 1) * n], expected.d, atol=1e-12)
        assert not np.delete(found.d[own], range(k * n, (k + 1) * n), axis=2).any()


def test_normals_of_a_sample_are_those_of_the_whole_mesh() -> None:
    anatomy, rng = load_anatomy("upper-limb-right"), np.random.default_rng(8)
    skin = anatomy.skin_vertices + rng.normal(0.0, 0.001, anatomy.skin_vertices.shape)
    sample = sample_skin(anatomy, at_most=500)
    whole = vertex_normals(skin, anatomy.skin_faces, incidence(anatomy.skin_faces, len(skin)))
    normals = sample.normals(skin)
    np.testing.assert_allclose(normals[sample.vertices], whole[sample.vertices], atol=1e-12)
    assert not np.delete(normals, sample.vertices, axis=0).any()


def test_of_each_cube_the_point_nearest_to_its_centre_is_kept() -> None:
    points = np.random.default_rng(9).uniform(-0.3, 0.4, (5000, 3))
    chosen = spread(points, spacing_m=0.05)
    cell = np.floor(points / 0.05).astype(int)
    off = np.linalg.norm(points / 0.05 - cell - 0.5, axis=1)
    best = {tuple(key): np.inf for key in cell}
    for key, value in zip(map(tuple, cell), off, strict=True):
        best[key] = min(best[key], value)
    assert len(chosen) == len(best)
    assert all(off[i] < best[tuple(cell[i])] + 1e-3 for i in chosen)
    assert (np.diff(chosen) > 0).all()


@pytest.mark.parametrize("bound", [np.inf, 0.03, 0.001])
@pytest.mark.parametrize("shape", ["slab", "line", "point", "wide"])
def test_a_grid_finds_the_neighbours_that_a_tree_finds(shape: str, bound: float) -> None:
    rng = np.random.default_rng(5)
    extent = {"slab": (0.5, 0.3, 0.01), "line": (0.4, 0.0, 0.0), "point": (0.0, 0.0, 0.0), "wide": (20.0, 30.0, 9.0)}
    points = rng.uniform(0.0, 1.0, (1 if shape == "point" else 800, 3)) * extent[shape] - 0.1
    queries = np.concatenate([points + rng.normal(0.0, 0.01, points.shape), rng.uniform(-2.0, 2.0, (60, 3))])
    distance, index = PointGrid(points).query(queries, distance_upper_bound=bound)
    expected, nearest = cKDTree(points).query(queries, distance_upper_bound=bound)
    np.testing.assert_allclose(distance, expected, atol=1e-12)
    np.testing.assert_array_equal(index, nearest)


def test_the_patches_of_a_ragged_depth_image_are_those_of_plain_arrays() -> None:
    rng = np.random.default_rng(6)
    row, column = np.mgrid[:60, :80]
    depth = (1.0 + 0.002 * row + 0.1 * (column > 40) + 0.003 * rng.normal(size=row.shape)).astype(np.float32)
    depth[rng.random(depth.shape) < 0.3] = 0.0
    pixels = np.argwhere(depth > 0.0)  # up to the very edge
    fits = [fit(depth, pixels, radius_px=7, focal_px=580.0) for fit in (fit_patches, fit_patches_by_arrays)]
    np.testing.assert_allclose(fits[0], fits[1], atol=2e-5)


@pytest.mark.parametrize("distortion", [(), (-0.2, 0.05, 0.003, -0.002, 0.01)])
def test_points_and_normals_of_patches_are_those_of_plain_arrays(distortion: tuple[float, ...]) -> None:
    rng, camera = np.random.default_rng(11), Camera(80, 60, 70.0, 72.0, 39.0, 31.0, distortion)
    row, column = np.mgrid[:60, :80]
    depth = (1.0 + 0.004 * row - 0.002 * column).astype(np.float32)
    pixels = np.argwhere(rng.random(depth.shape) < 0.3)  # up to the very edge
    points, normals = surface_at(depth, camera, pixels)
    radius = radius_px(camera)
    fit = fit_patches(depth, pixels, radius_px=radius, focal_px=camera.fx)
    x, y = ray_slopes(camera).astype(np.float64).transpose(2, 0, 1)
    row, column = pixels.T
    z0, inverse = depth[row, column], 1.0 - fit[:, 0] / depth[row, column]
    (xv, xu), (yv, yu) = (np.gradient(slope, edge_order=1) for slope in (x, y))
    jacobian = np.stack([xu, yu, xv, yv], axis=-1)[row, column].reshape(-1, 2, 2)
    slope = np.linalg.solve(jacobian, fit[:, 1:3, None])[..., 0] / (radius * z0)[:, None]
    rays = np.column_stack([x[row, column], y[row, column], np.ones(len(pixels))])
    expected = np.column_stack([slope, -inverse - (rays[:, :2] * slope).sum(axis=1)])
    np.testing.assert_allclose(points, rays * (z0 / inverse)[:, None], rtol=1e-6)
    np.testing.assert_allclose(normals, expected / np.linalg.norm(expected, axis=1, keepdims=True), atol=1e-5)


def test_a_region_holds_the_pixels_whose_points_it_holds() -> None:
    rng = np.random.default_rng(10)
    camera = Camera(80, 60, 70.0, 72.0, 39.0, 31.0, (0.1, -0.05, 0.001, 0.002))
    depth = np.where(rng.random((60, 80)) < 0.7, rng.uniform(0.5, 1.5, (60, 80)), 0.0).astype(np.float32)
    view = View("one", camera, transform(exp_so3(rng.normal(size=3)), rng.normal(size=3)), depth)
    points = np.nan_to_num(backproject(camera, depth))
    world = apply(view.world_from_sensor, points.reshape(-1, 3)).reshape(points.shape)
    region = Region(*np.percentile(world[depth > 0.0], [20, 80], axis=0))
    expected = (depth > 0.0) & ((world >= region.minimum) & (world <= region.maximum)).all(axis=2)
    pixels, inside, marked = pixels_inside(view, region)
    np.testing.assert_array_equal(marked, expected)
    np.testing.assert_array_equal(pixels, np.argwhere(expected))
    np.testing.assert_allclose(inside, points[expected], rtol=1e-6)
    assert 0.05 < expected.mean() < 0.5


@pytest.mark.parametrize("distortion", [(), (-0.2, 0.05, 0.003, -0.002, 0.01)])
def test_placements_cost_what_they_cost_in_plain_arrays(distortion: tuple[float, ...]) -> None:
    """Two sensors over a wall with holes, the vertices a blob on and around it, some of it beyond the images."""
    rng = np.random.default_rng(9)
    views = []
    for turned in (-0.2, 0.3):
        depth = np.where(rng.random((60, 80)) < 0.8, rng.uniform(0.9, 1.1, (60, 80)), 0.0).astype(np.float32)
        depth[:, 60:] = 0.0
        stands = transform(exp_so3(np.array([0.0, turned, 0.0])), np.array([-turned, 0.0, 0.0]))
        views.append(View("one", Camera(80, 60, 70.0, 72.0, 39.0, 31.0, distortion), stands, depth))
    points = rng.uniform(-0.3, 0.3, (500, 3)) + np.array([0.0, 0.0, 1.0])
    still = np.zeros(len(points), dtype=bool)
    scene = Scene(Cloud(points, np.zeros_like(points), still, still.astype(np.int64), tuple(views)))
    placed = rng.normal(0.0, 0.1, (40, 30, 3)) + rng.normal(0.0, 0.3, (40, 1, 3)) + np.array([0.0, 0.0, 1.0])
    normals = rng.normal(size=placed.shape)
    normals /= np.linalg.norm(normals, axis=2, keepdims=True)
    placements = Placements(placed, normals, rng.uniform(size=(40, 30)) * (normals[..., 2] < 0.0), rng.uniform(size=30))
    np.testing.assert_allclose(costs(scene, placements), costs_by_arrays(scene, placements), atol=1e-6)
    assert np.ptp(costs(scene, placements)) > 0.05


@pytest.mark.parametrize("kind", [compiled, compiled_sums, inlined])
def test_where_compiled_code_cannot_be_kept_it_is_compiled_all_the_same(kind, monkeypatch) -> None:
    jit = numba.njit

    def nowhere_to_keep_it(*, cache: bool, **options):
        if cache:
            raise RuntimeError("cannot cache function: no locator available")
        return jit(**options)

    monkeypatch.setattr(numba, "njit", nowhere_to_keep_it)
    assert kind(lambda x: 2.0 * x)(3.0) == 6.0
