"""Who could be meant, of all that the images of a recording show: one person, or several, or a person and furniture.

Of several, the one who is nearest in most images is meant, by the area that they show. Something else could be meant as
well if it is there in a good part of the images and

- it is about as large as the one who is meant, or nearer and at least a limb: who records an arm stands it in front;
- it moves. Furniture does not, and neither does somebody who only looks on, while the one who is meant does.

Then it is for the user to say which.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.sparse.csgraph import connected_components

from capture.cloud.motion import gone_share
from capture.cloud.preprocess import clean_depth
from capture.errors import CloudError
from capture.recording import Instant, Recording, read_depth
from capture.rigid import Floats

REACH_M = 0.25
"""What comes closer than this to somebody belongs to him."""

LIMB_M2 = 0.01
"""A child's forearm covers about this much of an image."""

LARGEST_PERSON_M = 2.4
"""The longest side of a box around one person at one instant, arms stretched out."""

_PRESENT = 1.0 / 3.0  # of the instants looked at
_LIMB_M = 0.25  # as long as this, at least
_AS_LARGE, _AS_LONG = 0.25, 0.6  # times the area, and the longest side, of the one who is meant
_MOVES = 0.05  # of what is seen has gone at the next instant looked at; of furniture it is less than 0.01
_OFTEN = 75.0  # percentile over all images: many a motion pauses


@dataclass(frozen=True, eq=False)
class Seen:
    """What one image shows of somebody.

    Attributes:
        number: which of the instants looked at.
        time_s: when.
        sensor: whose image.
        points: some of the points (N, 3) (m, sensor frame).
        minimum, maximum: smallest and largest coordinates (3,) (m, common frame).
        area_m2: how much of him is seen.
        nearest: whether he is the nearest large one in the image.
        minor: whether he is nearer than the nearest large one, and so much smaller that he is not him.
    """

    number: int
    time_s: float
    sensor: str
    points: Floats
    minimum: Floats
    maximum: Floats
    area_m2: float
    nearest: bool = False
    minor: bool = False


@dataclass(frozen=True, eq=False)
class Candidate:
    """All that was seen of somebody; ``gone`` is which share of him moves on to elsewhere, NaN if nobody can tell."""

    seen: tuple[Seen, ...]
    gone: float = np.nan

    @property
    def nearest_m2(self) -> float:
        """The area that he shows in the images in which he is the nearest."""
        return sum(one.area_m2 for one in self.seen if one.nearest)

    @cached_property
    def area_m2(self) -> float:
        """How much of him is seen at an instant (median), by the sensor that sees most."""
        return float(np.median([max(one.area_m2 for one in now) for now in self._by_instant()]))

    @cached_property
    def side_m(self) -> float:
        """The longest side of the box around him at an instant (median)."""
        return float(np.median([np.max(size) for _, size in self.sizes()]))

    @property
    def distance_m(self) -> float:
        """How far he is from the sensors (median)."""
        return float(np.median([np.median(one.points[:, 2]) for one in self.seen]))

    @property
    def place(self) -> Floats:
        """The middle (3,) (m, common frame) of where he mostly is."""
        return np.asarray(np.median([(one.minimum + one.maximum) / 2.0 for one in self.seen], axis=0))

    @property
    def instants(self) -> int:
        """At how many instants he is seen."""
        return len(self._by_instant())

    @property
    def moves(self) -> bool:
        """Whether he is known to move."""
        return self.gone > _MOVES

    def sizes(self) -> list[tuple[float, Floats]]:
        """For each instant its time (s) and the sides (3,) (m) of the box around him."""
        sizes = []
        for now in self._by_instant():
            low, high = (np.stack([getattr(one, end) for one in now]) for end in ("minimum", "maximum"))
            sizes.append((now[0].time_s, np.asarray(high.max(axis=0) - low.min(axis=0))))
        return sizes

    def distance_to(self, point: Floats) -> tuple[float, float]:
        """How near (m) his boxes come to a point (3,), and how near he mostly is, which tells equals apart."""
        outside = [np.maximum(np.maximum(one.minimum - point, point - one.maximum), 0.0) for one in self.seen]
        return float(np.linalg.norm(outside, axis=1).min()), float(np.linalg.norm(self.place - point))

    def _by_instant(self) -> list[list[Seen]]:
        numbers = sorted({one.number for one in self.seen})
        return [[one for one in self.seen if one.number == number] for number in numbers]


def candidates(seen: Sequence[Seen]) -> list[Candidate]:
    """Everybody who is seen. Boxes that come close to each other at any time are of one person.

    What is minor and reaches into somebody's box is left to that box.

    >>> def at(x):
    ...     return Seen(0, 0.0, "a", np.zeros((1, 3)), np.array([x, 0.0, 2.0]), np.array([x + 0.4, 1.7, 2.3]), 0.4)
    >>> [len(one.seen) for one in candidates([at(0.0), at(0.5), at(1.5)])]  # the first two are 0.1 m apart
    [2, 1]
    """
    large, minor = [one for one in seen if not one.minor], [one for one in seen if one.minor]
    return [*_grouped(large), *_grouped([one for one in minor if (_gaps([one], large) > 0.0).all()])]


def choose(
    recording: Recording, at: Sequence[Instant], everybody: Sequence[Candidate]
) -> tuple[Candidate, list[Candidate]]:
    """The one who is meant, and what was left out though it is of that size, because it does not move.

    Raises:
        CloudError: several could be meant.
        RecordingError: an image cannot be read.
    """
    first = max(everybody, key=lambda one: one.nearest_m2)
    others = [one for one in everybody if one is not first and _could_be_meant(one, first, len(at))]
    if not others:
        return first, []
    looked_at = [replace(one, gone=_gone(recording, at, one)) for one in (first, *others)]
    moving = [one for one in looked_at if one.moves]
    if len(moving) == 1:
        return moving[0], [one for one in looked_at if one is not moving[0]]
    several = moving or looked_at
    places = ", at ".join(" ".join(f"{value:.2f}" for value in one.place) for one in several)
    raise CloudError(
        f"{len(several)} could be meant, at {places} m",
        where=recording.path,
        remedy="say which with `--near X Y Z`, one of these places, or state where the limb is with "
        "`--region X0 Y0 Z0 X1 Y1 Z1`",
    )


def _could_be_meant(other: Candidate, first: Candidate, instants: int) -> bool:
    """Whether somebody is of a size, and in view often enough, to be meant instead of the first."""
    if other.instants < _PRESENT * instants or not _LIMB_M < other.side_m < LARGEST_PERSON_M:
        return False
    as_large = other.area_m2 > _AS_LARGE * first.area_m2 and other.side_m > _AS_LONG * first.side_m
    return as_large or other.distance_m < first.distance_m


def _gone(recording: Recording, at: Sequence[Instant], somebody: Candidate) -> float:
    """Which share of him has gone at the next instant looked at, in images in which much has; NaN of one instant."""
    shares = []
    for one in somebody.seen:
        frame = at[one.number + 1].frames.get(one.sensor) if one.number + 1 < len(at) else None
        if frame is not None:
            sensor = recording.sensor(one.sensor)
            depth = clean_depth(read_depth(sensor, frame), sensor.camera)
            shares.append(gone_share(one.points, sensor.camera, depth))
    return float(np.nanpercentile(shares, _OFTEN)) if np.isfinite(shares).any() else np.nan


def _grouped(seen: Sequence[Seen]) -> list[Candidate]:
    if not seen:
        return []
    count, labels = connected_components(_gaps(seen, seen) < REACH_M, directed=False)
    return [Candidate(tuple(one for one, label in zip(seen, labels, strict=True) if label == k)) for k in range(count)]


def _gaps(some: Sequence[Seen], others: Sequence[Seen]) -> Floats:
    """How far (N, M) (m) boxes are apart along the axis along which they are farthest apart; below 0 if not at all."""
    low, high = (np.stack([getattr(one, end) for one in some])[:, None] for end in ("minimum", "maximum"))
    others_low, others_high = (np.stack([getattr(one, end) for one in others])[None] for end in ("minimum", "maximum"))
    return np.asarray(np.maximum(low - others_high, others_low - high).max(axis=2))
