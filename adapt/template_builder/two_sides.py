"""Both sides of a body from its right one: names, and mirror images by the rule S T S of ``adapt.mirror``.

A part of the right side is called ``femur_r``, its image ``femur_l``; a part of the middle has one name and is, or is
taken to be, its own image.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from adapt.anatomy import Bone, Coordinate, Deformer, Frame, Handle, Joint
from adapt.mirror import mirrored_points
from adapt.model.deformers import DEFORMER_TYPES
from adapt.model.frames import mirrored_frame
from adapt.model.joints import JOINT_TYPES

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Name = Callable[[str], str]

RIGHT, LEFT = "_r", "_l"


def right_name(middle: frozenset[str]) -> Name:
    """How a part of a right limb is called in a body whose middle has those names."""
    return lambda name: name if name in middle or name.endswith((RIGHT, LEFT)) else name + RIGHT


def left_name(name: str) -> str:
    """What the mirror image of a part is called.

    >>> left_name("femur_r"), left_name("head"), left_name("GH_l")
    ('femur_l', 'head', 'GH_r')
    """
    other = {RIGHT: LEFT, LEFT: RIGHT}.get(name[-2:])
    return name if other is None else name[:-2] + other


def named_frame(frame: Frame, name: Name) -> Frame:
    """The same frame of landmarks called otherwise."""
    parts = (tuple(map(name, getattr(frame, part))) for part in ("origin", "y_from", "y_to", "z_from", "z_to"))
    return Frame(*parts)


def named_joint(joint: Joint, name: Name) -> Joint:
    """The same joint of parts called otherwise."""
    return replace(
        joint,
        name=name(joint.name),
        parent=None if joint.parent is None else name(joint.parent),
        child=name(joint.child),
        coordinates=tuple(map(name, joint.coordinates)),
        axes=tuple((name(first), name(second)) for first, second in joint.axes),
        centre=tuple(map(name, joint.centre)),
        frames=tuple(named_frame(frame, name) for frame in joint.frames),
        other=None if joint.other is None else name(joint.other),
    )


def named_deformer(deformer: Deformer, name: Name) -> Deformer:
    """The same deformer of parts called otherwise."""
    frames = tuple(named_frame(frame, name) for frame in deformer.frames)
    return replace(deformer, name=name(deformer.name), bones=tuple(map(name, deformer.bones)), frames=frames)


def with_left_joints(joints: tuple[Joint, ...]) -> tuple[Joint, ...]:
    """The joints, and after them the left side's, whose bones move as the mirror images of the right ones."""
    left = (JOINT_TYPES[j.type].mirrored(named_joint(j, left_name)) for j in joints if left_name(j.name) != j.name)
    return (*joints, *left)


def with_left_coordinates(coordinates: tuple[Coordinate, ...], joints: tuple[Joint, ...]) -> tuple[Coordinate, ...]:
    """The coordinates, and after them the left side's, with ranges turned where its joints turn them."""
    turned = {joint.coordinates[k] for joint in joints for k in JOINT_TYPES[joint.type].turned_over}
    left = []
    for c in coordinates:
        if left_name(c.name) != c.name:
            low, high, rest = (-c.high, -c.low, 0.0 - c.rest) if c.name in turned else (c.low, c.high, c.rest)
            left.append(replace(c, name=left_name(c.name), low=low, high=high, rest=rest))
    return (*coordinates, *left)


def with_left_deformers(deformers: tuple[Deformer, ...]) -> tuple[Deformer, ...]:
    """The deformers, and after them the left side's."""
    sided = [d for d in deformers if left_name(d.name) != d.name]
    return (*deformers, *(DEFORMER_TYPES[d.type].mirrored(named_deformer(d, left_name)) for d in sided))


def with_left_handles(handles: tuple[Handle, ...]) -> tuple[Handle, ...]:
    """The handles, and after them the left side's."""
    left = []
    for h in handles:
        if left_name(h.name) != h.name:
            x, y, z = h.position
            left.append(Handle(left_name(h.name), left_name(h.bone), left_name(h.joint), (x, y, -z)))
    return (*handles, *left)


def left_bone(bone: Bone, columns: Ints) -> Bone:
    """A right bone's image; ``columns`` (H,) says of every handle which one is its image."""
    vertices, faces = mirrored_points(bone.vertices), bone.faces[:, [0, 2, 1]]
    frame = mirrored_frame(named_frame(bone.frame, left_name))
    return Bone(left_name(bone.name), frame, vertices, faces, bone.handle_weights[:, columns])


def images(names: tuple[str, ...]) -> Ints:
    """For every name (N,) where its image's stands."""
    return np.array([names.index(left_name(name)) for name in names], dtype=np.int64)
