"""One body: prepared once from (shape, v_hat), posed many times by theta (equation 5).

v_i(theta, a, v_hat) = sum_d w_{d,i} D_d(theta, p(a), v_tilde_i(a, v_hat)).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from adapt.anatomy import Anatomy, Floats, Ints
from adapt.model.deformers import deform_by
from adapt.model.frames import frame_from_landmarks, landmark_mean
from adapt.model.handles import AffineSet, affine_set, deform, deform_varying, handle_positions, local_scale
from adapt.model.kinematics import bone_motions
from adapt.model.variation import Motion, Points, constant_points
from capture.errors import AnatomyError
from capture.rigid import log_so3


@dataclass(frozen=True, eq=False)
class Body:
    """An anatomy with its proportions (shape) and its template skin (v_hat): everything but the pose."""

    anatomy: Anatomy
    shape: Floats  # (4J,) see handles.AffineSet
    v_hat: Floats = field(repr=False)  # (V, 3) m

    @cached_property
    def affine(self) -> AffineSet:
        """The affine set A of the anatomy."""
        return affine_set(self.anatomy)

    @cached_property
    def a(self) -> Floats:
        """Handle parameters (H, 4) = [s, t]."""
        return self.affine.handle_parameters(self.shape)

    @cached_property
    def v_tilde(self) -> Points:
        """Rest skin (V, 3) after anthropometric deformation, varying with the shape."""
        return self._deformed(self.v_hat, self.anatomy.skin_handle_weights)

    @cached_property
    def p(self) -> Points:
        """Landmarks (P, 3), varying with the shape."""
        return self._deformed(self.anatomy.landmarks, self.anatomy.landmark_handle_weights)

    @cached_property
    def rest_bones(self) -> dict[str, Floats]:
        """Rest surface (N, 3) of every bone, deformed inside the bone's own tetrahedra."""
        positions = handle_positions(self.anatomy)
        return {b.name: deform(b.vertices, b.handle_weights, positions, self.a) for b in self.anatomy.bones}

    def _deformed(self, points: Floats, weights: Floats) -> Points:
        return deform_varying(points, weights, handle_positions(self.anatomy), self.a, self.affine.basis)


def make_body(anatomy: Anatomy, *, shape: Floats | None = None, v_hat: Floats | None = None) -> Body:
    """A body of that anatomy: the template itself where nothing else is said.

    Raises:
        AnatomyError: ``shape`` is not (4J,) or ``v_hat`` not (V, 3), or not finite, or a scale is not positive.
    """
    shape = affine_set(anatomy).identity if shape is None else np.asarray(shape, dtype=np.float64)
    v_hat = anatomy.skin_vertices if v_hat is None else np.asarray(v_hat, dtype=np.float64)
    if shape.shape != affine_set(anatomy).identity.shape or not np.isfinite(shape).all():
        raise AnatomyError(f"a shape of {anatomy.name} has {len(affine_set(anatomy).identity)} finite numbers")
    if (shape[::4] <= 0.0).any():
        raise AnatomyError("a handle's scale must be positive")
    if v_hat.shape != anatomy.skin_vertices.shape or not np.isfinite(v_hat).all():
        raise AnatomyError(f"v_hat of {anatomy.name} must be finite and of shape {anatomy.skin_vertices.shape}")
    return Body(anatomy, shape, v_hat)


def rest_theta(body: Body) -> Floats:
    """The pose (n,) in which the body stands as its rest skin: T_b = identity for every bone."""
    theta = np.array([coordinate.rest for coordinate in body.anatomy.coordinates])
    for joint in body.anatomy.joints:
        if joint.type == "free":
            frame = frame_from_landmarks(body.anatomy, body.anatomy.bone(joint.child).frame, body.p)
            index = [body.anatomy.coordinate_index(name) for name in joint.coordinates]
            theta[index] = np.concatenate([log_so3(frame.rotation), frame.translation])
    return theta


def pose_skin(body: Body, theta: Floats, *, vertices: Ints | None = None) -> Floats:
    """Posed skin v (V, 3) in metres, or only some ``vertices`` of it."""
    p = constant_points(body.p.value, len(theta))
    motions = bone_motions(body.anatomy, theta, p)
    still = {name: _without_derivative(motion) for name, motion in motions.items()}
    points = constant_points(_pick(body.v_tilde.value, vertices), 0)
    return _blend(body.anatomy, still, constant_points(p.value, 0), points, vertices).value


def pose_skin_varying(body: Body, theta: Floats, *, with_shape: bool = False, vertices: Ints | None = None) -> Points:
    """Posed skin with its derivative by theta (first columns) and, if asked, by the shape (last columns)."""
    spare = len(body.shape) if with_shape else 0
    p, skin = (_with_theta_columns(points, len(theta), spare) for points in (body.p, body.v_tilde))
    motions = bone_motions(body.anatomy, theta, p)
    skin = Points(_pick(skin.value, vertices), _pick(skin.d, vertices))
    return _blend(body.anatomy, motions, p, skin, vertices)


def pose_skin_by_v_hat(body: Body, theta: Floats) -> Points:
    """Posed skin with each vertex's derivative by its OWN template vertex v_hat_i: (V, 3, 3).

    A vertex does not depend on any other vertex of v_hat.
    """
    scale = local_scale(body.anatomy.skin_handle_weights, body.a)
    skin = Points(body.v_tilde.value, scale[:, None, None] * np.eye(3))
    motions = bone_motions(body.anatomy, theta, constant_points(body.p.value, len(theta)))
    still = {name: _without_derivative(motion, columns=3) for name, motion in motions.items()}
    return _blend(body.anatomy, still, constant_points(body.p.value, 3), skin, None)


def bone_transforms(body: Body, theta: Floats) -> dict[str, Floats]:
    """T_b(theta) (4, 4) of every bone: from its rest pose to its pose."""
    motions = bone_motions(body.anatomy, theta, constant_points(body.p.value, len(theta)))
    return {name: motion.matrix() for name, motion in motions.items()}


def bone_frames(body: Body, theta: Floats) -> dict[str, Floats]:
    """F_b(theta) (4, 4) of every bone: its ISB frame in the recording's frame."""
    transforms = bone_transforms(body, theta)
    return {
        bone.name: transforms[bone.name] @ frame_from_landmarks(body.anatomy, bone.frame, body.p).matrix()
        for bone in body.anatomy.bones
    }


def posed_bones(body: Body, theta: Floats) -> dict[str, Floats]:
    """Posed surface (N, 3) of every bone in metres."""
    transforms = bone_transforms(body, theta)
    return {name: rest @ transforms[name][:3, :3].T + transforms[name][:3, 3] for name, rest in body.rest_bones.items()}


def joint_centres(body: Body, theta: Floats) -> dict[str, Floats]:
    """Centre (3,) of every joint, posed with its parent; a child that only turns agrees, one that glides does not."""
    transforms = bone_transforms(body, theta)
    centres = {}
    for joint in body.anatomy.joints:
        rest, _ = landmark_mean(body.anatomy, body.p, joint.centre)
        carrier = transforms[joint.parent or joint.child]
        centres[joint.name] = carrier[:3, :3] @ rest + carrier[:3, 3]
    return centres


def _blend(anatomy: Anatomy, motions: Mapping[str, Motion], p: Points, skin: Points, vertices: Ints | None) -> Points:
    """Equation 3; a deformer is evaluated only where it has weight."""
    weights = _pick(anatomy.deformer_weights, vertices)
    value, d = np.zeros_like(skin.value), np.zeros_like(skin.d)
    for column, deformer in enumerate(anatomy.deformers):
        touched = np.flatnonzero(weights[:, column])
        share = weights[touched, column]
        moved = deform_by(anatomy, deformer, motions, p, Points(skin.value[touched], skin.d[touched]))
        value[touched] += share[:, None] * moved.value
        d[touched] += share[:, None, None] * moved.d
    return Points(value, d)


def _with_theta_columns(points: Points, n_theta: int, n_shape: int) -> Points:
    d = np.zeros((*points.value.shape, n_theta + n_shape))
    if n_shape:
        d[:, :, n_theta:] = points.d
    return Points(points.value, d)


def _without_derivative(motion: Motion, columns: int = 0) -> Motion:
    return Motion(motion.rotation, motion.translation, np.zeros((3, columns)), np.zeros((3, columns)))


def _pick(array: Floats, vertices: Ints | None) -> Floats:
    return array if vertices is None else array[vertices]
