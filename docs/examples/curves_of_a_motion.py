"""The curves of a motion, in Python.

python docs/examples/curves_of_a_motion.py MOTION
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from adapt.anatomy_file import load_anatomy
from track.curves.motion_curves import CurvesOptions, motion_curves
from track.curves.ranges import range_of
from track.motion import load_motion


def main(path: Path) -> None:
    """Ranges, speeds and the mean cycle of every angle."""
    motion = load_motion(path)
    found = motion_curves(motion, load_anatomy(motion.anatomy), CurvesOptions(cutoff_hz=6.0))
    for name, curve in found.curves.items():
        moved = range_of(curve, found.times)
        if moved is None:
            continue
        degrees, unsure, speed = np.rad2deg([moved.span, moved.span_sd, np.nanmax(np.abs(curve.velocity.value))])
        middle = np.rad2deg(found.cycle_curves(name, "angle").mean[50])
        sys.stdout.write(
            f"{curve.words.label}: moves {degrees:.1f} ± {unsure:.1f} degrees, at up to {speed:.0f} degrees a second\n"
            f"  in the middle of the mean {found.kind}: {middle:.1f} degrees ({len(found.cycles)} cycles)\n"
        )


if __name__ == "__main__":
    main(Path(sys.argv[1]))
