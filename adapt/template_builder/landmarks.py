"""Landmarks, joint axes and handles: found on the source bones, placed with them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from adapt.template_builder.plan import AnatomyPlan, AxisPlan, PointPlan
from adapt.template_builder.pose_bones import Placement
from adapt.template_builder.sources_myosim import SourceSkeleton
from capture.errors import AnatomyError
from capture.rigid import exp_so3

Floats = NDArray[np.float64]


def point_on_body(skeleton: SourceSkeleton, plan: PointPlan) -> Floats:
    """The point (3,) m of a plan, in its body's frame."""
    if plan.how == "at":
        return np.array(plan.value)
    vertices = skeleton.bodies[plan.body].vertices
    axis, low, high = plan.within
    vertices = vertices[(vertices[:, axis] >= low) & (vertices[:, axis] <= high)]
    if len(vertices) < 4:
        raise AnatomyError(f"no vertices for the landmark {plan.name!r}", remedy="check 'within' in the data module")
    if plan.how == "extreme":
        return np.asarray(vertices[np.argmax(vertices @ np.array(plan.value))])
    if plan.how == "sphere":
        return _sphere_centre(vertices)
    return np.asarray((vertices.min(axis=0) + vertices.max(axis=0)) / 2.0)


def landmarks_of(
    skeleton: SourceSkeleton, placements: dict[str, Placement], plan: AnatomyPlan, angles: dict[str, float]
) -> tuple[tuple[str, ...], Floats]:
    """Names and positions (P, 3) m of all landmarks: bony points, points on joint axes, controls of spline joints.

    ``angles`` (rad) are those of the source's hinges, by name, in which the placements stand.
    """
    names = [point.name for point in plan.points]
    positions = [placements[point.body].points(point_on_body(skeleton, point)) for point in plan.points]
    for axis in plan.axes:
        names.extend(axis.names)
        positions.extend(_on_axis(skeleton, placements, axis, angles))
    for spline in plan.splines:
        _, controls = spline.joint(placements[spline.carrier].points)
        names.extend(controls)
        positions.extend(controls.values())
    return tuple(names), np.array(positions)


def _on_axis(
    skeleton: SourceSkeleton, placements: dict[str, Placement], axis: AxisPlan, angles: dict[str, float]
) -> Floats:
    origin = np.zeros(3) if axis.carrier == axis.body else skeleton.bodies[axis.body].position
    direction = np.array(axis.axis) / np.linalg.norm(axis.axis)
    for hinge in reversed([h for h in skeleton.bodies[axis.body].hinges if h.name in axis.after]):
        direction = exp_so3(hinge.axis * angles[hinge.name]) @ direction
    return placements[axis.carrier].points(origin + np.outer(axis.distances, direction))


def _sphere_centre(points: Floats) -> Floats:
    """Centre (3,) of the sphere nearest to points: least squares of |x|^2 = 2 c x + d, robust to the neck.

    The 30 per cent of points farthest from the first sphere are left out of a second fit.
    """
    for share in (1.0, 0.7, 0.7):
        matrix = np.c_[2.0 * points, np.ones(len(points))]
        solution = np.linalg.lstsq(matrix, np.einsum("ij,ij->i", points, points), rcond=None)[0]
        centre = solution[:3]
        radius = np.sqrt(solution[3] + centre @ centre)
        off = np.abs(np.linalg.norm(points - centre, axis=1) - radius)
        points = points[np.argsort(off)[: max(8, int(share * len(points)))]]
    return np.asarray(centre)
