"""A toy body for tests: a trunk that curves, with a head and two arms, shoulder blades and collar bones.

It has all the kinds of joints that a person's trunk needs, and both sides.
"""

from __future__ import annotations

from functools import cache

import igl
import numpy as np

from adapt.anatomy import Anatomy, Bone, Coordinate, Deformer, Floats, Frame, Handle, Ints, Joint

RIGHT = {  # of the right side and the middle, m
    "hips": (0.0, 0.0, 0.0),
    "hip_r": (0.0, 0.0, 0.08),
    "base": (-0.03, 0.07, 0.0),
    "top": (-0.045, 0.34, 0.0),
    "nape": (-0.03, 0.50, 0.0),
    "crown": (0.0, 0.76, 0.0),
    "groin": (0.0, 0.0, 0.0),
    "groin_up": (0.03, 0.1, 0.0),
    "chest": (-0.02, 0.38, 0.0),
    "chest_up": (-0.05, 0.48, 0.0),
    "sternum_r": (0.06, 0.44, 0.02),
    "acromion_r": (-0.01, 0.47, 0.17),
    "centre_r": (0.0, 0.38, 0.06),
    "deep_r": (0.08, 0.38, 0.06),
    "tall_r": (0.0, 0.58, 0.06),
    "wide_r": (0.0, 0.38, 0.14),
    "tip_r": (-0.09, 0.32, 0.09),
    "shoulder_r": (-0.01, 0.44, 0.19),
    "armpit_r": (-0.01, 0.40, 0.215),
    "elbow_r": (-0.01, 0.22, 0.32),
    "elbow_in_r": (-0.01, 0.195, 0.30),
    "elbow_out_r": (-0.01, 0.245, 0.34),
    "above_r": (-0.01, 0.26, 0.30),
    "below_r": (0.02, 0.18, 0.345),
    "wrist_r": (0.06, 0.03, 0.43),
    "thumb_r": (0.09, 0.05, 0.41),
    "hand_r": (0.09, -0.08, 0.48),
}
RODS = {  # bones as rods between points; of the chest a ring of ribs besides
    "pelvis": ("hips", "base"),
    "chest": ("base", "nape"),
    "collar_r": ("sternum_r", "acromion_r"),
    "blade_r": ("acromion_r", "tip_r"),
    "arm_r": ("shoulder_r", "elbow_r"),
    "fore_r": ("elbow_r", "hand_r"),
}
HEADS = {  # handles: bone -> {joint: where}
    "pelvis": {"hips": "hips", "waist": "base"},
    "chest": {"waist": "base", "neck": "nape", "sternum_r": "sternum_r", "sternum_l": "sternum_l"},
    "collar_r": {"sternum_r": "sternum_r", "shoulder_r": "acromion_r"},
    "blade_r": {"shoulder_r": "shoulder_r"},
    "arm_r": {"shoulder_r": "shoulder_r", "elbow_r": "elbow_r"},
    "fore_r": {"elbow_r": "elbow_r", "hand_r": "hand_r"},
}
_GRAIN_M = 0.016


def other(name: str) -> str:
    """A name of the left side."""
    return name[:-2] + "_l" if name.endswith("_r") else name


LANDMARKS = RIGHT | {other(name): (x, y, -z) for name, (x, y, z) in RIGHT.items() if name.endswith("_r")}


def frame(origin: str, low: str, high: str, start: str, end: str) -> Frame:
    """y from low to high, z from start to end."""
    return Frame((origin,), (low,), (high,), (start,), (end,))


def turned_over(of: Frame) -> Frame:
    """The left side's, in which turns keep their signs."""
    return Frame(
        *(tuple(map(other, names)) for names in (of.origin, of.y_to, of.y_from, of.z_to, of.z_from))  # type: ignore[arg-type]
    )


@cache
def toy_trunk() -> Anatomy:
    """The whole."""
    handles = tuple(
        Handle(f"{bone}_{joint}", bone, joint, LANDMARKS[at])
        for bone, heads in _heads().items()
        for joint, at in heads.items()
    )
    skin, faces = _skin()
    points = np.array(list(LANDMARKS.values()))
    joints, coordinates = _joints()
    deformers, shares = _deformers(skin)
    return Anatomy(
        name="toy-trunk",
        side="both",
        bones=tuple(_bone(name, handles) for name in _heads()),
        joints=joints,
        coordinates=coordinates,
        handles=handles,
        deformers=deformers,
        landmark_names=tuple(LANDMARKS),
        landmarks=points,
        landmark_handle_weights=_near(points, handles),
        skin_vertices=skin,
        skin_faces=faces,
        skin_handle_weights=_near(skin, handles),
        deformer_weights=shares,
        fit_weight=np.clip((skin[:, 1] + 0.08) / 0.05, 0.0, 1.0),
        tetrahedra={"limb": (np.array([LANDMARKS[at] for at in ("hips", "base", "top")]), np.zeros((0, 4), dtype=int))},
    )


def _heads() -> dict[str, dict[str, str]]:
    left = {
        other(bone): {other(joint): other(at) for joint, at in heads.items()}
        for bone, heads in HEADS.items()
        if bone.endswith("_r")
    }
    return HEADS | left


def _near(points: Floats, handles: tuple[Handle, ...], bone: str | None = None) -> Floats:
    """Weights (N, H) of the handles (of a bone's alone) that fade with their distances."""
    away = np.linalg.norm(points[:, None] - np.array([handle.position for handle in handles]), axis=2)
    weights = (away**2 + 1e-3) ** -2.0 * [bone in (None, handle.bone) for handle in handles]
    return np.asarray(weights / weights.sum(axis=1, keepdims=True))


def _bone(name: str, handles: tuple[Handle, ...]) -> Bone:
    right = f"{name[:-2]}_r" if name.endswith("_l") else name
    ends = RODS[right] if right == name else tuple(map(other, RODS[right]))
    low, high = (np.array(LANDMARKS[at]) for at in ends)
    vertices, faces = _rod(low, high, 0.012)
    along = None
    if name == "chest":
        base, top = (np.array(LANDMARKS[at]) for at in ("base", "top"))
        along = np.clip((vertices - base) @ (top - base) / ((top - base) @ (top - base)), 0.0, 1.0)
    side = "hip_l", "hip_r"
    frames = {
        "pelvis": frame("hips", "hips", "base", *side),
        "chest": frame("top", "top", "nape", "sternum_l", "sternum_r"),
        "collar_r": frame("sternum_r", "hips", "nape", "sternum_r", "acromion_r"),
        "blade_r": frame("acromion_r", "tip_r", "acromion_r", "centre_r", "wide_r"),
        "arm_r": frame("shoulder_r", "elbow_r", "shoulder_r", "elbow_in_r", "elbow_out_r"),
        "fore_r": frame("elbow_r", "wrist_r", "elbow_r", "elbow_in_r", "elbow_out_r"),
    }
    of = frames[right] if right == name else _mirrored(frames[right])
    return Bone(name, of, vertices, faces, _near(vertices, handles, name), along)


def _mirrored(of: Frame) -> Frame:
    return Frame(
        *(tuple(map(other, names)) for names in (of.origin, of.y_from, of.y_to, of.z_to, of.z_from))  # type: ignore[arg-type]
    )


def _rod(low: Floats, high: Floats, radius: float) -> tuple[Floats, Ints]:
    """A closed tube of twelve rings."""
    way = (high - low) / np.linalg.norm(high - low)
    across = np.linalg.svd(way[None])[2][1:]
    if np.linalg.det([way, *across]) < 0.0:
        across = across[::-1]
    turn, at = np.linspace(0.0, 2.0 * np.pi, 10, endpoint=False), np.linspace(0.0, 1.0, 12)
    circle = radius * (np.outer(np.cos(turn), across[0]) + np.outer(np.sin(turn), across[1]))
    rings = (low + np.outer(at, high - low))[:, None] + circle
    ring = np.arange(120).reshape(12, 10)
    after = np.roll(ring, -1, axis=1)
    lids = np.full(10, 120), np.full(10, 121)
    corners = [
        (ring[:-1], after[:-1], ring[1:]),
        (after[:-1], after[1:], ring[1:]),
        (after[0], ring[0], lids[0]),
        (ring[-1], after[-1], lids[1]),
    ]
    faces = np.concatenate([np.stack(parts, axis=-1).reshape(-1, 3) for parts in corners])
    return np.concatenate([rings.reshape(-1, 3), [low, high]]), faces


def _skin() -> tuple[Floats, Ints]:
    """A level set of rounded rods that melt into one another, closed, its faces outward."""
    low, high = np.array([-0.22, -0.2, -0.62]), np.array([0.22, 0.9, 0.62])
    counts = np.round((high - low) / _GRAIN_M).astype(int) + 1
    axes = [np.linspace(a, b, n) for a, b, n in zip(low, high, counts, strict=True)]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3, order="F")
    field = -0.03 * np.log(sum(np.exp(-far / 0.03) for far in _outside(grid).values()))
    vertices, faces = igl.marching_cubes(field, grid, *(int(n) for n in counts), 0.0)[:2]
    faces = faces.astype(np.int64)
    a, b, c = (vertices[corner] for corner in faces.T)
    if np.einsum("ij,ij->", np.cross(a, b), c) < 0.0:
        faces = faces[:, ::-1]
    return np.asarray(vertices, dtype=np.float64), np.ascontiguousarray(faces)


def _outside(points: Floats) -> dict[str, Floats]:
    """How far (N,) m points are outside the trunk, the head and the parts of the arms."""
    flat = points * [1.3, 1.0, 0.8]

    def rod(start: tuple[float, ...], end: tuple[float, ...], radius: float, of: Floats = points) -> Floats:
        a, b = np.array(start), np.array(end)
        t = np.clip((of - a) @ (b - a) / ((b - a) @ (b - a)), 0.0, 1.0)
        return np.asarray(np.linalg.norm(of - a - t[:, None] * (b - a), axis=1) - radius)

    parts = {"trunk": rod((0.0, -0.02, 0.0), (0.0, 0.38, 0.0), 0.13, flat)}
    parts |= {"belly": rod((0.04, 0.1, 0.0), (0.03, 0.2, 0.0), 0.12, flat)}
    parts |= {
        "head": rod((-0.01, 0.5, 0.0), (0.0, 0.72, 0.0), 0.06),
        "face": rod((0.03, 0.66, 0.0), (0.03, 0.7, 0.0), 0.07),
    }
    for side, sign in (("r", 1.0), ("l", -1.0)):
        ends = {
            name: np.array(RIGHT[f"{name}_r"]) * [1, 1, sign]
            for name in ("shoulder", "elbow", "wrist", "hand", "thumb")
        }
        parts[f"arm_{side}"] = rod(ends["shoulder"], ends["elbow"], 0.045)
        parts[f"fore_{side}"] = rod(ends["elbow"], ends["wrist"], 0.036)
        parts[f"hand_{side}"] = rod(ends["wrist"], ends["hand"], 0.03)
        parts[f"thumb_{side}"] = rod(ends["wrist"], ends["thumb"], 0.02)
    return parts


def _deformers(skin: Floats) -> tuple[tuple[Deformer, ...], Floats]:
    """The deformers, and every vertex shared out among them (V, D)."""
    side = "hip_l", "hip_r"
    planes = frame("groin", "groin", "groin_up", *side), frame("chest", "chest", "chest_up", *side)
    away = _outside(skin)
    deformers, shares = [Deformer("belly", "curve", ("pelvis", "chest"), planes)], []
    for s in "rl":
        across = f"elbow_in_{s}", f"elbow_out_{s}"
        ends = ("shoulder", "armpit"), ("armpit", "elbow"), ("armpit", "elbow")
        upper = tuple(frame(f"{at}_{s}", f"{at}_{s}", f"{to}_{s}", *across) for at, to in ends[:2])
        turn = frame(f"shoulder_{s}", f"shoulder_{s}", f"elbow_{s}", *across)
        lower = tuple(
            frame(f"{at}_{s}", f"{low}_{s}", f"{high}_{s}", f"wrist_{s}", f"thumb_{s}")
            for at, low, high in (("above", "above", "elbow"), ("below", "elbow", "below"), ("elbow", "above", "below"))
        )
        deformers.append(Deformer(f"shoulder_{s}", "bend", (f"blade_{s}", f"arm_{s}"), (*upper, turn)))
        deformers.append(Deformer(f"elbow_{s}", "bend", (f"arm_{s}", f"fore_{s}"), lower))
        shoulder, elbow = (np.array(LANDMARKS[f"{at}_{s}"]) for at in ("shoulder", "elbow"))
        down = (skin - shoulder) @ (elbow - shoulder) / np.linalg.norm(elbow - shoulder)
        own = np.min([away[f"{part}_{s}"] for part in ("arm", "fore", "hand", "thumb")], axis=0)
        nearer = np.clip((np.minimum(away["trunk"], away["belly"]) - own) / 0.02 + 0.5, 0.0, 1.0)
        arm = np.clip((down + 0.04) / 0.05, 0.0, 1.0) * nearer
        low = np.clip((down - 0.09) / 0.04, 0.0, 1.0)
        shares += [arm * (1.0 - low), arm * low]
    return tuple(deformers), np.column_stack([1.0 - sum(shares), *shares])


def _joints() -> tuple[tuple[Joint, ...], tuple[Coordinate, ...]]:
    """Root, trunk, then of either side shoulder blade, collar bone, shoulder and elbow."""
    coordinates = [Coordinate(f"pelvis_r{axis}", "rad", -6.3, 6.3, 0.0) for axis in "xyz"]
    coordinates += [Coordinate(f"pelvis_t{axis}", "m", -10.0, 10.0, 0.0) for axis in "xyz"]
    joints = [Joint("root", "free", None, "pelvis", tuple(c.name for c in coordinates), (), ("hips",))]
    trunk = ("trunk_bending", 0.0), ("trunk_extension", 0.15), ("trunk_twist", 0.0)
    coordinates += [Coordinate(name, "rad", -0.9, 0.7, rest) for name, rest in trunk]
    arch = frame("base", "base", "top", "hip_l", "hip_r")
    joints.append(Joint("trunk", "curve", "pelvis", "chest", tuple(n for n, _ in trunk), (), ("base",), (), (arch,)))
    for side in "rl":
        blade = (f"blade_abduction_{side}", -1.2), (f"blade_elevation_{side}", 0.1), (f"blade_rotation_{side}", 0.1)
        coordinates += [Coordinate(name, "rad", rest - 0.3, rest + 0.3, rest) for name, rest in blade]
        coordinates += [Coordinate(f"arm_{axis}_{side}", "rad", -1.6, 1.6, 0.0) for axis in "xyz"]
        coordinates += [Coordinate(f"elbow_{side}", "rad", -0.2, 2.2, 0.0)]
        joints += _of_arm(side)
    return tuple(joints), tuple(coordinates)


def _of_arm(s: str) -> list[Joint]:
    def at(right: str) -> str:
        return f"{right}_{s}"

    def placed(right: Frame) -> Frame:
        return right if s == "r" else turned_over(right)

    ellipsoid = placed(frame("centre_r", "centre_r", "tall_r", "centre_r", "wide_r"))
    bar = placed(frame("sternum_r", "hips", "nape", "sternum_r", "acromion_r"))
    ball = placed(frame("shoulder_r", "hips", "nape", "centre_r", "wide_r"))
    blade = tuple(at(f"blade_{what}") for what in ("abduction", "elevation", "rotation"))
    arm = tuple(at(f"arm_{axis}") for axis in "xyz")
    radii = tuple((at("centre"), at(end)) for end in ("deep", "tall", "wide"))
    ends = ((at("sternum"), at("acromion")),)
    chest, own, upper = "chest", at("blade"), at("arm")
    return [
        Joint(own, "ellipsoid", chest, own, blade, radii, (at("acromion"),), (), (ellipsoid,)),
        Joint(at("collar"), "strut", chest, at("collar"), (), ends, (at("sternum"),), (), (bar,), own),
        Joint(at("shoulder"), "socket", own, upper, arm, (), (at("shoulder"),), (), (ball,)),
        Joint(at("elbow"), "hinge", upper, at("fore"), (at("elbow"),), (_hinge(s),), (at("elbow"),)),
    ]


def _hinge(side: str) -> tuple[str, str]:
    """The line about which the forearm comes forward."""
    line = f"elbow_out_{side}", f"elbow_in_{side}"
    return line if side == "r" else line[::-1]
