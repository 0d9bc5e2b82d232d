"""A motion in a few lines of words, as the commands print it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from adapt.commands import print_sensors
from capture.console import stdout

if TYPE_CHECKING:
    from adapt.subject import Subject
    from track.motion import Motion


def print_motion(motion: Motion, subject: Subject) -> None:
    """A short summary: frames tracked, how well, which bones did not show in them, and why others were lost."""
    import numpy as np

    from adapt.subject import doubts

    tracked = motion.tracked
    if motion.settings is not None:
        print_sensors(motion.settings.options)
    stdout.print(f"{int(tracked.sum())} of {len(tracked)} frames tracked", highlight=False)
    if tracked.any():
        residual = 1e3 * float(np.median(motion.residuals[tracked]))
        coverage = 100.0 * float(np.median(motion.coverage[tracked]))
        stdout.print(f"skin to cloud {residual:.2f} mm (median), {coverage:.0f} % of the skin in sight found")
    for doubt in doubts(subject):
        stdout.print(doubt, highlight=False)
    for how, told in _HOW.items():
        if count := motion.how.count(how):
            stdout.print(f"{count} {told}", highlight=False)
    for name, shown in zip(motion.transforms, motion.shown.T, strict=True):
        if hidden := int((tracked & ~shown).sum()):
            stdout.print(f"{name} does not show in {hidden} of the frames tracked", highlight=False)
    for number in np.flatnonzero(~tracked)[:5]:
        stdout.print(f"lost at {motion.times[number]:.3f} s: {motion.lost[number]}")
    if (~tracked).sum() > 5:
        stdout.print(f"... and {int((~tracked).sum()) - 5} more, see quality.csv")


_HOW = {
    "found": "found by search",
    "by hand": "tracked from poses set by hand",
    "backward": "tracked again, backward from a later frame",
}
