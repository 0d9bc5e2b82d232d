"""Which poses to adapt to: few that together tell the most about the body's shape.

A straight arm does not tell where the elbow is (paper, figure 8). What a pose tells about the shape is its
information matrix once the pose itself is integrated out; poses are chosen greedily, first so that every landmark
shows that shows at all, then for the largest gain in log det of the sum (D-optimal design), starting from what is
known of bodies beforehand.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from adapt.anatomy import Anatomy
from adapt.fit.pose import PoseFit
from adapt.fit.posterior import shape_information
from adapt.match.skin_sample import SkinSample
from adapt.model.body import Body
from adapt.model.shape.population import ANYBODY, Person
from adapt.model.shape.prior import shape_prior

_AROUND_LANDMARK_M = 0.05
_MATTERS = 0.5  # fit weight of the skin nearest to a landmark from which on it is worth a pose of its own
_SHOWN = 0.25  # a landmark shows when this share of the skin around it has a target


def choose_examples(
    body: Body, fits: Sequence[PoseFit], sample: SkinSample, count: int, person: Person = ANYBODY
) -> list[int]:
    """Indices of the ``count`` poses that together show the landmarks and tell the most about the shape.

    Greedy: while a pose is left that shows landmarks which those before it did not, the one that shows most of them;
    otherwise the one that tells the most.
    """
    informations = [shape_information(body, fit, sample) for fit in fits]
    shows = _shows(body, fits, sample)
    known, hidden = shape_prior(body.anatomy, body.affine, person).precision, _matter(body.anatomy)
    chosen: list[int] = []
    while len(chosen) < min(count, len(fits)):
        rest = [k for k in range(len(fits)) if k not in chosen]
        best = max(rest, key=lambda k: ((shows[k] & hidden).sum(), np.linalg.slogdet(known + informations[k])[1]))
        known, hidden = known + informations[best], hidden & ~shows[best]
        chosen.append(best)
    return chosen


def landmarks_shown(body: Body, fits: Sequence[PoseFit], sample: SkinSample) -> dict[str, int]:
    """In how many of the poses each landmark shows: its skin has targets."""
    counts = _shows(body, fits, sample).sum(axis=0)
    return {name: int(count) for name, count in zip(body.anatomy.landmark_names, counts, strict=True)}


def _matter(anatomy: Anatomy) -> NDArray[np.bool_]:
    """Which of P landmarks lie where skin counts in fitting (P,), as held fingertips do not."""
    _, nearest = cKDTree(anatomy.skin_vertices).query(anatomy.landmarks)
    return np.asarray(anatomy.fit_weight[nearest] > _MATTERS)


def _shows(body: Body, fits: Sequence[PoseFit], sample: SkinSample) -> NDArray[np.bool_]:
    """Which of K poses show which of P landmarks (K, P)."""
    anatomy = body.anatomy
    tree = cKDTree(anatomy.skin_vertices[sample.vertices])
    shows = np.zeros((len(fits), len(anatomy.landmarks)), dtype=bool)
    for j, point in enumerate(anatomy.landmarks):
        reach = max(_AROUND_LANDMARK_M, 1.2 * float(tree.query(point)[0]))
        around = sample.vertices[tree.query_ball_point(point, reach)]
        shows[:, j] = [np.isin(around, fit.matches.vertex).mean() > _SHOWN for fit in fits]
    return shows
