"""Bones lie as deep beneath a template's skin as beneath people's."""

from __future__ import annotations

from adapt.anatomy import Anatomy
from adapt.template_builder.check import Check
from adapt.template_builder.meshes import Mesh
from adapt.template_builder.plan import LimbPlan
from adapt.template_builder.superficial import Spot, depth_at


def depth_checks(anatomy: Anatomy, plan: LimbPlan) -> list[Check]:
    """Where bones lie just under people's skin, they lie as deep as in people."""
    checks = []
    for spot, depth in spot_depths(anatomy, plan):
        checks.append(Check(f"{spot.name} beneath the skin, no less", 1e3 * depth, 1e3 * spot.low, "mm", least=True))
        checks.append(Check(f"{spot.name} beneath the skin, no more", 1e3 * depth, 1e3 * spot.high, "mm"))
    return checks


def spot_depths(anatomy: Anatomy, plan: LimbPlan) -> list[tuple[Spot, float]]:
    """The plan's spots, each with its depth (m) in the anatomy at rest."""
    skin = Mesh(anatomy.skin_vertices, anatomy.skin_faces)
    bones = {bone.name: Mesh(bone.vertices, bone.faces) for bone in anatomy.bones}
    places = dict(zip(anatomy.landmark_names, anatomy.landmarks, strict=True))
    return [(spot, depth_at(spot, skin, bones, places)) for spot in plan.spots]
