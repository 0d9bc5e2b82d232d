"""Cross-sections of a closed mesh: areas and middles of plane slices, exactly, from the triangles they cut."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from adapt.anatomy import Floats, Ints


@dataclass(frozen=True)
class Sections:
    """L slices perpendicular to the line from ``start`` to ``end``, at shares ``t`` of its length."""

    t: Floats
    areas: Floats = field(repr=False)  # (L,) m^2
    middles: Floats = field(repr=False)  # (L, 3) m, centroids
    length: float  # m, of the whole line

    def volume(self) -> float:
        """Volume (m^3) between the first and the last slice."""
        return float(np.trapezoid(self.areas, self.t * self.length))

    def bow(self) -> Floats:
        """How far (L,) in m the line of centroids leaves the chord between its ends."""
        chord = self.middles[-1] - self.middles[0]
        offsets = np.cross(self.middles - self.middles[0], chord / np.linalg.norm(chord))
        return np.asarray(np.linalg.norm(offsets, axis=1))


def sections(vertices: Floats, faces: Ints, start: Floats, end: Floats, t: Floats) -> Sections:
    """Slice a closed mesh (V, 3), (F, 3) with outward faces at shares t (L,) of the way from start to end."""
    length = float(np.linalg.norm(end - start))
    axis = (end - start) / length
    across = np.linalg.svd(axis[None])[2][1:]
    across[1] *= np.sign(np.linalg.det(np.vstack([across, axis])))
    height = (vertices - start) @ axis / length
    flat = (vertices - start) @ across.T
    moments = np.array([_moments(flat, height - level, faces) for level in t])
    middles = start + (t * length)[:, None] * axis + moments[:, 1:] / moments[:, :1] @ across
    return Sections(t, moments[:, 0], middles, length)


def _moments(flat: Floats, height: Floats, faces: Ints) -> Floats:
    """Area and first moments (3,) of the polygon in which the plane height = 0 cuts the mesh (Green's theorem)."""
    above = height > 0.0
    count = above[faces].sum(axis=1)
    cut = faces[(count == 1) | (count == 2)]
    first, second = np.zeros((2, len(cut), 2))
    for k in range(3):
        a, b = cut[:, k], cut[:, (k + 1) % 3]
        rising, falling = ~above[a] & above[b], above[a] & ~above[b]
        rise = np.where(rising | falling, height[a] - height[b], np.inf)
        point = flat[a] + (height[a] / rise)[:, None] * (flat[b] - flat[a])
        first[falling], second[rising] = point[falling], point[rising]
    cross = first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]
    return np.concatenate([[0.5 * cross.sum()], (cross[:, None] * (first + second)).sum(axis=0) / 6.0])
