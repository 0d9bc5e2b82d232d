"""A small made-up limb with every joint and deformer type, for tests of the model's mathematics alone."""

from __future__ import annotations

import numpy as np

from adapt.anatomy import Anatomy, Bone, Coordinate, Deformer, Frame, Handle, Joint

LANDMARKS = {
    "top": (0.0, 0.0, 0.0),
    "inner": (0.005, -0.30, -0.03),
    "outer": (-0.004, -0.29, 0.03),
    "head": (0.01, -0.31, 0.02),
    "styloid": (0.18, -0.42, 0.01),
    "styloid2": (0.17, -0.40, 0.05),
    "flex_a": (0.17, -0.42, 0.0),
    "flex_b": (0.19, -0.40, 0.06),
    "dev_a": (0.16, -0.43, 0.03),
    "dev_b": (0.20, -0.38, 0.02),
    "tip": (0.26, -0.50, 0.03),
}


def toy_anatomy(seed: int = 0, n_skin: int = 60) -> Anatomy:
    """Random skin points around a bent limb; weights are random but valid."""
    rng = np.random.default_rng(seed)
    names = tuple(LANDMARKS)
    p = np.array([LANDMARKS[name] for name in names])
    handles = (
        Handle("upper_top", "upper", "shoulder", LANDMARKS["top"]),
        Handle("upper_low", "upper", "elbow", (0.0, -0.28, 0.0)),
        Handle("fore_top", "fore", "elbow", (0.02, -0.31, 0.0)),
        Handle("spin_top", "spin", "elbow", LANDMARKS["head"]),
        Handle("fore_low", "fore", "wrist", LANDMARKS["styloid"]),
        Handle("spin_low", "spin", "wrist", LANDMARKS["styloid2"]),
        Handle("palm_top", "palm", "wrist", (0.18, -0.41, 0.03)),
        Handle("palm_low", "palm", "tips", LANDMARKS["tip"]),
    )

    def weights(n: int, k: int) -> np.ndarray:
        w = rng.random((n, k)) ** 3
        return w / w.sum(axis=1, keepdims=True)

    def bone(name: str, frame: Frame) -> Bone:
        columns = [i for i, h in enumerate(handles) if h.bone == name]
        w = np.zeros((8, len(handles)))
        w[:, columns] = weights(8, len(columns))
        faces = np.array([[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]])
        return Bone(name, frame, rng.normal(0.0, 0.1, (8, 3)), faces, w)

    up = Frame(("top",), ("inner", "outer"), ("top",), ("inner",), ("outer",))
    lower = Frame(("inner", "outer"), ("styloid",), ("inner", "outer"), ("inner",), ("outer",))
    wrist = Frame(("styloid", "styloid2"), ("styloid",), ("head",), ("styloid",), ("styloid2",))
    turn = np.pi
    free = [("r" + c, "rad", 2 * turn) for c in "xyz"] + [("t" + c, "m", 10.0) for c in "xyz"]
    return Anatomy(
        name="toy",
        side="right",
        bones=(bone("upper", up), bone("fore", lower), bone("spin", wrist), bone("palm", wrist)),
        joints=(
            Joint("shoulder", "free", None, "upper", tuple(n for n, _, _ in free), (), ("top",)),
            Joint("elbow", "hinge", "upper", "fore", ("bend",), (("inner", "outer"),), ("inner", "outer")),
            Joint("twist", "hinge", "fore", "spin", ("spin",), (("head", "styloid"),), ("head",)),
            Joint(
                "wrist",
                "universal",
                "spin",
                "palm",
                ("dev", "flex"),
                (("dev_a", "dev_b"), ("flex_a", "flex_b")),
                ("styloid", "styloid2"),
            ),
        ),
        coordinates=(
            *(Coordinate(name, unit, -limit, limit, 0.0) for name, unit, limit in free),
            Coordinate("bend", "rad", 0.0, 2.3, 0.8),
            Coordinate("spin", "rad", -1.6, 1.6, 0.5),
            Coordinate("dev", "rad", -0.2, 0.5, 0.1),
            Coordinate("flex", "rad", -1.2, 1.2, -0.2),
        ),
        handles=handles,
        deformers=(
            Deformer("upper", "rigid", ("upper",)),
            Deformer("fore", "forearm", ("fore", "spin"), (lower, wrist)),
            Deformer("palm", "rigid", ("palm",)),
        ),
        landmark_names=names,
        landmarks=p,
        landmark_handle_weights=weights(len(names), len(handles)),
        skin_vertices=rng.uniform([-0.03, -0.5, -0.05], [0.3, 0.0, 0.07], (n_skin, 3)),
        skin_faces=np.array([[0, 1, 2]]),
        skin_handle_weights=weights(n_skin, len(handles)),
        deformer_weights=weights(n_skin, 3),
        fit_weight=np.ones(n_skin),
        tetrahedra={},
    )
