"""The size of a whole body against its template, apart from its proportions."""

from __future__ import annotations

from adapt.model.body import Body, make_body


def resized(body: Body, size: float) -> Body:
    """The body ``size`` times as large, soft tissue and all; the centre of its first group of handles stays in place.

    Raises:
        AnatomyError: ``size`` is not positive.

    >>> from adapt.anatomy_file import load_anatomy
    >>> arm = make_body(load_anatomy("upper-limb-right"))
    >>> arm.rest_bones["hand"].std(axis=0).round(3).tolist()
    [0.041, 0.033, 0.026]
    >>> resized(arm, 2.0).rest_bones["hand"].std(axis=0).round(3).tolist()
    [0.081, 0.066, 0.053]
    """
    return make_body(body.anatomy, shape=body.affine.resized(body.shape, size), v_hat=body.v_hat)
