"""A real man's limbs, from the shape of his bones and skin, and how a first pose of them is given."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from adapt.anatomy import Floats
from adapt.template_builder.meshes import Mesh
from capture.rigid import apply, transform
from track.evaluation.experiments.surface_fit import read_mesh
from track.evaluation.holes import closed

STARTS = ("start given", "start found")
START_DEG, START_M = 6.0, 0.015  # how far off a given first pose is
FOLDER = "bodyparts3d"

WORLD_FROM_HIM = transform(np.array([[0.0, -1.0, 0.0], [0.0, 0.0, 1.0], [-1.0, 0.0, 0.0]]), np.zeros(3))
"""His axes are left, back, up; the world's are forward, up, right."""


CREDIT = (
    "BodyParts3D, (c) The Database Center for Life Science licensed under CC Attribution-Share Alike 2.1 Japan; "
    "Z-Anatomy, CC BY-SA 4.0 - https://github.com/Z-Anatomy/Models-of-human-anatomy. This picture: CC BY-SA 4.0."
)


@dataclass(frozen=True)
class Limb:
    """What is compared: joint centres as means of (our bone, our landmark) and of his landmarks; long bones."""

    anatomy: str
    folder: str
    centres: dict[str, tuple[tuple[tuple[str, str], ...], tuple[str, ...]]]
    bones: tuple[str, ...]
    others: dict[tuple[str, str], str]  # more landmarks, ours and his, by which a person would set the first pose


LIMBS = {
    "arm": Limb(
        "upper-limb-right",
        "arm_r",
        {
            "shoulder": ((("humerus", "GH"),), ("humeral_head_centre",)),
            "elbow": ((("humerus", "EM"), ("humerus", "EL")), ("medial_epicondyle", "lateral_epicondyle")),
            "wrist": ((("ulna", "US"), ("radius", "RS")), ("ulnar_styloid", "radial_styloid")),
        },
        ("humerus", "ulna", "radius"),
        {("hand", "MC2_head"): "second_metacarpal_head", ("hand", "MC5_head"): "fifth_metacarpal_head"},
    ),
    "leg": Limb(
        "lower-limb-right",
        "leg_r",
        {
            "hip": ((("femur", "HJC"),), ("femoral_head_centre",)),
            "knee": ((("femur", "FME"), ("femur", "FLE")), ("medial_femoral_epicondyle", "lateral_femoral_epicondyle")),
            "ankle": ((("tibia", "MM"), ("tibia", "LM")), ("medial_malleolus_tip", "lateral_malleolus_tip")),
        },
        ("femur", "tibia"),
        {
            ("pelvis", "ASIS"): "ASIS",
            ("foot", "heel"): "heel_posterior_calcaneus",
            ("foot", "MT2_head"): "second_metatarsal_head",
        },
    ),
}


@dataclass(frozen=True, eq=False)
class RealLimb:
    """His skin, long bones, joint centres and landmarks, in the world (metres)."""

    skin: Mesh
    bones: dict[str, Mesh]
    centres: dict[str, Floats]
    landmarks: dict[str, Floats] = field(repr=False)


def read_limb(limb: Limb, data: Path) -> RealLimb:
    """His limb. The skin's cut is closed by flat pieces, which sensors then see where his trunk would be."""
    folder = data / FOLDER / limb.folder
    text = (folder / "landmarks.json").read_text(encoding="utf-8")
    points = {name: apply(WORLD_FROM_HIM, np.array([at]))[0] for name, at in json.loads(text)["landmarks"].items()}
    return RealLimb(
        closed(in_world(read_mesh(folder / "skin.ply"))),
        {name: in_world(read_mesh(folder / "bones" / f"{name}.ply")) for name in limb.bones},
        {joint: np.mean([points[name] for name in his], axis=0) for joint, (_, his) in limb.centres.items()},
        points,
    )


def in_world(mesh: Mesh) -> Mesh:
    """A surface of his in the world's axes."""
    return Mesh(apply(WORLD_FROM_HIM, mesh.vertices), mesh.faces)
