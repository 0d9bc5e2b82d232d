"""A recording in a few lines of words, as the commands print it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from capture.console import stdout

if TYPE_CHECKING:
    from capture.recording import Recording


def print_recording(recording: Recording) -> None:
    """What each sensor recorded, and how the recording was made."""
    for sensor in recording.sensors:
        camera = sensor.camera
        colour = "" if sensor.colour is None else f", {len(sensor.colour.frames)} colour images"
        box = f", {len(sensor.box_frames)} of the box" if sensor.box_frames else ""
        stdout.print(
            f"{recording.path}: {len(sensor.frames)} frames of {camera.width} x {camera.height} px, "
            f"unit {sensor.depth_unit_m * 1000:g} mm, fx {camera.fx:.1f} px{box}{colour}",
            highlight=False,
            soft_wrap=True,
        )
    stdout.print(recording.created_by, highlight=False, soft_wrap=True)
