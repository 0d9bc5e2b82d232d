"""Where one sensor stands relative to a box of known size, up to the box's own symmetries.

Three mutually perpendicular faces that meet in a corner fix the pose: each plane takes one rotation's share and one
translation. The size only says which face is which, so measuring it checks the result instead of bending it.

The box frame: origin at the centre, axes along the edges in the order of ``size_m``.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations, permutations, product

import numpy as np

from capture.camera import Camera, backproject
from capture.cloud.planes import Plane, find_planes
from capture.errors import CalibrationError
from capture.rigid import Floats, apply, exp_so3, inverse, transform

_SEARCH_ANGLE_DEG = 12.0  # planes this far from perpendicular are still looked at, so that the report can name it
_LARGEST_ANGLE_DEG = 2.0  # with sound intrinsics a Carmine at 1.2 m measures them to 0.3
_LARGEST_SIZE_ERROR_M = 0.012
_SCALE_ERRORS_PERCENT = (-3.3, 1.0)  # of true boxes, whose edges are lost, Carmines measure 0.4 to 2.4 per cent less
_ALIKE_M = 0.005  # sides that are wrong by one factor differ from it by less
_FAR_M = 1.6  # from here on noise tilts small faces
_AT_BORDER_PX = 3
_DISTINCT_SIDES_M = 0.015  # sides must differ by this much to be told apart, or be equal
_EQUAL_SIDES_M = 0.001
_TOUCHING_M = 0.035  # how near the points of a face come to the planes it meets
_STANDING_OUT_M = 0.015  # how far a few points of a face may stand out beyond the planes it meets
_EDGE_M = 0.012  # points this near an edge do not count: windows and silhouettes blur them
_FEWEST_POINTS = 200  # on each face
_ROUNDS = 20
_REACH_QUANTILE = 0.995  # of the points of a face; they are spread evenly, so it is this share of the side
_TUKEY = 4.685  # in standard deviations: 95 % efficiency for Gaussian errors
_SMALLEST_SIGMA_M = 3e-4

_REMEDY = "stand the box free, whole in the image, 0.6 to 1.5 m away, with a corner of three faces towards the sensor"


@dataclass(frozen=True, eq=False)
class BoxFit:
    """A box found in a sensor's images."""

    box_from_sensor: Floats  # (4, 4), up to the symmetries of the box
    residual_m: float  # root mean square distance of points to the faces
    points: int  # how many
    faces: int
    face_angles_deg: tuple[float, float, float]  # between the faces, each fitted alone: 90 if all is well
    measured_size_m: tuple[float, float, float]  # in the order of the stated size, from planes to far edges


@dataclass(frozen=True, eq=False)
class _Corner:
    """Three faces, in the order of the stated size's axes, and the sides measured along their normals (m)."""

    planes: tuple[Plane, Plane, Plane]
    size_m: Floats  # (3,)
    error_m: float


def symmetries(size_m: tuple[float, float, float]) -> list[Floats]:
    """The proper rotations (3, 3) that lay a box of that size upon itself, the identity first.

    Four for three different sides, eight for two equal ones, 24 for a cube.

    >>> [len(symmetries(size)) for size in [(0.3, 0.2, 0.1), (0.3, 0.2, 0.2), (0.2, 0.2, 0.2)]]
    [4, 8, 24]
    """
    found = []
    for order in permutations(range(3)):
        if max(abs(size_m[i] - size_m[j]) for i, j in enumerate(order)) > _EQUAL_SIDES_M:
            continue
        for signs in product((1.0, -1.0), repeat=3):
            rotation = np.eye(3)[list(order)] * np.array(signs)[:, None]
            if np.linalg.det(rotation) > 0.0:
                found.append(rotation)
    return found


def check_size(size_m: tuple[float, float, float]) -> None:
    """Refuse a box whose faces cannot be told apart by their size.

    Raises:
        CalibrationError: two sides differ, but by less than a sensor can see.
    """
    for a, b in combinations(size_m, 2):
        if _EQUAL_SIDES_M < abs(a - b) < _DISTINCT_SIDES_M:
            raise CalibrationError(
                f"sides of {1000 * a:.0f} and {1000 * b:.0f} mm are too alike to be told apart",
                remedy=f"use a box whose sides differ by {1000 * _DISTINCT_SIDES_M:.0f} mm or more",
            )


def find_box(depth_m: Floats, camera: Camera, size_m: tuple[float, float, float]) -> BoxFit:
    """Find a box of known size in a depth image (H, W) (m, 0 for none) and fit its pose.

    Minimises over the pose the sum of rho(s_a q_a - size_a / 2) for all points q (box frame) on the seen faces
    a in {1, 2, 3} of side s_a in {-1, 1}, with Tukey's rho.

    Raises:
        CalibrationError: no box, fewer than three faces, the wrong size, cut off by the image's border, faces that
            are not perpendicular, or too few points on them.
    """
    check_size(size_m)
    points = backproject(camera, depth_m)
    corner = _best_corner(find_planes(points), size_m)
    _refuse_another_size(corner, size_m, camera)
    angles = _face_angles(corner.planes)
    _refuse_other_angles(angles, corner.planes)
    _refuse_another_scale(corner, size_m)
    pose, sides = _initial_pose(corner.planes, size_m)
    cloud = points[np.isfinite(points[..., 2])]
    pose, residuals = _refined(pose, sides, cloud, np.asarray(size_m) / 2.0, 1e-8)
    measured = tuple(float(side) for side in corner.size_m)
    return BoxFit(
        box_from_sensor=pose,
        residual_m=float(np.sqrt(np.mean(residuals**2))),
        points=len(residuals),
        faces=len(corner.planes),
        face_angles_deg=angles,
        measured_size_m=(measured[0], measured[1], measured[2]),
    )


def displacement(fit: BoxFit, depth_m: Floats, camera: Camera, size_m: tuple[float, float, float]) -> float:
    """How far (m) a corner of the box in another image (H, W) (m, 0 for none) is at most from where the fit has it.

    Infinite if too little of the box is where the fit has it.
    """
    points = backproject(camera, depth_m)
    seen_from, half = fit.box_from_sensor[:3, 3], np.asarray(size_m) / 2.0
    try:
        pose, _ = _refined(fit.box_from_sensor, np.sign(seen_from), points[np.isfinite(points[..., 2])], half, 1e-5)
    except CalibrationError:
        return np.inf
    corners = half * np.array(list(product((1.0, -1.0), repeat=3)))
    return float(np.linalg.norm(apply(pose @ inverse(fit.box_from_sensor), corners) - corners, axis=1).max())


def _face_angles(planes: tuple[Plane, Plane, Plane]) -> tuple[float, float, float]:
    cosines = [planes[i].normal @ planes[j].normal for i, j in ((1, 2), (2, 0), (0, 1))]
    a, b, c = (float(np.rad2deg(np.arccos(np.clip(cosine, -1.0, 1.0)))) for cosine in cosines)
    return a, b, c


def _best_corner(planes: list[Plane], size_m: tuple[float, float, float]) -> _Corner:
    """The three faces that meet as a box's do and whose measured sides come nearest to the stated ones."""
    pairs = {(i, j) for i, j in combinations(range(len(planes)), 2) if _meet_outwards(planes[i], planes[j])}
    corners = [
        _named((planes[i], planes[j], planes[k]), size_m)
        for i, j, k in combinations(range(len(planes)), 3)
        if {(i, j), (i, k), (j, k)} <= pairs
    ]
    if not corners:
        two = any(_are_two_faces(planes[i], planes[j], size_m) for i, j in pairs)
        raise CalibrationError("only two faces of the box are seen" if two else "no box in view", remedy=_REMEDY)
    return min(corners, key=lambda corner: corner.error_m)


def _refuse_another_size(corner: _Corner, size_m: tuple[float, float, float], camera: Camera) -> None:
    """Raise CalibrationError for sides of which one is not as stated; all by one factor are another matter."""
    if (
        corner.error_m < _LARGEST_SIZE_ERROR_M
        or np.abs(corner.size_m - _scale(corner, size_m) * np.asarray(size_m)).max() < _ALIKE_M
    ):
        return
    if any(_at_border(plane, camera) for plane in corner.planes):
        raise CalibrationError(
            f"the box reaches over the border of the image: {_against(corner, size_m)}", remedy=_REMEDY
        )
    raise CalibrationError(
        f"box of the wrong size: {_against(corner, size_m)}",
        remedy="correct the size in the recording, or show three whole faces of the box",
    )


def _refuse_another_scale(corner: _Corner, size_m: tuple[float, float, float]) -> None:
    """Raise CalibrationError for sides that are all too large, or too small, by one factor."""
    percent = 100.0 * (_scale(corner, size_m) - 1.0)
    if not _SCALE_ERRORS_PERCENT[0] <= percent <= _SCALE_ERRORS_PERCENT[1]:
        larger = "large" if percent > 0.0 else "small"
        raise CalibrationError(
            f"all sides of the box are {abs(percent):.1f} % too {larger}: {_against(corner, size_m)}",
            remedy="check the depth unit and the focal length in the recording, then the stated size",
        )


def _scale(corner: _Corner, size_m: tuple[float, float, float]) -> float:
    """The factor that brings the stated sides nearest to the measured ones."""
    return float(corner.size_m @ size_m / np.dot(size_m, size_m))


def _against(corner: _Corner, size_m: tuple[float, float, float]) -> str:
    measured, stated = (" x ".join(f"{1000 * side:.0f}" for side in size) for size in (corner.size_m, size_m))
    return f"measured {measured} mm, the recording says {stated} mm"


def _at_border(plane: Plane, camera: Camera) -> bool:
    from capture.projection import project  # compiled loops, which a box's size alone does not need

    pixels, _ = project(camera, plane.points)
    nearest = np.minimum(pixels, np.array([camera.width - 1, camera.height - 1]) - pixels)
    return not (nearest >= _AT_BORDER_PX).all()  # what the lens model does not reach is at the border, too


def _refuse_other_angles(angles: tuple[float, float, float], planes: tuple[Plane, Plane, Plane]) -> None:
    """Raise CalibrationError for faces that are not perpendicular."""
    if max(abs(angle - 90.0) for angle in angles) <= _LARGEST_ANGLE_DEG:
        return
    listed = ", ".join(f"{angle:.1f}" for angle in angles)
    away = min(float(np.median(plane.points[:, 2])) for plane in planes)
    raise CalibrationError(
        f"the faces of the box, {away:.1f} m away, meet at {listed} degrees instead of 90",
        remedy=_REMEDY if away > _FAR_M else "use a rigid box, and check the camera's focal length and distortion",
    )


def _meet_outwards(a: Plane, b: Plane) -> bool:
    """Whether two regions are perpendicular and share an edge that points at the sensor."""
    if abs(float(a.normal @ b.normal)) > np.sin(np.deg2rad(_SEARCH_ANGLE_DEG)):
        return False
    return all(
        np.quantile(height, 0.95) < _STANDING_OUT_M and height.max() > -_TOUCHING_M
        for height in (a.points @ b.normal - b.offset, b.points @ a.normal - a.offset)
    )


def _named(planes: tuple[Plane, Plane, Plane], size_m: tuple[float, float, float]) -> _Corner:
    """Order three faces so that the sides measured along their normals fit the stated sides best.

    The other two faces both tell how far the box goes behind a plane; the shorter counts, because what stands behind
    the box by chance on the plane of a face can lengthen it.
    """
    reach = np.array([min(_reach(plane, other) for other in planes if other is not plane) for plane in planes])
    errors = {order: float(np.abs(reach[list(order)] - size_m).max()) for order in permutations(range(3))}
    order = min(errors, key=lambda key: errors[key])
    return _Corner((planes[order[0]], planes[order[1]], planes[order[2]]), reach[list(order)], errors[order])


def _reach(plane: Plane, other: Plane) -> float:
    """How far (m) a face goes behind the plane of another."""
    return float(np.quantile(plane.offset - other.points @ plane.normal, _REACH_QUANTILE)) / _REACH_QUANTILE


def _are_two_faces(a: Plane, b: Plane, size_m: tuple[float, float, float]) -> bool:
    """Whether two regions that meet have the sides of the box."""
    reach = np.array([_reach(a, b), _reach(b, a)])
    return any(np.abs(reach - sides).max() < _LARGEST_SIZE_ERROR_M for sides in permutations(size_m, 2))


def _initial_pose(planes: tuple[Plane, Plane, Plane], size_m: tuple[float, float, float]) -> tuple[Floats, Floats]:
    """Box from sensor (4, 4), and on which side (3,) of the box each seen face is.

    The sensor is put on the positive side of the first two axes; the third side makes the frame right-handed.
    """
    normals = np.stack([plane.normal for plane in planes])
    sides = np.array([1.0, 1.0, np.sign(np.linalg.det(normals))])
    left, _, right = np.linalg.svd(normals * sides[:, None])
    rotation = left @ right
    # Rows are no longer the normals exactly: each face is laid in its place where its points are, not at the sensor.
    centres = np.stack([plane.points.mean(axis=0) for plane in planes])
    return transform(rotation, sides * np.asarray(size_m) / 2.0 - (rotation * centres).sum(axis=1)), sides


def _refined(pose: Floats, sides: Floats, cloud: Floats, half: Floats, small_step: float) -> tuple[Floats, Floats]:
    """Gauss-Newton with Tukey's weights on the pose (4, 4); also the distances (N,) m of the points it rests on."""
    near = apply(pose, cloud)
    cloud = cloud[(np.abs(near) < half + 3.0 * _EDGE_M).all(axis=1)]
    for _ in range(_ROUNDS):
        q, face = _on_faces(apply(pose, cloud), sides, half)
        rows = np.arange(len(q))
        residual = sides[face] * q[rows, face] - half[face]
        sigma = max(1.4826 * float(np.median(np.abs(residual))), _SMALLEST_SIGMA_M)
        weight = np.maximum(1.0 - (residual / (_TUKEY * sigma)) ** 2, 0.0) ** 2
        # q -> q + omega x q + tau: the residual along axis a gains s_a (omega . (q x e_a) + tau_a).
        axis = np.eye(3)[face]
        jacobian = sides[face][:, None] * np.hstack([np.cross(q, axis), axis])
        normal, gradient = jacobian.T @ (weight[:, None] * jacobian), jacobian.T @ (weight * residual)
        step = np.asarray(np.linalg.solve(normal, -gradient), dtype=np.float64)
        pose = transform(exp_so3(step[:3]), step[3:]) @ pose
        if np.abs(step).max() < small_step:
            break
    return pose, residual[weight > 0.0]


def _on_faces(q: Floats, sides: Floats, half: Floats) -> tuple[Floats, np.ndarray[tuple[int], np.dtype[np.intp]]]:
    """The points (N, 3) of the box frame that lie on a seen face and not near its edges, and which face (N,)."""
    height = sides * q - half
    inside = (height < -_EDGE_M) & (sides * q + half > _EDGE_M)
    on = np.stack(
        [(np.abs(height[:, a]) < _EDGE_M) & np.delete(inside, a, axis=1).all(axis=1) for a in range(3)], axis=1
    )
    counts = on.sum(axis=0)
    if counts.min() < _FEWEST_POINTS:
        raise CalibrationError(f"too few points on the faces of the box ({counts.min()} on one)", remedy=_REMEDY)
    chosen = on.any(axis=1)
    return q[chosen], on[chosen].argmax(axis=1)
