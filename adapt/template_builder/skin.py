"""The limb's skin: smooth the body's coarse surface, cut the limb off by a plane, close it, even out its triangles."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from adapt.template_builder.meshes import Mesh, boundary_loop, compacted, isotropic

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

_MARGIN = 0.012  # m beyond the cut that take part in subdivision and resampling, whose borders are not clean
_DRAWN = 0.35  # share of an edge within which its end is drawn onto the plane
_ON_PLANE = 1e-9  # m
_CAP_STEP = 2.5  # mean edges from one ring of the cap to the next


@dataclass(frozen=True)
class Cut:
    """The plane that parts limb and trunk: a point (m) and the unit normal that points into the limb."""

    point: tuple[float, float, float]
    normal: tuple[float, float, float]

    def height(self, points: Floats) -> Floats:
        """Signed distance (N,) m of points from the plane, positive on the limb's side."""
        normal = np.asarray(self.normal) / np.linalg.norm(self.normal)
        return np.asarray((points - np.asarray(self.point)) @ normal)


def height_in(cuts: tuple[Cut, ...], points: Floats) -> Floats:
    """Signed distance (N,) m of points from the nearest of several cuts, positive inside all of them."""
    return np.asarray(np.min([cut.height(points) for cut in cuts], axis=0))


def smooth_limb(vertices: Floats, quads: Ints, cut: Cut, tip: Floats, *, rounds: int = 3) -> Mesh:
    """The surface of the limb and a little beyond the cut, open, after ``rounds`` of Catmull-Clark subdivision.

    ``tip`` (3,) m is any point of the limb: what the plane cuts off elsewhere (a head, say) is left away.
    """
    quads = quads[np.all(cut.height(vertices)[quads] > -5.0 * _MARGIN, axis=1)]
    vertices, quads = compacted(vertices, quads)
    for _ in range(rounds):
        vertices, quads = catmull_clark(vertices, quads)
    faces = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    vertices, faces = _clipped(vertices, faces, cut.height(vertices) + _MARGIN)
    return Mesh(*compacted(vertices, _connected_to(faces, vertices, tip)))


def catmull_clark(vertices: Floats, quads: Ints) -> tuple[Floats, Ints]:
    """One round of Catmull-Clark subdivision of quads (M, 4); open borders follow the cubic-spline rule."""
    halves = np.stack([quads, np.roll(quads, -1, axis=1)], axis=2).reshape(-1, 2)
    edges, of_half, uses = np.unique(np.sort(halves, axis=1), axis=0, return_inverse=True, return_counts=True)
    of_half = of_half.reshape(quads.shape)
    n, e, f = len(vertices), len(edges), len(quads)
    faces = vertices[quads].mean(axis=1)
    middles = vertices[edges].mean(axis=1)
    open_edge = uses == 1

    face_sum = np.zeros((e, 3))
    np.add.at(face_sum, of_half, np.broadcast_to(faces[:, None], (f, 4, 3)))
    edge_points = np.where(open_edge[:, None], middles, (2.0 * middles + face_sum) / 4.0)

    valence, q, r = np.zeros(n), np.zeros((n, 3)), np.zeros((n, 3))
    np.add.at(q, quads, np.broadcast_to(faces[:, None], (f, 4, 3)))
    faces_at = np.bincount(quads.ravel(), minlength=n).astype(float)
    np.add.at(valence, edges, 1.0)
    np.add.at(r, edges, np.broadcast_to(middles[:, None], (e, 2, 3)))
    v = np.maximum(valence, 1.0)[:, None]
    moved = (q / np.maximum(faces_at, 1.0)[:, None] + 2.0 * r / v + (v - 3.0) * vertices) / v

    border = np.unique(edges[open_edge])
    neighbours = np.zeros((n, 3))
    np.add.at(neighbours, edges[open_edge], middles[open_edge][:, None].repeat(2, axis=1))
    moved[border] = (neighbours[border] / 2.0 + vertices[border]) / 2.0

    face_index = n + e + np.arange(f)
    here, after, before = quads, n + of_half, n + np.roll(of_half, 1, axis=1)
    split = np.stack([here, after, np.broadcast_to(face_index[:, None], (f, 4)), before], axis=2)
    return np.concatenate([moved, edge_points, faces]), split.reshape(-1, 4)


def evened(surface: Mesh, cuts: tuple[Cut, ...], tip: Floats, *, count: int) -> tuple[Mesh, NDArray[np.bool_]]:
    """The limb up to the cuts with about ``count`` evenly spread vertices, closed; and which (V,) are the caps'.

    ``surface`` reaches a little beyond the first cut, where it is open; further cuts go through what that leaves.
    """
    left = surface
    for cut in cuts[1:]:
        left = cut_off(left, cut, tip)
    even = isotropic(surface, count=round(count * surface.area() / left.area()))
    mesh, is_cap = closed(cut_off(even, cuts[0], tip))
    for cut in cuts[1:]:
        mesh, _ = closed(cut_off(mesh, cut, tip))
        is_cap = height_in(cuts, mesh.vertices) < _ON_PLANE
    return mesh, is_cap


def cut_off(mesh: Mesh, cut: Cut, tip: Floats) -> Mesh:
    """The part of a surface on the limb's side of the plane that is connected to ``tip`` (3,), open at the cut.

    Where an edge crosses the plane near one of its ends, that end is first moved along it onto the plane, so that
    no slivers arise and the border stays on the surface.
    """
    vertices, height = _drawn_to_plane(mesh, cut.height(mesh.vertices))
    vertices, faces = _clipped(vertices, mesh.faces, height)
    return Mesh(*compacted(vertices, _connected_to(faces, vertices, tip)))


def _drawn_to_plane(mesh: Mesh, height: Floats) -> tuple[Floats, Floats]:
    """Vertices and heights after moving each vertex onto the plane along its crossing edge, if that is near."""
    ends = np.concatenate([mesh.faces[:, [0, 1]], mesh.faces[:, [1, 2]], mesh.faces[:, [2, 0]]])
    ends = np.concatenate([ends, ends[:, ::-1]])  # every edge from both of its ends
    start, end = ends[height[ends[:, 0]] * height[ends[:, 1]] < 0.0].T
    share = height[start] / (height[start] - height[end])
    near = share < _DRAWN
    start, end, share = start[near], end[near], share[near]
    order = np.argsort(-share)  # of several edges at a vertex the nearest crossing is written last
    vertices, drawn = mesh.vertices.copy(), height.copy()
    along = mesh.vertices[end] - mesh.vertices[start]
    vertices[start[order]] = (mesh.vertices[start] + share[:, None] * along)[order]
    drawn[start] = 0.0
    return vertices, drawn


def _clipped(vertices: Floats, faces: Ints, height: Floats) -> tuple[Floats, Ints]:
    """Triangles on the side ``height > 0``; crossing ones are split at height zero."""
    points = [vertices]
    kept: list[list[int]] = []
    made: dict[tuple[int, int], int] = {}
    count = len(vertices)

    def crossing(low: int, high: int) -> int:
        nonlocal count
        key = (min(low, high), max(low, high))
        if key not in made:
            share = height[low] / (height[low] - height[high])
            points.append((vertices[low] + share * (vertices[high] - vertices[low]))[None])
            made[key] = count
            count += 1
        return made[key]

    sign = np.sign(height).astype(int)
    for face in faces[np.max(sign[faces], axis=1) > 0]:
        corners: list[int] = []
        for a, b in zip(face, np.roll(face, -1), strict=True):
            if sign[a] >= 0:
                corners.append(int(a))
            if sign[a] * sign[b] < 0:
                corners.append(crossing(int(a), int(b)))
        kept.extend([corners[0], corners[i], corners[i + 1]] for i in range(1, len(corners) - 1))
    return np.concatenate(points), np.array(kept, dtype=np.int64)


def closed(mesh: Mesh) -> tuple[Mesh, NDArray[np.bool_]]:
    """Close the one border by rings that shrink to its centre; also which vertices (V,) are the cap's."""
    vertices, faces, edge = mesh.vertices, mesh.faces, mesh.mean_edge()
    loop = boundary_loop(faces)
    centre = vertices[loop].mean(axis=0)
    radius = float(np.linalg.norm(vertices[loop] - centre, axis=1).mean())
    rings = max(2, round(radius / (_CAP_STEP * edge)))
    outer, parts, new_faces, count = loop, [vertices], [faces], len(vertices)
    for ring in range(1, rings):
        share = 1.0 - ring / rings
        number = max(5, round(len(loop) * share / _CAP_STEP))
        at = np.linspace(0.0, len(loop), number, endpoint=False)
        closed = np.concatenate([vertices[loop], vertices[loop[:1]]])
        low = np.floor(at).astype(int)
        points = closed[low] + (at - low)[:, None] * (closed[low + 1] - closed[low])
        parts.append(centre + share * (points - centre))
        inner = count + np.arange(number)
        count += number
        new_faces.append(_strip(outer, inner))
        outer = inner
    parts.append(centre[None])
    new_faces.append(np.stack([np.roll(outer, -1), outer, np.full(len(outer), count)], axis=1))
    closed_mesh = Mesh(np.concatenate(parts), np.concatenate(new_faces))
    is_cap = np.zeros(len(closed_mesh.vertices), dtype=bool)
    is_cap[loop] = True
    is_cap[len(vertices) :] = True
    return closed_mesh, is_cap


def _strip(outer: Ints, inner: Ints) -> Ints:
    """Triangles between two closed rings that start side by side, facing against the border's direction."""
    triangles, i, j = [], 0, 0
    n, m = len(outer), len(inner)
    while i < n or j < m:
        if j >= m or (i < n and (i + 1) / n <= (j + 1) / m):
            triangles.append([outer[(i + 1) % n], outer[i % n], inner[j % m]])
            i += 1
        else:
            triangles.append([inner[(j + 1) % m], outer[i % n], inner[j % m]])
            j += 1
    return np.array(triangles, dtype=np.int64)


def _connected_to(faces: Ints, vertices: Floats, tip: Floats) -> Ints:
    """The faces of the connected part whose vertices come nearest to ``tip``."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    ends = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]]])
    graph = coo_array((np.ones(len(ends)), (ends[:, 0], ends[:, 1])), shape=(len(vertices), len(vertices)))
    _, label = connected_components(graph, directed=False)
    used = np.unique(faces)
    nearest = used[np.argmin(np.linalg.norm(vertices[used] - tip, axis=1))]
    return np.asarray(faces[label[faces[:, 0]] == label[nearest]])
