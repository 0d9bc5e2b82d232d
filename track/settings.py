"""With what a motion was tracked: versions, what was asked for, and the thresholds that decided."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from capture.recording import Region


@dataclass(frozen=True)
class Settings:
    """Plain JSON by name: versions of the software, options, and thresholds (SI units, stated at the names' ends).

    ``places`` are those of the subject and the recording (``track.whereabouts``).
    """

    versions: Mapping[str, str] = field(repr=False)
    options: Mapping[str, Any]
    thresholds: Mapping[str, float] = field(repr=False)
    places: Mapping[str, Sequence[str]] = field(default_factory=dict, repr=False)

    @property
    def region(self) -> Region:
        """Where the limb was looked for."""
        return Region(np.array(self.options["region_minimum_m"]), np.array(self.options["region_maximum_m"]))
