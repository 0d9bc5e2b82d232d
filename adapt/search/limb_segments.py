"""The slender parts of a cloud: limbs without the trunk they hang on, for the first search only.

In each depth image a disc clearly wider than the limb is rolled over the foreground; what it cannot reach (a
morphological opening's residue) is slender. Depth jumps cut the foreground first, so that an arm in front of a chest
stays apart.
"""

from __future__ import annotations

from functools import lru_cache

import cv2
import numpy as np
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from adapt.anatomy import Anatomy, Floats, Ints
from adapt.match.visibility import depth_of, pixel_of
from capture.cloud.fuse import Cloud, View
from capture.cloud.preprocess import Mask, jump_mask

_THICKER = 1.9  # times the template's thickest part: 8.5 cm for an arm, of which no sleeve falls short and no trunk
_FEWEST_POINTS = 200
_CONNECTED_M = 0.025
_HOLE_PX = 7  # holes up to this size do not make a trunk slender


@lru_cache(maxsize=4)
def thicker_than(anatomy: Anatomy) -> float:
    """The radius (m) of a disc that no part of such a limb holds: clearly more than the largest ball inside it.

    >>> from adapt.anatomy_file import load_anatomy
    >>> [round(thicker_than(load_anatomy(name)), 3) for name in ("upper-limb-right", "lower-limb-right")]
    [0.086, 0.157]
    """
    inside, _ = anatomy.tetrahedra["limb"]
    return _THICKER * float(cKDTree(anatomy.skin_vertices).query(inside)[0].max())


def slender_parts(cloud: Cloud, radius_m: float) -> list[Cloud]:
    """The connected parts of a cloud that a disc of that radius (m) cannot reach, largest first.

    The cloud itself if there is hardly anything of the kind.
    """
    kept = np.zeros(len(cloud.points), dtype=bool)
    for number, view in enumerate(cloud.views):
        mine = np.flatnonzero(cloud.sensor == number)
        if len(mine):
            row, column, inside = pixel_of(view, cloud.points[mine])
            kept[mine] = inside & _slender_pixels(view, cloud.points[mine], radius_m)[row, column]
    slender = np.flatnonzero(kept)
    if len(slender) < _FEWEST_POINTS:
        return [cloud]
    reach = cKDTree(cloud.points[slender])
    graph = reach.sparse_distance_matrix(reach, _CONNECTED_M, output_type="coo_matrix")
    _, label = connected_components(graph, directed=False)
    parts = [slender[label == part] for part in np.argsort(-np.bincount(label))]
    return [_pick(cloud, part) for part in parts if len(part) >= _FEWEST_POINTS] or [_pick(cloud, slender)]


def _pick(cloud: Cloud, index: Ints) -> Cloud:
    return Cloud(cloud.points[index], cloud.normals[index], cloud.boundary[index], cloud.sensor[index], cloud.views)


def _slender_pixels(view: View, points: Floats, radius_m: float) -> Mask:
    """Which pixels (H, W) the disc cannot reach, its size as seen at the points' distance."""
    distance = float(np.median(depth_of(view, points)))
    radius = max(1, round(radius_m * view.camera.fx / distance))
    filled = cv2.morphologyEx((view.depth > 0.0).astype(np.uint8), cv2.MORPH_CLOSE, np.ones((_HOLE_PX, _HOLE_PX)))
    foreground = filled * ~jump_mask(view.depth, view.camera)
    # The border counts as foreground: a trunk that runs out of the image is no less thick there.
    padded = cv2.copyMakeBorder(foreground, radius, radius, radius, radius, cv2.BORDER_REPLICATE)
    thick = cv2.distanceTransform(padded, cv2.DIST_L2, 5) > radius
    reached = cv2.distanceTransform((~thick).astype(np.uint8), cv2.DIST_L2, 5) <= radius + 1.0
    return np.asarray((foreground > 0) & ~reached[radius:-radius, radius:-radius])
