"""Faulty recordings for the evaluation: each fault is what it says."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from capture.errors import RecordingError
from capture.recording import instants
from tests.known_limb import FRAMES
from track.evaluation.experiments import faulty_recordings
from track.evaluation.experiments.faults import EXPERIMENT
from track.evaluation.experiments.faulty_recordings import FAULTS, LIMBS, Scene, person
from track.evaluation.known import KnownRecording
from track.simulation.performance import Performance


@pytest.fixture
def scene(limb) -> Scene:
    known = KnownRecording(limb.recording, limb.subject.body, limb.thetas)
    performance = Performance(limb.subject.body, limb.times, limb.thetas)
    return Scene(known, performance, None, np.zeros((1, 3)))  # type: ignore[arg-type]


def test_frames_are_dropped_of_each_sensor_by_itself(scene, tmp_path):
    faulty = FAULTS["50 percent of frames dropped"](scene, tmp_path)
    counts = [len(sensor.frames) for sensor in faulty.sensors]
    assert all(2 <= count <= 10 for count in counts)
    assert {frozenset(moment.frames) for moment in instants(faulty)} > {frozenset({"sensor1", "sensor2"})}


def test_a_sensor_that_dies_leaves_the_other_one(scene, tmp_path):
    moments = instants(FAULTS["one sensor dies half-way"](scene, tmp_path))
    assert [len(moment.frames) for moment in moments] == [2] * (FRAMES // 2) + [1] * (FRAMES // 2)


def test_swapped_frames_are_refused(scene, tmp_path):
    with pytest.raises(RecordingError, match=r"frames\.csv: line \d+: time .* does not come after"):
        FAULTS["two frames swapped"](scene, tmp_path)


def test_images_swapped_unnoticed_keep_the_times(scene, tmp_path, monkeypatch):
    monkeypatch.setattr(faulty_recordings, "_SWAPPED", 3)
    swapped, clean = FAULTS["two images swapped unnoticed"](scene, tmp_path), scene.known.recording
    for before, after in zip(clean.sensors, swapped.sensors, strict=True):
        assert [frame.time_s for frame in before.frames] == [frame.time_s for frame in after.frames]
    changed = [a.path != b.path for a, b in zip(clean.sensors[0].frames, swapped.sensors[0].frames, strict=True)]
    assert np.flatnonzero(changed).tolist() == [FRAMES // 2, FRAMES // 2 + 3]


def test_salt_is_anywhere(scene, tmp_path):
    salted = FAULTS["10 percent salt in the depth"](scene, tmp_path)
    clean = scene.known.recording.sensors[0]
    before, after = (cv2.imread(str(s.frames[0].path), cv2.IMREAD_UNCHANGED) for s in (clean, salted.sensors[0]))
    assert np.mean(before != after) == pytest.approx(0.1, abs=0.005)


def test_sensors_that_disturb_each_other_leave_holes_and_wrong_rims(scene, tmp_path):
    disturbed = FAULTS["sensors disturb each other"](scene, tmp_path)
    clean = scene.known.recording.sensors[0]
    before, after = (cv2.imread(str(s.frames[0].path), cv2.IMREAD_UNCHANGED) for s in (clean, disturbed.sensors[0]))
    seen = before > 0
    assert 0.1 < np.mean(after[seen] == 0) < 0.3
    assert 0.02 < np.mean((after != before)[seen & (after > 0)]) < 0.12
    assert not after[~seen].any()


def test_depths_that_are_all_too_large_move_the_sensors_away(scene, tmp_path):
    larger = FAULTS["all depths 1 percent too large"](scene, tmp_path)
    far, before = (
        np.array([np.linalg.norm(s.world_from_sensor[:3, 3]) for s in one.calibration.sensors.values()])
        for one in (larger, scene.known.recording)
    )
    assert far / before == pytest.approx(1.01, abs=0.002)


def test_somebody_is_of_a_persons_size():
    vertices, faces = person()
    assert faces.min() == 0
    assert faces.max() == len(vertices) - 1
    assert np.ptp(vertices, axis=0) == pytest.approx([0.24, 1.75, 0.58], abs=0.02)


def test_the_page_tells_what_was_refused_and_what_was_lost():
    tracked = {
        "frames": 105,
        "lost": 3,
        "flexion_deg": [1.0, 7.0],
        "centre_mm": [2.0],
        "how": {"found": 2, "backward": 4},
        "claimed_while_hidden": 1,
        "found_after_s": 0.25,
    }
    results = {"arm hidden for 2 s": tracked, "arm two frames swapped": {"refused": "line 21"}}
    text = EXPERIMENT.describe(results, Path())
    assert "| hidden for 2 s | 105 | 3 | 4.00 ± 3.00 (7.00) | 1 | 2.00 ± 0.00 (2.00) | 2 | 4 |" in text
    assert "| two frames swapped | - | refused: line 21 |" in text
    assert "1 frames are claimed; the limb is tracked again 0.25 s after" in text
    assert set(LIMBS) == {case.split(" ", 1)[0] for case in EXPERIMENT.cases}
