"""Who is recorded: sound limbs of either side, wrong sides asked for, children and tall people, stumps and sleeves."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from adapt.anatomy import Floats, Ints
from adapt.mirror import mirrored_name
from adapt.model.body import Body, make_body, pose_skin
from adapt.model.surface import incidence, vertex_normals
from adapt.template_builder.meshes import Mesh, compacted
from track.evaluation.holes import closed
from track.evaluation.trials.recorded import Made, performance_of, record
from track.simulation.performance import Performance

ARM, LEG = "upper-limb-right", "lower-limb-right"
_SLEEVE_M, _FOLDS_M = 0.010, 0.004  # thickness, and how far its folds go up and down


def sound(
    anatomy: str, *, asked: str | None = None, factor: float = 1.0, speed: int = 1
) -> Callable[[int, Path], Made]:
    """A sound recording of a random body; ``asked`` is the anatomy to ask for, if it is another one."""

    def make(seed: int, folder: Path) -> Made:
        truth = record(performance_of(anatomy, seed, factor=factor, speed=speed), folder, seed=seed)
        return Made(folder, asked or anatomy, truth)

    return make


def parted(anatomy: str, bones: tuple[str, ...], *, asked: str | None = None) -> Callable[[int, Path], Made]:
    """Only the skin on some bones is there, closed where it is cut."""

    def make(seed: int, folder: Path) -> Made:
        performance = performance_of(anatomy, seed)
        skin, faces = part_of(performance, bones)
        return Made(folder, asked or anatomy, record(performance, folder, seed=seed, skin=skin, faces=faces))

    return make


def part_of(performance: Performance, bones: tuple[str, ...]) -> tuple[Callable[[Floats], Floats], Ints]:
    """What remains of a posed skin (V, 3), and the triangles of that."""
    anatomy = performance.body.anatomy
    belongs = np.array([handle.bone in bones for handle in anatomy.handles])
    kept = anatomy.skin_handle_weights[:, belongs].sum(axis=1) > 0.5
    triangles = anatomy.skin_faces[kept[anatomy.skin_faces].all(axis=1)]

    def whole(vertices: Floats) -> Mesh:
        return closed(Mesh(*compacted(vertices, triangles)))

    return lambda vertices: whole(vertices).vertices, whole(pose_skin(performance.body, performance.thetas[0])).faces


def sleeved(body: Body, seed: int) -> Body:
    """The body in a sleeve over all but hand or foot: thicker, with folds across the limb."""
    anatomy = body.anatomy
    last = anatomy.bones[-1].name
    bare = anatomy.skin_handle_weights[:, [handle.bone == last for handle in anatomy.handles]].sum(axis=1)
    folds = np.sin(anatomy.skin_vertices @ np.random.default_rng(seed).normal(0.0, 60.0, 3))
    thickness = (1.0 - bare) * (_SLEEVE_M + _FOLDS_M * folds)
    skin, faces = anatomy.skin_vertices, anatomy.skin_faces
    normals = vertex_normals(skin, faces, incidence(faces, len(skin)))
    return make_body(anatomy, shape=body.shape, v_hat=body.v_hat + thickness[:, None] * normals)


def in_a_sleeve(seed: int, folder: Path) -> Made:
    """An arm in a thick sleeve."""
    performance = performance_of(ARM, seed, change=lambda body: sleeved(body, seed))
    return Made(folder, ARM, record(performance, folder, seed=seed))


_LEFT_ARM, _LEFT_LEG = mirrored_name(ARM), mirrored_name(LEG)
_SHANK = ("tibia", "foot")

MAKERS: dict[str, Callable[[int, Path], Made]] = {
    "sound right arm": sound(ARM),
    "sound left arm": sound(_LEFT_ARM),
    "sound right leg": sound(LEG),
    "sound left leg": sound(_LEFT_LEG),
    "right arm asked as left": sound(ARM, asked=_LEFT_ARM),
    "left arm asked as right": sound(_LEFT_ARM, asked=ARM),
    "right leg asked as left": sound(LEG, asked=_LEFT_LEG),
    "left leg asked as right": sound(_LEFT_LEG, asked=LEG),
    "foot and shank of a right leg": parted(LEG, _SHANK),
    "foot and shank asked as left": parted(LEG, _SHANK, asked=_LEFT_LEG),
    "hand missing": parted(ARM, ("humerus", "ulna", "radius")),
    "child 0.60": sound(ARM, factor=0.60),
    "child 0.62": sound(ARM, factor=0.62),
    "child 0.72": sound(ARM, factor=0.72),
    "tall man 1.25": sound(ARM, factor=1.25),
    "child's leg 0.62": sound(LEG, factor=0.62),
    "thick sleeve": in_a_sleeve,
    "fast forearm": sound(ARM, speed=2),
}
