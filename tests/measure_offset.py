"""Measures how well motion tells the offset of two sensors.

``python -m tests.measure_offset``: for each of 20 performances of a block a pair of sensors that saw the same, and a
pair of which the second saw another; 14 s at 30 and 25 Hz, 40 degrees apart, noise of 2 mm at 1 m, times unsteady by
2 ms.

``python -m tests.measure_offset REC``: a recording of two sensors by one clock, of which the second's beginning is cut
away, for instance a simulated one of the motion that ``python -m tests.measure_offset --motion FILE.csv`` writes.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from scipy.interpolate import PchipInterpolator

from capture.console import stdout
from capture.errors import RecordingError
from capture.importers import DepthFrame, MotionSignal, Offset, Source, estimate_offset, motion_of
from capture.recording import Sensor, depth_png, open_recording
from tests.test_import_offset import NAME, performance, two_views

COUNT = 20
CUTS_S = (0.5, 1.234, 2.0)
ARM_DEG = {
    "shoulder_rx": (-23, 23),
    "shoulder_ry": (-17, 17),
    "shoulder_rz": (-23, 23),
    "elbow_flexion": (11, 109),
    "pro_sup": (-46, 46),
}


def found(first: MotionSignal, second: MotionSignal) -> Offset | None:
    """The offset found, None if it was refused."""
    try:
        return estimate_offset(first, second, where=NAME)
    except RecordingError:
        return None


def blocks() -> None:
    """Print the errors for the performances of a block."""
    true = np.random.default_rng(0).uniform(-3.0, 3.0, COUNT)
    same = [found(*two_views(performance(seed), offset_s=float(true[seed]))) for seed in range(COUNT)]
    other = [found(*two_views(performance(s), offset_s=0.0, other=performance(s + 1000))) for s in range(COUNT)]
    error = np.array([one.seconds - true[seed] for seed, one in enumerate(same) if one is not None])
    stated = np.array([one.deviation_s for one in same if one is not None])
    stdout.print(f"the same performance: {len(error)} of {COUNT} found, {COUNT - len(error)} refused")
    stdout.print(
        f"error: {1e3 * np.sqrt((error**2).mean()):.1f} ms root mean square, {1e3 * abs(error).max():.1f} largest"
    )
    stdout.print(f"error in stated deviations: root mean square {np.sqrt(((error / stated) ** 2).mean()):.2f}")
    stdout.print(f"another performance: {sum(one is None for one in other)} of {COUNT} refused")


def recording(path: Path) -> None:
    """Print the errors for a recording whose second sensor begins later."""
    first, second = open_recording(path).sensors[:2]
    whole = motion_of(_from(first, 0.0))
    for cut_s in CUTS_S:
        late = next(frame.time_s for frame in second.frames if frame.time_s >= cut_s) - first.frames[0].time_s
        one = found(whole, motion_of(_from(second, cut_s)))
        told = "refused"
        if one is not None:
            error_ms, stated_ms = 1e3 * (one.seconds - late), 1e3 * one.deviation_s
            told = f"error {error_ms:.1f} ms, stated {stated_ms:.1f} ms, correlation {one.correlation:.2f}"
        stdout.print(f"begins {late:.3f} s later: {told}")


def _from(sensor: Sensor, start_s: float) -> Source:
    size = {"width": sensor.camera.width, "height": sensor.camera.height}
    kept = (frame for frame in sensor.frames if frame.time_s >= start_s)
    frames = (DepthFrame(frame.time_s, depth_png.read_readings(frame.path, **size)) for frame in kept)
    return Source(sensor, frames, times="the recording")


def write_motion(path: Path) -> None:
    """Write 12 s of an arm that moves at random, 30 Hz."""
    random = np.random.default_rng(3)
    times = np.arange(0.0, 12.0, 1.0 / 30.0)
    knots = np.concatenate([[0.0], np.cumsum(random.uniform(0.3, 1.3, 40))])
    angles = [PchipInterpolator(knots, np.deg2rad(random.uniform(*limits, 41)))(times) for limits in ARM_DEG.values()]
    header = ",".join(["time", *ARM_DEG])
    np.savetxt(path, np.column_stack([times, *angles]), delimiter=",", header=header, comments="", fmt="%.6f")


if __name__ == "__main__":
    arguments = sys.argv[1:]
    if arguments[:1] == ["--motion"]:
        write_motion(Path(arguments[1]))
    elif arguments:
        recording(Path(arguments[0]))
    else:
        blocks()
