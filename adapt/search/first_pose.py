"""A first pose from nothing: many starts, scored coarsely, the best refined and scored again.

The paper sets the first pose by hand (about a minute); here a person does so only to override this search.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from adapt.anatomy import Anatomy, Floats, Ints
from adapt.fit.pose import fit_pose
from adapt.fit.problem import SEARCH_PLANE_WEIGHT
from adapt.fit.unobserved import towards_rest
from adapt.match.correspondences import Target
from adapt.match.skin_sample import SkinSample, sample_skin
from adapt.match.visibility import face_the_sensors
from adapt.model.body import Body, pose_skin, rest_theta
from adapt.model.pose_space import joint_coordinates, root_coordinates
from adapt.model.shape.prior import overall_size
from adapt.search.coarse_cost import Placements, Scene, costs
from adapt.search.limb_segments import slender_parts, thicker_than
from adapt.search.pose_score import FoundPart, ScoredPose, find_skin, score_pose
from adapt.search.typical_poses import typical_forms
from capture.cloud.fuse import Cloud
from capture.errors import FitError
from capture.rigid import exp_so3

_COARSE_VERTICES = 100
_ROTATIONS = 600  # about 25 degrees apart
_REFINED = 10
_PARTS, _SPLINTER = 4, 0.15  # of the slender parts the largest; what is much smaller than that fits anywhere
_EXTREMITIES = 2  # of one slender part
_COARSE_GATE_M = 0.10
_IN_SIGHT, _FOUND = 0.1, 0.75  # of a bone's skin, and of that: of bones with less, the cloud tells nothing
GOOD_M = 0.006  # a pose from a likely start whose skin is this near to the cloud needs no search
_GOOD_COVERAGE = 0.9  # a pose from a likely start that finds this share of the skin needs no search
_GOOD_MERGED, _GOOD_FREE = 0.4, 0.15  # the same of a pose with less of its outline merged, of its skin in free space
CLEARLY_M = 0.003  # a pose found by search must be better by this much than one that was there before


def find_pose(body: Body, target: Target, *, seed: int = 0) -> ScoredPose:
    """The best of many poses of ``body`` in one cloud, whatever the body's orientation.

    Raises:
        FitError: no start finds enough correspondences.
    """
    sample = sample_skin(body.anatomy, at_most=600, seed=seed)
    thick = overall_size(body) * thicker_than(body.anatomy)
    parts = slender_parts(target.cloud, thick)[:_PARTS]
    parts = [part for part in parts if len(part.points) > _SPLINTER * len(parts[0].points)]
    candidates = _coarse_candidates(body, parts, np.random.default_rng(seed))
    refined = [score for theta in candidates for score in _refined(body, target, theta, sample)]
    if not refined:
        raise FitError(
            "no pose of the anatomy fits the cloud", remedy="narrow the region of interest or give a first pose"
        )
    return min(refined, key=lambda pose: pose.cost_m)


def locate(
    body: Body, target: Target, sample: SkinSample, starts: Sequence[Floats], *, good_m: float = GOOD_M
) -> ScoredPose:
    """A pose from some likely ``starts``, or by search where none of them leads to a good one.

    Good is a skin that is ``good_m`` from the cloud, nearly all found, and neither laid on other surface nor in free
    space.

    Raises:
        FitError: nothing fits.
    """
    tried: list[ScoredPose] = []
    for theta in starts:
        pose = try_pose(body, target, sample, theta)
        if pose is not None and pose.skin_m < good_m and is_sound(pose):
            return pose
        tried += [] if pose is None else [pose]
    best = min(tried, key=lambda pose: pose.cost_m, default=None)
    try:
        searched = find_pose(body, target)
    except FitError:
        if best is None:
            raise
        return best
    searched = try_pose(body, target, sample, searched.fit.theta) or searched
    if best is not None and best.cost_m < searched.cost_m + CLEARLY_M:
        return best
    return searched


def variations(anatomy: Anatomy, theta: Floats) -> list[Floats]:
    """A pose, and the same with each joint turned by a fifth of its range more or less: starts for a time apart.

    >>> from adapt.anatomy_file import load_anatomy
    >>> arm = load_anatomy("upper-limb-right")
    >>> poses = variations(arm, np.zeros(10))
    >>> len(poses), [round(float(np.rad2deg(pose[arm.coordinate_index("elbow_flexion")]))) for pose in poses]
    (9, [0, 0, 26, 0, 0, 0, 0, 0, 0])
    """
    varied = [theta]
    for i in joint_coordinates(anatomy):
        low, high = anatomy.coordinates[i].low, anatomy.coordinates[i].high
        for step in (-0.2 * (high - low), 0.2 * (high - low)):
            varied.append(np.r_[theta[:i], np.clip(theta[i] + step, low, high), theta[i + 1 :]])
    return varied


def is_sound(pose: ScoredPose) -> bool:
    """Whether nearly all the skin is found, and neither laid on other surface nor in free space.

    >>> from dataclasses import replace
    >>> from adapt.match.correspondences import Correspondences
    >>> from adapt.fit.pose import PoseFit
    >>> fit = PoseFit(np.zeros(10), Correspondences(*np.zeros((5, 0))), np.zeros(0))
    >>> good = ScoredPose(fit, skin_m=0.003, cloud_m=0.004, coverage=0.97, merged_outline=0.1, free_space=0.01)
    >>> is_sound(good), is_sound(replace(good, merged_outline=0.6))
    (True, False)
    """
    return pose.coverage > _GOOD_COVERAGE and pose.merged_outline < _GOOD_MERGED and pose.free_space < _GOOD_FREE


def try_pose(body: Body, target: Target, sample: SkinSample, start: Floats) -> ScoredPose | None:
    """The scored fit from one start, or None where too little of the skin finds a target."""
    try:
        fit = fit_pose(body, target, start, sample, plane_weight=SEARCH_PLANE_WEIGHT)
    except FitError:
        return None
    return score_pose(body, target, fit, sample)


def _refined(body: Body, target: Target, theta: Floats, sample: SkinSample) -> list[ScoredPose]:
    """The fit from one start, and where parts of the limb are out of sight or not found the same with these at rest."""
    fitted = _refine(body, target, theta, sample)
    if fitted is None:
        return []
    parts = find_skin(body, target, fitted.fit.theta, sample).bones
    shown = np.array([b.name in parts and _is_found(parts[b.name]) for b in body.anatomy.bones])
    resting = towards_rest(body, fitted.fit.theta, fitted.fit.theta, shown, 0.0)
    if resting is fitted.fit.theta:
        return [fitted]
    again = _refine(body, target, resting, sample)
    return [fitted] if again is None else [fitted, again]


def _is_found(part: FoundPart) -> bool:
    return part.in_sight > _IN_SIGHT and part.coverage > _FOUND


def _refine(body: Body, target: Target, theta: Floats, sample: SkinSample) -> ScoredPose | None:
    try:
        rough = fit_pose(
            body,
            target,
            theta,
            sample,
            updates=15,
            steps=2,
            gate_m=_COARSE_GATE_M,
            plane_weight=SEARCH_PLANE_WEIGHT,
        )
    except FitError:
        return None
    return score_pose(body, target, rough, sample)


@dataclass(frozen=True)
class _Coarse:
    """One joint configuration, root at the origin: coarse vertices (N, 3), normals, weights, anchor point."""

    theta: Floats
    root: Ints  # where the free joint's six coordinates stand in theta
    points: Floats = field(repr=False)
    normals: Floats = field(repr=False)
    weights: Floats = field(repr=False)
    tip: Floats = field(repr=False)


def _coarse_candidates(body: Body, parts: list[Cloud], rng: np.random.Generator) -> list[Floats]:
    """The most promising distinct starts in any of the parts."""
    rotations = Rotation.random(_ROTATIONS, rng=rng).as_matrix()
    thetas, scores = [], []
    scenes = [(Scene(part), _extremities(part)) for part in parts]
    for configuration in _configurations(body):
        for scene, extremities in scenes:
            for theta, score in _place(configuration, rotations, scene, extremities):
                thetas.append(theta)
                scores.append(score)
    order = np.argsort(np.concatenate(scores), kind="stable")
    return _distinct(np.concatenate(thetas)[order], np.array(root_coordinates(body.anatomy)), _REFINED)


def _configurations(body: Body) -> Iterator[_Coarse]:
    """Joint configurations that stand for all forms of the limb, root frame at the identity."""
    anatomy = body.anatomy
    sample = sample_skin(anatomy, at_most=_COARSE_VERTICES)
    root = np.array(root_coordinates(anatomy))
    tip = np.linalg.norm(body.v_tilde.value - rest_theta(body)[root[3:]], axis=1).argmax()
    chosen = sample.vertices
    for theta in typical_forms(anatomy):
        skin = pose_skin(body, theta)
        normals = sample.normals(skin)[chosen]
        yield _Coarse(theta, root, skin[chosen], normals, sample.observations[chosen], skin[tip])


def _place(coarse: _Coarse, rotations: Floats, scene: Scene, extremities: Floats) -> Iterator[tuple[Floats, Floats]]:
    """Turn one configuration every way, put its middle on the cloud's middle and its tip on each extremity."""
    cloud, back = scene.cloud, rotations.transpose(0, 2, 1)
    points, normals = coarse.points @ back, coarse.normals @ back
    facing = coarse.weights * face_the_sensors(cloud, normals)
    middle = np.einsum("rn,rni->ri", facing, points) / np.maximum(facing.sum(axis=1), 1e-9)[:, None]
    tips = rotations @ coarse.tip
    anchors = [cloud.points.mean(axis=0) - middle]
    anchors += [extremity - tips for extremity in extremities]
    vectors = Rotation.from_matrix(rotations).as_rotvec()
    for shift in anchors:
        theta = np.tile(coarse.theta, (len(rotations), 1))
        theta[:, coarse.root] = np.column_stack([vectors, shift])
        yield theta, costs(scene, Placements(points + shift[:, None], normals, facing, coarse.weights))


def _extremities(cloud: Cloud) -> Floats:
    """Points (E, 3) farthest from the middle along the cloud's surface: hands, head, the cut."""
    rng = np.random.default_rng(0)
    chosen = cloud.points[rng.permutation(len(cloud.points))[:800]]
    small = cKDTree(chosen)
    graph = sparse.csr_matrix(small.sparse_distance_matrix(small, 0.06, output_type="coo_matrix"))
    start = int(small.query(np.median(cloud.points, axis=0))[1])
    distance = dijkstra(graph, indices=start)
    found: list[int] = []
    for _ in range(_EXTREMITIES):
        reachable = np.where(np.isfinite(distance), distance, -1.0)
        found.append(int(reachable.argmax()))
        distance = np.minimum(distance, dijkstra(graph, indices=found[-1]))
    return np.asarray(chosen[found])


def _distinct(thetas: Floats, root: Ints, count: int) -> list[Floats]:
    """The first ``count`` poses that differ clearly from those before them."""
    kept: list[Floats] = []
    for theta in thetas:
        if all(_differ(theta, other, root) for other in kept):
            kept.append(theta)
        if len(kept) == count:
            break
    return kept


def _differ(one: Floats, other: Floats, root: Ints) -> bool:
    """By 30 degrees or 8 cm at the root, or 50 degrees at a joint."""
    turn = exp_so3(one[root[:3]]) @ exp_so3(other[root[:3]]).T
    cosine = (np.trace(turn) - 1.0) / 2.0
    joints = np.delete(one - other, root)
    return bool(
        cosine < np.cos(np.deg2rad(30.0))
        or np.linalg.norm(one[root[3:]] - other[root[3:]]) > 0.08
        or np.abs(joints).max(initial=0.0) > np.deg2rad(50.0)
    )
