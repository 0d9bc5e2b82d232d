"""What names of image files tell of order and time, and what is said where they tell none."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from capture.errors import RecordingError
from capture.importers import ImportOptions, UserCamera, import_recording, natural_order
from capture.importers.names import NamedTimes, named_times
from tests.sensor_files import scene


def told(*names: str, fps: float | None = None) -> NamedTimes:
    return named_times([Path(name) for name in names], fps)


def since_first(named: NamedTimes) -> np.ndarray:
    return np.array(named.times_s) - named.times_s[0]


@pytest.mark.parametrize(
    "ordered",
    [
        ["1.25.png", "1.5.png", "10.png"],
        ["depth-9.5.bin", "depth-9.75.bin", "depth-10.0.bin", "depth-10.25.bin"],
        ["take-1.8.png", "take-1.9.png", "take-1.10.png", "take-1.11.png"],
        ["1.2.png", "1.03.png"][::-1],
        ["3.png", "20.png", "100.png", "a2.png", "a10.png"],
    ],
)
def test_numbers_sort_by_their_value_and_decimals_as_decimals(ordered):
    shuffled = [Path(name) for name in reversed(ordered)]
    assert [file.name for file in natural_order(shuffled)] == ordered


CLOCKS = {
    "seconds, text order is wrong": [f"depth-{9.5 + k / 10:.1f}.bin" for k in range(16)],
    "seconds since 1970": [f"{1305031102.16 + k / 10:.6f}.png" for k in range(16)],
    "milliseconds since 1970": [f"d_{1616789136123 + 100 * k}.png" for k in range(16)],
    "microseconds since 1970": [f"{1616789136123456 + 100_000 * k}.png" for k in range(16)],
    "nanoseconds since 1970": [f"{1616789136123456789 + 100_000_000 * k}.png" for k in range(16)],
    "seconds and nanoseconds": [f"{1616789136 + k // 10}-{(k % 10) * 100_000_000:09d}.png" for k in range(16)],
    "date and time": [f"20210326-2305{36 + k // 10}-{k % 10}00.png" for k in range(16)],
    "date with separators": [f"2021-03-26_23.05.{36 + k // 10}.{k % 10}00.png" for k in range(16)],
    "a device's milliseconds": [f"depth_{5000 + 100 * k + k % 2}.png" for k in range(16)],
    "a device's microseconds": [f"{k:04d}_{70_000_000 + 100_003 * k}.png" for k in range(16)],
    "a device's milliseconds with decimals": [f"{81234.5 + 100.25 * k:.3f}.png" for k in range(16)],
    "a count and microseconds": [f"{k:06d}-{100_000 * k:012d}.png" for k in range(16)],
}


@pytest.mark.parametrize("names", CLOCKS.values(), ids=CLOCKS)
def test_a_clock_in_the_names_is_the_time_and_said_with_its_unit_and_rate(names):
    named = told(*reversed(names))
    assert [file.name for file in named.files] == names
    np.testing.assert_allclose(since_first(named), np.arange(16) / 10.0, atol=0.005)
    assert named.clock
    assert "the file names (" in named.words


def test_a_frame_that_a_clock_in_the_names_lacks_leaves_its_time_free():
    names = [f"{1616789136123 + 33 * k + k % 3}.png" for k in range(30) if k not in (10, 11)]
    assert np.diff(told(*names).times_s).max() == pytest.approx(0.1, abs=0.003)


def test_two_sensors_whose_names_tell_the_same_clock_are_on_it():
    first, second = (told(*(f"{1616789136123 + late + 100 * k}.png" for k in range(9))) for late in (0, 40))
    assert second.times_s[0] - first.times_s[0] == pytest.approx(0.040, abs=1e-6)


def test_numbers_that_count_leave_the_time_of_missing_frames_free():
    named = told(*(f"frame_{k:04d}.png" for k in range(20) if k not in (5, 6, 7)))
    assert not named.clock
    assert named.times_s[5] == pytest.approx(8 / 30)
    assert "a nominal rate of 30 Hz (assumed: the names tell no time but count, 0000 to 0019, 3 missing" in named.words


def test_numbers_in_even_steps_are_one_frame_each():
    named = told("0.png", "20.png", "40.png", "60.png", "80.png", "100.png", "140.png", fps=10.0)
    np.testing.assert_allclose(named.times_s, [0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.7])
    assert "(as stated: " in named.words
    assert "in steps of 20, one frame each, 1 missing" in named.words


def test_numbers_that_neither_count_nor_tell_a_possible_time_give_the_order_alone():
    seconds_apart = [1028894671, 1038901490, 1045879925, 1051883281, 1058893191, 1064898470, 1166565565, 1399145206]
    named = told(*(f"depth-data-{number}" for number in seconds_apart))
    np.testing.assert_allclose(named.times_s, np.arange(8) / 30.0)
    assert "tell no time and do not count" in named.words


def test_a_stated_rate_goes_before_the_names_and_their_clock_is_mentioned():
    named = told(*CLOCKS["milliseconds since 1970"], fps=15.0)
    np.testing.assert_allclose(named.times_s, np.arange(16) / 15.0)
    assert "a clock of their own (seconds since 1970, 10 Hz), which is not used" in named.words


def test_the_summary_of_import_says_whence_times_are(tmp_path):
    (tmp_path / "files").mkdir()
    for k in range(6):
        cv2.imwrite(str(tmp_path / "files" / f"{9.8 + 0.1 * k:.1f}.png"), scene.readings(k))
    recording = import_recording(tmp_path / "files", tmp_path / "rec", ImportOptions(cameras=UserCamera(fx=60.0)))
    np.testing.assert_allclose([frame.time_s for frame in recording.sensors[0].frames], np.arange(6) / 10, atol=1e-9)
    assert "times by the file names (seconds, 10 Hz)" in recording.created_by
    with pytest.raises(RecordingError, match=r"has 0\.1 frames a second.*--fps"):
        import_recording(tmp_path / "files", tmp_path / "slow", ImportOptions(cameras=UserCamera(fx=60.0, fps=0.1)))
    assert not (tmp_path / "slow" / "recording.json").exists()
