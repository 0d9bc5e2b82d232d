"""Command: the point cloud of one instant."""

from __future__ import annotations

from pathlib import Path

import click

from capture.commands.region_options import near_option, region_near, region_option
from capture.commands.written_file import WrittenFile
from capture.console import stdout
from capture.errors import RecordingError

_PATH = click.Path(path_type=Path)


@click.command("fuse")
@click.argument("recording", type=_PATH)
@click.option("--frame", type=click.IntRange(0), required=True, help="Which instant, counted from 0.")
@click.option("--out", type=WrittenFile(".ply", "PLY"), required=True, help="The point cloud to write (.ply).")
@region_option
@near_option
def fuse_command(
    recording: Path, frame: int, out: Path, region: tuple[float, ...] | None, near: tuple[float, ...] | None
) -> None:
    """Write the point cloud of one instant of RECORDING: cleaned, culled, with normals."""
    import numpy as np

    from capture.cloud.fuse import fuse, write_ply
    from capture.provenance import region_used, sensors_in_words
    from capture.recording import instants, open_recording

    opened = open_recording(recording)
    every = instants(opened)
    if frame >= len(every):
        raise RecordingError(f"has no frame {frame}", where=recording, remedy=f"its frames are 0 to {len(every) - 1}")
    chosen = region_near(opened, region, near)
    cloud = fuse(opened, every[frame], region=chosen)
    write_ply(cloud, out)
    for line in sensors_in_words(region_used(opened, chosen)):
        stdout.print(line, highlight=False, soft_wrap=True)
    if opened.common_frame_is_sensor:
        stdout.print("not calibrated: coordinates are the sensor's own (x right, y down, z forward)", highlight=False)
    stdout.print(
        f"{out}: {len(cloud.points)} points from {len(cloud.views)} sensor(s) at {every[frame].time_s:.3f} s, "
        f"{cloud.boundary.mean():.0%} on the scan's boundary",
        highlight=False,
        soft_wrap=True,
    )
    sides = " x ".join(f"{side:.2f}" for side in cloud.points.max(axis=0) - cloud.points.min(axis=0))
    stdout.print(f"extent {sides} m", highlight=False, soft_wrap=True)
    for number, view in enumerate(cloud.views):
        apart = cloud.points[cloud.sensor == number] - view.world_from_sensor[:3, 3]
        told = (
            f"{float(np.median(np.linalg.norm(apart, axis=1))):.2f} m away (median)"
            if len(apart)
            else "saw nothing of it"
        )
        stdout.print(f"{view.sensor}: {told}", highlight=False, soft_wrap=True)
