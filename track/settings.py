"""With what a motion was tracked: versions, what was asked for, and the thresholds that decided."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from adapt.anatomy import Floats
from capture.provenance import recording_used, region_used, sensors_used, versions
from capture.recording import Recording, Region
from track.poses_by_hand import HandPose


@dataclass(frozen=True)
class Settings:
    """Plain JSON by name: versions of the software, options, and thresholds (SI units, stated at the names' ends)."""

    versions: Mapping[str, str] = field(repr=False)
    options: Mapping[str, Any]
    thresholds: Mapping[str, float] = field(repr=False)

    @property
    def region(self) -> Region:
        """Where the limb was looked for."""
        return Region(np.array(self.options["region_minimum_m"]), np.array(self.options["region_maximum_m"]))


def settings_of(
    recording: Recording,
    thresholds: Mapping[str, float],
    *,
    subject: str,
    region: Region | None,
    poses: Sequence[HandPose],
    world_from_thorax: Floats | None,
) -> Settings:
    """What a recording is tracked with: the ``subject``'s fingerprint, and the ``region`` that is given, if any."""
    options = {
        **recording_used(recording),
        "subject_fingerprint": subject,
        **region_used(recording, region),
        **sensors_used(recording),
        "poses_by_hand": [{"name": pose.name, "frame": pose.frame} for pose in poses],
        "world_from_thorax": None if world_from_thorax is None else world_from_thorax.tolist(),
    }
    return Settings(versions(), options, dict(thresholds))
