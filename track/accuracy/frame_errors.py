"""Errors of one pose of a body against the true body in its true pose."""

from __future__ import annotations

import numpy as np

from adapt.anatomy import Anatomy, Floats
from adapt.model.body import Body, bone_frames, joint_centres, pose_skin, posed_bones
from adapt.model.pose_space import joint_coordinates, root_joint
from capture.rigid import apply, log_so3
from track.accuracy.mesh_distance import distance_to_mesh
from track.observed_bones import Bools, skin_shown

_SURFACE_POINTS = 600  # of each surface, whose distance to the true surface is measured


def frame_errors(
    body: Body, theta: Floats, shown: Bools, true_body: Body, true_theta: Floats, common: Floats
) -> dict[tuple[str, str], float]:
    """Errors by kind and unit; ``common`` (4, 4) carries the tracked body into the truth's world.

    ``shown`` (B,) says which bones the pose claims to know: the skin counts only where they carry it.
    """
    errors: dict[tuple[str, str], float] = {}
    true_centres = joint_centres(true_body, true_theta)
    for name, centre in joint_centres(body, theta).items():
        distance = np.linalg.norm(apply(common, centre[None])[0] - true_centres[name])
        errors[f"centre {name}", "mm"] = 1e3 * float(distance)
    errors |= _angle_errors(body.anatomy, theta, true_theta)
    root = root_joint(body.anatomy).child
    turn = common[:3, :3] @ bone_frames(body, theta)[root][:3, :3] @ bone_frames(true_body, true_theta)[root][:3, :3].T
    errors[f"orientation {root}", "deg"] = float(np.rad2deg(np.linalg.norm(log_so3(turn))))
    true_bones = posed_bones(true_body, true_theta)
    for bone in body.anatomy.bones:
        tracked = apply(common, posed_bones(body, theta)[bone.name])
        some = tracked[:: max(1, len(tracked) // _SURFACE_POINTS)]
        errors[f"surface {bone.name}", "mm"] = 1e3 * float(
            distance_to_mesh(some, true_bones[bone.name], bone.faces).mean()
        )
        apart = np.linalg.norm(tracked - true_bones[bone.name], axis=1)
        errors[f"points {bone.name}", "mm"] = 1e3 * float(apart.mean())
    counted = np.flatnonzero((body.anatomy.fit_weight > 0.5) & skin_shown(body, shown))
    counted = counted[:: max(1, len(counted) // _SURFACE_POINTS)]
    skin = apply(common, pose_skin(body, theta, vertices=counted))
    true_skin = pose_skin(true_body, true_theta)
    errors["skin", "mm"] = np.nan
    if len(counted):
        errors["skin", "mm"] = 1e3 * float(distance_to_mesh(skin, true_skin, body.anatomy.skin_faces).mean())
    return errors


def _angle_errors(anatomy: Anatomy, theta: Floats, true_theta: Floats) -> dict[tuple[str, str], float]:
    return {
        (f"angle {anatomy.coordinates[i].name}", "deg"): float(np.rad2deg(abs(theta[i] - true_theta[i])))
        for i in joint_coordinates(anatomy)
    }
