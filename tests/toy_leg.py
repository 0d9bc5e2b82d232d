"""A small made-up leg: thigh, shank, kneecap and foot about a knee calibrated from the published tables."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from adapt.anatomy import Anatomy, Bone, Coordinate, Deformer, Floats, Frame, Handle, Joint
from adapt.template_builder.coupled_joint import spline_joint
from adapt.template_builder.knee import KNEE_KNOTS, PATELLA_KNOTS, PATELLAR_FACETS, PATELLOFEMORAL, PLATEAU, WALKER_KNEE
from capture.rigid import apply, exp_so3, transform

REST = 0.15  # rad: the toy rests with a bent knee
SCALE = 1.07  # of the toy's thigh to the tables'
REST_FROM_FEMUR = transform(exp_so3(np.array([0.05, -0.2, 0.1])), np.array([0.1, 0.9, -0.2]))

_PLAIN = {
    "hip": (0.0, 0.0, 0.0),
    "epicondyle_m": (-0.004, -0.40, -0.04),
    "epicondyle_l": (-0.006, -0.405, 0.038),
    "ankle_m": (-0.05, -0.80, -0.03),
    "ankle_l": (-0.06, -0.81, 0.035),
    "toe": (0.1, -0.85, 0.01),
}


def place(points: Floats) -> Floats:
    """From the thigh's OpenSim frame (m) to the toy's rest space: a similarity."""
    return apply(REST_FROM_FEMUR, SCALE * points)


def toy_leg(seed: int = 0, n_skin: int = 40) -> Anatomy:
    """Handle weights are random but valid, save that all landmarks at the knee move with the knee's handles."""
    rng = np.random.default_rng(seed)
    epicondyles = ("epicondyle_m", "epicondyle_l")
    knee, at_knee = spline_joint(
        WALKER_KNEE,
        PLATEAU,
        place,
        knots=KNEE_KNOTS,
        name="knee",
        parent="thigh",
        child="shank",
        coordinate="bend",
        centre=epicondyles,
    )
    cap, at_cap = spline_joint(
        PATELLOFEMORAL,
        PATELLAR_FACETS,
        place,
        knots=PATELLA_KNOTS,
        name="cap",
        parent="thigh",
        child="kneecap",
        coordinate="bend",
        centre=epicondyles,
    )
    landmarks = dict(zip(_PLAIN, place(np.array(list(_PLAIN.values()))), strict=True)) | at_knee | at_cap
    points = {
        "thigh_top": ("thigh", "hip", (0.0, 0.0, 0.0)),
        "thigh_low": ("thigh", "knee", (0.0, -0.40, 0.0)),
        "shank_top": ("shank", "knee", (-0.01, -0.44, 0.0)),
        "kneecap_middle": ("kneecap", "knee", (0.04, -0.40, 0.0)),
        "shank_low": ("shank", "ankle", (-0.05, -0.79, 0.0)),
        "foot_top": ("foot", "ankle", (-0.05, -0.83, 0.0)),
    }
    handles = tuple(
        Handle(name, bone, joint, tuple(map(float, place(np.array([at]))[0])))  # type: ignore[arg-type]
        for name, (bone, joint, at) in points.items()
    )
    at_joint = np.array([[handle.joint == ("hip" if n == "hip" else "knee") for handle in handles] for n in landmarks])

    def weights(n: int) -> Floats:
        w = rng.random((n, len(handles))) ** 3
        return np.asarray(w / w.sum(axis=1, keepdims=True))

    def bone(name: str, frame: Frame) -> Bone:
        own = weights(8) * [handle.bone == name for handle in handles]
        faces = np.array([[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]])
        return Bone(name, frame, rng.normal(0.0, 0.1, (8, 3)), faces, own / own.sum(axis=1, keepdims=True))

    upper = Frame(("hip",), epicondyles, ("hip",), ("epicondyle_m",), ("epicondyle_l",))
    lower = Frame(("ankle_m", "ankle_l"), ("ankle_m", "ankle_l"), epicondyles, ("ankle_m",), ("ankle_l",))
    free = [("r" + c, "rad", 2 * np.pi) for c in "xyz"] + [("t" + c, "m", 10.0) for c in "xyz"]
    return Anatomy(
        name="toy-leg",
        side="right",
        bones=(bone("thigh", upper), bone("shank", lower), bone("kneecap", upper), bone("foot", lower)),
        joints=(
            Joint("hip", "free", None, "thigh", tuple(n for n, _, _ in free), (), ("hip",)),
            knee,
            cap,
            Joint("ankle", "hinge", "shank", "foot", ("point",), (("ankle_m", "ankle_l"),), ("ankle_m", "ankle_l")),
        ),
        coordinates=(
            *(Coordinate(name, unit, -limit, limit, 0.0) for name, unit, limit in free),  # type: ignore[arg-type]
            Coordinate("bend", "rad", 0.0, 2.0944, REST),
            Coordinate("point", "rad", -0.7, 0.5, 0.1),
        ),
        handles=handles,
        deformers=tuple(Deformer(name, "rigid", (name,)) for name in ("thigh", "shank", "foot")),
        landmark_names=tuple(landmarks),
        landmarks=np.array(list(landmarks.values())),
        landmark_handle_weights=at_joint / at_joint.sum(axis=1, keepdims=True),
        skin_vertices=place(rng.uniform([-0.1, -0.9, -0.05], [0.1, 0.0, 0.05], (n_skin, 3))),
        skin_faces=np.array([[0, 1, 2]]),
        skin_handle_weights=weights(n_skin),
        deformer_weights=(lambda w: w / w.sum(axis=1, keepdims=True))(rng.random((n_skin, 3))),
        fit_weight=np.ones(n_skin),
        tetrahedra={},
    )


def with_joint(anatomy: Anatomy, joint: Joint, **changed: object) -> Anatomy:
    """An anatomy one of whose joints has other parts."""
    other = replace(joint, **changed)  # type: ignore[arg-type]
    return replace(anatomy, joints=tuple(other if each is joint else each for each in anatomy.joints))
