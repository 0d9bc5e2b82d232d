"""The rigid deformer D = T_b v_tilde: linear blend skinning is a blend of these (equation 2)."""

from __future__ import annotations

from adapt.model.variation import Motion, Points, move


def rigid(motion: Motion, skin: Points) -> Points:
    """Skin carried by one bone."""
    return move(motion, skin)
