"""Arms and legs of bodies with MakeHuman's rigs: what they do, and where their joints truly are.

A limb turns about the places that are called true: where the template's own joints are, carried by the skin that all
of these bodies have in common (``track.evaluation.limb_ground``). The rig's own joint, with the difference that it has
from ours in the template's body, scaled with stature, is kept as a second yardstick.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from adapt.anatomy import Floats
from adapt.template_builder.skin import Cut
from adapt.template_builder.sources_makehuman import SourceSkin
from capture.rigid import exp_so3
from track.evaluation.limb_ground import limb_ground, limb_plan
from track.evaluation.rigged_people import RiggedLimb, cut_limb, read_rig
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

    ``joints``: ours, the rig's bone that turns about it, and the bone that carries it; in the limb's order, so that
    segments run from one to the next. ``bones``: ours, by the rig's that moves it. ``turned``: our coordinates that the
    turns move. ``twist``: two of our landmarks that the bone of that name turns about, for it is no place but a line.
    ``least_z``: where the head would begin (m from the body's middle).
    """

    anatomy: str
    tip: str
    least_z: float
    joints: tuple[tuple[str, str, str], ...]
    segments: tuple[str, ...]
    turns: tuple[RigTurn, ...]
    bones: dict[str, str] = field(repr=False)
    turned: tuple[str, ...] = ()
    twist: tuple[str, str] | None = None


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
            ("shoulder", "upper arm", "upper arm"),
            ("elbow", "forearm", "upper arm"),
            ("wrist", "hand", "twist"),
        ),
        ("upper arm", "forearm"),
        (
            RigTurn("forearm", "elbow", Swing(12.0, 45.0, 1.0, -0.25)),
            RigTurn("twist", "forearm", Swing(0.0, 45.0, 2.0)),
            RigTurn("hand", "palm", Swing(0.0, 18.0, 3.0)),
            RigTurn("upper arm", "right", Swing(5.0, 15.0, 1.0, 0.4)),
            RigTurn("upper arm", "forward", Swing(0.0, 10.0, 1.5)),
            *_SWAY,
        ),
        {"humerus": "upper arm", "ulna": "forearm", "radius": "twist", "hand": "hand"},
        ("elbow_flexion", "pro_sup", "deviation", "flexion"),
        ("ulnar_head", "radial_head"),
    ),
    "leg": Limb(
        "lower-limb-right",
        "r-toe-2-1",
        -0.004,
        (
            ("hip", "thigh", "root"),
            ("knee", "shank", "thigh"),
            ("ankle", "foot", "shank"),
        ),
        ("thigh", "shank"),
        (
            RigTurn("shank", "right", Swing(-34.0, -32.0, 1.0, -0.25)),
            RigTurn("foot", "right", Swing(0.0, 14.0, 2.0)),
            RigTurn("thigh", "right", Swing(15.0, 22.0, 1.0, -0.1)),
            RigTurn("thigh", "forward", Swing(0.0, 8.0, 1.5)),
            *_SWAY,
        ),
        {"pelvis": "root", "femur": "thigh", "tibia": "shank", "foot": "foot"},
        ("hip_flexion_r", "hip_adduction_r", "hip_rotation_r", "knee_angle_r", "ankle_angle_r"),
    ),
}


@dataclass(frozen=True, eq=False)
class Motions:
    """A limb over T frames: transforms (T, B, 4, 4) of the rig, and each joint's places (3,) m at rest.

    ``true``: what the limb turns about. ``by_rig``: the rig's own joint, with the difference from ours that it has in
    the template's body. ``landmarks`` (P, 3): ours, in this body at rest.
    """

    what: Limb
    limb: RiggedLimb
    body: SourceSkin = field(repr=False)
    transforms: Floats = field(repr=False)
    true: dict[str, Floats]
    by_rig: dict[str, Floats]
    landmarks: Floats = field(repr=False)

    def carried(self, joint: str, place: Floats) -> tuple[Floats, Floats]:
        """A joint's place at rest (3,), over time (T, 3), and the turns (T, 3, 3) of the bone that carries it."""
        carrier = next(carrier for name, _, carrier in self.what.joints if name == joint)
        moved = self.transforms[:, self.limb.rig.names.index(carrier)]
        return moved[:, :3, :3] @ place + moved[:, :3, 3], moved[:, :3, :3]

    def bone(self, ours: str) -> Floats:
        """The transforms (T, 4, 4), from rest, of the rig's bone that stands for one of ours."""
        return np.asarray(self.transforms[:, self.limb.rig.names.index(self.what.bones[ours])])


def moving_limb(limb: Limb, body: SourceSkin, rig: str, u: Floats) -> Motions:
    """Somebody's limb, swinging while u (T,) runs from 0 to 1, with the weights of one of ``rigged_people.RIGS``."""
    ground, plan, own = limb_ground(limb.anatomy), limb_plan(limb.anatomy).skin, read_rig(body, rig)
    true = {joint: ground.centre(body.vertices, joint) for joint, _, _ in limb.joints}
    places = {bone: true[joint] for joint, bone, _ in limb.joints}
    axes = _axes(body.joints)
    if limb.twist is not None:
        at, to = (ground.landmark(body.vertices, (name,)) for name in limb.twist)
        places["twist"], axes["forearm"] = at, (at - to) / np.linalg.norm(at - to)
    scale = float(np.ptp(body.vertices[np.unique(body.quads), 1])) / plan.stature
    first = limb.joints[0][0]
    farther = _farther(plan.cuts[0], true[first], ground.centre(ground.body.vertices, first), scale=scale)
    cuts = (farther, *plan.cuts[1:], Cut((0.0, 0.0, limb.least_z), (0.0, 0.0, 1.0)))
    turning = own.turning_about(places)
    return Motions(
        limb,
        cut_limb(body, turning, cuts, body.joints[limb.tip]),
        body,
        np.array([turning.transforms(turns) for turns in _turns(limb, axes, u)]),
        true,
        {joint: own.head(bone) + scale * definition(limb, rig)[joint] for joint, bone, _ in limb.joints},
        ground.landmarks(body.vertices),
    )


def _turns(limb: Limb, axes: Mapping[str, Floats], u: Floats) -> list[dict[str, Floats]]:
    """Rotations (3, 3) of the rig's bones in each frame."""
    frames = []
    for angles in np.transpose([turn.swing.degrees(u) for turn in limb.turns]):
        turns: dict[str, Floats] = {}
        for turn, angle in zip(limb.turns, angles, strict=True):
            turns[turn.bone] = exp_so3(np.deg2rad(angle) * axes[turn.axis]) @ turns.get(turn.bone, np.eye(3))
        frames.append(turns)
    return frames


def definition(limb: Limb, rig: str) -> dict[str, Floats]:
    """From a rig's joints to ours (3,) m in the body that the template was made of, at rest."""
    ground = limb_ground(limb.anatomy)
    body, own = ground.body, read_rig(ground.body, rig)
    return {joint: ground.centre(body.vertices, joint) - own.head(bone) for joint, bone, _ in limb.joints}


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
