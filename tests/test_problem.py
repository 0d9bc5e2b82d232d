"""The one least-squares problem: its sum has the form of an arrow, and blocks are integrated out of it."""

from __future__ import annotations

import numpy as np
import pytest

from adapt.fit.problem import (
    Arrow,
    Quadratic,
    Term,
    Unknowns,
    data_blocks,
    data_term,
    effective_parameters,
    gaussian_term,
    marginal_covariance,
    schur_complement,
)
from adapt.match.correspondences import Correspondences
from adapt.model.derivatives import Points

OF, POSES, VERTICES = Unknowns(m=3, q=4, n=2), 2, 6


def random_matches(rng: np.random.Generator, count: int) -> Correspondences:
    normals = rng.normal(size=(count, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return Correspondences(np.arange(count), rng.normal(size=(count, 3)), normals, np.zeros(count), np.ones(count))


def random_skin(rng: np.random.Generator, count: int, columns: int) -> Points:
    return Points(rng.normal(size=(count, 3)), rng.normal(size=(count, 3, columns)))


@pytest.fixture
def arrow() -> Arrow:
    rng = np.random.default_rng(1)
    made = Arrow(OF, POSES, rng.normal(size=(VERTICES, OF.q)))
    made.add(Term(OF.shape, gaussian_term(np.ones(3), np.zeros(3), np.eye(3))))
    made.add(Term(OF.tissue, gaussian_term(np.ones(4), np.zeros(4), np.eye(4))))
    for k, rows in enumerate((np.array([0, 2, 3, 5]), np.array([1, 2, 4]))):
        skin = random_skin(rng, len(rows), OF.n + OF.m + 1)
        made.add_matches(k, rows, skin, random_matches(rng, len(rows)), np.ones(len(rows)))
        made.add(Term(OF.pose(k), Quadratic(0.0, np.zeros(OF.n), np.eye(OF.n))))
    return made


def test_two_poses_share_nothing(arrow):
    matrix = arrow.quadratic().hessian
    assert not matrix[OF.pose(0), OF.pose(1)].any()
    assert (np.abs(matrix[OF.body, OF.pose(0)]) > 0.0).all()
    np.testing.assert_allclose(matrix, matrix.T, rtol=1e-12)
    assert np.linalg.eigvalsh(matrix).min() > 0.0


def test_what_a_pose_shares_is_the_same_with_and_without_the_rest_of_the_matrix(arrow):
    matrix = arrow.quadratic().hessian
    for k in range(POSES):
        own, with_body = arrow.of_pose(k)
        np.testing.assert_array_equal(own, matrix[OF.pose(k), OF.pose(k)])
        np.testing.assert_allclose(with_body, matrix[OF.pose(k), OF.body], rtol=1e-12)


def test_the_sum_may_be_asked_for_twice(arrow):
    once, again = arrow.quadratic(), arrow.quadratic()
    np.testing.assert_array_equal(once.gradient, again.gradient)
    np.testing.assert_array_equal(once.hessian, again.hessian)


def test_what_is_integrated_out_leaves_the_marginals_precision(arrow):
    matrix = arrow.quadratic().hessian
    poses = slice(OF.body.stop, len(matrix))
    precision = schur_complement(matrix, poses)
    np.testing.assert_allclose(np.linalg.inv(precision), marginal_covariance(matrix, OF.body), rtol=1e-9, atol=1e-15)


def test_data_decide_everything_but_what_was_known_beforehand():
    known = Term(slice(0, 2), gaussian_term(np.zeros(2), np.zeros(2), np.diag([1.0, 3.0])))
    without_data = Quadratic(0.0, np.zeros(3), np.diag([1.0, 3.0, 7.0]))
    assert effective_parameters(without_data, [known]) == pytest.approx(1.0)
    much = without_data + Quadratic(0.0, np.zeros(3), 1e9 * np.eye(3))
    assert effective_parameters(much, [known]) == pytest.approx(3.0)


def test_matches_that_share_no_parameters_have_blocks_of_their_own():
    rng = np.random.default_rng(3)
    skin, matches, weights = random_skin(rng, 5, 3), random_matches(rng, 5), rng.uniform(0.5, 2.0, 5)
    blocks, gradients = data_blocks(skin, matches, weights)
    for k in range(5):
        alone = data_term(Points(skin.value[[k]], skin.d[[k]]), matches.at(slice(k, k + 1)), weights[[k]])
        np.testing.assert_allclose(blocks[k], alone.hessian, rtol=1e-12)
        np.testing.assert_allclose(gradients[k], alone.gradient, rtol=1e-12)
