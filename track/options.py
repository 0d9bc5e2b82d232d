"""What may be asked of tracking: the command, the journal's key and a motion's settings have it from here."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from adapt.anatomy import Floats
from capture.provenance import recording_used, region_used, sensors_used, versions
from capture.recording import Recording, Region
from capture.upright import up_direction
from track.motion import MotionError
from track.poses_by_hand import HandPose
from track.settings import Settings
from track.thresholds import USUAL, Thresholds


@dataclass(frozen=True, eq=False)
class TrackOptions:
    """What is asked of tracking.

    Attributes:
        region: where the limb is, instead of the recording's or the automatic region.
        poses: set by hand for single frames; tracking starts from each, onward and back into the gap before it.
        world_from_thorax: (4, 4), if ISB's thoraco-humeral angles are wanted.
        keep_searching: go on where neither the first frame nor a few others show the subject.
        thresholds: what decides whether a frame is tracked and a limb is searched.

    >>> TrackOptions(keep_searching=True).thresholds.least_coverage
    0.75
    """

    region: Region | None = None
    poses: Sequence[HandPose] = ()
    world_from_thorax: Floats | None = None
    keep_searching: bool = False
    thresholds: Thresholds = USUAL

    def by_frame(self, frames: int) -> dict[int, Floats]:
        """The poses set by hand (n,), by frame.

        Raises:
            MotionError: one is of a frame that is not among so many.
        """
        strange = [pose for pose in self.poses if not 0 <= pose.frame < frames]
        if strange:
            problem = f"pose {strange[0].name!r} is of frame {strange[0].frame}"
            raise MotionError(problem, remedy=f"frames run from 0 to {frames - 1}")
        return {pose.frame: pose.theta for pose in self.poses}

    def decide(self, region: Region) -> list[Floats | str]:
        """The options one by one, as a frame's pose depends on them: for the key of a journal.

        The ``region`` is the one that is used. What is left out changes no pose: the thorax what is written of poses,
        ``keep_searching`` whether any are looked for at all.
        """
        given = sorted(self.poses, key=lambda pose: pose.frame)
        hands = [part for pose in given for part in (str(pose.frame), pose.theta)]
        return [region.minimum, region.maximum, *hands, repr(self.thresholds)]

    def used(self, recording: Recording, *, subject: str, thresholds: Mapping[str, float]) -> Settings:
        """What a motion says of how it was tracked: the ``subject``'s fingerprint, and all thresholds by name."""
        options = {
            **recording_used(recording),
            "up": up_direction(recording).tolist(),
            "subject_fingerprint": subject,
            **region_used(recording, self.region),
            **sensors_used(recording),
            "poses_by_hand": [{"name": pose.name, "frame": pose.frame} for pose in self.poses],
            "world_from_thorax": None if self.world_from_thorax is None else self.world_from_thorax.tolist(),
        }
        return Settings(versions(), options, dict(thresholds))


AS_USUAL = TrackOptions()
"""The whole recording, as its region and the usual thresholds have it."""
