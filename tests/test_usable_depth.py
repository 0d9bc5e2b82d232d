"""Depth of which hardly anything can be used is refused before a limb is searched in it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from adapt.adapt_recording import adapt_recording
from adapt.anatomy import Anatomy
from capture.camera import Camera
from capture.errors import RecordingError
from capture.recording import Recording, RecordingWriter, Sensor, open_recording, refuse_useless_depth

CAMERA = Camera(40, 30, 40.0, 40.0, 19.5, 14.5)


def filmed(path, readings, *, unit_m=0.001) -> Recording:
    """A recording of a good sensor, and of one that gave these readings (H, W)."""
    sensors = [Sensor("good", CAMERA), Sensor("other", CAMERA, depth_unit_m=unit_m)]
    with RecordingWriter(path, sensors=sensors, created_by="test") as writer:
        for k in range(8):
            writer.add_frame("good", np.full((30, 40), 1000 + k, np.uint16), k / 30.0)
            writer.add_frame("other", (readings + (k % 2)).astype(np.uint16), k / 30.0)
    return open_recording(path)


@pytest.mark.parametrize(
    ("reading", "unit_m", "said"),
    [(12000, 0.001, "ten times smaller"), (150, 0.001, "ten times larger"), (1200, 1.0, "1000 times smaller")],
)
def test_depth_in_another_unit_is_refused_by_the_sensors_name_with_the_likely_one(tmp_path, reading, unit_m, said):
    recording = filmed(tmp_path / "rec", np.full((30, 40), reading), unit_m=unit_m)
    with pytest.raises(
        RecordingError, match=r"sensor 'other' has depth from .* of which 0% lies in its range"
    ) as refused:
        refuse_useless_depth(recording)
    assert f"a depth_unit_m {said}" in refused.value.remedy


def test_adapting_refuses_it_before_it_searches(tmp_path, arm: Anatomy):
    recording = filmed(tmp_path / "rec", np.full((30, 40), 12000))
    with pytest.raises(RecordingError, match="sensor 'other' has depth from"):
        adapt_recording(recording, arm)


def test_a_range_set_close_around_a_limb_is_meant_so(tmp_path):
    readings = np.full((30, 40), 9000)
    readings[10:14, 10:14] = 1200
    refuse_useless_depth(filmed(tmp_path / "rec", readings))


def test_a_sensor_that_saw_nothing_says_nothing(tmp_path):
    recording = filmed(tmp_path / "rec", np.full((30, 40), 1200))
    with RecordingWriter(tmp_path / "empty", sensors=[replace(recording.sensors[0])], created_by="test") as writer:
        writer.add_frame("good", np.zeros((30, 40), np.uint16), 0.0)
    refuse_useless_depth(open_recording(tmp_path / "empty"))
