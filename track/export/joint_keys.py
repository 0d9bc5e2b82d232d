"""A skeleton's keys, as animation formats store them: each joint's place, turn and scale as its parent sees it."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy.spatial.transform import Rotation

from adapt.anatomy import Floats
from capture.rigid import inverse
from track.export.linear_skin import LinearSkin


@dataclass(frozen=True, eq=False)
class JointKeys:
    """T keys of J joints: translations (T, J, 3) m, unit quaternions x, y, z, w (T, J, 4), scales (T, J, 3).

    A joint's quaternions keep to one side, so that readers that blend two of them number by number take the short way.
    """

    translations: Floats = field(repr=False)
    rotations: Floats = field(repr=False)
    scales: Floats = field(repr=False)


def posed_joints(skin: LinearSkin, thetas: Floats, turned: Floats) -> Floats:
    """The joints' frames (T, J, 4, 4) in poses (T, n), after all was turned by ``turned`` (4, 4)."""
    return np.array([turned @ skin.frames(theta) for theta in thetas])


def local_frames(skin: LinearSkin, frames: Floats) -> Floats:
    """Frames (T, J, 4, 4) as each joint's parent sees them."""
    seen = [
        frames[:, k] if parent is None else np.array([inverse(f[parent]) @ f[k] for f in frames])
        for k, parent in enumerate(skin.parents)
    ]
    return np.stack(seen, axis=1)


def joint_keys(skin: LinearSkin, frames: Floats) -> JointKeys:
    """Keys that put a skin's joints at frames (T, J, 4, 4)."""
    local = local_frames(skin, frames)
    turned = local[..., :3, :3]
    scales = np.linalg.norm(turned, axis=-2)
    rotations = np.asarray(Rotation.from_matrix((turned / scales[..., None, :]).reshape(-1, 3, 3)).as_quat())
    return JointKeys(local[..., :3, 3], _continuous(rotations.reshape(*scales.shape[:2], 4)), scales)


def _continuous(quaternions: Floats) -> Floats:
    """The same rotations (T, J, 4), each with the sign that is nearer to the one before."""
    turned = np.einsum("tji,tji->tj", quaternions[1:], quaternions[:-1]) < 0.0
    signs = np.cumprod(np.concatenate([np.ones((1, quaternions.shape[1])), np.where(turned, -1.0, 1.0)]), axis=0)
    return np.asarray(quaternions * signs[..., None])
