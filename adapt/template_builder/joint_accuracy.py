"""How far an anatomy's spline joint is off the table it was calibrated from.

The table lives in its parent's OpenSim frame, the anatomy at rest in its own. The similarity between the two follows
from the joint's control landmarks, so the comparison needs nothing but the anatomy and the table; a left limb's is a
mirror image.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy.linalg import orthogonal_procrustes

from adapt.anatomy import Anatomy, Floats, Joint
from adapt.model.derivatives import constant_points
from adapt.model.joints import joint_motion
from adapt.template_builder.coupled_joint import CoupledJoint, Guides, child_in_parent
from capture.rigid import apply, rotation_angle, transform


@dataclass(frozen=True)
class Similarity:
    """x' = scale turn x + shift, where ``turn`` (3, 3) is a rotation, or one with a mirror."""

    scale: float
    turn: Floats = field(repr=False)
    shift: Floats = field(repr=False)

    def apply(self, points: Floats) -> Floats:
        """Carry points (N, 3)."""
        return np.asarray(self.scale * points @ self.turn.T + self.shift)

    def seen_from_before(self, motion: Floats) -> Floats:
        """A rigid motion (4, 4) of what was carried, as a motion of what was there before."""
        turn = self.turn.T @ motion[:3, :3] @ self.turn
        back = self.turn.T @ (motion[:3, :3] @ self.shift + motion[:3, 3] - self.shift) / self.scale
        return transform(turn, back)


@dataclass(frozen=True)
class Comparison:
    """A joint beside its table at the coordinate's values ``angles`` (T,) in rad.

    ``ours`` and ``table`` (T, 4, 4) place the child in its parent's OpenSim frame at the table's size; the
    differences are at the anatomy's size: of the child's origin (T,) in m, of its axes (T,) in rad.
    """

    angles: Floats
    ours: Floats = field(repr=False)
    table: Floats = field(repr=False)
    distance: Floats = field(repr=False)
    turn: Floats = field(repr=False)


def rest_from_table(anatomy: Anatomy, joint: Joint, table: CoupledJoint, guides: Guides) -> Similarity:
    """The similarity from the parent's OpenSim frame to the anatomy at rest: least squares over control landmarks."""
    points = np.array([guides.medial, guides.lateral, guides.normal])
    before = np.concatenate([apply(child_in_parent(table, knot), points) for knot in joint.knots])
    names = [name for frame in joint.frames for name in (*frame.origin, *frame.y_to)]  # medial, lateral, normal
    after = anatomy.landmarks[[anatomy.landmark_index(name) for name in names]]
    middle, goal = before.mean(axis=0), after.mean(axis=0)
    turn, spread = orthogonal_procrustes(after - goal, before - middle)
    scale = spread / float(((before - middle) ** 2).sum())
    return Similarity(scale, turn, goal - scale * turn @ middle)


def compare_with_table(
    anatomy: Anatomy, joint: Joint, table: CoupledJoint, guides: Guides, angles: Floats
) -> Comparison:
    """The anatomy's joint beside the table from which ``spline_joint`` made it, at coordinate values (T,) in rad."""
    similarity = rest_from_table(anatomy, joint, table, guides)
    k = anatomy.coordinate_index(joint.coordinates[0])
    at_rest = child_in_parent(table, anatomy.coordinates[k].rest)
    p = constant_points(anatomy.landmarks, len(anatomy.coordinates))
    ours = []
    for angle in angles:
        theta = np.zeros(len(anatomy.coordinates))
        theta[k] = angle
        motion = joint_motion(anatomy, joint, theta, p, 0).matrix()
        ours.append(similarity.seen_from_before(motion) @ at_rest)
    stated = [child_in_parent(table, float(angle)) for angle in angles]
    return Comparison(
        angles,
        np.array(ours),
        np.array(stated),
        similarity.scale * np.linalg.norm(np.array(ours)[:, :3, 3] - np.array(stated)[:, :3, 3], axis=1),
        np.array([rotation_angle(a[:3, :3].T @ b[:3, :3]) for a, b in zip(ours, stated, strict=True)]),
    )
