"""Changed and cut files: whatever they hold, nothing but one clear line comes out of a reader."""

from __future__ import annotations

import functools
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from capture.errors import BonetrackError
from tests.fuzz.targets import TARGETS

LIBRARIES = {"azure-kinect": "av", "realsense-bag": "rosbags"}


@functools.cache
def seeds(name: str) -> list[bytes]:
    return TARGETS[name].seeds()


@st.composite
def changes(draw: st.DrawFn) -> tuple[int, list[tuple[float, int]], float]:
    """Which file, where and to what its bytes are changed (positions as parts of it), and how much is kept."""
    places = st.tuples(st.floats(0.0, 1.0) | st.floats(0.0, 0.02), st.integers(0, 255))
    return draw(st.integers(0, 1)), draw(st.lists(places, max_size=12)), draw(st.just(1.0) | st.floats(0.0, 1.0))


@pytest.mark.parametrize("name", TARGETS)
@settings(
    max_examples=15,
    deadline=None,
    derandomize=True,
    database=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
)
@given(change=changes())
def test_a_changed_file_is_read_or_refused_in_one_line(name: str, change, tmp_path: Path):
    if name in LIBRARIES:
        pytest.importorskip(LIBRARIES[name])
    which, places, kept = change
    data = bytearray(seeds(name)[which % len(seeds(name))])
    for part, value in places:
        data[int(part * (len(data) - 1))] = value
    said = ""
    try:
        TARGETS[name].read(bytes(data[: int(kept * len(data))]), tmp_path)
    except BonetrackError as error:
        said = str(error)
    assert "\n" not in said
