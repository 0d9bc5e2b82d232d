"""One body: prepared once from (shape, v_hat), posed many times by theta (equation 5).

v_i(theta, a, v_hat) = sum_d w_{d,i} D_d(theta, p(a), v_tilde_i(a, v_hat)).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property, lru_cache

import numpy as np

from adapt.anatomy import Anatomy, Floats, Ints
from adapt.model.along import posed_along
from adapt.model.compiled.layout import BoundSkin, Varying
from adapt.model.compiled.links import Chain
from adapt.model.compiled.prepared import prepare_chain, prepare_skin
from adapt.model.compiled.skin import pose_rows
from adapt.model.deformers import bind, bone_shares
from adapt.model.deformers.deformer_type import Bound
from adapt.model.derivatives import Motion, Points, constant_points, mere_points, still_points
from adapt.model.frames import frame_from_landmarks, landmark_mean
from adapt.model.handles import d_deform_d_shape, deform, deform_varying, handle_positions, local_scale
from adapt.model.kinematics import bone_motions
from adapt.model.parts import refuse_wrong_parts
from adapt.model.pose_space import rest_pose
from adapt.model.shape.handle_space import AffineSet, affine_set
from capture.errors import AnatomyError


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
    def rest_skin(self) -> Floats:
        """Rest skin (V, 3) after anthropometric deformation: the values of ``v_tilde`` alone."""
        return deform(self.v_hat, self.anatomy.skin_handle_weights, handle_positions(self.anatomy), self.a)

    @cached_property
    def v_tilde(self) -> Points:
        """Rest skin (V, 3) after anthropometric deformation, varying with the shape."""
        return self.rest_skin_varying(slice(None))

    def rest_skin_varying(self, vertices: Ints | slice) -> Points:
        """The same of some vertices."""
        weights, positions = self.anatomy.skin_handle_weights[vertices], handle_positions(self.anatomy)
        by_shape = d_deform_d_shape(self.v_hat[vertices], weights, positions, self.affine.basis)
        return Points(self.rest_skin[vertices], by_shape)

    @cached_property
    def p(self) -> Points:
        """Landmarks (P, 3), varying with the shape."""
        weights, positions = self.anatomy.landmark_handle_weights, handle_positions(self.anatomy)
        return deform_varying(self.anatomy.landmarks, weights, positions, self.a, self.affine.basis)

    @cached_property
    def bound_skin(self) -> tuple[Bound, ...]:
        """The whole rest skin bound to each deformer, as it is when only the pose varies."""
        p, skin = constant_points(self.p.value, 1), still_points(self.rest_skin)
        return tuple(bind(self.anatomy, deformer, p, skin) for deformer in self.anatomy.deformers)

    @cached_property
    def skin_riding(self) -> Floats:
        """The share (V, B) of each skin vertex that rides on each bone; a bone without skin (a kneecap) has none."""
        names, shares = [bone.name for bone in self.anatomy.bones], self.anatomy.deformer_weights.T
        rides = np.zeros((len(self.v_hat), len(names)))
        for deformer, bound, weight in zip(self.anatomy.deformers, self.bound_skin, shares, strict=True):
            for name, share in bone_shares(deformer, bound).items():
                rides[:, names.index(name)] += weight * share
        return rides

    @cached_property
    def everything(self) -> Ints:
        """The rows (V,) of the whole skin."""
        return np.arange(len(self.v_hat))

    @cached_property
    def prepared(self) -> PreparedSkin:
        """The whole skin as it varies with the pose."""
        return _prepared(self, self.everything, mere_points(self.rest_skin), mere_points(self.p.value))

    @cached_property
    def shaped(self) -> PreparedSkin:
        """The whole skin as it varies with pose and shape."""
        return shaped_skin(self, self.everything)

    @cached_property
    def grown(self) -> PreparedSkin:
        """The whole skin as it varies with pose and each vertex's own template vertex."""
        scale = local_scale(self.anatomy.skin_handle_weights, self.a)
        skin, p = Points(self.rest_skin, scale[:, None, None] * np.eye(3)), constant_points(self.p.value, 3)
        return _prepared(self, self.everything, skin, p)

    @cached_property
    def rest_bones(self) -> dict[str, Floats]:
        """Rest surface (N, 3) of every bone, deformed inside the bone's own tetrahedra."""
        positions = handle_positions(self.anatomy)
        return {b.name: deform(b.vertices, b.handle_weights, positions, self.a) for b in self.anatomy.bones}


@dataclass(frozen=True, eq=False)
class PreparedSkin:
    """Some vertices of a body's skin, prepared for pose after pose; they may vary with the body's parameters, too."""

    chain: Chain = field(repr=False)
    skin: BoundSkin = field(repr=False)
    varying: Varying = field(repr=False)

    def placed(self, theta: Floats, rows: Ints) -> Floats:
        """Posed skin (M, 3) m of some ``rows`` of the vertices."""
        pose = np.asarray(theta, dtype=np.float64)
        return pose_rows(self.chain, self.skin, self.varying, pose, rows, varying=False)[0]

    def posed(self, theta: Floats, rows: Ints) -> Points:
        """The same with its derivative by theta, then by the parameters."""
        pose = np.asarray(theta, dtype=np.float64)
        return Points(*pose_rows(self.chain, self.skin, self.varying, pose, rows, varying=True))


def shaped_skin(body: Body, vertices: Ints, *, along: Floats | None = None) -> PreparedSkin:
    """Some ``vertices`` (N,) of a body's skin as they vary with the shape.

    ``along`` (N, 3) are directions: one more parameter is how far each vertex's OWN template vertex v_hat_i moves along
    its direction.
    """
    skin, p = body.rest_skin_varying(vertices), body.p
    if along is not None:
        own = local_scale(body.anatomy.skin_handle_weights[vertices], body.a)[:, None] * along
        skin = Points(skin.value, np.concatenate([skin.d, own[:, :, None]], axis=2))
        p = Points(p.value, np.concatenate([p.d, np.zeros((len(p.value), 3, 1))], axis=2))
    return _prepared(body, vertices, skin, p)


def _prepared(body: Body, vertices: Ints, skin: Points, p: Points) -> PreparedSkin:
    """Rest skin of some vertices and landmarks, which vary with the same parameters."""
    anatomy = body.anatomy
    return PreparedSkin(prepare_chain(anatomy, p), *prepare_skin(anatomy, p, skin, anatomy.deformer_weights[vertices]))


def make_body(anatomy: Anatomy, *, shape: Floats | None = None, v_hat: Floats | None = None) -> Body:
    """A body of that anatomy: the template itself where nothing else is said.

    Raises:
        AnatomyError: ``shape`` is not (4J,) or ``v_hat`` not (V, 3), or not finite, or a scale is not positive; or a
            joint or deformer of the anatomy has not the parts that its type needs.

    >>> from adapt.anatomy_file import load_anatomy
    >>> body = make_body(load_anatomy("upper-limb-right"))
    >>> dict(zip(body.affine.groups, body.affine.scales(body.shape).tolist()))
    {'shoulder': 1.0, 'elbow': 1.0, 'wrist': 1.0, 'knuckles': 1.0}
    """
    refuse_wrong_parts(anatomy)
    shape = affine_set(anatomy).identity if shape is None else np.asarray(shape, dtype=np.float64)
    v_hat = anatomy.skin_vertices if v_hat is None else np.asarray(v_hat, dtype=np.float64)
    if shape.shape != affine_set(anatomy).identity.shape or not np.isfinite(shape).all():
        raise AnatomyError(f"a shape of {anatomy.name} has {len(affine_set(anatomy).identity)} finite numbers")
    if not affine_set(anatomy).is_possible(shape):
        raise AnatomyError("a handle's scale must be positive")
    if v_hat.shape != anatomy.skin_vertices.shape or not np.isfinite(v_hat).all():
        raise AnatomyError(f"v_hat of {anatomy.name} must be finite and of shape {anatomy.skin_vertices.shape}")
    return Body(anatomy, shape, v_hat)


def rest_theta(body: Body) -> Floats:
    """The pose (n,) in which the body stands as its rest skin: T_b = identity for every bone.

    >>> from adapt.anatomy_file import load_anatomy
    >>> leg = load_anatomy("lower-limb-right")
    >>> theta = rest_theta(make_body(leg))
    >>> round(float(np.rad2deg(theta[leg.coordinate_index("knee_angle_r")])), 1)
    1.3
    """
    return rest_pose(body.anatomy, body.p)


def pose_skin(body: Body, theta: Floats, *, vertices: Ints | None = None) -> Floats:
    """Posed skin v (V, 3) in metres, or only some ``vertices`` of it."""
    return body.prepared.placed(theta, body.everything if vertices is None else vertices)


def pose_skin_varying(body: Body, theta: Floats, *, with_shape: bool = False, vertices: Ints | None = None) -> Points:
    """Posed skin with its derivative by theta (first columns) and, if asked, by the shape (next columns)."""
    prepared = body.shaped if with_shape else body.prepared
    return prepared.posed(theta, body.everything if vertices is None else vertices)


def pose_skin_by_v_hat(body: Body, theta: Floats, *, vertices: Ints | None = None) -> Points:
    """Posed skin, or some ``vertices`` of it, with each one's derivative by its OWN template vertex v_hat_i: (V, 3, 3).

    A vertex does not depend on any other vertex of v_hat.
    """
    posed = body.grown.posed(theta, body.everything if vertices is None else vertices)
    return Points(posed.value, posed.d[:, :, len(theta) :])


def bone_transforms(body: Body, theta: Floats) -> dict[str, Floats]:
    """T_b(theta) (4, 4) of every bone: from its rest pose to its pose.

    >>> from adapt.anatomy_file import load_anatomy
    >>> body = make_body(load_anatomy("upper-limb-right"))
    >>> theta = rest_theta(body)
    >>> theta[body.anatomy.coordinate_index("shoulder_ty")] += 0.1
    >>> np.allclose(bone_transforms(body, theta)["hand"], [[1, 0, 0, 0], [0, 1, 0, 0.1], [0, 0, 1, 0], [0, 0, 0, 1]])
    True
    """
    return {name: motion.matrix() for name, motion in _motions(body, theta).items()}


def bone_frames(body: Body, theta: Floats) -> dict[str, Floats]:
    """F_b(theta) (4, 4) of every bone: its ISB frame in the recording's frame.

    >>> from adapt.anatomy_file import load_anatomy
    >>> body = make_body(load_anatomy("upper-limb-right"))
    >>> frame = bone_frames(body, rest_theta(body))["humerus"]  # of ISB, its origin in the shoulder
    >>> np.allclose(frame[:3, 3], joint_centres(body, rest_theta(body))["shoulder"])
    True
    """
    transforms = bone_transforms(body, theta)
    return {
        bone.name: transforms[bone.name] @ frame_from_landmarks(body.anatomy, bone.frame, body.p).matrix()
        for bone in body.anatomy.bones
    }


def posed_bones(body: Body, theta: Floats) -> dict[str, Floats]:
    """Posed surface (N, 3) of every bone in metres.

    >>> from adapt.anatomy_file import load_anatomy
    >>> body = make_body(load_anatomy("upper-limb-right"))
    >>> bones = posed_bones(body, rest_theta(body))
    >>> list(bones), np.allclose(bones["ulna"], body.rest_bones["ulna"])
    (['humerus', 'ulna', 'radius', 'hand'], True)
    """
    transforms = bone_transforms(body, theta)
    anatomy, p = body.anatomy, body.p.value
    return {b.name: posed_along(anatomy, b, body.rest_bones[b.name], p, transforms) for b in anatomy.bones}


def joint_centres(body: Body, theta: Floats) -> dict[str, Floats]:
    """Centre (3,) of every joint, posed with its parent; a child that only turns agrees, one that glides does not.

    >>> from adapt.anatomy_file import load_anatomy
    >>> body = make_body(load_anatomy("upper-limb-right"))
    >>> centres = joint_centres(body, rest_theta(body))
    >>> list(centres), round(float(np.linalg.norm(centres["shoulder"] - centres["elbow"])), 2)
    (['shoulder', 'elbow', 'radioulnar', 'wrist'], 0.29)
    """
    transforms = bone_transforms(body, theta)
    centres = {}
    for joint in body.anatomy.joints:
        rest, _ = landmark_mean(body.anatomy, body.p, joint.centre)
        carrier = transforms[joint.parent or joint.child]
        centres[joint.name] = carrier[:3, :3] @ rest + carrier[:3, 3]
    return centres


def _motions(body: Body, theta: Floats) -> Mapping[str, Motion]:
    """T_b of every bone, varying with theta."""
    return _kept_motions(body, np.asarray(theta, dtype=np.float64).tobytes())


@lru_cache(maxsize=4)
def _kept_motions(body: Body, theta: bytes) -> Mapping[str, Motion]:
    """They are kept a while because a pose is asked for several things in a row: matches, derivatives, bones."""
    pose = np.frombuffer(theta)
    return bone_motions(body.anatomy, pose, constant_points(body.p.value, len(pose)))
