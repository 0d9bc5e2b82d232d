"""A motion as BVH: a skeleton's hierarchy and each joint's turns, for Blender, MotionBuilder, Maya and the like.

Lengths are in centimetres, as animation programs take them, y is up. At rest all axes are parallel, so a joint's turn
is that of its bone against its parent bone from the rest pose: in degrees about Z, then X, then Y, each as turned so
far. A joint whose centre glides on its parent has positions too, in the offset's stead as readers take them.

BVH has frames at even times and no way to say that one is not known, so who writes one says what a gap becomes.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import numpy as np
from scipy.interpolate import interp1d
from scipy.spatial.transform import Rotation, Slerp

from adapt.anatomy import Floats
from adapt.model.body import Body, bone_transforms, joint_centres, rest_theta
from adapt.subject import Subject
from capture.own import Mark, refuse_any_foreign, replaced_if_own
from capture.rigid import apply, inverse
from capture.upright import AXES
from track.export.even_times import EvenTimes, even_times
from track.export.upright import y_up
from track.motion import Motion, MotionError
from track.observed_bones import Bools

Gaps = Literal["bridge", "hold", "split"]
MARK = Mark(re.compile(rb"\AHIERARCHY\nROOT \S+\n\{\n\tOFFSET [^\n]+\n\tCHANNELS 6 [^\n]+[a-z]  \n"))
"""The format has no room for words; readers pass over the two blanks after the root's channels."""
_CM = 100.0
_GLIDES_M = 1e-4
_TURNS, _PLACES = "Zrotation Xrotation Yrotation", "Xposition Yposition Zposition"


@dataclass(frozen=True)
class BvhReport:
    """Files written; frames between known ones that were filled; frames left out, at the ends or as gaps."""

    paths: list[Path]
    filled: int
    left_out: int


@dataclass(frozen=True, eq=False)
class _Joint:
    """A bone's joint at N even times: its place (N, 3) m from the parent bone's joint, and its turn against that bone.

    ``offset`` (3,) m is its place at rest, ``tip`` (3,) m leads from it to the bone's far end.
    """

    bone: str
    parent: str | None
    offset: Floats
    tip: Floats
    places: Floats = field(repr=False)
    turns: Rotation = field(repr=False)

    @property
    def glides(self) -> bool:
        """Whether its place must be told in every frame."""
        return self.parent is None or bool(np.abs(self.places - self.offset).max() > _GLIDES_M)

    def columns(self) -> Floats:
        """Its channels (N, 6 or 3) in cm and degrees, without jumps by a whole turn."""
        degrees = np.rad2deg(np.unwrap(self.turns.as_euler("ZXY"), axis=0))
        return np.column_stack([_CM * self.places, degrees]) if self.glides else np.asarray(degrees)


def write_bvh(
    motion: Motion, subject: Subject, path: Path, *, up: Floats = AXES["y"], gaps: Gaps | None = None
) -> BvhReport:
    """Write a motion of the subject as ``.bvh``, from its first known frame to its last.

    ``up`` (3,) is the direction of the recording's frame that points up. ``gaps`` says what becomes of lost frames
    between known ones: ``bridge`` moves evenly over them, ``hold`` stands still in the pose before, ``split`` writes a
    file for every span of known frames, called ``NAME_1.bvh`` and so on.

    Raises:
        MotionError: no frame was tracked, or frames between others were lost and ``gaps`` is not given.
        OutputError: something stands there that bonetrack did not write; nothing is written then.
    """
    refuse_gaps(motion, gaps)
    even = even_times(motion.times)
    known, ends = _known(motion, even)
    times, lost = even.times[ends], int((~known).sum())
    if gaps == "hold":
        times = times[np.maximum.accumulate(np.where(known, np.arange(len(times)), 0))]
    joints = _joints(motion, subject.body, times, y_up(up))
    spans = _spans(known) if gaps == "split" else [slice(None)]
    paths = [path] if len(spans) == 1 else [path.with_stem(f"{path.stem}_{k}") for k in range(1, len(spans) + 1)]
    refuse_any_foreign(dict.fromkeys(paths, MARK))
    for one, span in zip(paths, spans, strict=True):
        with replaced_if_own(one, MARK) as partial:
            partial.write_text(_text(joints, 1.0 / even.rate_hz, span), encoding="utf-8")
    left_out = len(even.times) - len(times)
    return BvhReport(paths, 0, left_out + lost) if gaps == "split" else BvhReport(paths, lost, left_out)


def refuse_gaps(motion: Motion, gaps: Gaps | None) -> None:
    """Raise MotionError where no frame was tracked, or some between others were lost and nothing is said of it."""
    known, _ = _known(motion, even_times(motion.times))
    if gaps is None and not known.all():
        remedy = "say what becomes of them: --gaps bridge (move evenly), hold (stand still) or split (several files)"
        raise MotionError(f"BVH cannot leave out {int((~known).sum())} lost frame(s) between others", remedy=remedy)


def _known(motion: Motion, even: EvenTimes) -> tuple[Bools, slice]:
    """From the first known one of the even times to the last: which are known, and where they stand among all."""
    known = np.isfinite(even.at(np.where(motion.tracked, 0.0, np.nan)))
    if not known.any():
        raise MotionError("no frame was tracked", remedy="a motion without a pose cannot be animated")
    first, last = np.flatnonzero(known)[[0, -1]]
    ends = slice(int(first), int(last) + 1)
    return known[ends], ends


def _spans(known: Bools) -> list[slice]:
    """The spans of known frames; the first and the last frame are known."""
    edges = np.flatnonzero(np.diff(known.astype(int))) + 1
    return [slice(a, b) for a, b in np.array([0, *edges, len(known)]).reshape(-1, 2)]


def _joints(motion: Motion, body: Body, times: Floats, turned: Floats) -> list[_Joint]:
    """All joints, parents before children, at times (N,) s; lost frames between tracked ones are passed evenly."""
    tracked = np.flatnonzero(motion.tracked)
    moved = [bone_transforms(body, motion.thetas[t]) for t in tracked]
    centres = joint_centres(body, rest_theta(body))
    pivots = {joint.child: centres[joint.name] for joint in body.anatomy.joints}
    keys = np.r_[motion.times[tracked], motion.times[tracked[-1]] + 1.0]  # one more, so that there are two
    at = np.clip(times, keys[0], keys[-2])
    joints = []
    for joint in body.anatomy.joints:
        bone, parent = joint.child, joint.parent
        if parent is None:
            local = [turned @ frame[bone] for frame in moved]
        else:
            local = [inverse(frame[parent]) @ frame[bone] for frame in moved]
        from_parent = np.zeros(3) if parent is None else pivots[parent]
        places = np.array([apply(one, pivots[bone][None])[0] - from_parent for one in local])
        turns = Rotation.from_matrix(np.array([one[:3, :3] for one in local]))
        away = body.rest_bones[bone] - pivots[bone]
        joints.append(
            _Joint(
                bone,
                parent,
                np.zeros(3) if parent is None else pivots[bone] - from_parent,
                away[np.argmax((away**2).sum(axis=1))],
                interp1d(keys, np.vstack([places, places[-1:]]), axis=0)(at),
                Slerp(keys, Rotation.concatenate([turns, turns[-1:]]))(at),
            )
        )
    return joints


def _text(joints: list[_Joint], step_s: float, span: slice) -> str:
    children: dict[str | None, list[_Joint]] = {}
    for joint in joints:
        children.setdefault(joint.parent, []).append(joint)
    ordered: list[_Joint] = []
    lines = ["HIERARCHY", *_branch(children[None][0], children, ordered, "")]
    table = np.column_stack([joint.columns()[span] for joint in ordered])
    lines += ["MOTION", f"Frames: {len(table)}", f"Frame Time: {step_s:.8f}"]
    return "\n".join([*lines, *(" ".join(f"{value:.6f}" for value in row) for row in table)]) + "\n"


def _branch(
    joint: _Joint, children: Mapping[str | None, list[_Joint]], ordered: list[_Joint], indent: str
) -> Iterable[str]:
    """The lines of a joint and of all that hang on it; adds them to ``ordered``, which is the order of columns."""
    ordered.append(joint)
    hanging = children.get(joint.bone, [])
    yield f"{indent}{'ROOT' if joint.parent is None else 'JOINT'} {'_'.join(joint.bone.split())}"
    yield f"{indent}{{"
    yield f"{indent}\tOFFSET {_numbers(joint.offset)}"
    own = f"6 {_PLACES} {_TURNS}" if joint.glides else f"3 {_TURNS}"
    yield f"{indent}\tCHANNELS {own}{'  ' if joint.parent is None else ''}"
    for child in hanging:
        yield from _branch(child, children, ordered, f"{indent}\t")
    if not hanging:
        yield from (
            f"{indent}\tEnd Site",
            f"{indent}\t{{",
            f"{indent}\t\tOFFSET {_numbers(joint.tip)}",
            f"{indent}\t}}",
        )
    yield f"{indent}}}"


def _numbers(at: Floats) -> str:
    return " ".join(f"{_CM * value:.6f}" for value in at)
