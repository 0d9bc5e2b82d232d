"""Which share of a spine's curve each vertex of vertebrae, ribs and breastbone rides on.

It is that of the skin around them, so that no rib leaves the skin however the trunk bends: a vertebra rides as a whole
on its mean, a rib and the breastbone give way, each vertex on its own.
"""

from __future__ import annotations

from dataclasses import replace

import igl
import numpy as np
from numpy.typing import NDArray

from adapt.anatomy import Anatomy, Bone
from adapt.model.deformers import bind
from adapt.model.deformers.curve import BoundCurve
from adapt.model.derivatives import constant_points, still_points
from adapt.template_builder.body_trunk import CERVICAL

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

_VERTEBRA_WIDE, _OFF_MIDDLE = 0.048, 0.006  # m: no part of a vertebra, and not its middle, is farther to the side


def riding_along(anatomy: Anatomy) -> tuple[Bone, ...]:
    """The bones, those at the top of a curve with their shares of it."""
    p = constant_points(anatomy.landmarks, 1)
    shares = {d.bones[1]: d for d in anatomy.deformers if d.type == "curve"}
    made = []
    for bone in anatomy.bones:
        if bone.name not in shares:
            made.append(bone)
            continue
        bound = bind(anatomy, shares[bone.name], p, still_points(bone.vertices))
        assert isinstance(bound, BoundCurve)
        made.append(replace(bone, along=_whole(bone, bound.s)))
    return tuple(made)


def _whole(bone: Bone, shares: Floats) -> Floats:
    """Shares (N,) of which vertebrae have one each, and what is neither vertebra nor rib goes with the bone."""
    parts = _parts(bone.faces, len(bone.vertices))
    moved = shares.copy()
    skull = [] if bone.name != "head" else parts[: -len(CERVICAL)]
    for part in parts:
        z = bone.vertices[part, 2]
        if any(part is other for other in skull):
            moved[part] = 1.0
        elif np.abs(z).max() < _VERTEBRA_WIDE and abs(z.mean()) < _OFF_MIDDLE:
            moved[part] = shares[part].mean()
    return moved


def _parts(faces: Ints, count: int) -> list[Ints]:
    """The vertices of every connected part, in the order in which the parts were put together."""
    label = np.asarray(igl.vertex_components(faces)).ravel()
    firsts = [int(np.flatnonzero(label == k)[0]) for k in range(int(label.max()) + 1)]
    return [np.flatnonzero(label == k) for k in np.argsort(firsts)]
