"""Bones over time as any tool gives them, and how far two tools, or a tool and the truth, are apart."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from adapt.anatomy import Anatomy, Floats, Ints
from adapt.model.body import Body, bone_transforms, joint_centres
from adapt.model.pose_space import joint_coordinates
from capture.rigid import inverse
from track.accuracy.mesh_distance import distance_to_mesh

_POINTS = 300  # of each bone's surface that are compared


@dataclass(frozen=True, eq=False)
class Reconstruction:
    """T frames: coordinates (T,) in degrees, joint centres (T, 3), and bones at rest (N, 3) with motions (T, 4, 4).

    A bone's vertices are those of the anatomy, so the same index is the same anatomical point in all. Metres, in one
    frame for all tools; NaN where a tool has no answer.
    """

    angles: dict[str, Floats] = field(repr=False)
    centres: dict[str, Floats] = field(repr=False)
    rest: dict[str, Floats] = field(repr=False)
    motions: dict[str, Floats] = field(repr=False)

    def points(self, bone: str) -> Floats:
        """Some points (T, K, 3) of a bone's surface, the same for all reconstructions of one anatomy."""
        rest, motion = self.rest[bone], self.motions[bone]
        some = rest[:: max(1, len(rest) // _POINTS)]
        return np.asarray(some @ motion[:, :3, :3].transpose(0, 2, 1) + motion[:, None, :3, 3])


def reconstruction_of_poses(body: Body, thetas: Floats, world: Floats) -> Reconstruction:
    """What poses (T, n) of a body say, carried by ``world`` (4, 4); NaN where a pose is NaN."""
    anatomy = body.anatomy
    motions = {bone.name: np.full((len(thetas), 4, 4), np.nan) for bone in anatomy.bones}
    centres = {joint.name: np.full((len(thetas), 3), np.nan) for joint in anatomy.joints}
    for t in np.flatnonzero(np.isfinite(thetas).all(axis=1)):
        for name, motion in bone_transforms(body, thetas[t]).items():
            motions[name][t] = world @ motion
        for name, centre in joint_centres(body, thetas[t]).items():
            centres[name][t] = world[:3, :3] @ centre + world[:3, 3]
    angles = {name: np.rad2deg(thetas[:, anatomy.coordinate_index(name)]) for name in compared_coordinates(anatomy)}
    return Reconstruction(angles, centres, body.rest_bones, motions)


def compared_coordinates(anatomy: Anatomy) -> list[str]:
    """Coordinates that mean the same in every tool: all but the free joint's."""
    return [anatomy.coordinates[i].name for i in joint_coordinates(anatomy)]


def differences(one: Reconstruction, other: Reconstruction, faces: dict[str, Ints]) -> dict[tuple[str, str], Floats]:
    """Differences (T,) by kind and unit.

    Kinds: angles (deg, absolute), joint centres (mm), and of every bone the mean distance of the same anatomical points
    (mm) and the mean distance of points of ``one`` to the surface of ``other`` (mm).
    """
    apart: dict[tuple[str, str], Floats] = {}
    for name, values in one.angles.items():
        apart[f"angle {name}", "deg"] = np.abs(values - other.angles[name])
    for name, centre in one.centres.items():
        apart[f"centre {name}", "mm"] = 1e3 * np.linalg.norm(centre - other.centres[name], axis=1)
    for bone in one.motions:
        points = one.points(bone)
        apart[f"points {bone}", "mm"] = 1e3 * np.linalg.norm(points - other.points(bone), axis=2).mean(axis=1)
        apart[f"surface {bone}", "mm"] = 1e3 * _to_surface(points, other, bone, faces[bone])
    return apart


def _to_surface(points: Floats, other: Reconstruction, bone: str, faces: Ints) -> Floats:
    """Mean distance (T,) in metres of points (T, K, 3) to a moving surface, found where that surface rests."""
    mean = np.full(len(points), np.nan)
    known = np.isfinite(points).all(axis=(1, 2)) & np.isfinite(other.motions[bone]).all(axis=(1, 2))
    back = np.array([inverse(motion) for motion in other.motions[bone][known]]).reshape(-1, 4, 4)
    at_rest = points[known] @ back[:, :3, :3].transpose(0, 2, 1) + back[:, None, :3, 3]
    distance = distance_to_mesh(at_rest.reshape(-1, 3), other.rest[bone], faces)
    mean[known] = distance.reshape(at_rest.shape[:2]).mean(axis=1)
    return mean
