"""What our model would say of a body that is not of its making: the nearest body of ours, and its pose in each frame.

``nearest_body``: the shape whose landmarks come closest to ours as the skin carries them there (the joints' centres
count most), in a linear least-squares problem, for landmarks are linear in the shape; with ``with_skin`` its skin is
that body's own, vertex by vertex. ``true_thetas``: the pose whose bones come closest to where the rig's bones carry
them,

    theta_t = argmin sum_b sum_x |T_b(theta) x - G_b(t) x|^2

over the corners x of each bone at rest. At rest it is the body's own rest pose: so our coordinates have a truth of
their own, zero included, though nothing moves by our model.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import least_squares

from adapt.anatomy import Floats
from adapt.anatomy_file import load_anatomy
from adapt.model.body import Body, bone_transforms, make_body, rest_theta
from adapt.model.handles import local_scale
from capture.rigid import apply
from track.evaluation.limb_ground import limb_ground
from track.evaluation.rigged_limbs import Motions

_CENTRES_COUNT = 10.0  # times as much as any other landmark
_HELD = 1e-3  # 1 (scales) and m per m that the landmarks are off: what no landmark tells stays as the template has it


def nearest_body(motions: Motions, *, with_skin: bool = False) -> Body:
    """The body of our model that is nearest to somebody's limb at rest."""
    anatomy = load_anatomy(motions.what.anatomy)
    template = make_body(anatomy)
    weight = np.ones(len(anatomy.landmarks))
    centres = {name for joint in anatomy.joints for name in joint.centre}
    weight[[anatomy.landmark_index(name) for name in centres]] = _CENTRES_COUNT
    rows = np.repeat(weight, 3)[:, None] * template.p.d.reshape(-1, len(template.shape))
    off = np.repeat(weight, 3) * (motions.landmarks - template.p.value).ravel()
    held = _HELD * np.eye(len(template.shape))
    change = np.linalg.lstsq(np.vstack([rows, held]), np.r_[off, np.zeros(len(held))], rcond=None)[0]
    body = make_body(anatomy, shape=template.shape + change)
    if not with_skin:
        return body
    skin = limb_ground(anatomy.name).skin(motions.body.vertices)
    scale = local_scale(anatomy.skin_handle_weights, body.a)[:, None]
    return make_body(anatomy, shape=body.shape, v_hat=body.v_hat + (skin - body.rest_skin) / scale)


def true_thetas(motions: Motions, body: Body) -> Floats:
    """Poses (T, n) of a body of ours that is at rest where somebody's limb is, frame by frame, in the limb's world."""
    corners = {bone: _corners(body.rest_bones[bone]) for bone in motions.what.bones}
    carried = {bone: motions.bone(bone) for bone in motions.what.bones}

    def off(theta: Floats, t: int) -> Floats:
        ours = bone_transforms(body, theta)
        parts = [apply(ours[bone], x) - apply(carried[bone][t], x) for bone, x in corners.items()]
        return np.concatenate(parts).ravel()

    theta, found = rest_theta(body), []
    for t in range(len(motions.transforms)):
        theta = least_squares(off, theta, args=(t,), method="lm").x
        found.append(theta)
    return np.array(found)


def _corners(points: Floats) -> Floats:
    """The corners (8, 3) of the box around points (N, 3)."""
    ends = np.array([points.min(axis=0), points.max(axis=0)])
    return np.array([[ends[i, 0], ends[j, 1], ends[k, 2]] for i in (0, 1) for j in (0, 1) for k in (0, 1)])
