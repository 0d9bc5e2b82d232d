"""Back in time from a frame that is sure into the gap before it.

A limb that comes back may be found late, the frames before a pose set by hand were tracked without it, and a pose found
anew rests on one image alone. So from a frame like these, and from the one after a find, tracking runs backward, until
it meets what tracking forward found, or has not done better for half a second. Of each frame the better of the two
poses is kept as it is: nothing is blended, so poses may jump where both are joined.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from adapt.anatomy import Anatomy
from adapt.model.pose_space import pose_difference
from track.observed_bones import coordinates_known
from track.tracked_frame import BACKWARD, BY_HAND, FOUND, TrackedFrame, TrackerState
from track.tracker import Tracker

Step = Callable[[int, TrackerState], tuple[TrackedFrame, TrackerState]]
"""Tracks the frame of an index from a state in which time runs backward (seconds are negative)."""

_GIVEN_UP_S = 0.5  # tracking goes no farther back beyond the last frame in which it did better
_CLEARLY = 0.8  # a pose is better than another that shows as much if its residual is this share of the other's
_NEARER = 0.9  # or if all its skin is that much nearer to the cloud
_MEET_RAD, _MEET_M = np.deg2rad(3.0), 0.008  # poses nearer than this tell the same


def anchors(frames: list[TrackedFrame]) -> list[int]:
    """Frames to go back from: the first after a gap, those found anew and the ones after them, those set by hand.

    >>> from dataclasses import replace
    >>> from adapt.anatomy_file import load_anatomy
    >>> from track.tracked_frame import lost_frame
    >>> lost = lost_frame(load_anatomy("upper-limb-right"), 0.0, "nothing there")
    >>> tracked = replace(lost, lost="")
    >>> anchors([tracked, lost, lost, tracked, tracked])  # the first after the gap
    [3]
    """
    tracked = [not frame.lost for frame in frames]
    found, by_hand = ([frame.how == how for frame in frames] for how in (FOUND, BY_HAND))
    return [
        k
        for k in range(1, len(frames))
        if tracked[k] and (found[k] or found[k - 1] or by_hand[k] or not tracked[k - 1])
    ]


def go_back(tracker: Tracker, frames: list[TrackedFrame], anchor: int, step: Step) -> list[TrackedFrame]:
    """The frames with those before the anchor replaced where tracking backward does better.

    From a pose set by hand it is preferred up to the gap before it, and no pose set by hand is ever replaced.
    """
    anatomy, revised = tracker.subject.anatomy, frames.copy()
    state = _turned_round(tracker, frames, anchor)
    preferred = frames[anchor].how == BY_HAND
    in_gap, better_s = False, frames[anchor].time_s
    for k in range(anchor - 1, -1, -1):
        forward = frames[k]
        if forward.how == BY_HAND or better_s - forward.time_s > _GIVEN_UP_S:
            break
        preferred &= not (in_gap and not forward.lost)
        in_gap |= bool(forward.lost)
        backward, state = step(k, state)
        if _meet(anatomy, forward, backward):
            break
        if not backward.lost and (forward.lost or preferred or _better(backward, forward)):
            revised[k] = replace(backward, time_s=forward.time_s, how=BACKWARD)
            better_s = forward.time_s
    return revised


def _turned_round(tracker: Tracker, frames: list[TrackedFrame], anchor: int) -> TrackerState:
    """The state after the anchor with time reversed; its velocity is that at which the next frame was reached."""
    anatomy, frame = tracker.subject.anatomy, frames[anchor]
    velocity = np.zeros_like(frame.theta)
    following = frames[anchor + 1] if anchor + 1 < len(frames) else frame
    if following is not frame and not following.lost:
        apart = pose_difference(anatomy, following.theta, frame.theta)
        velocity = -apart / (following.time_s - frame.time_s)
    known = coordinates_known(anatomy, frame.shown[None])[0]
    return TrackerState(-frame.time_s, frame.theta, velocity, frame.shown, np.where(known, -frame.time_s, -np.inf))


def _meet(anatomy: Anatomy, one: TrackedFrame, other: TrackedFrame) -> bool:
    """Whether both are tracked, show the same bones, and are in the same pose as far as it is known."""
    if one.lost or other.lost or (one.shown != other.shown).any():
        return False
    near = np.array([_MEET_RAD if c.unit == "rad" else _MEET_M for c in anatomy.coordinates])
    apart = np.abs(pose_difference(anatomy, one.theta, other.theta))
    return bool((apart < near)[coordinates_known(anatomy, one.shown[None])[0]].all())


def _better(one: TrackedFrame, other: TrackedFrame) -> bool:
    """Whether more bones show, or as many and clearly nearer to the cloud."""
    more = int(one.shown.sum()) - int(other.shown.sum())
    nearer = one.residual_m < _CLEARLY * other.residual_m or one.skin_m < _NEARER * other.skin_m
    return more > 0 or (more == 0 and nearer)
