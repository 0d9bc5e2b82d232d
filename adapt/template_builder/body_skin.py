"""The whole body's skin: smooth, its pockets filled, finer at hands, feet and face, the same on both sides."""

from __future__ import annotations

from dataclasses import dataclass

import igl
import numpy as np
from numpy.typing import NDArray

from adapt.mirror import mirrored_points
from adapt.template_builder.meshes import Mesh, compacted
from adapt.template_builder.pockets import without_pockets
from adapt.template_builder.skin import Cut, catmull_clark, cut_off
from adapt.template_builder.sources_makehuman import SourceSkin

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

_ROUNDS = 2  # of Catmull-Clark subdivision: edges of 3 mm
_MIDDLE = Cut(point=(0.0, 0.0, 0.0), normal=(0.0, 0.0, 1.0))
_HEAD = ((-0.11, -0.06, -0.12), (0.22, 0.29, 0.12))  # m, about the rig's neck: where pockets are looked for


@dataclass(frozen=True)
class Finer:
    """Where triangles are smaller: ``times`` as fine beyond ``fade`` (m) on the way from one joint centre to another.

    Both centres are the rig's, of the right side or the middle.
    """

    start: str
    towards: str
    times: float
    fade: tuple[float, float]


def filled_skin(rig: SourceSkin) -> Mesh:
    """The body's surface after subdivision, closed, with mouth and eyes filled."""
    vertices, quads = compacted(rig.vertices, rig.quads)
    for _ in range(_ROUNDS):
        vertices, quads = catmull_clark(vertices, quads)
    mesh = Mesh(vertices, np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]))
    low, high = (rig.joints["neck"] + np.array(corner) for corner in _HEAD)
    return without_pockets(mesh, low, high)


def even_body(surface: Mesh, rig: SourceSkin, finer: tuple[Finer, ...], tip: str, *, count: int) -> Mesh:
    """The closed skin with about ``count`` vertices, whose left half is the mirror image of its right one."""
    large = Mesh(stretched(surface.vertices, rig, finer), surface.faces)
    even, faces, *_ = igl.decimate(large.vertices, large.faces, 2 * count, True)
    _, face, nearest = igl.point_mesh_squared_distance(even, large.vertices, large.faces)
    corners = large.faces[face]
    a, b, c = large.vertices[corners].transpose(1, 0, 2)
    shares = np.asarray(igl.barycentric_coordinates(np.asarray(nearest), a, b, c))
    points = np.einsum("kc,kcx->kx", shares, surface.vertices[corners])
    right = cut_off(Mesh(points, np.asarray(faces, dtype=np.int64)), _MIDDLE, rig.joints[tip])
    return both_halves(right)


def both_halves(right: Mesh) -> Mesh:
    """A right half, open in the plane z = 0, and its mirror image, joined along that plane."""
    in_plane = np.abs(right.vertices[:, 2]) < 1e-9
    vertices = np.where(in_plane[:, None], right.vertices * [1.0, 1.0, 0.0], right.vertices)
    left = np.flatnonzero(~in_plane)
    index = np.arange(len(vertices))
    index[left] = len(vertices) + np.arange(len(left))
    return Mesh(
        np.concatenate([vertices, mirrored_points(vertices[left])]),
        np.concatenate([right.faces, index[right.faces][:, ::-1]]),
    )


def other_side(points: Floats) -> Ints:
    """For every point (N, 3) of a symmetric set, which one (N,) is its mirror image."""
    from scipy.spatial import cKDTree

    _, index = cKDTree(points).query(mirrored_points(points))
    return np.asarray(index)


def stretched(points: Floats, rig: SourceSkin, finer: tuple[Finer, ...]) -> Floats:
    """Points (N, 3) m with the finer parts drawn out of the body, each about its own start, on both sides."""
    moved = points
    for part in finer:
        for side in (np.ones(3), np.array([1.0, 1.0, -1.0])):
            start, to = side * rig.joints[part.start], side * rig.joints[part.towards]
            moved = _grown(moved, start, to, part)
            if abs(rig.joints[part.start][2]) < 1e-3:
                break
    return moved


def unstretched(points: Floats, rig: SourceSkin, finer: tuple[Finer, ...]) -> Floats:
    """The points (N, 3) m that ``stretched`` brings there: by bisection along each part."""
    found = points.copy()
    for part in reversed(finer):
        for side in (np.ones(3), np.array([1.0, 1.0, -1.0])):
            start, to = side * rig.joints[part.start], side * rig.joints[part.towards]
            found = _shrunk(found, start, to, part)
            if abs(rig.joints[part.start][2]) < 1e-3:
                break
    return found


def _factor(along: Floats, part: Finer) -> Floats:
    share = np.clip((along - part.fade[0]) / (part.fade[1] - part.fade[0]), 0.0, 1.0)
    return np.asarray(1.0 + (part.times - 1.0) * share * share * (3.0 - 2.0 * share))


def _near(points: Floats, start: Floats, length: float) -> NDArray[np.bool_]:
    """Which points (N, 3) belong to a part from ``start``: within 2.5 lengths, and on its side of the body."""
    return np.asarray(_own_side(points, start) & (np.linalg.norm(points - start, axis=1) < 2.5 * length))


def _own_side(points: Floats, start: Floats) -> NDArray[np.bool_]:
    return np.ones(len(points), dtype=bool) if abs(start[2]) < 1e-3 else np.asarray(points[:, 2] * start[2] > 0.0)


def _grown(points: Floats, start: Floats, to: Floats, part: Finer) -> Floats:
    length = float(np.linalg.norm(to - start))
    way = (to - start) / length
    reach = points - start
    near = _near(points, start, length)
    return np.where(near[:, None], start + _factor(reach @ way, part)[:, None] * reach, points)


def _shrunk(points: Floats, start: Floats, to: Floats, part: Finer) -> Floats:
    """Along the way h = k(a) a is inverted by bisection; then all of the reach is divided by k(a)."""
    length = float(np.linalg.norm(to - start))
    way = (to - start) / length
    reach = points - start
    h = reach @ way
    low, high = np.minimum(h, h / part.times) - 1e-6, np.maximum(h, h / part.times) + 1e-6
    for _ in range(60):
        middle = 0.5 * (low + high)
        over = _factor(middle, part) * middle > h
        low, high = np.where(over, low, middle), np.where(over, middle, high)
    shrunk = start + reach / _factor(0.5 * (low + high), part)[:, None]
    near = _near(shrunk, start, length) & _own_side(points, start)
    return np.where(near[:, None], shrunk, points)
