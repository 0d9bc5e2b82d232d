"""One figure of what several sensors show of a person: joints and confidences in the room."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from adapt.search.figure.names import MIRRORED_JOINTS
from adapt.search.figure.view import LEAST_CONFIDENCE, FigureView
from capture.rigid import apply

Floats = NDArray[np.float64]

_STRAY_M = 0.15  # from the surest view's joint: others beyond are left out
_FARTHEST_M = 0.5  # what counts at most when labellings are compared
_IN_DOUBT_M = 0.03  # as much nearer must a view be with sides exchanged


@dataclass(frozen=True, eq=False)
class Figure:
    """Joints (19, 3) m in the room and confidences (19,), 0 to 1."""

    joints: Floats = field(repr=False)
    confidence: Floats = field(repr=False)

    @property
    def is_person(self) -> bool:
        """Whether the network is sure enough that this is a person with these joints."""
        return float(np.median(self.confidence)) >= LEAST_CONFIDENCE

    def mirrored(self) -> Figure:
        """The same joints with left and right exchanged: the other way to read a view of limbs."""
        order = list(MIRRORED_JOINTS)
        return Figure(self.joints[order], self.confidence[order])


def join_views(views: Sequence[FigureView], world_from_sensor: Sequence[Floats]) -> Figure:
    """The figure that views of several sensors (4, 4) show together.

    Sides are as the surest view has them: another view is read with sides exchanged where that lies clearly nearer.
    Each joint is the mean of the views that agree with the surest one of it, weighted by confidence squared.

    Raises:
        ValueError: there is no view.
    """
    if not views:
        raise ValueError("no view to join")
    figures = [
        Figure(apply(placed, view.joints), view.confidence)
        for view, placed in zip(views, world_from_sensor, strict=True)
    ]
    surest = max(figures, key=lambda figure: float(figure.confidence.sum()))
    agreed = [figure if figure is surest else _same_sides(figure, surest) for figure in figures]
    joints = np.stack([figure.joints for figure in agreed])
    weights = np.stack([figure.confidence for figure in agreed]) ** 2 + 1e-6
    best = joints[weights.argmax(axis=0), np.arange(joints.shape[1])]
    weights = weights * (np.linalg.norm(joints - best, axis=2) < _STRAY_M)
    mean = (joints * weights[..., None]).sum(axis=0) / weights.sum(axis=0)[:, None]
    return Figure(mean, np.max([figure.confidence for figure in agreed], axis=0))


def _same_sides(figure: Figure, surest: Figure) -> Figure:
    """A figure, or with sides exchanged where it lies nearer to the surest one so."""
    as_it_is, exchanged = (_distance(reading, surest) for reading in (figure, figure.mirrored()))
    return figure.mirrored() if exchanged + _IN_DOUBT_M < as_it_is else figure


def _distance(one: Figure, other: Figure) -> float:
    """How far joints are apart (m), by confidence."""
    apart = np.minimum(np.linalg.norm(one.joints - other.joints, axis=1), _FARTHEST_M)
    return float(np.average(apart, weights=one.confidence * other.confidence + 1e-9))
