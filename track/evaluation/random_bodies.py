"""Random bodies: who moves in the project's own accuracy protocol.

Bone lengths are within 8 %, scales within 6 %, and there is soft tissue that the handles cannot express.
"""

from __future__ import annotations

import numpy as np

from adapt.anatomy import Anatomy, Floats
from adapt.model.body import Body, make_body
from adapt.model.shape.handle_space import affine_set
from adapt.model.surface import incidence, vertex_normals
from adapt.tissue import tissue_deviation

LENGTH_SPREAD = 0.08
SCALE_SPREAD = 0.06
_SOFT_REACH_M = 0.04
_SOFT_BUMPS = 200


def random_body(anatomy: Anatomy, seed: int) -> Body:
    """A body of other proportions: bone lengths, scales at the joints, and smooth bumps of soft tissue."""
    rng = np.random.default_rng(seed)
    affine = affine_set(anatomy)
    scales = 1.0 + rng.uniform(-SCALE_SPREAD, SCALE_SPREAD, len(affine.groups))
    stretch = 1.0 + rng.uniform(-LENGTH_SPREAD, LENGTH_SPREAD, len(affine.groups) - 1)
    spans = stretch[:, None] * np.diff(affine.centres, axis=0)
    heads = affine.centres[0] + np.vstack([np.zeros(3), np.cumsum(spans, axis=0)])
    return make_body(
        anatomy,
        shape=affine.shape(scales, heads - affine.centres),
        v_hat=anatomy.skin_vertices + soft_tissue(anatomy, rng),
    )


def soft_tissue(anatomy: Anatomy, rng: np.random.Generator) -> Floats:
    """A smooth random displacement (V, 3) m along the skin's normals, as much as the tissue's depth allows.

    Its standard deviation at a vertex is that of ``adapt.tissue``: millimetres on muscle, little over bone.
    """
    skin, faces = anatomy.skin_vertices, anatomy.skin_faces
    centres = skin[rng.choice(len(skin), _SOFT_BUMPS, replace=False)]
    bumps = np.exp(-0.5 * ((skin[:, None] - centres) ** 2).sum(axis=2) / _SOFT_REACH_M**2)
    bumps /= np.linalg.norm(bumps, axis=1, keepdims=True)  # unit variance everywhere
    along_normal = tissue_deviation(anatomy) * (bumps @ rng.normal(size=_SOFT_BUMPS))
    return np.asarray(along_normal[:, None] * vertex_normals(skin, faces, incidence(faces, len(skin))))
