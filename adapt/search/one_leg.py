"""Of a person with both legs in view, all example poses must be of one and the same leg, the asked one.

Frame by frame a search takes either. Where both are found, the side on which a leg lies tells which it is
(``own_side``); the other frames' legs are then told by where these two stood, nearest in time.
"""

from __future__ import annotations

from dataclasses import replace

from adapt.match.skin_sample import SkinSample
from adapt.model.body import Body
from adapt.search.candidates import Candidate
from adapt.search.first_pose import is_sound, try_pose
from adapt.search.other_limb import on_its_side
from adapt.search.own_side import is_nearer_to, lies_on_its_side

_REASON = "the other leg was found"


def on_one_leg(
    body: Body, used: list[Candidate], others: list[Candidate], sample: SkinSample
) -> tuple[list[Candidate], list[Candidate], dict[float, str]]:
    """The candidates used and the others, all on the asked leg; and by their times why some are left out.

    Where one of those used is left out, one of the others takes its place.
    """
    beside = [_beside(body, one, sample) for one in (*used, *others)]
    told = [one for one in beside if one.beside is not None]
    moved = [one if one.beside is not None else _moved(body, one, told, sample) for one in beside]
    crossed = {one.instant.time_s: _REASON for one, to in zip(beside, moved, strict=True) if to is None}
    kept, spare = ([one for one in some if one is not None] for some in (moved[: len(used)], moved[len(used) :]))
    short = len(used) - len(kept)
    return [*kept, *spare[:short]], spare[short:], crossed


def _beside(body: Body, candidate: Candidate, sample: SkinSample) -> Candidate:
    """The candidate, posed in the leg on the asked side where both of a person's are found."""
    pose, beside = on_its_side(body, candidate.target, candidate.pose, sample)
    return replace(candidate, pose=pose, beside=beside)


def _moved(body: Body, candidate: Candidate, told: list[Candidate], sample: SkinSample) -> Candidate | None:
    """The candidate, moved to the asked leg where it lies in the other; None where it cannot be moved there."""
    told = sorted(told, key=lambda one: abs(one.instant.time_s - candidate.instant.time_s))
    for one in told:
        assert one.beside is not None
        on_it = is_nearer_to(body, candidate.pose.fit.theta, one.pose.fit.theta, one.beside)
        if on_it is not None:
            break
    else:
        return candidate
    if on_it:
        return candidate
    for one in told:
        pose = try_pose(body, candidate.target, sample, one.pose.fit.theta)
        if (
            pose is not None
            and is_sound(pose)
            and lies_on_its_side(body, pose.fit.theta, candidate.pose.fit.theta) is True
        ):
            return replace(candidate, pose=pose)
    return None
