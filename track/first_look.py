"""A first look, before a recording is tracked to its end: does it show the subject, and one limb only that is meant?

A search in vain costs seconds, so an arm's subject would be looked for in a leg's recording for minutes. Where the
first frame does not show the limb, a few others, spread over the recording, tell whether any does.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from adapt.match.correspondences import Target
from adapt.search.other_limb import limbs_that_could_be_meant
from capture.errors import CloudError
from capture.recording import Instant
from track.motion import MotionError
from track.tracked_frame import TrackedFrame
from track.tracker import Tracker

_LOOKED_AT = 6
_ALIKE = 1.25  # a second limb of which the skin fits worse than the subject's by more is another one

Ready = Callable[[Instant], Target | CloudError]
"""The cloud of an instant, or why there is none."""


def refuse_a_stranger(tracker: Tracker, moments: list[Instant], first: TrackedFrame, ready: Ready, where: Path) -> None:
    """Raise MotionError if the subject, not found in the first frame, is not found in any of a few others, either."""
    spread = np.unique(np.linspace(0, len(moments) - 1, _LOOKED_AT + 1).round().astype(int))[1:]
    reasons = [first.lost]
    for k in spread:
        target = ready(moments[k])
        if isinstance(target, CloudError):
            reasons.append(target.problem)
            continue
        frame, _ = tracker.first(target, moments[k].time_s)
        if not frame.lost:
            return
        reasons.append(frame.lost)
    raise MotionError(
        f"does not show the subject's {tracker.subject.anatomy.name} in any of {len(reasons)} frames looked at "
        f"(at {moments[0].time_s:.2f} s: {reasons[0]})",
        where=where,
        remedy="is it the same person and limb, and is the region right? If the limb does come into view, "
        "`--keep-searching`, or set a pose by hand and give it with `--poses`",
    )


def refuse_two_limbs(tracker: Tracker, target: Target, frame: TrackedFrame, where: Path) -> None:
    """Raise MotionError if the subject fits another limb as well, in what a tracked frame leaves of its cloud."""
    places = limbs_that_could_be_meant(tracker.subject.body, target, frame.theta, tracker.sample, most_worse=_ALIKE)
    if places is not None:
        raise MotionError(
            f"shows two limbs that could be the subject's at {frame.time_s:.2f} s, at {places[0]} and at {places[1]} m",
            where=where,
            remedy="say which with `--near X Y Z` or a region, or set a pose by hand and give it with `--poses`",
        )
