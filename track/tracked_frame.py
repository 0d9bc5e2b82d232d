"""What tracking makes of a frame, and what the next frame needs of it."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from adapt.anatomy import Anatomy, Floats
from track.observed_bones import Bools

FORGOTTEN_S = 0.5  # a limb lost for longer is searched for anew, once in this time

FOLLOWED, FOUND, BY_HAND, BACKWARD = "followed", "found", "by hand", "backward"
"""How a frame's pose was come by: from the frame before, by search, from a pose set by hand, from a later frame."""


@dataclass(frozen=True)
class TrackedFrame:
    """One frame: pose (n,), covariance (n, n), which bones show (B,), and quality; ``lost`` is the reason, or empty.

    Of a tracked frame the pose is whole, coordinates of bones that do not show are guessed. ``late`` is the lever
    (n, n) (s) of sensors that did not look at once (``track.out_of_step``), (0, 0) where all did.
    """

    time_s: float
    theta: Floats = field(repr=False)
    covariance: Floats = field(repr=False)
    shown: Bools = field(repr=False)
    residual_m: float
    skin_m: float
    coverage: float
    matches: int
    lost: str
    how: str = FOLLOWED
    late: Floats = field(default_factory=lambda: np.zeros((0, 0)), repr=False)


@dataclass(frozen=True)
class TrackerState:
    """What the next frame needs: the last tracked pose, its time (-inf: none), its velocity, what is not known of it.

    ``shown`` are the bones that showed then; ``known_s`` says when each coordinate was last known (-inf: never),
    ``searched_s`` when the limb was last searched, ``wait_s`` how long to wait before what was not found is searched
    again, ``look`` how the cloud looked when the whole limb was searched in vain (``track.cloud_change``),
    ``taken_up_s`` when the limb was taken up from a forgotten pose, inf once that has been compared with what a search
    finds.
    """

    time_s: float
    theta: Floats
    velocity: Floats  # (n,) rad/s, m/s
    shown: Bools  # (B,)
    known_s: Floats  # (n,)
    searched_s: float = -np.inf
    wait_s: float = FORGOTTEN_S
    look: Floats = field(default_factory=lambda: np.zeros(0), repr=False)
    taken_up_s: float = np.inf


def lost_frame(anatomy: Anatomy, time_s: float, reason: str) -> TrackedFrame:
    """A frame without a pose, and why.

    >>> from adapt.anatomy_file import load_anatomy
    >>> frame = lost_frame(load_anatomy("upper-limb-right"), 0.5, "no cloud")
    >>> frame.lost, frame.theta.shape, bool(np.isnan(frame.theta).all()), frame.shown.tolist()
    ('no cloud', (10,), True, [False, False, False, False])
    """
    n, nowhere = len(anatomy.coordinates), np.zeros(len(anatomy.bones), dtype=bool)
    return TrackedFrame(time_s, np.full(n, np.nan), np.full((n, n), np.nan), nowhere, np.nan, np.nan, 0.0, 0, reason)
