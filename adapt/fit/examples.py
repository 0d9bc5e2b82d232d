"""Which poses to adapt to: few that together tell the most about the body's shape.

A straight arm does not tell where the elbow is (paper, figure 8). What a pose tells about the shape is its
information matrix once the pose itself is integrated out; poses are chosen greedily for the largest gain in
log det of the sum (D-optimal design), starting from what is known of bodies beforehand.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.spatial import cKDTree

from adapt.anatomy import Floats
from adapt.fit.least_squares import data_term
from adapt.fit.pose import PoseFit
from adapt.fit.priors import shape_precision
from adapt.fit.sample import SkinSample
from adapt.model.body import Body, pose_skin_varying

_AROUND_LANDMARK_M = 0.05
_SHOWN = 0.25  # a landmark shows when this share of the skin around it has a target


def shape_information(body: Body, fit: PoseFit, sample: SkinSample) -> Floats:
    """What one fitted pose tells about the shape (m, m): H_ss - H_st H_tt^-1 H_ts."""
    skin = pose_skin_varying(body, fit.theta, with_shape=True, vertices=fit.matches.vertex)
    hessian = data_term(skin, fit.matches, sample.observations[fit.matches.vertex]).hessian
    n = len(fit.theta)
    pose = hessian[:n, :n] + 1e-6 * np.trace(hessian[:n, :n]) / n * np.eye(n)
    return np.asarray(hessian[n:, n:] - hessian[n:, :n] @ np.linalg.solve(pose, hessian[:n, n:]))


def choose_examples(body: Body, fits: Sequence[PoseFit], sample: SkinSample, count: int) -> list[int]:
    """Indices of the ``count`` poses that together tell the most about the shape, the best first."""
    informations = [shape_information(body, fit, sample) for fit in fits]
    known = shape_precision(body.anatomy, body.affine)
    chosen: list[int] = []
    while len(chosen) < min(count, len(fits)):
        rest = [k for k in range(len(fits)) if k not in chosen]
        best = max(rest, key=lambda k: np.linalg.slogdet(known + informations[k])[1])
        known = known + informations[best]
        chosen.append(best)
    return chosen


def landmarks_shown(body: Body, fits: Sequence[PoseFit], sample: SkinSample) -> dict[str, int]:
    """In how many of the poses each landmark shows: its skin has targets."""
    anatomy = body.anatomy
    tree = cKDTree(anatomy.skin_vertices[sample.vertices])
    counts = {}
    for name, point in zip(anatomy.landmark_names, anatomy.landmarks, strict=True):
        reach = max(_AROUND_LANDMARK_M, 1.2 * float(tree.query(point)[0]))
        around = sample.vertices[tree.query_ball_point(point, reach)]
        counts[name] = sum(bool(np.isin(around, fit.matches.vertex).mean() > _SHOWN) for fit in fits)
    return counts
