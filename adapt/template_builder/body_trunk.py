"""The source's trunk as the body wants it: taken flat, vertebrae that bend as arcs, no logo on the breastbone.

In the source, collar bone and shoulder blade hang on massless bodies with coupled hinges, thorax and neck are one body
each, and a relief lies on the breastbone (eleven loose parts and their backs). Here every bone hangs on the bone that
it sits on, all frames are parallel at zero (X forward, Y up, Z right), and vertebrae share one angle an arc.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from adapt.template_builder.meshes import Mesh, joined, parts_of
from adapt.template_builder.sources_myosim import SourceBody, SourceHinge, SourceSkeleton, load_skeleton

Floats = NDArray[np.float64]

LUMBAR = ("lumbar5", "lumbar4", "lumbar3", "lumbar2", "lumbar1")
CERVICAL = ("c7", "c6", "c5", "c4", "c3", "c2", "c1")
TRUNK = ("sacrum", "pelvis", *LUMBAR, "thorax", *CERVICAL, "head", "clavicle_r", "scapula_r")

_SOURCE = (
    "sacrum",
    "pelvis",
    *LUMBAR,
    "torso",
    "head_attach",
    "neck",
    "head",
    "Arm_attachment",
    "chest_r",
    "cervical_spine",
    "myoarm_r_root",
    "clavicle_r",
    "clavphant_r",
    "scapula_r",
)
# Points of the source at zero, in the frame of its pelvis (m): the discs below T12 and C7, and beneath the skull.
_BELOW_T12, _BELOW_C7, _BELOW_SKULL = (-0.115, 0.2235, 0.0), (-0.1280, 0.5070, 0.0), (-0.1115, 0.6085, 0.0)
_LARGEST = 1000  # vertices of a bone of thorax or neck; the relief has more, or is open
_SMALLEST = 40  # vertices: discs between vertebrae, and a splinter of the collar bone, have less
_Z = np.array([0.0, 0.0, 1.0])
_ALL_WAYS = tuple(
    SourceHinge(f"scapula_r{axis}", direction, -1.0, 1.0) for axis, direction in zip("xyz", np.eye(3), strict=True)
)


def load_trunk() -> SourceSkeleton:
    """Sacrum and right hip bone, vertebrae, thorax, head, right collar bone and shoulder blade, each on the last.

    The vertebrae of an arc have one hinge's name: ``lumbar_arc`` and ``neck_arc`` are the angle from each to the next.
    """
    loaded = load_skeleton(_SOURCE, without=("l_pelvis",))
    at = _at_zero(loaded)
    mesh = {name: Mesh(body.vertices + at[name], body.faces) for name, body in loaded.bodies.items()}
    bodies = {"sacrum": replace(loaded.bodies["sacrum"], parent="", hinges=())}
    bodies["pelvis"] = _body("pelvis", "sacrum", at["pelvis"], at["sacrum"], (), mesh["pelvis"])
    below = "sacrum"
    for name in LUMBAR:
        bodies[name] = _body(name, below, at[name], at[below], (_arc("lumbar_arc"),), mesh[name])
        below = name
    at["thorax"] = np.array(_BELOW_T12)
    bones = joined([part for part in parts_of(mesh["torso"]) if len(part.vertices) <= _LARGEST and part.is_closed()])
    bodies["thorax"] = _body("thorax", below, at["thorax"], at[below], (_arc("thorax_pitch"),), bones)
    vertebrae = [part for part in parts_of(mesh["neck"]) if len(part.vertices) >= _SMALLEST]
    vertebrae.sort(key=lambda part: float(part.vertices[:, 1].mean()))
    below, disc = "thorax", np.array(_BELOW_C7)
    for name, part in zip(CERVICAL, vertebrae, strict=True):
        at[name] = disc
        bodies[name] = _body(name, below, disc, at[below], (_arc("neck_arc"),), part)
        below, disc = name, disc + (np.array(_BELOW_SKULL) - np.array(_BELOW_C7)) / len(CERVICAL)
    at["skull"] = np.array(_BELOW_SKULL)
    bodies["head"] = _body("head", below, at["skull"], at[below], (_arc("head_pitch"),), mesh["head"])
    collar = joined([part for part in parts_of(mesh["clavicle_r"]) if len(part.vertices) >= _SMALLEST])
    hinges = loaded.bodies["clavicle_r"].hinges
    bodies["clavicle_r"] = _body("clavicle_r", "thorax", at["clavicle_r"], at["thorax"], hinges, collar)
    blade = mesh["scapula_r"]
    bodies["scapula_r"] = _body("scapula_r", "clavicle_r", at["scapula_r"], at["clavicle_r"], _ALL_WAYS, blade)
    return SourceSkeleton(release=loaded.release, bodies=bodies)


def _arc(name: str) -> SourceHinge:
    return SourceHinge(name, _Z, -0.6, 0.6)


def _body(
    name: str, parent: str, origin: Floats, parent_origin: Floats, hinges: tuple[SourceHinge, ...], mesh: Mesh
) -> SourceBody:
    return SourceBody(name, parent, origin - parent_origin, np.eye(3), hinges, mesh.vertices - origin, mesh.faces)


def _at_zero(skeleton: SourceSkeleton) -> dict[str, Floats]:
    """Where every body's origin (3,) m stands in the sacrum's frame with all hinges at zero; frames are parallel there.

    Massless bodies between them are turned, and turn back.
    """
    rotation = {"sacrum": np.eye(3), "pelvis": np.eye(3)}
    at = {"sacrum": np.zeros(3), "pelvis": np.zeros(3)}
    for name, body in list(skeleton.bodies.items())[2:]:
        turned, position = body.in_parent({})
        rotation[name] = rotation[body.parent] @ turned
        at[name] = at[body.parent] + rotation[body.parent] @ position
    return at
