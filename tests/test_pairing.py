"""Which frames belong together, which are used, and which are told apart as impossible or stale."""

from __future__ import annotations

import numpy as np
import pytest

from capture.camera import Camera
from capture.errors import RecordingError
from capture.provenance import sensors_in_words, sensors_used
from capture.recording import (
    RecordingWriter,
    Sensor,
    frames_used,
    instants,
    open_recording,
    refuse_impossible_rates,
    used_in_words,
)

CAMERA = Camera(40, 30, 40.0, 40.0, 19.5, 14.5)


def written(path, times, images=None):
    """A recording of sensors with frames at these times; image k of a sensor shows what ``images`` says, else k."""
    with RecordingWriter(path, sensors=[Sensor(name, CAMERA) for name in times], created_by="test") as writer:
        for name, seconds in times.items():
            for k, time_s in enumerate(seconds):
                shown = k if images is None else images[name][k]
                writer.add_frame(name, np.full((30, 40), 1.0 + 0.01 * shown), time_s)
    return open_recording(path)


@pytest.mark.parametrize("rate", [10.0, 15.0, 20.0, 30.0, 60.0, 90.0])
@pytest.mark.parametrize("phase", [0.0, 0.2, 0.35, 0.5, 0.65, 0.9])
def test_a_free_running_sensor_is_used_whatever_its_phase(tmp_path, rate, phase):
    rng, ticks = np.random.default_rng(1), np.arange(60)
    trembling = 0.02 / rate * rng.standard_normal((2, 60))
    times = {"a": (ticks + 1.0) / rate + trembling[0], "b": (ticks + 1.0 + phase) / rate + trembling[1]}
    for used in frames_used(written(tmp_path / "rec", times)):
        assert used.used >= 58
        assert not used.few


@pytest.mark.parametrize("phase_ms", [17.0, 20.0, 25.0])
def test_at_20_hz_no_phase_falls_between_paired_and_alone(tmp_path, phase_ms):
    ticks = np.arange(60) / 20.0
    moments = instants(written(tmp_path / "rec", {"a": ticks, "b": ticks + phase_ms / 1e3}))
    assert sum(len(moment.frames) for moment in moments) == 120
    assert sum(len(moment.frames) == 2 for moment in moments) >= 59


def test_a_slower_sensor_is_used_whole_at_its_own_rate(tmp_path):
    recording = written(tmp_path / "rec", {"a": np.arange(90) / 30.0, "b": np.arange(15) / 5.0 + 0.013})
    assert [used.used for used in frames_used(recording)] == [90, 15]


def test_a_faster_sensor_is_used_whole_though_a_slower_one_has_more_frames(tmp_path):
    times = {"long": np.arange(150) / 30.0, "short": 1.0 + np.arange(120) / 60.0 + 0.003}
    assert [used.used for used in frames_used(written(tmp_path / "rec", times))] == [150, 120]


def test_few_used_frames_are_said_by_name(tmp_path):
    images = {"a": range(20), "b": [0, *[1] * 15, *range(2, 6)]}
    times = {name: np.arange(20) / 30.0 for name in images}
    used = frames_used(written(tmp_path / "rec", times, images))
    assert [(one.used, one.stale) for one in used] == [(20, 0), (6, 14)]
    assert "only 6 of 20 frames of sensor 'b'" in used_in_words(used)[1]


def test_an_image_that_a_sensor_repeats_while_another_sees_time_go_on_is_left_out(tmp_path):
    images = {"a": range(10), "b": [0, 1, 2, 2, 2, 2, 2, 3, 4, 5]}
    moments = instants(written(tmp_path / "rec", {name: np.arange(10) / 30.0 for name in images}, images))
    assert [set(moment.frames) for moment in moments[3:7]] == [{"a"}] * 4
    assert all(len(moment.frames) == 2 for moment in moments[:3] + moments[7:])


def test_a_scene_in_which_nothing_moves_is_not_stale(tmp_path):
    images = {"a": [0] * 5, "b": [0] * 5}
    moments = instants(written(tmp_path / "rec", {name: np.arange(5) / 30.0 for name in images}, images))
    assert all(len(moment.frames) == 2 for moment in moments)


def test_a_lone_sensor_that_hangs_is_found_by_its_own_other_images(tmp_path):
    recording = written(tmp_path / "rec", {"a": np.arange(6) / 30.0}, {"a": [0, 1, 1, 1, 2, 3]})
    assert [moment.time_s for moment in instants(recording)] == pytest.approx([0.0, 1 / 30, 4 / 30, 5 / 30])


def test_clocks_without_a_common_time_are_named(tmp_path):
    recording = written(tmp_path / "rec", {"left": np.arange(5) / 30.0, "right": 100.0 + np.arange(5) / 30.0})
    with pytest.raises(RecordingError, match=r"no time in common: 'left' 0.00 to 0.13 s and 'right' 100.00"):
        instants(recording)


@pytest.mark.parametrize(
    ("step", "unit"),
    [(33.3, "milliseconds"), (33_300.0, "microseconds"), (33_300_000.0, "nanoseconds"), (1 / 30 / 60, "minutes")],
)
def test_times_in_another_unit_are_refused_with_the_likely_one(tmp_path, step, unit):
    recording = written(tmp_path / "rec", {"a": np.arange(5) * step})
    with pytest.raises(RecordingError, match="which no sensor has") as refused:
        refuse_impossible_rates(recording)
    assert unit in refused.value.remedy


@pytest.mark.parametrize("rate", [1.5, 5.0, 30.0, 90.0, 300.0])
def test_rates_of_real_sensors_pass(tmp_path, rate):
    refuse_impossible_rates(written(tmp_path / "rec", {"a": np.arange(5) / rate}))


SPAN_S = 2.0**32 / 1e6


def wrapped(times):
    """What a 32-bit clock of microseconds says that begins anew in the middle."""
    return [(SPAN_S - times[len(times) // 2] + time) % SPAN_S for time in times]


def changed_times(recording, sensor, change):
    path = recording.path / sensor / "frames.csv"
    rows = [line.split(",") for line in path.read_text().splitlines()[1:]]
    times = change([float(time) for _, time in rows])
    lines = [f"{name},{time!r}" for (name, _), time in zip(rows, times, strict=True)]
    path.write_text("\n".join(["file,time_s", *lines]) + "\n")
    return open_recording(recording.path)


def test_a_32_bit_clock_that_begins_anew_is_gone_on_with_and_told(tmp_path):
    ticks = np.arange(20) / 30.0
    recording = written(tmp_path / "rec", {"a": ticks, "b": ticks})
    for name in ("a", "b"):
        recording = changed_times(recording, name, wrapped)
    np.testing.assert_allclose(np.diff([moment.time_s for moment in instants(recording)]), 1 / 30, atol=1e-6)
    assert all(len(moment.frames) == 2 for moment in instants(recording))
    assert "sensor 'b': the 32-bit clock of microseconds began anew after 4294.9" in recording.mended[1]
    assert "mended: sensor 'a': the 32-bit clock" in sensors_in_words(sensors_used(recording))[0]


def test_times_that_lie_back_for_another_reason_are_refused(tmp_path):
    recording = written(tmp_path / "rec", {"a": np.arange(20) / 30.0})
    with pytest.raises(RecordingError, match=r"line 12: time 0 s does not come after 0\.3"):
        changed_times(recording, "a", lambda times: times[:10] + [time - times[10] for time in times[10:]])


def test_impossible_times_reach_no_step_of_the_program(tmp_path):
    with pytest.raises(RecordingError, match="which no sensor has"):
        instants(written(tmp_path / "rec", {"a": np.arange(5) * 33.3}))
