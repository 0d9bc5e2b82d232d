"""Real people's right legs with their own bones: a woman's (computed tomography) and a man's (BodyParts3D).

The woman's skin reaches from the ankle to the upper thigh: nothing is said of her hip and foot. The man's superficial
bones lie 10 to 20 mm too deep, his kneecap's front 26 mm. Both stand in folders outside the project.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import igl
import numpy as np
from scipy.optimize import least_squares

from adapt.anatomy import Anatomy, Floats
from adapt.model.body import Body, bone_transforms, make_body, rest_theta
from adapt.model.pose_space import free_coordinates
from adapt.model.shape.prior import shape_prior
from adapt.model.size import resized
from adapt.template_builder.meshes import Mesh, compacted
from capture.rigid import apply
from track.evaluation.experiments.real_limbs import FOLDER, WORLD_FROM_HIM
from track.evaluation.experiments.surface_fit import read_mesh

BONES = ("tibia", "fibula", "patella", "femur")
WOMAN, MAN = "woman (CT)", "man (BodyParts3D)"
_WOMANS = "vhf_leg_r"
LANDMARKS = {
    "HJC": ("femur", "femoral_head_centre"),
    "FME": ("femur", "medial_femoral_epicondyle"),
    "FLE": ("femur", "lateral_femoral_epicondyle"),
    "MM": ("tibia", "medial_malleolus_tip"),
    "LM": ("tibia", "lateral_malleolus_tip"),
}
"""Our landmarks: the bone they ride on, and what they are called in the folders."""

_LANDMARK_M, _CAP_M = 0.003, 5e-4
_LEAST_SIZE = 0.7


@dataclass(frozen=True, eq=False)
class RealLeg:
    """Skin (closed), bones by name and landmarks by our names, in metres, X forward, Y up, Z right.

    ``span``: between which heights (m) there is skin of the leg proper; infinite where nothing is missing.
    """

    skin: Mesh = field(repr=False)
    bones: dict[str, Mesh] = field(repr=False)
    landmarks: dict[str, Floats] = field(repr=False)
    span: tuple[float, float]

    @property
    def open_skin(self) -> Mesh:
        """The skin without the flat caps that end it."""
        y = self.skin.vertices[self.skin.faces][:, :, 1]
        cap = (np.abs(y - self.span[0]) < _CAP_M).all(axis=1) | (np.abs(y - self.span[1]) < _CAP_M).all(axis=1)
        return Mesh(*compacted(self.skin.vertices, self.skin.faces[~cap]))


def read_leg(who: str, data: Path) -> RealLeg:
    """The leg of WOMAN or MAN below the folder ``data``. Raises AnatomyError where it is not there."""
    woman = who == WOMAN
    folder = data / _WOMANS if woman else data / FOLDER / "leg_r"
    turn = np.eye(4) if woman else WORLD_FROM_HIM

    def surface(name: str) -> Mesh:
        mesh = read_mesh(folder / f"{name}.ply")
        return Mesh(apply(turn, mesh.vertices), mesh.faces)

    told = json.loads((folder / "landmarks.json").read_text(encoding="utf-8"))
    places = {name: (at["xyz_m"] if woman else at) for name, at in told["landmarks"].items()}
    low, high = told["skin_cap_planes_y_m"] if woman else (-np.inf, np.inf)
    return RealLeg(
        surface("skin"),
        {bone: surface(f"bones/{bone}") for bone in BONES},
        {ours: apply(turn, np.array([places[theirs]]))[0] for ours, (_, theirs) in LANDMARKS.items()},
        (float(low), float(high)),
    )


def laid_on(anatomy: Anatomy, landmarks: Mapping[str, Floats], *, proportions: bool) -> tuple[Body, Floats]:
    """The body and pose (n,) that bring our landmarks closest to somebody's (3,) m.

    With ``proportions`` the whole shape may change, held by what is known of bodies; otherwise only the overall size.
    """
    template = make_body(anatomy)
    start, n = rest_theta(template), len(anatomy.coordinates)
    expected = shape_prior(anatomy, template.affine)
    root = np.linalg.cholesky(expected.precision).T
    held = np.full(n, 0.1)  # per rad: what no landmark tells stays at rest
    held[np.concatenate(free_coordinates(anatomy))] = 1e-3
    index = {name: anatomy.landmark_index(name) for name in landmarks}

    def made(x: Floats) -> Body:
        if proportions:
            return make_body(anatomy, shape=template.affine.nearest_possible(x[n:]))
        return resized(template, max(float(x[n]), _LEAST_SIZE))

    def off(x: Floats) -> Floats:
        body = made(x)
        moved = bone_transforms(body, x[:n])
        ours = [apply(moved[LANDMARKS[k][0]], body.p.value[[i]])[0] for k, i in index.items()]
        far = (np.array(ours) - np.array(list(landmarks.values()))).ravel() / _LANDMARK_M
        prior = root @ (x[n:] - expected.mean) if proportions else np.zeros(0)
        return np.concatenate([far, held * (x[:n] - start), prior])

    shape = template.shape if proportions else np.array([_size(anatomy, landmarks)])
    x = least_squares(off, np.r_[start, shape], x_scale="jac").x
    return made(x), np.asarray(x[:n], dtype=np.float64)


def _size(anatomy: Anatomy, landmarks: Mapping[str, Floats]) -> float:
    """How large somebody is against the template, by how far the landmarks are spread."""
    ours = anatomy.landmarks[[anatomy.landmark_index(name) for name in landmarks]]
    theirs = np.array(list(landmarks.values()))
    return float(np.linalg.norm(theirs - theirs.mean(axis=0)) / np.linalg.norm(ours - ours.mean(axis=0)))


def parts_of(mesh: Mesh) -> list[Mesh]:
    """The parts of a surface that do not hang together, the largest first."""
    _, label = igl.facet_components(mesh.faces)
    parts = [Mesh(*compacted(mesh.vertices, mesh.faces[label == k])) for k in range(label.max() + 1)]
    return sorted(parts, key=lambda part: -len(part.vertices))


def our_bones(body: Body, placed: Mapping[str, Floats]) -> dict[str, Mesh]:
    """Our tibia, fibula, patella and femur, from surfaces (N, 3) of our bones; our tibia's bone has both."""
    meshes = {bone.name: Mesh(placed[bone.name], bone.faces) for bone in body.anatomy.bones if bone.name in placed}
    tibia, fibula = parts_of(meshes["tibia"])[:2]
    return {
        "tibia": tibia,
        "fibula": fibula,
        "patella": parts_of(meshes["patella"])[0],
        "femur": parts_of(meshes["femur"])[0],
    }
