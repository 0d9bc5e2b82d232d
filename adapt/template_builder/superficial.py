"""Where bone lies just under the skin, and how deep it does so in people: what a template is built to, and checked by.

A spot is a bony landmark or a place on a border; the depth of a spot is that of the shallowest vertex of its bone
nearby. On real bones under real skin the same is measured in the same way.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from adapt.template_builder.meshes import Mesh
from capture.errors import AnatomyError

Floats = NDArray[np.float64]

_STEP = 0.012  # m, from one spot to the next along a border that the skin is moved to


@dataclass(frozen=True)
class Spot:
    """A place where a bone lies just under the skin, and between which depths (m) people have it there.

    It is at the landmark ``at``, or on the way from there ``to`` another at ``share`` of it. The bone's vertices
    count within ``along`` (m) of that place along the way, and ``across`` (m) across it; where there is no way, within
    ``along`` in any direction. ``source`` says who measured the depths and how, or that nobody did.
    """

    name: str
    bone: str
    at: str
    low: float
    high: float
    source: str
    to: str = ""
    share: float = 0.0
    along: float = 0.006
    across: float = 0.045

    def vertices(self, bone: Floats, landmarks: Mapping[str, Floats]) -> Floats:
        """The vertices (N, 3) of a bone that count. Raises AnatomyError when there are none."""
        reach = bone - landmarks[self.at]
        if not self.to:
            found = bone[np.linalg.norm(reach, axis=1) < self.along]
        else:
            way = landmarks[self.to] - landmarks[self.at]
            length = float(np.linalg.norm(way))
            along = reach @ way / length
            off = np.linalg.norm(reach - np.outer(along, way / length), axis=1)
            found = bone[(np.abs(along - self.share * length) < self.along) & (off < self.across)]
        if len(found) == 0:
            raise AnatomyError(f"no vertices of the {self.bone} at {self.name!r}", remedy="widen the spot")
        return np.asarray(found)


def depth_at(spot: Spot, skin: Mesh, bones: Mapping[str, Mesh], landmarks: Mapping[str, Floats]) -> float:
    """How deep (m) a spot's shallowest vertex lies beneath a closed skin."""
    return float(skin.depth(spot.vertices(bones[spot.bone].vertices, landmarks)).min())


def filled_in(spots: tuple[Spot, ...], landmarks: Mapping[str, Floats]) -> list[Spot]:
    """The spots, and between neighbours on one border further ones whose depths lie between theirs."""
    dense = list(spots)
    for spot, after in pairwise(spots):
        if not spot.to or (spot.bone, spot.at, spot.to) != (after.bone, after.at, after.to):
            continue
        length = float(np.linalg.norm(landmarks[spot.to] - landmarks[spot.at]))
        for share in np.arange(spot.share, after.share, _STEP / length)[1:]:
            t = (share - spot.share) / (after.share - spot.share)
            low, high = (1.0 - t) * spot.low + t * after.low, (1.0 - t) * spot.high + t * after.high
            dense.append(replace(spot, share=float(share), low=low, high=high))
    return dense
