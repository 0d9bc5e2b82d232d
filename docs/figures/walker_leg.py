"""One leg of the walker, adapted and tracked, and what of the recording shows it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from adapt.anatomy import Floats
from adapt.model.body import Body, bone_transforms
from adapt.subject import Subject
from capture.rigid import apply
from track.motion import Motion

SOURCE = "gait_legs_walker"
BOTH = (-0.19, -0.6, 0.6, 0.19, 0.24, 1.7)


@dataclass(frozen=True)
class Leg:
    """One leg's subject and motion."""

    side: str
    subject: Subject
    motion: Motion

    @property
    def body(self) -> Body:
        """The adapted leg."""
        return self.subject.body

    @cached_property
    def joints(self) -> Floats:
        """Knee, ankle and ball of the foot (T, 3, 3) m, each carried by the shank or the foot; NaN where lost."""
        anatomy = self.body.anatomy
        points = np.full((len(self.motion.times), 3, 3), np.nan)
        rest = self.body.p.value
        carriers = (("tibia", "knee"), ("tibia", "talus"), ("foot", "MT2_head"))
        for t in np.flatnonzero(self.motion.tracked):
            moved = bone_transforms(self.body, self.motion.thetas[t])
            for j, (bone, landmark) in enumerate(carriers):
                points[t, j] = apply(moved[bone], rest[anatomy.landmark_index(landmark)][None])[0]
        return points


FLOOR_UP = np.array([0.0, -0.79, -0.61]) / np.linalg.norm([0.79, 0.61])  # the floor's normal in the sensor's frame
