"""How noisy a curve is, and where to cut it off: residual analysis.

What a low-pass filter takes away, R(f) (root mean square), falls steeply with the cut-off f while movement is taken
away, and slowly where only noise is left. Winter (2009, section 3.4.4.3) draws a straight line through the slow part;
here the slow part is that of white noise itself,

    R(f)^2 = s^2 g(f),     g from ``low_pass.residual_share``,

which gives s, the noise of a single frame. The cut-off is his: the lowest at which R(f) = s, where as much movement is
taken away as noise is let through. A curve that is still moving at the highest cut-off has no slow part: it is said.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from adapt.anatomy import Floats
from track.curves.low_pass import least_frames, low_pass, residual_share

LOWEST_HZ = 1.0
_HIGHEST = 0.38  # of the rate
_SLOW_FROM = 0.7  # of the highest: from there on only noise is left, if there is such a part
_STEPS = 40
_EVEN = 1.5  # by how much the noise may seem to differ between both halves of the slow part


@dataclass(frozen=True, eq=False)
class ResidualAnalysis:
    """The residuals (K,) of cut-offs (K,) in Hz, the noise of a frame, and the cut-off chosen.

    ``has_floor`` tells whether there is a part where only noise is left; without it the noise is an upper bound.
    """

    cutoffs: Floats = field(repr=False)
    residuals: Floats = field(repr=False)
    noise: float
    cutoff: float
    has_floor: bool


def residual_analysis(spans: Sequence[Floats], rate: float) -> ResidualAnalysis | None:
    """The analysis of a curve in unbroken spans (N,); None where all are too short for the lowest cut-off's filter.

    >>> t, noise = np.arange(600) / 60.0, np.random.default_rng(1).normal(0.0, 0.02, 600)
    >>> found = residual_analysis([np.sin(2.0 * np.pi * t) + noise], rate=60.0)
    >>> round(found.noise, 3), 2.0 < found.cutoff < 6.0, found.has_floor
    (0.019, True, True)
    """
    long = [span for span in spans if len(span) >= least_frames(rate, 2.0 * LOWEST_HZ)]
    if not long:
        return None
    cutoffs = np.linspace(LOWEST_HZ, _HIGHEST * rate, _STEPS)
    count = sum(len(span) for span in long)
    squares = [sum(float(np.sum((span - low_pass(span, rate, f)) ** 2)) for span in long) for f in cutoffs]
    residuals = np.sqrt(np.array(squares) / count)
    slow = cutoffs >= _SLOW_FROM * cutoffs[-1]
    told = residuals[slow] / np.sqrt([residual_share(rate, f) for f in cutoffs[slow]])
    noise = float(np.median(told))
    enough = np.flatnonzero(residuals <= noise)
    cutoff = float(cutoffs[enough[0]] if len(enough) else cutoffs[-1])
    return ResidualAnalysis(cutoffs, residuals, noise, cutoff, bool(told[0] <= _EVEN * told[-1]))
