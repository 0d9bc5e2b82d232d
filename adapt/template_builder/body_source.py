"""The whole body's source: skin and skeleton, posed; every stage kept, so that what comes after can be done again."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from types import ModuleType

import numpy as np
from numpy.typing import NDArray

from adapt.template_builder import (
    body_pose,
    body_skin,
    body_trunk,
    depth_grid,
    lower_limb,
    lower_limb_bones,
    lower_limb_pose,
    pockets,
    pose_bones,
    upper_limb,
    upper_limb_pose,
)
from adapt.template_builder.assemble import source_of
from adapt.template_builder.meshes import Mesh, joined
from adapt.template_builder.plan import LimbPlan
from adapt.template_builder.pose_bones import Placement
from adapt.template_builder.skin import smooth_limb
from adapt.template_builder.sources_makehuman import SourceSkin, load_skin
from adapt.template_builder.sources_myosim import SourceBody, SourceSkeleton, shifted
from adapt.template_builder.stages import Stages

Floats = NDArray[np.float64]

SKIN = lower_limb.LOWER_LIMB_RIGHT.skin  # the leg's: with the knees where people have them
_LIMBS: tuple[tuple[LimbPlan, tuple[ModuleType, ...]], ...] = (
    (upper_limb.UPPER_LIMB_RIGHT, (upper_limb, upper_limb_pose, pose_bones)),
    (lower_limb.LOWER_LIMB_RIGHT, (lower_limb, lower_limb_bones, lower_limb_pose, pose_bones)),
)


@dataclass(frozen=True)
class PosedBody:
    """Skin, skeleton (right side and middle), where every body of it goes, and the angles and scales of that."""

    rig: SourceSkin
    skin: Mesh
    skeleton: SourceSkeleton
    placements: dict[str, Placement]
    pose: dict[str, float]

    def with_both_hips(self) -> SourceSkeleton:
        """The skeleton whose pelvis has its left hip bone: the right one's image, as the pelvis stands upright."""
        pelvis = self.skeleton.bodies["pelvis"]
        right = Mesh(pelvis.vertices, pelvis.faces)
        left = Mesh(pelvis.vertices * [1.0, 1.0, -1.0], pelvis.faces[:, ::-1])
        both = joined([right, left])
        whole = replace(pelvis, vertices=both.vertices, faces=both.faces)
        return replace(self.skeleton, bodies=self.skeleton.bodies | {"pelvis": whole})


def posed_body(count: int, finer: tuple[body_skin.Finer, ...], stages: Stages) -> PosedBody:
    """The source skeleton in the source skin, evened to about ``count`` vertices."""
    rig = load_skin(SKIN.targets, stature=SKIN.stature)
    surface = stages.kept(
        "filled", (SKIN.targets, SKIN.stature, pockets, body_skin), lambda: body_skin.filled_skin(rig)
    )
    skin = stages.kept(
        "skin",
        (surface, body_skin, count, finer),
        lambda: body_skin.even_body(surface, rig, finer, "r-finger-3-4", count=count),
    )
    depth = stages.kept("depth", (skin, depth_grid), lambda: depth_grid.depth_grid(skin, halved=True))
    pose: dict[str, float] = {}
    placements: dict[str, Placement] = {}
    bodies: dict[str, SourceBody] = {}
    for plan, modules in _LIMBS:
        skeleton = shifted(source_of(plan), plan.shifts)
        values, placed = stages.kept(plan.name, (SKIN, *modules), partial(_posed_limb, plan, skeleton, rig))
        pose, placements, bodies = pose | values, placements | placed, bodies | skeleton.bodies
    trunk = body_trunk.load_trunk()
    values, placed = stages.kept(
        "trunk",
        (skin, body_pose, body_trunk, pose_bones, *(p.translation for p in placements.values())),
        lambda: body_pose.pose_trunk(trunk, placements, skin, depth),
    )
    tilt = pose["root_rz"] - values["root_rz"]  # the pelvis turns about the thighs' heads, which stay
    pose |= values | {"hip_flexion_r": pose["hip_flexion_r"] + tilt}
    return PosedBody(rig, skin, SourceSkeleton(trunk.release, bodies | trunk.bodies), placements | placed, pose)


def _posed_limb(
    plan: LimbPlan, skeleton: SourceSkeleton, rig: SourceSkin
) -> tuple[dict[str, float], dict[str, Placement]]:
    """A limb as its own template has it."""
    smooth = smooth_limb(rig.vertices, rig.quads, plan.skin.cuts[0], rig.joints[plan.skin.tip])
    return plan.pose(skeleton, rig, smooth)
