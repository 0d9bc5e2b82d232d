"""How well a pose explains a cloud: what candidates are compared by, and what tells that a frame is lost."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import cv2
import numpy as np
from scipy.spatial import cKDTree

from adapt.anatomy import Floats
from adapt.fit.correspondences import Target, depth_at, visible_from
from adapt.fit.pose import PoseFit
from adapt.fit.sample import SkinSample
from adapt.model.body import Body, pose_skin
from adapt.model.surface import vertex_areas
from capture.fuse import Cloud

FAR_M = 0.05  # a distance counts up to this much: beyond it, a point is simply not explained
ATTACHED_M = 0.03  # what a limb whose whole outline lies on other surface costs
VOID_M = 0.06  # what a limb that lies in empty space altogether costs
_BESIDE_M = 0.035  # how far beside the outline to look for other surface
_SAME_SURFACE_M = 0.035  # surface this near in depth goes on beyond the outline
_SEEN_PAST_M = 0.06  # a sensor that measures this much behind a vertex has looked past it
_AROUND_PX, _NOTHING_M = 7, 1e6
_OUTLINE = 0.35  # cosine between normal and line of sight below which skin belongs to the outline


@dataclass(frozen=True)
class FoundSkin:
    """Of the skin that should show: its mean distance to the cloud (m), and the share of it that is found there."""

    skin_m: float
    coverage: float


@dataclass(frozen=True)
class ScoredPose:
    """A pose with how badly it explains the cloud (m): skin without points, points without skin, and what else jars.

    ``attached`` is the share of the outline beyond which the same surface goes on: an arm laid out on a chest has
    points near all its skin, but no outline of its own. ``void`` is the share of the skin's area, parts that do not
    count in fitting included, where the sensors saw past it: an arm turned end for end may have its forearm in the
    person's, but its shoulder in empty space.
    """

    fit: PoseFit = field(repr=False)
    skin_m: float
    cloud_m: float
    coverage: float  # share of the skin that should be seen and is
    attached: float
    void: float

    @property
    def badness_m(self) -> float:
        """What candidates are compared by."""
        return self.skin_m + self.cloud_m + ATTACHED_M * self.attached + VOID_M * self.void


def score_pose(body: Body, target: Target, fit: PoseFit, sample: SkinSample) -> ScoredPose:
    """Score a fitted pose in both directions, distances truncated at FAR_M."""
    skin = pose_skin(body, fit.theta)
    points, normals = skin[sample.vertices], sample.normals(skin)[sample.vertices]
    weight = sample.observations[sample.vertices]
    found = _found(target, points, normals, weight)
    tree = cKDTree(skin[:: max(1, len(skin) // 2000)])
    unexplained, _ = tree.query(target.cloud.points[:: max(1, len(target.cloud.points) // 500)])
    cloud_m = float(np.minimum(unexplained, FAR_M).mean())
    attached = float(attached_share(target.cloud, points[None], normals[None], weight)[0])
    void = float(void_share(target.cloud, skin[None], vertex_areas(skin, body.anatomy.skin_faces))[0])
    return ScoredPose(fit, found.skin_m, cloud_m, found.coverage, attached, void)


def find_skin(body: Body, target: Target, theta: Floats, sample: SkinSample) -> FoundSkin:
    """The part of ``score_pose`` that tells whether a limb that is being followed is lost."""
    skin = pose_skin(body, theta)
    points, normals = skin[sample.vertices], sample.normals(skin)[sample.vertices]
    return _found(target, points, normals, sample.observations[sample.vertices])


def _found(target: Target, points: Floats, normals: Floats, weights: Floats) -> FoundSkin:
    distance, should_show = _distance_if_visible(target, points, normals)
    shown = weights * should_show
    if not shown.any():
        return FoundSkin(FAR_M, 0.0)
    near = distance < 0.5 * FAR_M
    return FoundSkin(float(np.average(distance, weights=shown)), float(np.average(near, weights=shown)))


def attached_share(cloud: Cloud, points: Floats, normals: Floats, weights: Floats) -> Floats:
    """For R placements of N vertices (R, N, 3) the share (R,) of the outline that is no outline in the depth images.

    A vertex whose normal is square to the line of sight belongs to the outline; a little beside it, away from the
    limb, there should be nothing or something at another depth.
    """
    attached, outline = np.zeros(len(points)), np.zeros(len(points))
    for view in cloud.views:
        eye = view.world_from_sensor[:3, 3]
        forward = view.world_from_sensor[:3, 2]
        on_outline = np.abs(normals @ (-forward)) < _OUTLINE
        placement, vertex = np.nonzero(on_outline)
        beside = points[placement, vertex] + _BESIDE_M * normals[placement, vertex]
        depth = (points[placement, vertex] - eye) @ forward
        measured, _, _ = depth_at(view, beside)
        same = (measured > 0.0) & (np.abs(measured - depth) < _SAME_SURFACE_M)
        outline += np.bincount(placement, weights[vertex], minlength=len(points))
        attached += np.bincount(placement, weights[vertex] * same, minlength=len(points))
    return np.asarray(attached / np.maximum(outline, 1e-9))


def void_share(cloud: Cloud, points: Floats, weights: Floats) -> Floats:
    """For R placements of N vertices (R, N, 3) the weighted share (R,) at which a sensor saw nothing, or past it.

    Sensors drop pixels on any surface, so a vertex is in the void only where no pixel around it shows a surface.
    """
    void = np.zeros(points.shape[:2], dtype=bool)
    for view in cloud.views:
        filled = np.where(view.depth > 0.0, view.depth, _NOTHING_M).astype(np.float32)
        nearest = cv2.erode(filled, np.ones((_AROUND_PX, _AROUND_PX)), borderType=cv2.BORDER_REPLICATE)
        measured, depth, inside = depth_at(replace(view, depth=nearest), points.reshape(-1, 3))
        void |= (inside & (measured > depth + _SEEN_PAST_M)).reshape(void.shape)
    return np.asarray(void @ weights / weights.sum())


def _distance_if_visible(target: Target, points: Floats, normals: Floats) -> tuple[Floats, Floats]:
    """Truncated distance (N,) to the nearest point of a sensor that a vertex faces, and the weight (N,) of it.

    A vertex that faces a sensor but is hidden by something nearer may rightly be hidden: it counts, at half
    weight, as unexplained, so that hiding the whole limb behind the trunk does not pay.
    """
    distance, weight = np.full(len(points), FAR_M), np.zeros(len(points))
    for view, _, tree in target.parts:
        sight = view.world_from_sensor[:3, 3] - points
        faces = np.einsum("ij,ij->i", normals, sight) > 0.3 * np.linalg.norm(sight, axis=1)
        seen = visible_from(view, points, normals) & faces
        nearest, _ = tree.query(points[seen])
        distance[seen] = np.minimum(distance[seen], nearest)
        weight[seen] = 1.0
        weight[faces & ~seen] = np.maximum(weight[faces & ~seen], 0.5)
    return distance, weight
