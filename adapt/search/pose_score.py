"""How well a pose explains a cloud: what candidates are compared by, and what tells which bones show."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from adapt.anatomy import Floats
from adapt.fit.pose import PoseFit, match_pose
from adapt.match.bending_skin import bend_trust
from adapt.match.correspondences import Target
from adapt.match.skin_sample import SkinSample
from adapt.match.visibility import depth_at, depth_of, looked_past, on_outline, plainly_seen_or_hidden
from adapt.model.body import Body, pose_skin
from adapt.model.surface import vertex_areas
from capture.cloud.fuse import Cloud

FAR_M = 0.05  # a distance counts up to this much: beyond it, a point is simply not explained
_NEAR_M = 0.025  # skin this near to the cloud is found
MERGED_M = 0.03  # what a limb whose whole outline lies on other surface costs
FREE_SPACE_M = 0.06  # what a limb that lies in empty space altogether costs
BESIDE_M = 0.035  # how far beside the outline to look for other surface
SAME_SURFACE_M = 0.035  # surface this near in depth goes on beyond the outline


@dataclass(frozen=True)
class FoundPart:
    """Of some skin the share in sight; of that the mean distance to the cloud (m) and the share found there.

    Skin is in sight where a sensor that it faces looks at it. It is not where the limb leaves the image, where
    something nearer hides it, or where the sensor does show it but those points were left out of the cloud (by the
    region of interest): there it neither speaks for the pose nor against it.
    """

    in_sight: float
    skin_m: float
    coverage: float


@dataclass(frozen=True)
class FoundSkin:
    """All the skin that counts, and that of each bone that has any: skin counts there by its share that rides on it."""

    whole: FoundPart
    bones: dict[str, FoundPart]


@dataclass(frozen=True)
class ScoredPose:
    """A pose with how badly it explains the cloud (m): skin without points, points without skin, and what else jars.

    ``merged_outline`` is the share of the outline beyond which the same surface goes on: an arm laid out on a chest has
    points near all its skin, but no outline of its own. ``free_space`` is the share of the skin's area, parts that do
    not count in fitting included, where the sensors saw past it: an arm turned end for end may have its forearm in the
    person's, but its shoulder in empty space.
    """

    fit: PoseFit = field(repr=False)
    skin_m: float
    cloud_m: float
    coverage: float  # share of the skin that should be seen and is
    merged_outline: float
    free_space: float

    @property
    def cost_m(self) -> float:
        """What candidates are compared by."""
        return self.skin_m + self.cloud_m + MERGED_M * self.merged_outline + FREE_SPACE_M * self.free_space


def score_pose(body: Body, target: Target, fit: PoseFit, sample: SkinSample) -> ScoredPose:
    """Score a fitted pose in both directions, distances truncated at FAR_M."""
    skin = pose_skin(body, fit.theta)
    points, normals = skin[sample.vertices], sample.normals(skin)[sample.vertices]
    weight = sample.observations[sample.vertices]
    sight = _sight(target, points, normals)
    skin_m, coverage = _found(sight.distance, weight * sight.weight)
    tree = cKDTree(skin[:: max(1, len(skin) // 2000)])
    unexplained, _ = tree.query(target.cloud.points[:: max(1, len(target.cloud.points) // 500)])
    cloud_m = float(np.minimum(unexplained, FAR_M).mean())
    merged = float(merged_share(target.cloud, points[None], normals[None], weight)[0])
    free_space = float(free_space_share(target.cloud, skin[None], vertex_areas(skin, body.anatomy.skin_faces))[0])
    return ScoredPose(fit, skin_m, cloud_m, coverage, merged, free_space)


def find_skin(body: Body, target: Target, theta: Floats, sample: SkinSample) -> FoundSkin:
    """What of a posed skin is in sight and found there, as a whole and bone by bone; near bends it counts less."""
    skin = pose_skin(body, theta)
    sight = _sight(target, skin[sample.vertices], sample.normals(skin)[sample.vertices])
    counted = sample.observations[sample.vertices] * bend_trust(body, theta, sample.vertices)
    shares = np.column_stack([counted, counted[:, None] * body.skin_riding[sample.vertices]])
    whole, *bones = _parts(sight, shares)
    names, has_skin = [bone.name for bone in body.anatomy.bones], np.flatnonzero(shares[:, 1:].any(axis=0))
    return FoundSkin(whole, {names[k]: bones[k] for k in has_skin})


def skin_apart(body: Body, target: Target, theta: Floats, sample: SkinSample, *, gate_m: float) -> Floats:
    """How far (V,) m each vertex of the posed skin is from the cloud; NaN where it is not in sight or not sampled.

    Matched vertices count along their normals, with their sign; those in sight without any point within the gate by
    how far the nearest one is, at most FAR_M. What lies on a scan's boundary tells nothing.

    Raises:
        FitError: fewer than 30 skin vertices find a target.
    """
    skin = pose_skin(body, theta)
    matches = match_pose(body, target, theta, sample, gate_m=gate_m)
    sight = _sight(target, skin[sample.vertices], sample.normals(skin)[sample.vertices])
    apart = np.full(len(skin), np.nan)
    missed = sight.in_sight & (sight.distance > gate_m)
    apart[sample.vertices[missed]] = sight.distance[missed]
    apart[matches.vertex] = matches.distance
    return apart


def skin_found(
    body: Body, target: Target, theta: Floats, sample: SkinSample
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Which vertices (V,) of a posed skin are in sight, and which of those are found; only the sample's are asked."""
    skin = pose_skin(body, theta)
    sight = _sight(target, skin[sample.vertices], sample.normals(skin)[sample.vertices])
    in_sight, found = np.zeros(len(skin), dtype=bool), np.zeros(len(skin), dtype=bool)
    in_sight[sample.vertices] = sight.in_sight
    found[sample.vertices] = sight.in_sight & (sight.distance < _NEAR_M)
    return in_sight, found


def _parts(sight: _Sight, shares: Floats) -> list[FoundPart]:
    """What is found of parts of the skin, each by what its vertices count (N, K)."""
    shown = shares * sight.in_sight[:, None]
    all_of_it, in_sight = shares.sum(axis=0), shown.sum(axis=0)
    far, near = sight.distance @ shown, (sight.distance < _NEAR_M) @ shown
    none = in_sight == 0.0
    skin_m = np.where(none, FAR_M, far / np.maximum(in_sight, 1e-300))
    coverage = np.where(none, 0.0, near / np.maximum(in_sight, 1e-300))
    in_sight = in_sight / np.maximum(all_of_it, 1e-300)
    return [FoundPart(*(float(part) for part in parts)) for parts in zip(in_sight, skin_m, coverage, strict=True)]


def _found(distance: Floats, weights: Floats) -> tuple[float, float]:
    """Weighted mean of distances (N,) m and the share of them that is small."""
    if not weights.any():
        return FAR_M, 0.0
    return float(np.average(distance, weights=weights)), float(np.average(distance < _NEAR_M, weights=weights))


def merged_share(cloud: Cloud, points: Floats, normals: Floats, weights: Floats) -> Floats:
    """For R placements of N vertices (R, N, 3) the share (R,) of the outline that is no outline in the depth images.

    A little beside it, away from the limb, there should be nothing or something at another depth.
    """
    merged, outline = np.zeros(len(points)), np.zeros(len(points))
    for view in cloud.views:
        placement, vertex = np.nonzero(on_outline(view, normals))
        beside = points[placement, vertex] + BESIDE_M * normals[placement, vertex]
        depth = depth_of(view, points[placement, vertex])
        measured, _, _ = depth_at(view, beside)
        same = (measured > 0.0) & (np.abs(measured - depth) < SAME_SURFACE_M)
        outline += np.bincount(placement, weights[vertex], minlength=len(points))
        merged += np.bincount(placement, weights[vertex] * same, minlength=len(points))
    return np.asarray(merged / np.maximum(outline, 1e-9))


def free_space_share(cloud: Cloud, points: Floats, weights: Floats) -> Floats:
    """For R placements of N vertices (R, N, 3) the weighted share (R,) at which a sensor saw nothing, or past it.

    >>> from capture.camera import Camera
    >>> from capture.cloud.fuse import View
    >>> view = View("a", Camera(640, 480, 500.0, 500.0, 319.5, 239.5), np.eye(4), np.full((480, 640), 2.0))
    >>> cloud = Cloud(np.eye(3)[2:], -np.eye(3)[2:], np.zeros(1, bool), np.zeros(1, int), (view,))
    >>> free_space_share(cloud, np.array([[[0.0, 0.0, 1.0], [0.0, 0.0, 2.0]]]), np.array([1.0, 3.0])).tolist()
    [0.25]
    """
    free_space = np.zeros(points.shape[:2], dtype=bool)
    for view in cloud.views:
        free_space |= looked_past(view, points.reshape(-1, 3)).reshape(free_space.shape)
    return np.asarray(free_space @ weights / weights.sum())


@dataclass(frozen=True)
class _Sight:
    """Of N vertices: distance (N,) m to the cloud, truncated; what it weighs in a score (N,); which are in sight (N,).

    The distance is that to the nearest point of a sensor that the vertex faces. A vertex that faces a sensor but is
    hidden by something nearer may rightly be hidden: in a score it counts, at half weight, as unexplained, so that
    hiding the whole limb behind the trunk does not pay. One beyond the images' edges counts for nothing: legs are cut
    off at the knee by many a sensor, and points left without skin tell of a limb laid beyond the edge.
    """

    distance: Floats
    weight: Floats
    in_sight: NDArray[np.bool_]


def _sight(target: Target, points: Floats, normals: Floats) -> _Sight:
    """How the target's sensors see vertices (N, 3) with unit normals."""
    distance, weight = np.full(len(points), FAR_M), np.zeros(len(points))
    in_sight = np.zeros(len(points), dtype=bool)
    for view, _, tree in target.parts:
        seen, hidden = plainly_seen_or_hidden(view, points, normals)
        nearest, _ = tree.query(points[seen], distance_upper_bound=FAR_M)
        distance[seen] = np.minimum(distance[seen], nearest)
        weight[seen] = 1.0
        weight[hidden] = np.maximum(weight[hidden], 0.5)
        measured, depth, _ = depth_at(view, points[seen])
        left_out = (np.abs(measured - depth) < _NEAR_M) & (nearest >= _NEAR_M)
        in_sight[seen] |= ~left_out
    return _Sight(distance, weight, in_sight)
