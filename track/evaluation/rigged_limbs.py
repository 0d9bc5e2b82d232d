"""Arms and legs of people by MakeHuman, what they do, and where their joints are beside ours."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np

from adapt.anatomy import Floats
from adapt.anatomy_file import load_anatomy
from adapt.model.body import joint_centres, make_body, rest_theta
from adapt.template_builder.plan import LimbPlan
from adapt.template_builder.skin import Cut
from adapt.template_builder.sources_makehuman import load_skin
from capture.rigid import exp_so3
from track.evaluation.rigged_people import Build, Rig, RiggedLimb, cut_limb, person, read_rig
from track.evaluation.swing import Swing

_TRUNK_M = 0.04  # so much more than the template's is seen of the trunk


@dataclass(frozen=True)
class RigTurn:
    """A bone of the rig that swings about an axis of the limb at rest."""

    bone: str
    axis: str
    swing: Swing


@dataclass(frozen=True, eq=False)
class Limb:
    """What is compared.

    ``joints``: ours, the rig's bone that begins there, and the bone in whose axes its place is told; in the limb's
    order, so that segments run from one to the next. ``angles``: our coordinate, the turn (by its number) that it
    follows, its sign. ``least_z``: where the head would begin (m from the body's middle).
    """

    anatomy: str
    tip: str
    least_z: float
    joints: tuple[tuple[str, str, str], ...]
    segments: tuple[str, ...]
    turns: tuple[RigTurn, ...]
    angles: tuple[tuple[str, int, float], ...] = field(repr=False)


_SWAY = (
    RigTurn("root", "up", Swing(0.0, 14.0, 1.0, 0.1)),
    RigTurn("root", "right", Swing(0.0, 5.0, 1.5)),
)
LIMBS = {
    "arm": Limb(
        "upper-limb-right",
        "r-finger-3-4",
        0.09,
        (
            ("shoulder", "upperarm01.R", "upperarm02.R"),
            ("elbow", "lowerarm01.R", "upperarm02.R"),
            ("wrist", "wrist.R", "lowerarm01.R"),
        ),
        ("upper arm", "forearm"),
        (
            RigTurn("lowerarm01.R", "elbow", Swing(12.0, 45.0, 1.0, -0.25)),
            RigTurn("lowerarm02.R", "forearm", Swing(0.0, 45.0, 2.0)),
            RigTurn("wrist.R", "palm", Swing(0.0, 18.0, 3.0)),
            RigTurn("upperarm01.R", "right", Swing(5.0, 15.0, 1.0, 0.4)),
            RigTurn("upperarm01.R", "forward", Swing(0.0, 10.0, 1.5)),
            *_SWAY,
        ),
        (("elbow_flexion", 0, 1.0), ("pro_sup", 1, -1.0), ("flexion", 2, 1.0)),
    ),
    "leg": Limb(
        "lower-limb-right",
        "r-toe-2-1",
        -0.004,
        (
            ("hip", "upperleg01.R", "pelvis.R"),
            ("knee", "lowerleg01.R", "upperleg02.R"),
            ("ankle", "foot.R", "lowerleg02.R"),
        ),
        ("thigh", "shank"),
        (
            RigTurn("lowerleg01.R", "right", Swing(-34.0, -32.0, 1.0, -0.25)),
            RigTurn("foot.R", "right", Swing(0.0, 14.0, 2.0)),
            RigTurn("upperleg01.R", "right", Swing(15.0, 22.0, 1.0, -0.1)),
            RigTurn("upperleg01.R", "forward", Swing(0.0, 8.0, 1.5)),
            *_SWAY,
        ),
        (("knee_angle_r", 0, -1.0), ("ankle_angle_r", 1, 1.0)),
    ),
}


@dataclass(frozen=True, eq=False)
class Motions:
    """Somebody's limb over T frames: transforms (T, B, 4, 4) of the rig, and each turn's degrees (T,)."""

    limb: RiggedLimb
    transforms: Floats = field(repr=False)
    degrees: tuple[Floats, ...]

    def at(self, head: str, carrier: str) -> tuple[Floats, Floats]:
        """Where a bone begins (T, 3), and the turns (T, 3, 3) of the bone that carries it."""
        rig = self.limb.rig
        moved = self.transforms[:, rig.names.index(carrier)]
        return moved[:, :3, :3] @ rig.head(head) + moved[:, :3, 3], moved[:, :3, :3]


def moving_limb(limb: Limb, build: Build, u: Floats) -> Motions:
    """Somebody's limb, swinging while u (T,) runs from 0 to 1."""
    body, rig = person(build)
    plan = limb_plan(limb.anatomy)
    root = rig.head(limb.joints[0][1]), neutral_rig(limb.anatomy).head(limb.joints[0][1])
    farther = _farther(plan.skin.cuts[0], *root, scale=build.stature / plan.skin.stature)
    cuts = (farther, *plan.skin.cuts[1:], Cut((0.0, 0.0, limb.least_z), (0.0, 0.0, 1.0)))
    axes = _axes(body.joints)
    degrees = tuple(turn.swing.degrees(u) for turn in limb.turns)
    transforms = []
    for angles in np.transpose(degrees):
        turns: dict[str, Floats] = {}
        for turn, angle in zip(limb.turns, angles, strict=True):
            turns[turn.bone] = exp_so3(np.deg2rad(angle) * axes[turn.axis]) @ turns.get(turn.bone, np.eye(3))
        transforms.append(rig.transforms(turns))
    return Motions(cut_limb(body, rig, cuts, body.joints[limb.tip]), np.array(transforms), degrees)


def limb_plan(anatomy: str) -> LimbPlan:
    """How the template of that name is built."""
    from adapt.template_builder.__main__ import PLANS  # it needs what only the templates' build needs

    return PLANS[anatomy]


def _farther(cut: Cut, root: Floats, neutral_root: Floats, *, scale: float) -> Cut:
    """The template's cut in another body, by the limb's first joint (3,) in either, and farther into the trunk."""
    normal = np.array(cut.normal) / np.linalg.norm(cut.normal)
    x, y, z = root + scale * (np.array(cut.point) - neutral_root) - _TRUNK_M * normal
    return Cut((float(x), float(y), float(z)), cut.normal)


def _axes(joints: Mapping[str, Floats]) -> dict[str, Floats]:
    """Axes (3,) to turn about, at rest: a positive turn about the elbow's and the palm's flexes."""
    upper, fore = joints["r-elbow"] - joints["r-shoulder"], joints["r-hand"] - joints["r-elbow"]
    axes = {
        "forward": np.array([1.0, 0.0, 0.0]),
        "up": np.array([0.0, 1.0, 0.0]),
        "right": np.array([0.0, 0.0, 1.0]),
        "elbow": np.cross(upper, fore),
        "forearm": fore,
        "palm": joints["r-finger-2-1"] - joints["r-finger-5-1"],
    }
    return {name: axis / np.linalg.norm(axis) for name, axis in axes.items()}


@lru_cache(maxsize=2)
def neutral_rig(anatomy: str) -> Rig:
    """The rig in the body that the template was made of."""
    plan = limb_plan(anatomy).skin
    return read_rig(load_skin(plan.targets, stature=plan.stature))


def definition(limb: Limb) -> dict[str, Floats]:
    """From the rig's joints to ours (3,) m in the body that the template was made of, at rest."""
    body, rig = make_body(load_anatomy(limb.anatomy)), neutral_rig(limb.anatomy)
    ours = joint_centres(body, rest_theta(body))
    return {joint: ours[joint] - rig.head(head) for joint, head, _ in limb.joints}
