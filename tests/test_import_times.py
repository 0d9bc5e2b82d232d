"""Times of frames as they come out of files: what lies back, what stands twice, what no sensor has."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from capture.errors import RecordingError
from capture.importers.source import ColourFrame, DepthFrame
from capture.importers.times import Timed

SPAN_S = 2.0**32 / 1e6
FILE = Path("second.bag")


def depth(time_s, shown):
    return DepthFrame(time_s, np.full((2, 3), shown, np.uint16))


def passed_on(frames):
    timed = Timed(FILE)
    return timed, list(timed.watched(iter(frames)))


def test_a_32_bit_clock_that_begins_anew_goes_on_for_depth_and_colour():
    times = [(SPAN_S - 0.5 + k / 30.0) % SPAN_S for k in range(30)]
    frames = [frame for k, at in enumerate(times) for frame in (depth(at, k), ColourFrame(at, b"a picture"))]
    timed, seen = passed_on(frames)
    np.testing.assert_allclose(np.diff([frame.time_s for frame in seen[::2]]), 1 / 30, atol=1e-6)
    np.testing.assert_allclose([frame.time_s for frame in seen[::2]], [frame.time_s for frame in seen[1::2]])
    np.testing.assert_allclose(timed.times_s, [frame.time_s for frame in seen[::2]])
    assert "32-bit clock of microseconds began anew" in timed.words()[0]


def test_a_frame_that_stands_twice_is_left_out_and_told():
    timed, seen = passed_on([depth(0.0, 1), depth(0.1, 2), depth(0.1, 2), depth(0.2, 3)])
    assert [frame.time_s for frame in seen] == [0.0, 0.1, 0.2]
    assert timed.words() == ["1 frames that stood twice, time and image, left out"]


def test_one_time_of_two_images_is_told_by_number_and_time():
    with pytest.raises(RecordingError, match=r"second\.bag: depth frames 1 and 2 have one time \(0\.1000 s\)"):
        passed_on([depth(0.0, 1), depth(0.1, 2), depth(0.1, 3)])


def test_a_time_that_lies_back_is_refused():
    with pytest.raises(RecordingError, match=r"depth frame 3 \(at 0\.0500 s\) does not come after the one before"):
        passed_on([depth(0.0, 1), depth(0.1, 2), depth(0.2, 3), depth(0.05, 4)])
