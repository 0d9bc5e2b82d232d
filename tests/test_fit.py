"""Fitting: correspondences keep their rules, energies their derivatives, and known bodies and poses come back."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import sparse
from scipy.sparse.linalg import spsolve

from adapt.anatomy import Floats
from adapt.fit.examples import choose_examples
from adapt.fit.first_poses import read_first_poses
from adapt.fit.least_squares import levenberg_marquardt
from adapt.fit.pose import GaussianPose, PoseEnergy, fit_pose, match_pose
from adapt.fit.priors import range_term
from adapt.fit.problem import Quadratic, Unknowns, data_term, gaussian_term
from adapt.fit.shape import ShapeEnergy, fit_shape
from adapt.fit.skin import STIFFNESS, Factor, fit_skin
from adapt.match.correspondences import GATE_M, Correspondences, Target, find_corres
from adapt.match.skin_sample import sample_skin
from adapt.match.visibility import visible_vertices
from adapt.model.body import joint_centres, make_body, pose_skin, pose_skin_by_v_hat, pose_skin_varying, rest_theta
from adapt.model.derivatives import Points
from adapt.model.shape.handle_space import affine_set
from adapt.model.shape.prior import SIZE_SIGMA, shape_prior
from adapt.model.surface import incidence, vertex_areas, vertex_normals
from adapt.tissue import tissue_deviation, tissue_field
from capture.cloud.fuse import Cloud
from capture.errors import FitError
from capture.rigid import exp_so3, log_so3
from tests.finite_differences import check_jacobian
from tests.known_limb import bent, empty_view, exact_target
from track.evaluation.random_bodies import random_body
from track.evaluation.skin_of_blocks import skin_of_blocks_by_shape

POSES = ((15.0, 0.0), (60.0, 50.0), (95.0, -50.0), (125.0, 10.0))


@pytest.fixture(scope="module")
def person(arm):
    """A body unlike the template, its poses, and exact clouds of them."""
    body = random_body(arm, 7)
    thetas = np.array([bent(body, *degrees) for degrees in POSES])
    return body, thetas, [exact_target(body, theta) for theta in thetas]


@pytest.fixture(scope="module")
def sample(arm):
    return sample_skin(arm, at_most=1500)


# ---- correspondences: a sensor at the origin looks along +Z at a patch one metre away


def patch(**changes):
    """A cloud of a small square patch 1 m in front of the sensor, facing it."""
    grid = 0.01 * np.stack(np.meshgrid(np.arange(-5, 6), np.arange(-5, 6)), axis=-1).reshape(-1, 2)
    n = len(grid)
    parts = {
        "points": np.column_stack([grid, np.ones(n)]),
        "normals": np.tile([0.0, 0.0, -1.0], (n, 1)),
        "boundary": np.zeros(n, dtype=bool),
        "sensor": np.zeros(n, dtype=np.int64),
        "views": (empty_view(),),
    }
    return Target(Cloud(**(parts | changes)))


def matched(target, vertex, normal=(0.0, 0.0, -1.0), **options):
    """Matches of a single vertex."""
    return find_corres(target, np.array([vertex]), np.array([normal]), np.array([0]), **options)


def test_a_vertex_takes_the_nearest_point_of_the_cloud():
    matches = matched(patch(), (0.012, -0.019, 1.01))
    np.testing.assert_allclose(matches.target, [[0.01, -0.02, 1.0]])
    np.testing.assert_allclose(matches.normal, [[0.0, 0.0, -1.0]])
    np.testing.assert_allclose(matches.distance, [-0.01], atol=1e-12)


def test_distance_is_measured_along_the_skins_normal_whatever_the_clouds_noisy_one():
    leaning = np.tile([0.6, 0.0, -0.8], (len(patch().cloud.points), 1))
    matches = matched(patch(normals=leaning), (0.0, 0.0, 1.01))
    np.testing.assert_allclose(matches.normal, [[0.0, 0.0, -1.0]])
    np.testing.assert_allclose(matches.distance, [-0.01], atol=1e-12)


def test_a_vertex_farther_than_the_gate_has_no_target():
    assert len(matched(patch(), (0.0, 0.0, 1.039))) == 1
    assert len(matched(patch(), (0.0, 0.0, 1.041))) == 0
    assert len(matched(patch(), (0.0, 0.0, 1.02), gate_m=0.015)) == 0


def test_normals_that_disagree_make_no_match():
    away = patch(normals=np.tile([0.0, 0.0, 1.0], (121, 1)))
    assert len(matched(away, (0.0, 0.0, 1.0))) == 0


def test_the_scans_boundary_makes_no_match():
    boundary = np.zeros(121, dtype=bool)
    boundary[60] = True
    assert len(matched(patch(boundary=boundary), (0.001, 0.0, 1.0))) == 0
    assert len(matched(patch(boundary=boundary), (0.009, 0.0, 1.0))) == 1


def test_a_vertex_that_does_not_face_a_sensor_is_not_seen_by_it():
    view = empty_view()
    normals = np.array([[0.0, 0.0, -1.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.9, 0.0, -0.436], [0.99, 0.0, -0.14]])
    vertices = np.tile([0.0, 0.0, 1.0], (len(normals), 1))
    np.testing.assert_array_equal(visible_vertices(view, vertices, normals), [True, False, False, True, False])
    assert len(matched(patch(), (0.0, 0.0, 1.0), normal=(0.0, 0.0, 1.0))) == 0


def test_a_vertex_behind_something_nearer_is_not_seen():
    view = empty_view()
    vertices, normals = np.array([[0.0, 0.0, 1.0]]), np.array([[0.0, 0.0, -1.0]])
    for depth, seen in ((0.90, False), (0.99, True), (1.10, True), (0.0, True)):
        hiding = replace(view, depth=np.full_like(view.depth, depth))
        assert visible_vertices(hiding, vertices, normals)[0] == seen, depth
    hiding = replace(view, depth=np.full_like(view.depth, 0.90))
    assert len(matched(patch(views=(hiding,)), (0.0, 0.0, 1.0))) == 0


def test_a_vertex_outside_the_image_or_behind_the_sensor_is_not_seen():
    outside = np.array([[0.57, 0.0, 1.0], [-0.57, 0.0, 1.0], [0.0, 0.43, 1.0], [0.0, -0.43, 1.0], [0.0, 0.0, -1.0]])
    normals = -outside / np.linalg.norm(outside, axis=1, keepdims=True)
    assert not visible_vertices(empty_view(), outside, normals).any()
    assert visible_vertices(empty_view(), 0.9 * outside[:4] + [0.0, 0.0, 0.1], normals[:4]).all()


def test_a_vertex_takes_points_only_of_sensors_that_see_it():
    behind = replace(empty_view(), world_from_sensor=np.diag([-1.0, 1.0, -1.0, 1.0]) + np.eye(4, k=3) * 0.0)
    behind.world_from_sensor[2, 3] = 2.0
    points = np.array([[0.0, 0.0, 1.02], [0.0, 0.0, 1.001]])
    facing = np.tile([0.0, 0.0, -1.0], (2, 1))
    cloud = Cloud(points, facing, np.zeros(2, dtype=bool), np.array([0, 1]), (empty_view(), behind))
    matches = matched(Target(cloud), (0.0, 0.0, 1.0))
    np.testing.assert_allclose(matches.target, [[0.0, 0.0, 1.02]])


def test_only_eligible_vertices_are_matched():
    vertices = np.array([[0.0, 0.0, 1.0], [0.01, 0.0, 1.0], [0.02, 0.0, 1.0]])
    matches = find_corres(patch(), vertices, np.tile([0.0, 0.0, -1.0], (3, 1)), np.array([0, 2]))
    np.testing.assert_array_equal(matches.vertex, [0, 2])


def test_the_normals_of_a_sample_are_those_of_the_whole_mesh(arm, person, sample):
    body, thetas, _ = person
    skin, faces = pose_skin(body, thetas[1]), arm.skin_faces
    normals = sample.normals(skin)
    whole = vertex_normals(skin, faces, incidence(faces, len(skin)))
    np.testing.assert_allclose(normals[sample.vertices], whole[sample.vertices], atol=1e-12)
    np.testing.assert_array_equal(np.delete(normals, sample.vertices, axis=0), 0.0)


# ---- energies and their derivatives


def check_quadratic(term, at: Floats, **tolerance) -> None:
    """Gradient against finite differences of the energy."""
    here = term(at)
    check_jacobian(lambda x: np.array([term(x).energy]), here.gradient[None], at, **tolerance)


def test_the_data_terms_gradient_is_that_of_its_energy(arm, person):
    body, thetas, targets = person
    few = sample_skin(arm, at_most=120)
    matches = match_pose(body, targets[1], thetas[1], few, gate_m=0.04)
    weights = few.counts(matches)
    off = thetas[1] + np.random.default_rng(0).normal(0.0, 0.02, len(thetas[1]))
    check_quadratic(
        lambda theta: data_term(pose_skin_varying(body, theta, vertices=matches.vertex), matches, weights),
        off,
        relative=1e-5,
    )


def random_data(rng, m=7, n=4):
    """Skin points that vary linearly with n parameters, and matches with unit normals."""
    d, base = rng.normal(size=(m, 3, n)), rng.normal(size=(m, 3))
    normal = rng.normal(size=(m, 3))
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    matches = Correspondences(np.arange(m), rng.normal(size=(m, 3)), normal, np.zeros(m), np.ones(m))
    return (lambda x: Points(base + d @ x, d)), matches, rng.uniform(0.5, 2.0, m)


def test_the_data_terms_matrix_is_that_of_its_residuals():
    """For skin linear in its parameters the energy is quadratic, so J^T J is its second derivative."""
    rng = np.random.default_rng(1)
    skin, matches, weights = random_data(rng)
    x = rng.normal(size=4)
    here = data_term(skin(x), matches, weights)
    scale = np.abs(here.hessian).max()
    gradient = lambda y: data_term(skin(y), matches, weights).gradient / scale  # noqa: E731
    check_jacobian(gradient, here.hessian / scale, x)
    np.testing.assert_allclose(here.hessian, here.hessian.T)
    assert (np.linalg.eigvalsh(here.hessian) > 0.0).all()


def test_the_cost_of_a_pose_is_the_same_with_and_without_its_derivatives(person, sample):
    body, thetas, targets = person
    matches = match_pose(body, targets[2], thetas[2], sample, gate_m=0.04)
    theta = thetas[2] + np.random.default_rng(4).normal(0.0, 0.05, len(thetas[2]))
    theta[body.anatomy.coordinate_index("elbow_flexion")] = -0.3  # outside its range
    prior = GaussianPose(thetas[2], np.eye(len(theta)))
    for expected in (None, prior):
        cost = PoseEnergy(body, matches, sample.counts(matches), expected)
        assert cost.value(theta) == pytest.approx(cost.quadratic(theta).energy, rel=1e-12)


def test_the_data_term_weighs_distance_to_the_plane_a_hundred_times():
    n = np.array([[0.0, 0.0, 1.0]])
    matches = Correspondences(np.array([0]), np.zeros((1, 3)), n, np.zeros(1), np.ones(1))
    along, across = (
        data_term(Points(np.array([p]), np.zeros((1, 3, 1))), matches, np.ones(1)).energy
        for p in ([0.0, 0.0, 0.01], [0.01, 0.0, 0.0])
    )
    assert along == pytest.approx(101.0 * across)


def test_joint_ranges_cost_nothing_inside_and_have_true_derivatives_outside(arm):
    low = np.array([coordinate.low for coordinate in arm.coordinates])
    high = np.array([coordinate.high for coordinate in arm.coordinates])
    inside = range_term(arm, 0.5 * (low + high))
    assert inside.energy == 0.0
    assert not inside.gradient.any()
    outside = high + np.linspace(0.02, 0.2, len(high))
    outside[::2] = low[::2] - 0.1
    here = range_term(arm, outside)
    check_quadratic(lambda theta: range_term(arm, theta), outside, relative=1e-5)
    scale = np.abs(here.hessian).max()
    check_jacobian(lambda theta: range_term(arm, theta).gradient / scale, here.hessian / scale, outside)


def test_a_gaussian_prior_has_true_derivatives():
    rng = np.random.default_rng(2)
    root = rng.normal(size=(3, 3))
    mean, at = rng.normal(size=(2, 3))
    check_quadratic(lambda x: gaussian_term(x, mean, root.T @ root), at)


def rosenbrock(x: Floats) -> Quadratic:
    r = np.array([10.0 * (x[1] - x[0] ** 2), 1.0 - x[0]])
    j = np.array([[-20.0 * x[0], 10.0], [-1.0, 0.0]])
    return Quadratic(0.5 * float(r @ r), j.T @ r, j.T @ j)


def test_levenberg_marquardt_finds_a_known_minimum():
    found = levenberg_marquardt(rosenbrock, np.array([-1.2, 1.0]), steps=100, tolerance=0.0)
    np.testing.assert_allclose(found, [1.0, 1.0], atol=1e-6)


@pytest.mark.parametrize("steps", range(8))
def test_levenberg_marquardt_never_raises_the_energy(steps):
    rng = np.random.default_rng(steps)
    for start in rng.uniform(-3.0, 3.0, (10, 2)):
        fewer, more = (
            rosenbrock(levenberg_marquardt(rosenbrock, start, steps=n, tolerance=0.0)).energy
            for n in (steps, steps + 1)
        )
        assert more <= fewer <= rosenbrock(start).energy


def test_levenberg_marquardt_is_not_held_up_by_a_parameter_that_hardly_shows():
    def evaluate(x):
        # Where x[1] = 0 the first two residuals ask for a step of -10,000 in it, which the third then refuses.
        r = np.array([10.0 * (x[0] - 1.0), 1e-4 * x[1] + 1.0, 300.0 * x[1] ** 2])
        jacobian = np.array([[10.0, 0.0], [0.0, 1e-4], [0.0, 600.0 * x[1]]])
        return Quadratic(0.5 * float(r @ r), jacobian.T @ r, jacobian.T @ jacobian)

    assert levenberg_marquardt(evaluate, np.zeros(2), steps=3)[0] == pytest.approx(1.0, abs=0.01)


def test_levenberg_marquardt_moves_on_though_its_first_steps_are_refused():
    start = np.array([-1.2, 1.0])
    for steps in (1, 3):
        assert rosenbrock(levenberg_marquardt(rosenbrock, start, steps=steps)).energy < rosenbrock(start).energy


@pytest.mark.parametrize("steps", [1, 2, 7])
def test_derivatives_are_only_worked_out_where_a_step_starts_if_the_energy_comes_alone(steps):
    started = []

    def counted(x):
        started.append(x)
        return rosenbrock(x)

    for start in np.random.default_rng(0).uniform(-3.0, 3.0, (10, 2)):
        started.clear()
        found = levenberg_marquardt(counted, start, steps=steps, energy=lambda x: rosenbrock(x).energy)
        np.testing.assert_array_equal(found, levenberg_marquardt(rosenbrock, start, steps=steps))
        assert 0 < len(started) <= steps


# ---- what is known of bodies


def test_the_shape_prior_is_positive_definite_and_centred_near_the_template(arm):
    affine = affine_set(arm)
    prior = shape_prior(arm, affine)
    np.testing.assert_allclose(prior.precision, prior.precision.T, rtol=1e-9)
    assert np.linalg.eigvalsh(prior.precision).min() > 0.0
    assert gaussian_term(affine.identity, prior.mean, prior.precision).energy < 0.5  # the average man is nobody strange


@pytest.mark.parametrize("growth", [-0.1, 0.05, 0.2])
def test_growing_all_over_costs_only_the_spread_of_size(arm, growth):
    affine = affine_set(arm)
    change = np.zeros((len(affine.groups), 4))
    change[:, 0] = growth
    change[:, 1:] = growth * (affine.centres - affine.centres[0])
    x = affine.identity + change.ravel()
    precision = shape_prior(arm, affine).precision
    energy = gaussian_term(x, affine.identity, precision).energy
    assert 0.95 < energy / (0.5 * (growth / SIZE_SIGMA) ** 2) <= 1.0 + 1e-9
    change[1, 0] += 0.1  # one joint thicker than the rest
    x = affine.identity + change.ravel()
    assert gaussian_term(x, affine.identity, precision).energy > energy + 1.0


# ---- algorithms 1 to 3


def centres_apart_m(body, one, other) -> float:
    """The largest distance between the same joint centre in two poses."""
    here, there = joint_centres(body, one), joint_centres(body, other)
    return max(float(np.linalg.norm(here[name] - there[name])) for name in here)


def test_a_known_pose_comes_back_from_an_exact_cloud(person, sample):
    """From starts that every joint centre is inside the gate of: from 4 to 6 cm away, the twist may come out wrong."""
    body, thetas, targets = person
    rng = np.random.default_rng(3)
    spread = np.r_[np.full(3, 0.015), np.full(3, 0.005), np.full(4, 0.025)]
    for theta, target in zip(thetas, targets, strict=True):
        off = theta + rng.normal(0.0, 1.0, len(theta)) * spread
        assert 0.005 < centres_apart_m(body, off, theta) < GATE_M
        fit = fit_pose(body, target, off, sample, updates=25)
        assert fit.residual_m < 0.0005
        assert centres_apart_m(body, fit.theta, theta) < 0.002
        assert np.rad2deg(np.abs(fit.theta - theta)[6:]).max() < 1.5


def test_the_same_inputs_give_the_same_pose(person, sample):
    body, thetas, targets = person
    one, other = (fit_pose(body, targets[1], thetas[1] + 0.02, sample).theta for _ in range(2))
    np.testing.assert_array_equal(one, other)


def test_a_cloud_that_is_far_away_is_refused(person, sample):
    body, thetas, targets = person
    far = thetas[0].copy()
    far[3:6] += 1.0
    with pytest.raises(FitError, match="skin vertices have a point of the cloud within"):
        fit_pose(body, targets[0], far, sample)


def test_a_sharp_prior_holds_a_pose_where_it_is(person, sample):
    body, thetas, targets = person
    off = thetas[1] + 0.03
    held = fit_pose(body, targets[1], off, sample, prior=GaussianPose(off, np.diag(np.full(len(off), 1e12))))
    np.testing.assert_allclose(held.theta, off, atol=1e-3)


def test_a_prior_holds_across_half_a_turn_of_the_rotation_vector(arm, person, sample):
    body = person[0]
    before, after = bent(body, 60.0, 30.0), bent(body, 60.0, 30.0)
    before[:3] = [0.0, np.deg2rad(178.0), 0.0]
    after[:3] = [0.0, np.deg2rad(184.0 - 360.0), 0.0]
    prior = GaussianPose(before, np.eye(len(before)) / 0.05**2)
    fit = fit_pose(body, exact_target(body, after), before, sample, prior=prior)
    turn = exp_so3(fit.theta[:3]) @ exp_so3(after[:3]).T
    assert np.rad2deg(np.linalg.norm(log_so3(turn))) < 1.0
    assert np.linalg.norm(fit.theta[:3]) <= np.pi


@pytest.fixture(scope="module")
def shaped(arm, person, sample):
    """The template, fitted to the person's clouds from poses that are a little off."""
    _, thetas, targets = person
    start = make_body(arm)
    off = thetas + np.random.default_rng(5).normal(0.0, 0.02, thetas.shape)
    return fit_shape(start, targets, off, sample, updates=12)


def spans(body):
    """Distances (m) between neighbouring joint centres at rest."""
    centres = np.array(list(joint_centres(body, rest_theta(body)).values()))
    return np.linalg.norm(np.diff(centres, axis=0), axis=1)


def test_a_known_shape_comes_back_from_exact_clouds(arm, person, shaped):
    body, thetas, _ = person
    template_off = np.abs(spans(make_body(arm)) - spans(body))
    off = np.abs(spans(shaped.body) - spans(body))
    assert template_off.max() > 0.01
    assert off.max() < 0.0065  # soft tissue that nobody knows of hides the shoulder's end best
    assert off[-1] < 0.004
    fitted = [pose_skin(shaped.body, theta) for theta in shaped.thetas]
    true = [pose_skin(body, theta) for theta in thetas]
    counted = arm.fit_weight > 0.5
    apart = [np.linalg.norm(f - t, axis=1)[counted].mean() for f, t in zip(fitted, true, strict=True)]
    assert max(apart) < 0.005


def test_the_data_decide_the_poses_and_some_but_not_all_of_shape_and_tissue(arm, shaped):
    poses = shaped.thetas.size
    body = len(shaped.body.shape) + tissue_field(arm).modes.shape[1]
    assert poses + 0.1 * body < shaped.parameters < poses + 0.9 * body


@pytest.fixture(scope="module")
def skinned(arm, person, sample):
    """The template's skin drawn onto clouds of the person, whose shape and poses are known; and the matches."""
    body, thetas, targets = person
    start = make_body(arm, shape=body.shape)
    whole = sample_skin(arm)
    matches = [match_pose(start, t, theta, whole, gate_m=0.02) for t, theta in zip(targets, thetas, strict=True)]
    return start, matches, whole, fit_skin(start, thetas, matches, whole)


def test_skin_comes_onto_the_clouds(person, skinned):
    body, thetas, targets = person
    start, _, whole, fitted = skinned
    distances = [
        np.mean(
            [
                np.abs(match_pose(b, t, theta, whole, gate_m=0.02).distance).mean()
                for t, theta in zip(targets, thetas, strict=True)
            ]
        )
        for b in (start, fitted)
    ]
    assert distances[1] < 0.5 * distances[0]
    seen = np.unique(np.concatenate([matches.vertex for matches in skinned[1]]))
    before, after = (np.linalg.norm(b.v_hat - body.v_hat, axis=1)[seen].mean() for b in (start, fitted))
    assert after < 0.7 * before


def test_a_factor_kept_from_another_system_finds_the_same_skin(person, skinned, monkeypatch):
    _, thetas, _ = person
    start, matches, whole, fitted = skinned
    factor = Factor()
    fit_skin(start, thetas[:1], matches[:1], whole, factor=factor)
    monkeypatch.delattr("adapt.fit.skin.splu")
    again = fit_skin(start, thetas, matches, whole, factor=factor)
    np.testing.assert_allclose(again.v_hat, fitted.v_hat, atol=1e-6)


def test_skin_that_nobody_saw_stays_smooth(arm, skinned):
    import igl

    start, matches, _, fitted = skinned
    seen = np.zeros(len(arm.skin_vertices), dtype=bool)
    seen[np.concatenate([match.vertex for match in matches])] = True
    moved = fitted.v_hat - start.v_hat
    edges = igl.edges(arm.skin_faces)
    length = np.linalg.norm(np.diff(arm.skin_vertices[edges], axis=1)[:, 0], axis=1)
    strain = np.linalg.norm(np.diff(moved[edges], axis=1)[:, 0], axis=1) / length
    unseen = ~seen[edges].any(axis=1)
    assert unseen.sum() > 500
    assert np.quantile(strain[unseen], 0.99) < 0.2
    assert np.linalg.norm(moved[~seen], axis=1).max() <= 1.5 * np.linalg.norm(moved[seen], axis=1).max()


def test_skin_that_nobody_saw_keeps_its_coarse_tissue(arm, person):
    body, thetas, _ = person
    tissue = tissue_field(arm)
    coarse = tissue.displacement(np.random.default_rng(0).normal(size=tissue.modes.shape[1]))
    start = make_body(arm, shape=body.shape, v_hat=arm.skin_vertices + coarse)
    whole = sample_skin(arm)
    matches = match_pose(start, exact_target(start, thetas[0]), thetas[0], whole, gate_m=0.02)
    moved = fit_skin(start, thetas[:1], [matches], whole).v_hat - start.v_hat
    unseen = np.setdiff1d(whole.vertices, matches.vertex)
    assert np.linalg.norm(coarse[unseen], axis=1).mean() > 5e-4
    assert np.linalg.norm(moved[unseen], axis=1).mean() < 0.1 * np.linalg.norm(coarse[unseen], axis=1).mean()


def test_skin_solves_the_system_that_it_states(arm, person, skinned):
    """Against a direct solution of the same normal equations, put together here from the statement."""
    import igl

    _, thetas, _ = person
    start, matches, whole, fitted = skinned
    n = len(start.v_hat)
    mass = np.asarray(igl.massmatrix(arm.skin_vertices, arm.skin_faces, igl.MASSMATRIX_TYPE_VORONOI).diagonal())
    laplacian = sparse.csr_matrix(igl.cotmatrix(arm.skin_vertices, arm.skin_faces))
    smooth = STIFFNESS * laplacian.T @ sparse.diags(1.0 / mass) @ laplacian
    variance = tissue_deviation(arm) ** 2 + 0.001**2
    system = sparse.kron(smooth + sparse.diags(mass / (variance * 0.04**2)), np.eye(3))
    blocks, right = np.zeros((n, 3, 3)), np.zeros((n, 3))
    for theta, match in zip(thetas, matches, strict=True):
        skin = pose_skin_by_v_hat(start, theta)
        for k, i in enumerate(match.vertex):
            one = match.at(np.array([k]))
            quadratic = data_term(Points(skin.value[[i]], skin.d[[i]]), one, whole.counts(one))
            blocks[i] += quadratic.hessian
            right[i] -= quadratic.gradient
    system = system.tocsc() + sparse.block_diag(list(blocks), format="csc")
    direct = spsolve(system, right.ravel()).reshape(n, 3)
    moved = fitted.v_hat - start.v_hat
    assert np.abs(direct).max() > 0.002
    np.testing.assert_allclose(moved, direct, atol=1e-3 * np.abs(direct).max())


# ---- samples and examples


def test_a_sample_is_spread_by_area(arm):
    few = sample_skin(arm, at_most=1000, seed=5)
    assert len(few.vertices) == 1000
    assert len(np.unique(few.vertices)) == 1000
    areas = vertex_areas(arm.skin_vertices, arm.skin_faces)
    counted = arm.fit_weight > 0.02
    x = arm.skin_vertices[:, 1]
    middle = np.median(x[counted])
    for part in (x < middle, x >= middle):
        expected = areas[counted & part].sum() / areas[counted].sum()
        assert np.mean(part[few.vertices]) == pytest.approx(expected, abs=0.06)


def test_a_sample_stands_for_as_many_observations_as_the_whole_skin(arm):
    whole, few = sample_skin(arm), sample_skin(arm, at_most=500)
    assert few.observations.sum() == pytest.approx(whole.observations[whole.vertices].sum())
    assert not few.observations[np.setdiff1d(np.arange(len(arm.skin_vertices)), few.vertices)].any()
    np.testing.assert_array_equal(few.vertices, sample_skin(arm, at_most=500).vertices)


def test_bent_poses_tell_more_than_copies_of_a_straight_one(person, sample):
    body, thetas, targets = person
    fits = [fit_pose(body, target, theta, sample, updates=3) for target, theta in zip(targets, thetas, strict=True)]
    straight, *others = fits
    chosen = choose_examples(body, [straight] * 5 + others, sample, 4)
    assert len(set(chosen)) == 4
    assert len(set(chosen) & {5, 6, 7}) >= 2
    assert chosen == choose_examples(body, [straight] * 5 + others, sample, 4)


# ---- first poses by hand


def test_first_poses_are_read_by_name_and_the_rest_stays_at_rest(tmp_path, arm):
    (tmp_path / "first.csv").write_text("frame,elbow_flexion\n7,1.5\n12,0.5\n", encoding="utf-8-sig")
    poses = read_first_poses(tmp_path / "first.csv", arm)
    i = arm.coordinate_index("elbow_flexion")
    assert {frame: theta[i] for frame, theta in poses.items()} == {7: 1.5, 12: 0.5}
    rest = rest_theta(make_body(arm))
    np.testing.assert_array_equal(np.delete(poses[7], i), np.delete(rest, i))


@pytest.mark.parametrize(
    "text",
    ["", "frame\n", "elbow_flexion\n1\n", "frame,knee\n1,2\n", "frame,elbow_flexion\n1\n", "frame,elbow_flexion\nx,1\n",
     "frame,elbow_flexion\n1,inf\n", "frame,elbow_flexion\n1,2,3\n"],
)  # fmt: skip
def test_first_poses_that_make_no_sense_are_refused(tmp_path, arm, text):
    (tmp_path / "first.csv").write_text(text)
    with pytest.raises(FitError, match=r"first\.csv"):
        read_first_poses(tmp_path / "first.csv", arm)
    with pytest.raises(FitError, match=r"none\.csv"):
        read_first_poses(tmp_path / "none.csv", arm)


@pytest.fixture
def two_poses(arm, person, sample):
    """The energy of algorithm 2 for fixed matches in two poses, and where it is looked at."""
    body, thetas, targets = person
    c = np.random.default_rng(2).normal(0.0, 0.3, tissue_field(arm).modes.shape[1])
    x = np.concatenate([body.shape, c, thetas[:2].ravel()])
    of = Unknowns(len(body.shape), len(c), len(arm.coordinates))
    matches = [
        match_pose(body, target, theta + 0.01, sample, gate_m=GATE_M)
        for target, theta in zip(targets[:2], thetas[:2], strict=True)
    ]
    return ShapeEnergy(body, arm.skin_vertices, matches, sample, of), x


def test_algorithm_2s_normal_equations_are_those_of_the_models_blocks(arm, two_poses):
    """With every column written out, the tissue's too."""
    cost, x = two_poses
    of, body, field = cost.of, cost.at(x), tissue_field(arm)
    nothing = Correspondences(np.zeros(0, dtype=np.int64), *np.zeros((2, 0, 3)), *np.zeros((2, 0)))
    here, none = cost.quadratic(x), replace(cost, matches=[nothing, nothing]).quadratic(x)
    energy, gradient, hessian = none.energy, none.gradient.copy(), none.hessian.copy()
    for k, match in enumerate(cost.matches):
        i, index = match.vertex, np.r_[of.pose(k), 0 : of.m + of.q]
        skin = skin_of_blocks_by_shape(body, x[of.pose(k)], i, along=field.normals[i])
        tissue = skin.d[:, :, -1:] * field.modes[i][:, None, :]
        whole = Points(skin.value, np.concatenate([skin.d[:, :, :-1], tissue], axis=2))
        data = data_term(whole, match, cost.sample.counts(match))
        energy += data.energy
        gradient[index] += data.gradient
        hessian[np.ix_(index, index)] += data.hessian
    assert here.energy == pytest.approx(energy, rel=1e-12)
    np.testing.assert_allclose(here.gradient, gradient, atol=1e-10 * np.abs(gradient).max())
    np.testing.assert_allclose(here.hessian, hessian, atol=1e-12 * np.abs(hessian).max())


def test_shape_tissue_and_poses_have_true_derivatives(two_poses):
    """The energy of algorithm 2, by some of each kind of unknown."""
    cost, x = two_poses
    of = cost.of
    some = np.r_[0:16:3, of.tissue.start : of.tissue.stop : 30, of.pose(0), of.pose(1)]

    def energy(part):
        moved = x.copy()
        moved[some] = part
        return np.array([cost.quadratic(moved).energy])

    gradient = cost.quadratic(x).gradient[some]
    scale = np.abs(gradient).max()
    check_jacobian(lambda part: energy(part) / scale, gradient[None] / scale, x[some], step=1e-5, relative=1e-5)
    assert cost.value(x) == pytest.approx(cost.quadratic(x).energy, rel=1e-9)
