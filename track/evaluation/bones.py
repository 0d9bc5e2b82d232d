"""Measures of bones: how deep they lie beneath the skin, in each other, and what other proportions do to them."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np
from scipy.spatial import cKDTree

from adapt.anatomy import Anatomy, Floats, Ints, Joint
from adapt.model.body import Body, bone_transforms, make_body, rest_theta
from adapt.model.shape.handle_space import affine_set
from capture.rigid import apply, inverse

_HEAD_RADIUS_M = 0.045


def depth_inside(points: Floats, vertices: Floats, faces: Ints) -> Floats:
    """How deep (N,) in m points lie inside a surface; negative outside. Holes and folds are no harm."""
    import igl

    kind = igl.SignedDistanceType.SIGNED_DISTANCE_TYPE_FAST_WINDING_NUMBER
    parts = (np.ascontiguousarray(points), np.ascontiguousarray(vertices), np.ascontiguousarray(faces))
    return -np.asarray(igl.signed_distance(*parts, kind)[0])


def overlap(first: tuple[Floats, Ints], second: tuple[Floats, Ints]) -> float:
    """How deep (m) two bones stand in each other, at most: 0 when no point of one surface is inside the other."""
    reach = 0.005
    depths = [0.0]
    for surface, (vertices, faces) in ((first, second), (second, first)):
        points = surface_points(*surface)
        low, high = vertices.min(axis=0) - reach, vertices.max(axis=0) + reach
        near = points[((points > low) & (points < high)).all(axis=1)]
        if len(near):
            depths.append(float(depth_inside(near, vertices, faces).max()))
    return max(depths)


def surface_points(vertices: Floats, faces: Ints) -> Floats:
    """Vertices (N, 3) and the middles of the triangles, so that a coarse mesh is not seen through."""
    return np.concatenate([vertices, vertices[faces].mean(axis=1)])


def pose(body: Body, **degrees: float) -> Floats:
    """Theta (n,): the rest pose, with some coordinates by name (degrees) instead."""
    theta = rest_theta(body)
    for name, angle in degrees.items():
        theta[body.anatomy.coordinate_index(name)] = np.deg2rad(angle)
    return theta


def grid(**degrees: tuple[float, ...]) -> list[dict[str, float]]:
    """Every combination of the coordinates' values (degrees)."""
    return [dict(zip(degrees, values, strict=True)) for values in product(*degrees.values())]


@dataclass(frozen=True)
class Proportions:
    """A kind of body: lengths of all bones and scales of all joints, relative to the template."""

    name: str
    length: float = 1.0
    scale: float = 1.0

    def body(self, anatomy: Anatomy) -> Body:
        """The body of that kind: joint centres spread from the first by ``length``, heads scaled by ``scale``."""
        affine = affine_set(anatomy)
        shifts = (self.length - 1.0) * (affine.centres - affine.centres[0])
        return make_body(anatomy, shape=affine.shape(np.full(len(shifts), self.scale), shifts))


FIGURE_7 = (
    Proportions("longer", length=1.15),
    Proportions("shorter", length=0.85),
    Proportions("thicker", scale=1.15),
    Proportions("thinner", scale=0.85),
)


def heads(anatomy: Anatomy) -> dict[str, tuple[str, Ints]]:
    """The ends of the bones: handle name -> (bone name, indices of its vertices).

    A head reaches from the bone's end to as far behind the handle in it as the end lies beyond the handle, but no
    farther than a quarter of the way to the bone's other handle, and 4.5 cm to the sides (the thumb, which springs
    from the carpus, does not belong to the knuckles).
    """
    found = {}
    for bone in anatomy.bones:
        own = [handle for handle in anatomy.handles if handle.bone == bone.name]
        middle = np.mean([handle.position for handle in own], axis=0)
        for handle in own:
            outward = np.array(handle.position) - middle
            half = float(np.linalg.norm(outward))
            offset = bone.vertices - np.array(handle.position)
            beyond = offset @ outward / half
            across = np.linalg.norm(offset - beyond[:, None] * outward / half, axis=1)
            inside = (beyond > -min(float(beyond.max()), half / 2.0)) & (across < _HEAD_RADIUS_M)
            found[handle.name] = (bone.name, np.flatnonzero(inside))
    return found


def similarity_residual(rest: Floats, moved: Floats) -> tuple[float, float]:
    """Largest distance (m) that the best similarity from rest (N, 3) to moved (N, 3) leaves, and its scale."""
    a, b = rest - rest.mean(axis=0), moved - moved.mean(axis=0)
    u, d, vt = np.linalg.svd(b.T @ a)
    sign = np.array([1.0, 1.0, np.sign(np.linalg.det(u @ vt))])
    scale = float((d * sign).sum() / (a**2).sum())
    fitted = scale * a @ ((u * sign) @ vt).T
    return float(np.linalg.norm(fitted - b, axis=1).max()), scale


@dataclass(frozen=True, eq=False)
class Contact:
    """Where the two bones of a joint face each other: K pairs of vertices, closest at rest in the template."""

    parent: str
    child: str
    of_parent: Ints
    of_child: Ints


def contact(anatomy: Anatomy, joint: Joint, *, reach: float = 0.006) -> Contact:
    """Pairs of vertices of a joint's two bones that lie within ``reach`` m (or 1.5 times the smallest gap)."""
    assert joint.parent is not None
    parent, child = anatomy.bone(joint.parent), anatomy.bone(joint.child)
    distance, nearest = cKDTree(parent.vertices).query(child.vertices)
    near = np.flatnonzero(distance < max(reach, 1.5 * float(distance.min())))
    return Contact(parent.name, child.name, nearest[near], near)


def drift(template: Body, body: Body, joint: Joint, thetas: list[Floats], *, scale: float) -> float:
    """How far (m), at most, a joint of ``body`` moves otherwise than the template's own, scaled.

    g(theta) is the gap between the vertices of a pair, seen from the parent bone; what is measured is
    |g_body(theta) - scale g_template(theta)| over all pairs and poses: 0 when the joint is a scaled copy.
    """
    pairs = contact(template.anatomy, joint)
    return max(
        float(np.linalg.norm(_gaps(body, pairs, theta) - scale * _gaps(template, pairs, theta), axis=1).max())
        for theta in thetas
    )


def _gaps(body: Body, pairs: Contact, theta: Floats) -> Floats:
    transforms = bone_transforms(body, theta)
    parent_from_child = inverse(transforms[pairs.parent]) @ transforms[pairs.child]
    carried = apply(parent_from_child, body.rest_bones[pairs.child][pairs.of_child])
    return np.asarray(carried - body.rest_bones[pairs.parent][pairs.of_parent])


def joint_poses(body: Body, joint: Joint, *, steps: int = 5) -> list[Floats]:
    """Poses (n,) over the whole range of one joint's coordinates, the others at rest."""
    coordinates = [body.anatomy.coordinates[body.anatomy.coordinate_index(name)] for name in joint.coordinates]
    values = {c.name: tuple(np.rad2deg(np.linspace(c.low, c.high, steps))) for c in coordinates}
    return [pose(body, **degrees) for degrees in grid(**values)]
