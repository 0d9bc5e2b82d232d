"""Bones of the anatomy from the bones of the source: closed, smooth, of moderate size."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from adapt.template_builder.meshes import Mesh, joined, largest_part, level_set, parts_of, simplified
from adapt.template_builder.plan import BonePlan
from adapt.template_builder.pose_bones import Placement
from adapt.template_builder.sources_myosim import SourceSkeleton
from capture.errors import AnatomyError


def bone_surface(
    skeleton: SourceSkeleton,
    placements: dict[str, Placement],
    plan: BonePlan,
    smooth: Callable[[Mesh, BonePlan], Mesh] | None = None,
) -> Mesh:
    """The bone's surface (m) as it stands in the skin: one closed part for every connected part of its sources.

    ``smooth`` closes and smooths a part; without it, a level set on a full grid does.
    """
    meshes = [part for name in plan.bodies for part in parts_of(_placed(skeleton, placements, name))]
    mended = [_mended(mesh, plan, smooth or _on_full_grid) for mesh in meshes]
    area = np.array([mesh.area() for mesh in mended])
    counts = np.maximum(120, plan.count * area / area.sum()).astype(int)
    return joined([simplified(mesh, count=int(count)) for mesh, count in zip(mended, counts, strict=True)])


def _on_full_grid(mesh: Mesh, plan: BonePlan) -> Mesh:
    return level_set([mesh], spacing=plan.spacing, blur=plan.blur)


def _mended(mesh: Mesh, plan: BonePlan, smooth: Callable[[Mesh, BonePlan], Mesh]) -> Mesh:
    """The mesh itself when it is closed and needs no smoothing, else the level set that closes and smooths it."""
    if plan.blur == 0.0 and mesh.is_closed():
        return mesh
    return largest_part(smooth(mesh, plan))


def envelope(surface: Mesh, plan: BonePlan) -> Mesh:
    """One connected closed surface around all parts of a bone; the bone itself when it has one part."""
    if plan.envelope == 0.0:
        return surface
    around = level_set([surface], spacing=0.001, grow=plan.envelope, blur=0.0005)
    whole = largest_part(around)
    if len(whole.faces) < 0.98 * len(around.faces):
        raise AnatomyError(f"the parts of {plan.name!r} do not touch", remedy="raise its envelope in the data module")
    return simplified(whole, count=3000)


def _placed(skeleton: SourceSkeleton, placements: dict[str, Placement], name: str) -> Mesh:
    body = skeleton.bodies[name]
    return Mesh(placements[name].points(body.vertices), body.faces)
