"""Per-frame quality as a table: how sure each frame is, which bones do not show, and why a frame was lost."""

from __future__ import annotations

import csv
import re
from pathlib import Path

import numpy as np

from adapt.anatomy import Anatomy
from capture.own import Mark, replaced_if_own
from track.motion import Motion
from track.observed_bones import coordinates_known

_FIRST, _LAST = ("time_s", "tracked", "residual_mm", "coverage", "matches"), ("hidden", "lost_because", "how")
QUALITY = Mark(re.compile(rb"\A%b(,sd_\w+)+,%b\r?\n" % (",".join(_FIRST).encode(), ",".join(_LAST).encode())))
"""Of any anatomy's coordinates."""


def write_quality(path: Path, motion: Motion, anatomy: Anatomy) -> None:
    """Write time, state, fit quality, one standard deviation per coordinate (deg or mm), hidden bones as CSV.

    Deviations are nan where a coordinate is not known; of a tracked frame bones that do not show are named, and how its
    pose was come by (from the frame before, by search, from a pose set by hand, backward from a later frame).
    """
    rotational = np.array([coordinate.unit == "rad" for coordinate in anatomy.coordinates])
    deviations = motion.deviations * np.where(rotational, 180.0 / np.pi, 1e3)
    deviations[~coordinates_known(anatomy, motion.shown)] = np.nan
    how = motion.how or ("",) * len(motion.times)
    units = ["deg" if turn else "mm" for turn in rotational]
    header = [*_FIRST, *(f"sd_{name}_{unit}" for name, unit in zip(motion.coordinates, units, strict=True)), *_LAST]
    with replaced_if_own(path, QUALITY) as partial, partial.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(header)
        for t, time in enumerate(motion.times):
            quality = [f"{1e3 * motion.residuals[t]:.3f}", f"{motion.coverage[t]:.3f}", int(motion.matches[t])]
            spread = [f"{value:.4f}" for value in deviations[t]]
            hidden = "" if motion.lost[t] else " ".join(motion.hidden(t))
            writer.writerow([f"{time:.6f}", int(not motion.lost[t]), *quality, *spread, hidden, motion.lost[t], how[t]])
