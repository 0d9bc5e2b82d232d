"""The posed skin from the model's own blocks in plain NumPy: the twin that the compiled loops are held against."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from adapt.anatomy import Anatomy, Floats, Ints
from adapt.model.body import Body
from adapt.model.deformers import bind, carry
from adapt.model.deformers.deformer_type import Bound
from adapt.model.derivatives import Motion, Points, constant_points
from adapt.model.handles import local_scale
from adapt.model.kinematics import bone_motions


def skin_of_blocks(body: Body, theta: Floats, *, columns: int) -> Points:
    """The posed skin (V, 3) m with so many columns of derivatives: all by theta, or none."""
    motions = bone_motions(body.anatomy, theta, constant_points(body.p.value, len(theta)))
    none = np.zeros((3, 0))
    still = {name: Motion(motion.rotation, motion.translation, none, none) for name, motion in motions.items()}
    weights = body.anatomy.deformer_weights
    return _blend(body.anatomy, motions if columns else still, body.bound_skin, weights, columns=columns)


def skin_of_blocks_by_shape(body: Body, theta: Floats, vertices: Ints, *, along: Floats | None = None) -> Points:
    """Some ``vertices`` (N,) of it with derivatives by theta, then by the shape; see ``body.shaped_skin``."""
    own = np.zeros((len(vertices), 3, 0 if along is None else 1))
    if along is not None:
        own[:, :, 0] = local_scale(body.anatomy.skin_handle_weights[vertices], body.a)[:, None] * along
    p = _among(body.p, len(theta), np.zeros((len(body.p.value), 3, own.shape[2])))
    return _bound_and_blended(body, theta, p, _among(body.rest_skin_varying(vertices), len(theta), own), vertices)


def skin_of_blocks_by_v_hat(body: Body, theta: Floats, vertices: Ints) -> Points:
    """Some ``vertices`` (N,) of it with derivatives by theta, then by each one's own template vertex."""
    scale = local_scale(body.anatomy.skin_handle_weights[vertices], body.a)
    skin = Points(body.rest_skin[vertices], np.zeros((len(vertices), 3, 0)))
    p = constant_points(body.p.value, len(theta) + 3)
    own = scale[:, None, None] * np.eye(3)
    return _bound_and_blended(body, theta, p, _among(skin, len(theta), own), vertices)


def _bound_and_blended(body: Body, theta: Floats, p: Points, skin: Points, vertices: Ints) -> Points:
    anatomy = body.anatomy
    bound = [bind(anatomy, deformer, p, skin) for deformer in anatomy.deformers]
    weights = anatomy.deformer_weights[vertices]
    return _blend(anatomy, bone_motions(anatomy, theta, p), bound, weights, columns=p.n)


def _blend(
    anatomy: Anatomy, motions: Mapping[str, Motion], bound: Sequence[Bound], weights: Floats, *, columns: int
) -> Points:
    """Equation 3 for vertices with ``weights`` (N, D), with so many columns of derivatives."""
    value, d = np.zeros((len(weights), 3)), np.zeros((len(weights), 3, columns))
    for deformer, skin, share in zip(anatomy.deformers, bound, weights.T, strict=True):
        rows = _touched(share)
        moved = carry(deformer, skin.at(rows), motions)
        value[rows] += share[rows, None] * moved.value
        d[rows] += share[rows, None, None] * moved.d
    return Points(value, d)


def _touched(share: Floats) -> Ints | slice:
    """Where a deformer has weight (N,); everywhere if that is mostly so, because picking costs more than it saves."""
    rows = np.flatnonzero(share)
    return rows if len(rows) < 0.5 * len(share) else slice(None)


def _among(points: Points, n_theta: int, own: Floats) -> Points:
    """The same points with the (zero) columns of theta before their own, and ``own`` columns (N, 3, k) after them."""
    return Points(points.value, np.concatenate([np.zeros((*points.value.shape, n_theta)), points.d, own], axis=2))
