"""What tracking decides by, as far as people may have reasons to set it: wide clothes, slow sensors, little time."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import asdict, dataclass, replace

import numpy as np

from adapt.fit.judge import FOLLOWED, Bounds
from track.motion import MotionError


@dataclass(frozen=True)
class Thresholds:
    """What decides whether a frame is tracked and a limb is searched: m, s, rad, shares and counts, as named.

    Attributes:
        sampled_vertices: of the skin, fitted to every frame.
        largest_residual_m: of matched skin, in the median.
        largest_skin_to_cloud_m: of all skin in sight, in the mean.
        least_coverage: share of the skin in sight that is found.
        largest_residual_without_root_m: always good enough for a pose found anew, and the most where its root bone does
            not show.
        least_bones_found_anew: with skin, that must show in a frame without a past; one alone may be anything.
        most_outline_on_other_surface: share of the outline beyond which the same surface goes on, in such a frame.
        found_anew_after_s: what is found when the last pose is older is found anew.
        compared_after_s: after which what was taken up from a forgotten pose is compared with what a search finds.
        longest_wait_for_search_s: between searches for bones out of sight, or in a cloud that stays as it was.
        back_to_rest_s: in which a joint that nothing tells of has gone most of the way back to rest.
        sd_by_hand_rad, sd_by_hand_m: how sure a pose is that a person set.

    Raises:
        MotionError: a value is not above zero, or not finite.
    """

    sampled_vertices: int = 2000
    largest_residual_m: float = FOLLOWED.residual_m
    largest_skin_to_cloud_m: float = FOLLOWED.skin_m
    least_coverage: float = FOLLOWED.coverage
    largest_residual_without_root_m: float = 0.002
    least_bones_found_anew: int = 2
    most_outline_on_other_surface: float = 0.4
    found_anew_after_s: float = 0.15
    compared_after_s: float = 0.2
    longest_wait_for_search_s: float = 8.0
    back_to_rest_s: float = 1.0
    sd_by_hand_rad: float = float(np.deg2rad(5.0))
    sd_by_hand_m: float = 0.015

    def __post_init__(self) -> None:
        for name, value in asdict(self).items():
            if not 0.0 < value < math.inf:
                raise MotionError(f"{name} cannot be {value:g}", remedy="give a number above zero")

    @property
    def followed(self) -> Bounds:
        """What the fit of a frame must keep to."""
        return Bounds(self.largest_residual_m, self.largest_skin_to_cloud_m, self.least_coverage)


def thresholds_of(stated: Iterable[tuple[str, float]]) -> Thresholds:
    """The thresholds with some stated by name.

    Raises:
        MotionError: there is none of a name, or a value cannot be.

    >>> thresholds_of([("least_coverage", 0.6)]).least_coverage
    0.6
    >>> thresholds_of([("coverage", 0.6)])
    Traceback (most recent call last):
        ...
    track.motion.MotionError: no threshold is called coverage; there are sampled_vertices, largest_residual_m, ...
    """
    usual, given = asdict(Thresholds()), dict(stated)
    if strange := sorted(set(given) - set(usual)):
        raise MotionError(f"no threshold is called {strange[0]}", remedy=f"there are {', '.join(usual)}")
    return replace(Thresholds(), **{name: type(usual[name])(value) for name, value in given.items()})


USUAL = Thresholds()
"""What nobody set."""
