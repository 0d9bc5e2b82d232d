"""The two skinning methods that the forearm deformer is held against, with the same weights.

Both need weights of bones, not of deformers: a rigid deformer's weight goes to its bone, and the forearm deformer's
weight w is shared as (1 - t) w to the ulna and t w to the radius, with the deformer's own ramp t.

Linear blending:    v = (sum_b w_b T_b) v_rest
Dual quaternions:   v = T(q) v_rest with q = sum_b w_b q_b / |sum_b w_b q_b|, every q_b on the side of q_0
"""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from adapt.anatomy import Floats
from adapt.model.body import Body, bone_transforms, rest_theta
from adapt.model.frames import frame_from_landmarks
from capture.rigid import apply, inverse


def bone_weights(body: Body) -> Floats:
    """Weights (V, B) of the bones, which sum to one in every row."""
    names = tuple(bone.name for bone in body.anatomy.bones)
    weights = np.zeros((len(body.v_hat), len(names)))
    for deformer, share in zip(body.anatomy.deformers, body.anatomy.deformer_weights.T, strict=True):
        if deformer.type == "rigid":
            weights[:, names.index(deformer.bones[0])] += share
            continue
        start, end = forearm_line(body, rest_theta(body))
        t = np.clip((body.v_tilde.value - start) @ (end - start) / ((end - start) @ (end - start)), 0.0, 1.0)
        weights[:, names.index(deformer.bones[0])] += share * (1.0 - t)
        weights[:, names.index(deformer.bones[1])] += share * t
    return weights


def forearm_line(body: Body, theta: Floats) -> tuple[Floats, Floats]:
    """Where the bones have carried the origins (3,) of the forearm deformer's two frames: elbow end, wrist end."""
    deformer = next(d for d in body.anatomy.deformers if d.type == "forearm")
    transforms = bone_transforms(body, theta)
    start, end = (
        apply(transforms[bone], frame_from_landmarks(body.anatomy, frame, body.p).translation[None])[0]
        for bone, frame in zip(deformer.bones, deformer.frames, strict=True)
    )
    return start, end


def bound_to(body: Body, bound: Floats, theta: Floats) -> Floats:
    """Transforms (B, 4, 4) of the bones from the pose ``bound`` to the pose ``theta``, in the order of the weights."""
    now, then = bone_transforms(body, theta), bone_transforms(body, bound)
    return np.array([now[bone.name] @ inverse(then[bone.name]) for bone in body.anatomy.bones])


def linear_blending(rest: Floats, weights: Floats, transforms: Floats) -> Floats:
    """Points (V, 3) by the weighted mean of the matrices (B, 4, 4)."""
    matrices = np.tensordot(weights, transforms[:, :3], axes=(1, 0))
    return np.asarray(np.einsum("vij,vj->vi", matrices[:, :, :3], rest) + matrices[:, :, 3])


def dual_quaternions(rest: Floats, weights: Floats, transforms: Floats) -> Floats:
    """Points (V, 3) by the normalised weighted mean of the unit dual quaternions of (B, 4, 4)."""
    real = Rotation.from_matrix(transforms[:, :3, :3]).as_quat(scalar_first=True)
    real *= np.where(real @ real[0] < 0.0, -1.0, 1.0)[:, None]
    shift = np.concatenate([np.zeros((len(real), 1)), transforms[:, :3, 3]], axis=1)
    dual = 0.5 * _product(shift, real)
    length = np.linalg.norm(weights @ real, axis=1, keepdims=True)
    real, dual = weights @ real / length, weights @ dual / length
    turned = Rotation.from_quat(real, scalar_first=True).apply(rest)
    return np.asarray(turned + 2.0 * _product(dual, real * [1.0, -1.0, -1.0, -1.0])[:, 1:])


def _product(p: Floats, q: Floats) -> Floats:
    """Quaternion products (N, 4), scalar first."""
    scalar = p[:, 0] * q[:, 0] - np.einsum("ij,ij->i", p[:, 1:], q[:, 1:])
    vector = p[:, :1] * q[:, 1:] + q[:, :1] * p[:, 1:] + np.cross(p[:, 1:], q[:, 1:])
    return np.column_stack([scalar, vector])
