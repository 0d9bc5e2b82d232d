"""One real man's limb in one pose: his skin recorded, our template adapted to it, its bones held against his.

His surfaces (BodyParts3D) were segmented from magnetic resonance images and edited by illustrators. Some of his
superficial bones lie 10 to 20 mm too deep; so what counts is what does not depend on depth.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import partial
from itertools import pairwise
from pathlib import Path

import igl
import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from adapt.anatomy import Anatomy, Floats
from adapt.anatomy_file import load_anatomy
from adapt.fit.alternate import adapt_body
from adapt.fit.pose import fit_pose
from adapt.match.correspondences import Target
from adapt.match.skin_sample import sample_skin
from adapt.model.body import Body, bone_transforms, make_body, pose_skin, posed_bones, rest_theta
from adapt.model.shape.handle_space import affine_set
from adapt.search.first_pose import find_pose
from adapt.template_builder.meshes import Mesh, largest_part
from capture.cloud.fuse import fuse, region_of_interest
from capture.recording import instants
from capture.rigid import apply, inverse, transform
from track.accuracy.mesh_distance import distance_to_mesh
from track.evaluation import known
from track.evaluation.experiments.experiment import Experiment, Result
from track.evaluation.experiments.real_limbs import LIMBS, START_DEG, START_M, STARTS, Limb, RealLimb, read_limb
from track.evaluation.experiments.real_person_page import describe, losses
from track.evaluation.experiments.surface_fit import fit_family, greatest_length, rigid
from track.view.render import BONE, SKIN, Layer, framing_camera, look_at, render, save_png

NAME, TITLE = "real-person", "A real man's limbs, one pose"
SEEDS = (1, 2, 3)
_LEAST_SIZE = 0.7  # of a template scaled to him by hand
_FITTED = 0.5  # a vertex of the skin that counts by more than this in fitting is one of the limb proper
_SHAFT = 0.6  # the middle share of a long bone's length
_HIS = (0.30, 0.62, 0.55)


@dataclass(frozen=True, eq=False)
class Posed:
    """Our body, as found, in the world."""

    skin: Mesh
    bones: dict[str, Mesh]
    centres: dict[str, Floats] = field(repr=False)
    fitted: NDArray[np.bool_] = field(repr=False)  # (V,): which of the skin's vertices count in fitting


def run(case: str, folder: Path, *, data: Path) -> Result:
    """Record his skin for an instant, adapt to it from a first pose, and compare."""
    name, seed = case.split()[0], int(case.split()[-1])
    limb = LIMBS[name]
    him = read_limb(limb, data)
    recording, world_from_common = known.record_meshes(
        [him.skin.vertices], him.skin.faces, [0.0], folder / "recording", points=him.skin.vertices, seed=seed
    )
    target = Target(fuse(recording, instants(recording)[0], region=region_of_interest(recording)))
    anatomy = load_anatomy(limb.anatomy)
    sized, theta = _by_landmarks(anatomy, limb, him, inverse(world_from_common))
    by_hand = sized, _off(theta, sized, np.random.default_rng(seed))
    template = make_body(anatomy)
    found: dict[str, Posed] = {}
    for start, (body, theta) in zip(
        STARTS, (by_hand, (template, find_pose(template, target, seed=seed).fit.theta)), strict=True
    ):
        fit = fit_pose(body, target, theta, sample_skin(body.anatomy))
        found[f"posed, {start}"] = posed(body, fit.theta, limb, world_from_common)
        adaptation = adapt_body(body, [target], theta[None])
        found[f"adapted, {start}"] = posed(adaptation.body, adaptation.thetas[0], limb, world_from_common)
    save_png(picture(him, found[f"adapted, {STARTS[0]}"]), folder / "bones.png")
    save_png(picture(him, found[f"adapted, {STARTS[1]}"]), folder / "bones-searched.png")
    return {"picture": str(folder / "bones.png"), "ways": {way: compared(ours, him) for way, ours in found.items()}}


def _by_landmarks(anatomy: Anatomy, limb: Limb, him: RealLimb, common_from_world: Floats) -> tuple[Body, Floats]:
    """The template in the one size and the pose (n,) that bring its landmarks closest to his."""
    pairs = [pair for ours, his in limb.centres.values() for pair in zip(ours, his, strict=True)]
    pairs += list(limb.others.items())
    index = [anatomy.landmark_index(name) for (_, name), _ in pairs]
    his = apply(common_from_world, np.array([him.landmarks[name] for _, name in pairs]))

    def off(x: Floats) -> Floats:
        body = _sized(anatomy, x[0])
        moved = bone_transforms(body, x[1:])
        ours = [apply(moved[bone], body.p.value[[i]])[0] for ((bone, _), _), i in zip(pairs, index, strict=True)]
        return np.asarray(np.array(ours) - his).ravel()

    rest = anatomy.landmarks[index]
    turn, _ = Rotation.align_vectors(his - his.mean(axis=0), rest - rest.mean(axis=0))
    laid = transform(turn.as_matrix(), his.mean(axis=0) - turn.apply(rest.mean(axis=0)))
    start = known.carried(anatomy, rest_theta(make_body(anatomy))[None], laid)[0]
    low, high = np.array([(_LEAST_SIZE, 1.0 / _LEAST_SIZE), *((c.low, c.high) for c in anatomy.coordinates)]).T
    found = least_squares(off, np.clip(np.r_[1.0, start], low + 1e-6, high - 1e-6), bounds=(low, high)).x
    return _sized(anatomy, found[0]), np.asarray(found[1:], dtype=np.float64)


def _sized(anatomy: Anatomy, scale: float) -> Body:
    """The whole template larger or smaller."""
    affine = affine_set(anatomy)
    return make_body(anatomy, shape=affine.shape(np.full(len(affine.groups), scale), (scale - 1.0) * affine.centres))


def _off(theta: Floats, body: Body, rng: np.random.Generator) -> Floats:
    """The pose as a hand would set it: every coordinate off by up to a few degrees, or centimetres."""
    scale = [START_M if c.unit == "m" else np.deg2rad(START_DEG) for c in body.anatomy.coordinates]
    return np.asarray(theta + rng.uniform(-1.0, 1.0, len(scale)) * scale)


def posed(body: Body, theta: Floats, limb: Limb, world_from_common: Floats) -> Posed:
    """Our posed skin, long bones and centres, in the world."""
    bones, carried = posed_bones(body, theta), bone_transforms(body, theta)

    def landmark(bone: str, name: str) -> Floats:
        at_rest = body.p.value[body.anatomy.landmark_index(name)]
        return np.asarray(apply(world_from_common @ carried[bone], at_rest[None])[0])

    return Posed(
        Mesh(apply(world_from_common, pose_skin(body, theta)), body.anatomy.skin_faces),
        {
            name: largest_part(Mesh(apply(world_from_common, bones[name]), body.anatomy.bone(name).faces))
            for name in limb.bones
        },
        {joint: np.mean([landmark(*at) for at in ours], axis=0) for joint, (ours, _) in limb.centres.items()},
        body.anatomy.fit_weight > _FITTED,
    )


def compared(ours: Posed, him: RealLimb) -> Result:
    """Errors of joint centres, lengths, shafts and surfaces; offsets are in the world's axes: forward, up, right."""
    joints = list(him.centres)
    between = {f"{a} to {b}": (a, b) for a, b in pairwise(joints)}
    return {
        "centres_mm": {joint: (1e3 * (ours.centres[joint] - him.centres[joint])).tolist() for joint in joints},
        "distances_m": {
            name: [float(np.linalg.norm(of.centres[a] - of.centres[b])) for of in (ours, him)]
            for name, (a, b) in between.items()
        },
        "lengths_m": {name: [greatest_length(of.bones[name]) for of in (ours, him)] for name in him.bones},
        "axes_deg": {name: axis_between(ours.bones[name], bone) for name, bone in him.bones.items()},
        "skin_mm": _three(distance_to_mesh(ours.skin.vertices[ours.fitted], him.skin.vertices, him.skin.faces)),
        "surfaces": {name: _surface_error(ours.bones[name], bone) for name, bone in him.bones.items()},
    }


def shaft_axis(mesh: Mesh) -> Floats:
    """The principal axis (3,) of the middle of a long bone."""
    corners = mesh.vertices[mesh.faces]
    middles, areas = corners.mean(axis=1), igl.doublearea(mesh.vertices, mesh.faces)
    along = (middles - middles.mean(axis=0)) @ _principal_axis(middles, areas)
    low, high = along.min(), along.max()
    shaft = np.abs(along - (low + high) / 2.0) < _SHAFT * (high - low) / 2.0
    return _principal_axis(middles[shaft], areas[shaft])


def _principal_axis(points: Floats, weights: Floats) -> Floats:
    return np.asarray(np.linalg.eigh(np.cov(points.T, aweights=weights))[1][:, -1])


def axis_between(ours: Mesh, his: Mesh) -> float:
    """The angle (deg) between the shafts of two long bones."""
    between = float(np.linalg.norm(np.cross(shaft_axis(ours), shaft_axis(his))))
    return float(np.rad2deg(np.arcsin(min(1.0, between))))


def _surface_error(ours: Mesh, his: Mesh) -> dict[str, list[float]]:
    """Mean, 95 % and maximum (mm) over the vertices of both, where they are and after the best rigid move of ours."""
    there = distance_to_mesh(ours.vertices, his.vertices, his.faces)
    back = distance_to_mesh(his.vertices, ours.vertices, ours.faces)
    moved = fit_family(ours, rigid(ours), his).distances
    return {"as it lies": _three(np.concatenate([there, back])), "moved rigidly": _three(moved)}


def _three(distances: Floats) -> list[float]:
    return [1e3 * float(value) for value in (distances.mean(), np.percentile(distances, 95), distances.max())]


def picture(him: RealLimb, ours: Posed) -> NDArray[np.uint8]:
    """His bones (green) and ours (bone) inside his skin, from the front and from the right."""
    panels = []
    for direction in (np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0])):
        eye = look_at(him.skin.vertices, direction, np.array([0.0, 1.0, 0.0]), distance_m=3.0)
        camera = framing_camera(eye, him.skin.vertices, width=360, height=560)
        layers = [Layer(him.skin.vertices, him.skin.faces, SKIN, 0.25)]
        layers += [Layer(bone.vertices, bone.faces, _HIS, 0.8) for bone in him.bones.values()]
        layers += [Layer(bone.vertices, bone.faces, BONE, 0.8) for bone in ours.bones.values()]
        panels.append(render(layers, eye, camera))
    return np.concatenate(panels, axis=1)


def experiment(data: Path) -> Experiment:
    """The experiment on the man below ``data``."""
    cases = tuple(f"{name} seed {seed}" for seed in SEEDS for name in LIMBS)
    return Experiment(NAME, TITLE, cases, partial(run, data=data), describe, losses)
