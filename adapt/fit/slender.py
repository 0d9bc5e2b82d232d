"""The slender parts of a cloud: limbs without the trunk they hang on, for the first search only.

In each depth image a disc as wide as a trunk is rolled over the foreground; what it cannot reach (a morphological
opening's residue) is slender. Depth jumps cut the foreground first, so that an arm in front of a chest stays apart.
"""

from __future__ import annotations

import cv2
import numpy as np
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from adapt.anatomy import Floats, Ints
from adapt.fit.correspondences import pixel_of
from capture.fuse import Cloud, View
from capture.preprocess import Mask, jump_mask

_TRUNK_RADIUS_M = 0.085  # wider than any arm, narrower than a head or trunk
_FEWEST_POINTS = 200
_CONNECTED_M = 0.025
_HOLE_PX = 7  # holes up to this size do not make a trunk slender


def slender_parts(cloud: Cloud) -> list[Cloud]:
    """The connected slender parts of a cloud, largest first; the cloud itself if hardly anything is slender."""
    kept = np.zeros(len(cloud.points), dtype=bool)
    for number, view in enumerate(cloud.views):
        mine = np.flatnonzero(cloud.sensor == number)
        if len(mine):
            row, column, inside = pixel_of(view, cloud.points[mine])
            kept[mine] = inside & _slender_pixels(view, cloud.points[mine])[row, column]
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


def _slender_pixels(view: View, points: Floats) -> Mask:
    """Which pixels (H, W) the disc cannot reach, its size that of a trunk at the points' distance."""
    distance = float(np.median((points - view.world_from_sensor[:3, 3]) @ view.world_from_sensor[:3, 2]))
    radius = max(1, round(_TRUNK_RADIUS_M * view.camera.fx / distance))
    filled = cv2.morphologyEx((view.depth > 0.0).astype(np.uint8), cv2.MORPH_CLOSE, np.ones((_HOLE_PX, _HOLE_PX)))
    foreground = filled * ~jump_mask(view.depth, view.camera)
    # The border counts as foreground: a trunk that runs out of the image is no less thick there.
    padded = cv2.copyMakeBorder(foreground, radius, radius, radius, radius, cv2.BORDER_REPLICATE)
    thick = cv2.distanceTransform(padded, cv2.DIST_L2, 5) > radius
    reached = cv2.distanceTransform((~thick).astype(np.uint8), cv2.DIST_L2, 5) <= radius + 1.0
    return np.asarray((foreground > 0) & ~reached[radius:-radius, radius:-radius])
