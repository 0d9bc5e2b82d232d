"""Pockets of a skin filled: MakeHuman's folds inward through the lips and the lids to a mouth, a throat and sockets.

A sensor sees none of it, and bones that lie in it are inside the body. So what a ball cannot reach from outside, and
is larger than a crease between two toes, counts as inside; the surface that bounds it goes, and the lips' and lids'
borders are closed.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from adapt.template_builder.meshes import Mesh, compacted, largest_part

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Mask = NDArray[np.bool_]

_BALL = 0.006  # m, its radius; pockets come out alike from 4 to 10 mm
_LEAST = 5e-6  # m^3, of a pocket: the eyes' are 14 cm^3 each, mouth and throat 363, folds of an ear at most 2
_SPACING = 0.005  # m


def without_pockets(mesh: Mesh, low: Floats, high: Floats, *, spacing: float = _SPACING) -> Mesh:
    """A closed mesh with the pockets between the corners ``low`` and ``high`` (3,) m filled, closed again."""
    shape = np.ceil((high - low) / spacing).astype(int) + 1
    grid = low + spacing * np.stack(np.meshgrid(*map(np.arange, shape), indexing="ij"), axis=-1)
    depth = mesh.depth(grid.reshape(-1, 3)).reshape(shape)
    inside = (depth > 0.0) | _pockets(-depth, spacing)
    middles = mesh.vertices[mesh.faces].mean(axis=1)
    bounds = np.all((middles > low) & (middles < high), axis=1)
    hidden = np.zeros(len(middles), dtype=bool)
    hidden[bounds] = _deep_in(inside, (middles[bounds] - low) / spacing)
    if not hidden.any():
        return mesh
    left = largest_part(Mesh(mesh.vertices, mesh.faces[~hidden]))
    return _closed(left)


def _pockets(outside: Floats, spacing: float) -> Mask:
    """Cells of a grid of distances (m, negative inside) in pockets that the ball does not reach from outside."""
    free, _ = ndimage.label(outside > _BALL)
    border = np.ones(free.shape, dtype=bool)
    border[1:-1, 1:-1, 1:-1] = False
    reached = np.isin(free, np.setdiff1d(np.unique(free[border]), [0]))
    near = ndimage.distance_transform_edt(~reached) * spacing <= _BALL + 0.5 * spacing
    parts, _ = ndimage.label((outside > 0.0) & ~near)
    large = np.bincount(parts.ravel()) * spacing**3 >= _LEAST
    large[0] = False
    return np.asarray(large[parts])


def _deep_in(inside: Mask, at: Floats) -> Mask:
    """Whether points, in cells, lie so deep inside that no cell of the outside is at hand: within a cell and a half."""
    distance = ndimage.distance_transform_edt(inside)
    return np.asarray(ndimage.map_coordinates(distance, at.T, order=1) > 1.5)


def _closed(mesh: Mesh) -> Mesh:
    """Every border of a mesh closed by triangles to its middle."""
    vertices, faces = compacted(mesh.vertices, mesh.faces)
    parts, points, count = [faces], [vertices], len(vertices)
    for loop in border_loops(faces):
        points.append(vertices[loop].mean(axis=0)[None])
        parts.append(np.stack([np.roll(loop, -1), loop, np.full(len(loop), count)], axis=1))
        count += 1
    return Mesh(np.concatenate(points), np.concatenate(parts))


def border_loops(faces: Ints) -> list[Ints]:
    """The closed borders of a mesh, each in the direction of its faces; where two meet in a vertex they are parted."""
    halves = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    known = {(int(a), int(b)) for a, b in halves}
    after: dict[int, list[int]] = {}
    for a, b in sorted(known):
        if (b, a) not in known:
            after.setdefault(a, []).append(b)
    loops = []
    while after:
        walk = [next(iter(after))]
        while True:
            following = after[walk[-1]].pop()
            if not after[walk[-1]]:
                del after[walk[-1]]
            if following in walk:
                start = walk.index(following)
                loops.append(np.array(walk[start:], dtype=np.int64))
                walk = walk[: start + 1]
                if start == 0:
                    break
            else:
                walk.append(following)
    return loops
