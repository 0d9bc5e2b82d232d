"""What moves the skin (paper, equation 3): one module per deformer type, chosen by name here."""

from __future__ import annotations

from collections.abc import Mapping

from adapt.anatomy import Anatomy, Deformer
from adapt.model.deformers.forearm import forearm
from adapt.model.deformers.rigid import rigid
from adapt.model.variation import Motion, Points


def deform_by(anatomy: Anatomy, deformer: Deformer, motions: Mapping[str, Motion], p: Points, skin: Points) -> Points:
    """D_d(theta, p, v_tilde): where the deformer carries each rest point of ``skin``."""
    if deformer.type == "rigid":
        return rigid(motions[deformer.bones[0]], skin)
    proximal, distal = deformer.bones
    return forearm(anatomy, deformer.frames, (motions[proximal], motions[distal]), p, skin)
