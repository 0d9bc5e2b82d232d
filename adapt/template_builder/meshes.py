"""Triangle meshes as the build needs them: neighbours, closedness, even triangles, level sets, signed depth."""

from __future__ import annotations

from dataclasses import dataclass, field

import igl
import numpy as np
from numpy.typing import NDArray

from capture.errors import AnatomyError

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True)
class Mesh:
    """A triangle mesh: vertices (V, 3) m and faces (F, 3)."""

    vertices: Floats = field(repr=False)
    faces: Ints = field(repr=False)

    def mean_edge(self) -> float:
        """Mean edge length, m."""
        corners = self.vertices[self.faces]
        return float(np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).mean())

    def area(self) -> float:
        """Area of the surface, m^2."""
        a, b, c = self.vertices[self.faces].transpose(1, 0, 2)
        return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2.0)

    def volume(self) -> float:
        """Enclosed volume, m^3; positive for a closed mesh that faces outward."""
        a, b, c = self.vertices[self.faces].transpose(1, 0, 2)
        return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6.0)

    def is_closed(self) -> bool:
        """Whether every edge belongs to exactly two faces that run along it in opposite directions."""
        halves = np.concatenate([self.faces[:, [0, 1]], self.faces[:, [1, 2]], self.faces[:, [2, 0]]])
        forward = {(int(a), int(b)) for a, b in halves}
        return len(forward) == len(halves) and all((b, a) in forward for a, b in forward)

    def depth(self, points: Floats) -> Floats:
        """How deep points (N, 3) lie inside this closed mesh (m), negative outside."""
        if len(points) == 0:
            return np.zeros(0)
        kind = igl.SIGNED_DISTANCE_TYPE_FAST_WINDING_NUMBER
        distance, *_ = igl.signed_distance(np.ascontiguousarray(points), self.vertices, self.faces, kind)
        return -np.asarray(distance)


def compacted(vertices: Floats, faces: Ints) -> tuple[Floats, Ints]:
    """Drop vertices that no face uses; faces may have any number of corners."""
    used, index = np.unique(faces, return_inverse=True)
    return vertices[used], index.reshape(faces.shape)


def boundary_loop(faces: Ints) -> Ints:
    """The one closed border of an open mesh, in the direction of its faces. Raises AnatomyError if not one."""
    halves = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    known = {(int(a), int(b)) for a, b in halves}
    after = {a: b for a, b in known if (b, a) not in known}
    if not after:
        raise AnatomyError("the surface has no border to close")
    first = next(iter(after))
    loop = [first]
    while (following := after[loop[-1]]) != first and len(loop) < len(after):
        loop.append(following)
    if len(loop) != len(after):
        raise AnatomyError("the cut runs through the surface more than once", remedy="move the cut plane")
    return np.array(loop, dtype=np.int64)


def isotropic(mesh: Mesh, *, count: int) -> Mesh:
    """Resample a finer mesh to about ``count`` evenly spread vertices by collapsing the shortest edges.

    Collapsing to middles shrinks round parts, so vertices are put back onto ``mesh`` afterwards.
    """
    vertices, faces, *_ = igl.decimate(mesh.vertices, mesh.faces, 2 * count, True)
    _, _, nearest = igl.point_mesh_squared_distance(vertices, mesh.vertices, mesh.faces)
    return Mesh(np.asarray(nearest), np.asarray(faces, dtype=np.int64))


def level_set(meshes: list[Mesh], *, spacing: float, grow: float = 0.0, blur: float = 0.0) -> Mesh:
    """The closed surface at distance ``grow`` (m) around the union of meshes, faces outward.

    The sign comes from the winding number, so meshes may have small holes and may overlap. ``blur`` (m) is the
    standard deviation of a Gaussian that rounds the facets of coarse meshes; ``spacing`` (m) is that of the grid.
    """
    from scipy.ndimage import gaussian_filter

    margin = grow + 4.0 * spacing + 2.0 * blur
    points = np.concatenate([mesh.vertices for mesh in meshes])
    low, high = points.min(axis=0) - margin, points.max(axis=0) + margin
    shape = np.ceil((high - low) / spacing).astype(int) + 1
    grid = low + spacing * np.stack(np.meshgrid(*map(np.arange, shape), indexing="ij"), axis=-1).reshape(-1, 3)
    distance = np.full(len(grid), margin)
    for mesh in meshes:
        near = np.all(
            (grid >= mesh.vertices.min(axis=0) - margin) & (grid <= mesh.vertices.max(axis=0) + margin), axis=1
        )
        distance[near] = np.minimum(distance[near], -mesh.depth(grid[near]))
    if blur > 0.0:
        distance = gaussian_filter(distance.reshape(shape), blur / spacing).ravel()
    # libigl counts the grid with x running fastest.
    order = np.arange(len(grid)).reshape(shape).transpose(2, 1, 0).ravel()
    vertices, faces, *_ = igl.marching_cubes(distance[order], grid[order], *map(int, shape), grow)
    surface = Mesh(np.asarray(vertices), np.asarray(faces, dtype=np.int64))
    return surface if surface.volume() > 0.0 else Mesh(surface.vertices, surface.faces[:, ::-1].copy())


def largest_part(mesh: Mesh) -> Mesh:
    """The connected part with the most faces."""
    _, label = igl.facet_components(mesh.faces)
    return Mesh(*compacted(mesh.vertices, mesh.faces[label == np.argmax(np.bincount(label))]))


def parts_of(mesh: Mesh) -> list[Mesh]:
    """The connected parts."""
    count, label = igl.facet_components(mesh.faces)
    return [Mesh(*compacted(mesh.vertices, mesh.faces[label == part])) for part in range(count)]


def joined(meshes: list[Mesh]) -> Mesh:
    """Several meshes as one, without merging anything."""
    starts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    faces = [mesh.faces + start for mesh, start in zip(meshes, starts, strict=False)]
    return Mesh(np.concatenate([mesh.vertices for mesh in meshes]), np.concatenate(faces))


def simplified(mesh: Mesh, *, count: int) -> Mesh:
    """Fewer vertices, about ``count``, where the shape allows: edges collapse by quadric error."""
    vertices, faces, *_ = igl.qslim(mesh.vertices, mesh.faces, 2 * count)
    return Mesh(np.asarray(vertices), np.asarray(faces, dtype=np.int64))
