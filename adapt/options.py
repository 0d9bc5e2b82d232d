"""What may be asked of an adaptation: the command, the search, the journal's key and the report have it from here."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from adapt.anatomy import Floats
from adapt.model.shape.population import ANYBODY, Person
from capture.provenance import recording_used, region_used, sensors_used, versions
from capture.recording import Recording, Region


@dataclass(frozen=True, eq=False)
class AdaptOptions:
    """Every automatic choice can be overridden.

    Attributes:
        poses: how many example poses to choose (4 to 8).
        frames: indices of instants to adapt to, instead of the automatic choice.
        first_poses: theta (n,) by index of instant, instead of the automatic search; these instants are looked at.
        region: where the limb is, instead of the recording's or the automatic region.
        person: height, mass and sex, as far as they are stated.

    >>> AdaptOptions(poses=4).frames is None
    True
    """

    poses: int = 6
    frames: Sequence[int] | None = None
    first_poses: Mapping[int, Floats] = field(default_factory=dict)
    region: Region | None = None
    person: Person = ANYBODY

    def decide(self, recording: Recording) -> list[Floats | str]:
        """The options one by one, as what is found depends on them: for the key of a journal."""
        region = self.region or recording.region
        given = [part for frame, theta in sorted(self.first_poses.items()) for part in (str(frame), theta)]
        corners = [] if region is None else [region.minimum, region.maximum]
        stated = [] if self.person.is_unknown else [repr(self.person)]
        return [f"{self.poses} {self._frames()}", *given, *stated, "region", *corners]

    def used(self, recording: Recording, *, example_poses: int) -> dict[str, Any]:
        """What the report says of how a subject was made: plain JSON."""
        return {
            "versions": versions(),
            **recording_used(recording),
            **region_used(recording, self.region),
            "example_poses": self.poses if self.frames is None else example_poses,
            **sensors_used(recording),
            "frames_given": self._frames(),
            "first_poses_given": sorted(self.first_poses),
        }

    def _frames(self) -> list[int] | None:
        """The given frames, each once, in order."""
        return None if self.frames is None else sorted(set(self.frames))


AS_USUAL = AdaptOptions()
"""Everything is chosen automatically."""
