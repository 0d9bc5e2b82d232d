"""The forearm deformer (paper, section 3.5): a twist that neither collapses nor bends the forearm.

A proximal frame rides on the ulna, a distal one on the radius. Between them, at t in [0, 1] along the forearm
(0: elbow end, follows the ulna; 1: wrist end, follows the radius), stands the blended frame

    o(t) = (1 - t) o_p + t o_d,      R(t) = exp(t rho) R_p,   rho = log(R_d R_p^T)      (SLERP)

and a point is carried by F_blend(theta, t) F_blend(rest, t)^-1, with its own t(v_tilde). What F_blend(rest, t)^-1
makes of a point does not depend on the pose: it is worked out once for a body. Fitting runs the same equations as
compiled loops: TURNING in ``adapt.model.compiled.skin``.
"""

from __future__ import annotations

import numpy as np

from adapt.anatomy import Floats
from adapt.model.deformers.turning import Turning
from adapt.model.derivatives import Motion, Points, d_reach_along, reach_along


class Forearm(Turning):
    """Skin that twists between two bones: ``frames[0]`` rides on the first (the ulna), ``frames[1]`` on the radius."""

    name = "forearm"

    def along(self, first: Motion, second: Motion, skin: Points) -> tuple[Floats, Floats]:
        """The ramp t (N,) in [0, 1] along the forearm and its derivative (N, n)."""
        axis, d_axis = second.translation - first.translation, second.d_translation - first.d_translation
        length2 = axis @ axis
        share, d_share = axis / length2, (d_axis - 2.0 * np.outer(axis, axis @ d_axis) / length2) / length2
        t, dt = reach_along(first, share, skin), np.zeros((len(skin.value), first.n))
        inside = np.flatnonzero((t > 0.0) & (t < 1.0))
        dt[inside] = d_reach_along(first, share, d_share, skin.at(inside))
        return np.clip(t, 0.0, 1.0), dt
