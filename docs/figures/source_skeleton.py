"""How deep the source skeleton's own bones stand in each other (needs the ``build`` extra)."""

from __future__ import annotations

import numpy as np
from bones import overlap
from numpy.typing import NDArray

from adapt.build.pose_bones import Placement
from adapt.build.sources_myosim import SourceSkeleton, load_skeleton
from adapt.build.upper_limb import UPPER_LIMB_RIGHT

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


def load_source() -> SourceSkeleton:
    """The bodies that the right upper limb is made of."""
    return load_skeleton(UPPER_LIMB_RIGHT.bodies)


def source_overlap(skeleton: SourceSkeleton, first: str, second: str, degrees: dict[str, float]) -> float:
    """Overlap (m) of two bones, named as in the anatomy, with its coordinates at ``degrees``."""
    posed = _posed(skeleton, degrees)
    return overlap(posed[first], posed[second])


def _posed(skeleton: SourceSkeleton, degrees: dict[str, float]) -> dict[str, tuple[Floats, Ints]]:
    """Every bone of the anatomy as the source has it, unscaled: vertices (N, 3) m and faces."""
    angles = {
        hinge: sign * np.deg2rad(degrees[name])
        for name, (hinge, sign) in UPPER_LIMB_RIGHT.rest_from.items()
        if name in degrees
    }
    placed: dict[str, Placement] = {}
    for name, body in skeleton.bodies.items():
        parent = placed.get(body.parent)
        rotation, position = body.turned(angles), body.position
        if parent is not None:
            rotation, position = parent.rotation @ rotation, parent.points(position)
        placed[name] = Placement(rotation, position, np.ones(3))
    return {bone.name: _joined(skeleton, placed, bone.bodies) for bone in UPPER_LIMB_RIGHT.bones}


def _joined(skeleton: SourceSkeleton, placed: dict[str, Placement], names: tuple[str, ...]) -> tuple[Floats, Ints]:
    bodies = [skeleton.bodies[name] for name in names]
    first = np.cumsum([0] + [len(body.vertices) for body in bodies])
    vertices = [placed[body.name].points(body.vertices) for body in bodies]
    faces = [body.faces + start for body, start in zip(bodies, first, strict=False)]
    return np.concatenate(vertices), np.concatenate(faces)
