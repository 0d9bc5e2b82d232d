"""Which frames of a motion were tracked, as a strip over time for a page or a notebook."""

from __future__ import annotations

from html import escape

import numpy as np

from adapt.anatomy import Floats
from track.observed_bones import Bools

_KINDS = (("all bones show", "#4d8f5b"), ("some do not show", "#e0a030"), ("lost", "#c0392b"))
_WIDTH = 640  # px


def strip(name: str, times: Floats, tracked: Bools, shown: Bools) -> str:
    """HTML of frames at times (T,) s, tracked (T,) or not, in which bones (T, B) show or do not.

    >>> print(strip("arm", np.array([0.0, 0.1]), np.array([True, False]), np.ones((2, 1), dtype=bool)))
    <div><b>arm</b>: 1 of 2 frames tracked, 0.00 to 0.10 s<br><svg width="100%" height="14" viewBox="0 0 640 14"
    preserveAspectRatio="none"><rect x="0.00" width="320.00" height="14" fill="#4d8f5b"/><rect x="320.00"
    width="320.00" height="14" fill="#c0392b"/></svg><br><span style="color:#4d8f5b">■</span> all bones show: 1 &nbsp;
    <span style="color:#c0392b">■</span> lost: 1</div>
    """
    kind = np.where(~tracked, 2, np.where(shown.all(axis=1), 0, 1))
    edges = np.flatnonzero(np.diff(kind, prepend=-1, append=-1)) * _WIDTH / max(len(kind), 1)
    firsts = kind[np.flatnonzero(np.diff(kind, prepend=-1))]
    bars = [
        f'<rect x="{left:.2f}" width="{right - left:.2f}" height="14" fill="{_KINDS[k][1]}"/>'
        for k, left, right in zip(firsts, edges[:-1], edges[1:], strict=True)
    ]
    words = [
        f'<span style="color:{colour}">■</span> {what}: {int((kind == k).sum())}'
        for k, (what, colour) in enumerate(_KINDS)
        if (kind == k).any()
    ]
    said = f"{int(tracked.sum())} of {len(tracked)} frames tracked"
    span = f", {times[0]:.2f} to {times[-1]:.2f} s" if len(times) else ""
    size = f'width="100%" height="14" viewBox="0 0 {_WIDTH} 14" preserveAspectRatio="none"'
    picture = f"<svg {size}>{''.join(bars)}</svg>"
    return f"<div><b>{escape(name)}</b>: {said}{span}<br>{picture}<br>{' &nbsp; '.join(words)}</div>"
