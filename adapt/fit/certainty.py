"""How sure an adapted body is: the joint covariance of its proportions and its soft tissue.

At the best fit, x = [shape (m), tissue (q), theta_1, ..., theta_K] has the covariance H^-1, H being the normal matrix
of algorithm 2 with its priors. The block of shape and tissue in the inverse has the poses integrated out (their Schur
complement). Two things are not as they are in fitting:

- When the skin slides along the cloud, the nearest points slide with it: that they lie near says next to nothing of
  where along the surface a vertex is. So the planes alone count (CERTAINTY_PLANE_WEIGHT).
- The noise is that of clouds which the body was not adapted to. In its own clouds the skin has bent to the noise.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from adapt.anatomy import Floats
from adapt.fit.correspondences import Target
from adapt.fit.least_squares import CERTAINTY_PLANE_WEIGHT
from adapt.fit.never_seen import Bools, without
from adapt.fit.noise import patch_noise, trusted
from adapt.fit.pose import PoseFit, fit_pose
from adapt.fit.sample import sample_skin, weighted_by_tissue
from adapt.fit.shape import ShapeEnergy, Unknowns, split_tissue
from adapt.model.body import Body
from adapt.tissue import tissue_field
from capture.errors import FitError

_SAMPLED_VERTICES = 2000


def body_covariance(body: Body, fits: Sequence[PoseFit], *, noise_m: float) -> Floats:
    """Covariance (m + q, m + q) of the shape and the tissue's coefficients of a body that was adapted to K clouds.

    ``fits`` are its poses there; ``noise_m`` is the standard deviation of a patch's distance from the cloud.
    """
    anatomy = body.anatomy
    fine, c = split_tissue(body, tissue_field(anatomy))
    of = Unknowns(len(body.shape), len(c), len(anatomy.coordinates))
    x = np.concatenate([body.shape, c, *(fit.theta for fit in fits)])
    sample = trusted(weighted_by_tissue(sample_skin(anatomy), anatomy), noise_m)
    matches = [fit.matches for fit in fits]
    energy = ShapeEnergy(body, fine, matches, sample, of, CERTAINTY_PLANE_WEIGHT)
    covariance = np.linalg.inv(energy.quadratic(x).hessian)[: of.m + of.q, : of.m + of.q]
    return np.asarray(0.5 * (covariance + covariance.T))


def unseen_noise(body: Body, unseen: Sequence[tuple[Target, Floats]], gone: Bools | None = None) -> float | None:
    """The noise (m, see ``patch_noise``) in clouds that the body was not adapted to, from poses (n,) near theirs.

    The median over the clouds, for some of the poses may be wrong; None where no cloud can be posed. Skin (V,) that is
    ``gone`` takes no part.
    """
    sample, found = sample_skin(body.anatomy, at_most=_SAMPLED_VERTICES), []
    sample = sample if gone is None else without(sample, gone)
    for target, theta in unseen:
        try:
            fit = fit_pose(body, target, theta, sample)
        except FitError:
            continue
        found.append(patch_noise(body.anatomy, [fit.matches], sample, len(theta)))
    return float(np.median(found)) if found else None
