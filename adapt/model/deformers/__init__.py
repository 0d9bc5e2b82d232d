"""What moves the skin (paper, equation 3): one module per deformer type, chosen by name here.

A deformer first binds the skin at rest, once for a body, then carries what it bound, once for a pose.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from adapt.anatomy import Anatomy, Deformer, Floats
from adapt.model.deformers.bend import BoundBend, bind_bend, carry_bend
from adapt.model.deformers.forearm import BoundForearm, bind_forearm, carry_forearm
from adapt.model.deformers.rigid import rigid
from adapt.model.variation import Motion, Points

Bound = Points | BoundForearm | BoundBend
"""Skin at rest, as its deformer wants it: all types know some of their points by ``at``."""


def bind(anatomy: Anatomy, deformer: Deformer, p: Points, skin: Points) -> Bound:
    """What a deformer has to know of rest points of ``skin`` and of the landmarks, whatever the pose."""
    match deformer.type:
        case "rigid":
            return skin
        case "forearm":
            return bind_forearm(anatomy, deformer.frames, p, skin)
        case "bend":
            return bind_bend(anatomy, deformer.frames, p, skin)


def carry(deformer: Deformer, bound: Bound, motions: Mapping[str, Motion]) -> Points:
    """D_d(theta, p, v_tilde): where the deformer carries each bound point."""
    if isinstance(bound, Points):
        return rigid(motions[deformer.bones[0]], bound)
    first, second = (motions[bone] for bone in deformer.bones)
    return carry_bend(bound, (first, second)) if isinstance(bound, BoundBend) else carry_forearm(bound, (first, second))


def riding(deformer: Deformer, bound: Bound) -> dict[str, Floats]:
    """The share (N,) of each bound point that rides on each of the deformer's bones; they sum up to 1."""
    if isinstance(bound, Points):
        return {deformer.bones[0]: np.ones(len(bound.value))}
    return dict(zip(deformer.bones, (1.0 - bound.t, bound.t), strict=True))
