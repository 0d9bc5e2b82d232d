"""The size of a whole body against its template, apart from its proportions."""

from __future__ import annotations

import numpy as np

from adapt.anatomy import Floats
from adapt.model.body import Body, make_body


def resized(body: Body, size: float) -> Body:
    """The body ``size`` times as large, soft tissue and all; the centre of its first group of handles stays in place.

    Raises:
        AnatomyError: ``size`` is not positive.
    """
    shape, centres = body.shape.reshape(-1, 4).copy(), body.affine.centres
    shape[:, 1:] = size * (centres + shape[:, 1:]) + (1.0 - size) * centres[0] - centres
    shape[:, 0] *= size
    return make_body(body.anatomy, shape=shape.ravel(), v_hat=body.v_hat)


def handle_centres(body: Body) -> Floats:
    """Where the groups of handles (J, 3) stand in the body at rest (m): near its joints' centres."""
    return np.asarray(body.affine.centres + body.shape.reshape(-1, 4)[:, 1:])
