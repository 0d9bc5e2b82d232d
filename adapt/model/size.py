"""The size of a whole body against its template, apart from its proportions."""

from __future__ import annotations

from adapt.anatomy import Anatomy
from adapt.model.body import Body, make_body
from adapt.model.shape.population import MEN_M, Person


def resized(body: Body, size: float) -> Body:
    """The body ``size`` times as large, soft tissue and all; the centre of its first group of handles stays in place.

    Raises:
        AnatomyError: ``size`` is not positive.

    >>> from adapt.anatomy_file import load_anatomy
    >>> arm = make_body(load_anatomy("upper-limb-right"))
    >>> arm.rest_bones["hand"].std(axis=0).round(3).tolist()
    [0.04, 0.033, 0.027]
    >>> resized(arm, 2.0).rest_bones["hand"].std(axis=0).round(3).tolist()
    [0.081, 0.066, 0.053]
    """
    return make_body(body.anatomy, shape=body.affine.resized(body.shape, size), v_hat=body.v_hat)


def expected_body(anatomy: Anatomy, person: Person) -> Body:
    """The template as large as the person is said to be; as it is where no height is stated.

    >>> from adapt.anatomy_file import load_anatomy
    >>> arm = load_anatomy("upper-limb-right")
    >>> small, usual = expected_body(arm, Person(height_m=1.40)), expected_body(arm, Person(sex="female"))
    >>> small.affine.scales(small.shape).round(2).tolist(), usual.affine.scales(usual.shape).tolist()
    ([0.8, 0.8, 0.8, 0.8], [1.0, 1.0, 1.0, 1.0])
    """
    body = make_body(anatomy)
    return body if person.height_m is None else resized(body, person.height_m / MEN_M)
