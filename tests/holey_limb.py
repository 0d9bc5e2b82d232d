"""Motions with lost frames and a hidden bone, for the readers of exported files."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from adapt.anatomy_file import load_anatomy
from adapt.model.body import Body
from adapt.subject import Subject
from capture.upright import AXES
from tests.known_limb import known_subject
from tests.test_export_readers import LOST, holey_motion
from track.evaluation.random_bodies import random_body
from track.export.upright import y_up
from track.motion import Motion

UP = AXES["-y"]
KNOWN = [t for t in range(9) if t not in LOST]


@dataclass(frozen=True, eq=False)
class HoleyLimb:
    subject: Subject
    motion: Motion

    @property
    def body(self) -> Body:
        return self.subject.body

    def turned(self, points: np.ndarray) -> np.ndarray:
        """Points (..., 3) of the recording's frame with y up."""
        return points @ y_up(UP)[:3, :3].T


@pytest.fixture(scope="module", params=["upper-limb-right", "lower-limb-left"])
def holey(request: pytest.FixtureRequest) -> HoleyLimb:
    body = random_body(load_anatomy(request.param), 3)
    subject = known_subject(body, np.zeros((0, len(body.anatomy.coordinates))), np.zeros(0))
    return HoleyLimb(subject, holey_motion(subject))
