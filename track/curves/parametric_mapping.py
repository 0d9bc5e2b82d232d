"""Where in a cycle two groups differ: statistical parametric mapping, by spm1d.

At each percent there is a t value, and the whole curve is tested at once: where it is beyond a threshold that smooth
random curves reach in 5 % of the cases, the groups differ (Pataky 2010, *J. Biomech.* 43, 1976-1982). Lasting errors of
single motions are not in it: it tells of cycles, not of how they were measured.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from adapt.anatomy import Floats
from track.curves.motion_curves import CurvesError

ALPHA = 0.05
_LEAST = 3  # cycles of a group: two leave hardly anything to be smooth
_SAME = 1e-9


@dataclass(frozen=True, eq=False)
class Mapping1D:
    """The t values (101,), the threshold, and the parts of the cycle beyond it: from, to (%), and how unlikely."""

    t: Floats = field(repr=False)
    threshold: float
    clusters: tuple[tuple[float, float, float], ...]


def refuse_without_spm1d() -> None:
    """Tell before the work, not after it.

    Raises:
        CurvesError: spm1d is not installed.
    """
    try:
        import spm1d  # noqa: F401
    except ImportError as error:
        raise CurvesError("--spm needs spm1d", remedy="pip install 'bonetrack[statistics]'") from error


def parametric_mapping(first: Floats, other: Floats) -> Mapping1D | None:
    """Two samples of cycles (N, 101) and (M, 101) tested for a difference, other less first, variances not taken equal.

    None where a sample has fewer than three cycles, or cycles that do not differ.
    """
    import spm1d

    if min(len(first), len(other)) < _LEAST or min(np.std(x, axis=0).min() for x in (first, other)) < _SAME:
        return None
    found = spm1d.stats.ttest2(other, first, equal_var=False).inference(ALPHA, two_tailed=True)
    clusters = [(*(float(end) for end in one.endpoints), float(one.P)) for one in found.clusters]
    return Mapping1D(np.asarray(found.z), float(found.zstar), tuple((a, b, p) for a, b, p in clusters))
