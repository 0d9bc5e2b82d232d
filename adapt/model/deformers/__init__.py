"""What moves the skin (paper, equation 3): one file per type of deformer.

A deformer first binds the skin at rest, once for a body, then carries what it bound, once for a pose.
"""

from __future__ import annotations

from collections.abc import Mapping

from adapt.anatomy import Anatomy, Deformer, Floats
from adapt.model.deformers.bend import Bend
from adapt.model.deformers.curve import Curve
from adapt.model.deformers.deformer_type import Bound, DeformerType
from adapt.model.deformers.forearm import Forearm
from adapt.model.deformers.halfway import Halfway
from adapt.model.deformers.rigid import Rigid
from adapt.model.derivatives import Motion, Points

__all__ = ["DEFORMER_TYPES", "Bound", "DeformerType", "bind", "bone_shares", "carry", "deformer_problem"]

_TYPES: tuple[DeformerType, ...] = (
    Rigid(),
    Forearm(),
    Bend(),
    Halfway(),
    Curve(),
)
DEFORMER_TYPES = {each.name: each for each in _TYPES}
"""Every type of deformer by the name that an anatomy gives it."""


def bind(anatomy: Anatomy, deformer: Deformer, p: Points, skin: Points) -> Bound:
    """What a deformer has to know of rest points of ``skin`` and of the landmarks, whatever the pose."""
    bound: Bound = DEFORMER_TYPES[deformer.type].bind(anatomy, deformer, p, skin)
    return bound


def carry(deformer: Deformer, bound: Bound, motions: Mapping[str, Motion]) -> Points:
    """D_d(theta, p, v_tilde): where the deformer carries each bound point."""
    return DEFORMER_TYPES[deformer.type].carry(bound, tuple(motions[bone] for bone in deformer.bones))


def bone_shares(deformer: Deformer, bound: Bound) -> dict[str, Floats]:
    """The share (N,) of each bound point that rides on each of the deformer's bones; they sum up to 1."""
    return dict(zip(deformer.bones, DEFORMER_TYPES[deformer.type].bone_shares(bound), strict=True))


def deformer_problem(anatomy: Anatomy, deformer: Deformer) -> str | None:
    """Why these parts make no deformer of the type that they name, or None."""
    if deformer.type not in DEFORMER_TYPES:
        return f"no type {deformer.type!r}: the types are {', '.join(DEFORMER_TYPES)}"
    return DEFORMER_TYPES[deformer.type].problem(anatomy, deformer)
