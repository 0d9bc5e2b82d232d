"""A motion as one tidy table for pandas: a row for every frame and coordinate."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from adapt.subject import Subject
from track.belonging import refuse_other_subject
from track.motion import Motion, MotionError
from track.observed_bones import coordinates_known

if TYPE_CHECKING:
    import pandas


def tidy_angles(motion: Motion, subject: Subject) -> pandas.DataFrame:
    """Coordinates of a motion, a row for every frame and coordinate.

    Columns: ``frame``, ``time_s``, ``coordinate``, ``unit`` (deg or m), ``value`` and ``sd`` (one standard deviation)
    in that unit, missing where not known, and ``lost_because`` (empty where the frame was tracked).

    Raises:
        MotionError: pandas is not installed, or the motion is one of another subject.
    """
    try:
        import pandas
    except ImportError as error:
        raise MotionError("a tidy table needs pandas", remedy="pip install 'bonetrack[pandas]'") from error
    refuse_other_subject(motion, subject)
    anatomy, count = subject.anatomy, len(motion.times)
    turns = np.array([coordinate.unit == "rad" for coordinate in anatomy.coordinates])
    scale = np.where(coordinates_known(anatomy, motion.shown), np.where(turns, 180.0 / np.pi, 1.0), np.nan)
    names = [coordinate.name for coordinate in anatomy.coordinates]
    return pandas.DataFrame(
        {
            "frame": np.repeat(np.arange(count), len(names)),
            "time_s": np.repeat(motion.times, len(names)),
            "coordinate": pandas.Categorical(np.tile(names, count), categories=names),
            "unit": np.tile(np.where(turns, "deg", "m"), count),
            "value": (scale * motion.thetas).ravel(),
            "sd": (scale * motion.deviations).ravel(),
            "lost_because": np.repeat(motion.lost, len(names)),
        }
    )
