"""Joint angles over time as a picture, with their uncertainty, the truth where it is known, and what was lost."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from adapt.anatomy import Anatomy, Floats
from adapt.model.pose_space import joint_coordinates
from adapt.plain_words import plain_words
from capture.own import PNG, replaced_if_own
from track.motion import Motion
from track.observed_bones import known_thetas

_LOST = "; red: frames that were lost"


def plot_angles(
    motion: Motion, anatomy: Anatomy, path: Path, *, true_times: Floats | None = None, true_thetas: Floats | None = None
) -> None:
    """Write a PNG with one panel per coordinate that is not a free joint's: degrees over seconds, band of two SD.

    Where a coordinate is not known there is a gap; frames that were lost are marked.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    shown = joint_coordinates(anatomy)
    known = known_thetas(anatomy, motion.thetas, motion.shown)
    figure = Figure(figsize=(9, 1.9 * len(shown)), layout="constrained")
    FigureCanvasAgg(figure)
    for axes, i in zip(figure.subplots(len(shown), sharex=True, squeeze=False)[:, 0], shown, strict=True):
        angle, spread = np.rad2deg(known[:, i]), 2.0 * np.rad2deg(motion.deviations[:, i])
        if true_times is not None and true_thetas is not None:
            axes.plot(true_times, np.rad2deg(true_thetas[:, i]), color="black", lw=2.5, alpha=0.3, label="truth")
        axes.fill_between(motion.times, angle - spread, angle + spread, color="tab:blue", alpha=0.25, lw=0)
        axes.plot(motion.times, angle, color="tab:blue", lw=1.2, label="tracked, ±2 SD")
        for time in motion.times[~motion.tracked]:
            axes.axvline(time, color="tab:red", alpha=0.4)
        told = plain_words(anatomy.coordinates[i].name).label.replace(" (", "\n(")
        axes.set_ylabel(f"{told}\n(deg)", fontsize="small")
    axes.set_xlabel("time (s)")
    figure.suptitle(
        f"{anatomy.name}: joint angles over time" + (_LOST if not motion.tracked.all() else ""), fontsize=11
    )
    figure.axes[0].legend(loc="upper right", fontsize="small")
    with replaced_if_own(path, PNG) as partial:
        figure.savefig(partial, dpi=110, metadata={"Software": "bonetrack"})
