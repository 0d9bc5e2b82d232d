"""The size of a whole body against its template, apart from its proportions."""

from __future__ import annotations

from adapt.model.body import Body, make_body


def resized(body: Body, size: float) -> Body:
    """The body ``size`` times as large, soft tissue and all; the centre of its first group of handles stays in place.

    Raises:
        AnatomyError: ``size`` is not positive.
    """
    return make_body(body.anatomy, shape=body.affine.resized(body.shape, size), v_hat=body.v_hat)
