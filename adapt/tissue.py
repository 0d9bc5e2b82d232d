"""Soft tissue between skin and bone: where it is thin, the skin tells where the bone is.

Muscle and fat differ between people where there is muscle and fat; over an epicondyle or a styloid there is hardly
any. So skin is taken to stray from the template by a share of the tissue's depth beneath it.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from scipy.spatial import cKDTree

from adapt.anatomy import Anatomy, Floats

SHARE = 0.2  # standard deviation of the skin's displacement per depth of tissue (an assumption, not a measurement)
DEEP_M = 0.02  # tissue deeper than this varies no more


@lru_cache(maxsize=8)
def tissue_depth(anatomy: Anatomy) -> Floats:
    """Distance (V,) in metres from each skin vertex to the nearest bone, at rest."""
    bones = cKDTree(np.concatenate([bone.vertices for bone in anatomy.bones]))
    return np.asarray(bones.query(anatomy.skin_vertices)[0])


def tissue_deviation(anatomy: Anatomy) -> Floats:
    """Standard deviation (V,) in metres of the skin's displacement between people whom the handles made alike."""
    return np.asarray(SHARE * np.minimum(tissue_depth(anatomy), DEEP_M))
