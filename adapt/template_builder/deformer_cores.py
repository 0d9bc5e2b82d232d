"""How far the body's deformers reach: each holds a core, and between cores their weights are bounded biharmonic.

Of limbs the cores are the bones. A trunk's deformers hold more: all that ribs or skull enclose goes with them. A
pelvis is held half by either hip.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from adapt.anatomy import Deformer
from adapt.mirror import mirrored_points
from adapt.template_builder import weights
from adapt.template_builder.body import BODY
from adapt.template_builder.body_bones import MIDDLE
from adapt.template_builder.body_source import PosedBody
from adapt.template_builder.body_trunk import CERVICAL
from adapt.template_builder.meshes import Mesh, compacted
from adapt.template_builder.skinning import along_line
from adapt.template_builder.stages import Stages
from adapt.template_builder.tetrahedra import TetMesh
from adapt.template_builder.two_sides import left_name, right_name
from adapt.template_builder.weights import bounded_biharmonic, normalised

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

_LEAST_WEIGHT = 1e-3  # of a deformer: it costs time wherever it has any
# What deformers hold that do not hold their bones.
_CORES = {
    "lumbar_curve": ("lumbar",),
    "thoracic_curve": ("ribcage",),
    "neck_curve": ("cervical",),
    "skull": ("cranium",),
}
_name = right_name(MIDDLE)


def core_weights(
    volume: TetMesh,
    cores: Mapping[str, Mesh],
    places: Mapping[str, Floats],
    deformers: tuple[Deformer, ...],
    stages: Stages,
) -> Floats:
    """Weights (N, D) of the deformers at the corners of the body's tetrahedra.

    ``cores`` are those of the right side and the middle (``trunk_cores`` and bones), ``places`` all landmarks.
    """
    owner = _owners(volume.points, cores, places, deformers)
    raw = stages.kept(
        "deformers",
        (volume.points, volume.tets, owner, weights),
        lambda: bounded_biharmonic(volume, [np.flatnonzero(owner == k) for k in range(len(deformers))]),
    )
    return normalised(np.where(raw < _LEAST_WEIGHT, 0.0, raw))


def trunk_cores(body: PosedBody) -> dict[str, Mesh]:
    """The hulls of the ribs, of the skull and of the vertebrae of the neck."""

    def hull(*names: str) -> Mesh:
        points = [body.placements[n].points(body.skeleton.bodies[n].vertices) for n in names]
        return convex_hull(np.concatenate(points))

    return {"ribcage": hull("thorax"), "cranium": hull("head"), "cervical": hull(*CERVICAL)}


def convex_hull(points: Floats) -> Mesh:
    """The hull of points (N, 3), its faces outward."""
    found = ConvexHull(points)
    a, b, c = points[found.simplices].transpose(1, 0, 2)
    inward = np.einsum("ij,ij->i", np.cross(b - a, c - a), found.equations[:, :3]) < 0.0
    faces = np.where(inward[:, None], found.simplices[:, ::-1], found.simplices)
    return Mesh(*compacted(points, faces.astype(np.int64)))


def _owners(
    points: Floats, cores: Mapping[str, Mesh], places: Mapping[str, Floats], deformers: tuple[Deformer, ...]
) -> Ints:
    """For every corner (N,) the deformer in whose core it lies deepest, or -1."""
    depth = {core: mesh.depth(points) for core, mesh in cores.items()}
    images = {core: mesh.depth(mirrored_points(points)) for core, mesh in cores.items()}
    deepest = np.full((len(deformers), len(points)), -np.inf)
    for k, deformer in enumerate(deformers):
        right, left = deformer.name, deformer.name.endswith("_l")
        if left:
            right = left_name(deformer.name)
        bones = tuple(left_name(bone) if left else bone for bone in deformer.bones)
        for core in _CORES.get(right, bones):
            inside = (images if left else depth)[core]
            if core in MIDDLE and core not in _CORES.get(right, ()):  # a hip's half of the pelvis
                inside = np.where((points[:, 2] < 0.0) == left, inside, -np.inf)
            for held in BODY.held:
                if (_name(held.deformer), _name(held.bone)) == (right, core):
                    start, end = (places[left_name(_name(n)) if left else _name(n)] for n in (held.start, held.end))
                    inside = np.where(along_line(points, start, end) > held.beyond, inside, -np.inf)
            deepest[k] = np.maximum(deepest[k], inside)
    owner = np.where(deepest.max(axis=0) > 0.0, np.argmax(deepest, axis=0), -1)
    for k in range(len(deformers)):
        if not (owner == k).any():  # a core between corners has the one next to it
            owner[np.argmax(deepest[k])] = k
    return _cushioned(owner, points, places, deformers)


def _cushioned(owner: Ints, points: Floats, places: Mapping[str, Floats], deformers: tuple[Deformer, ...]) -> Ints:
    """What covers a bony point stays on it."""
    for cushion in BODY.cushions:
        for side in (_name, lambda n: left_name(_name(n))):
            near = np.linalg.norm(points - places[side(cushion.landmark)], axis=1) < cushion.radius
            carrier = next(k for k, deformer in enumerate(deformers) if side(cushion.bone) in deformer.bones)
            owner = np.where(near & (owner == -1), carrier, owner)
    return owner
