"""Exported C3D files in two readers: ezc3d, which wrote them, and c3d, which did not."""

from __future__ import annotations

import warnings
from dataclasses import replace

import numpy as np
import pytest

from capture.errors import OutputError
from tests.holey_limb import HoleyLimb, holey
from tests.test_export_readers import COUNT, HIDDEN, LOST
from track.export.c3d import MOST_FRAMES, c3d_points, write_c3d
from track.export.even_times import even_times
from track.motion import MotionError

__all__ = ["holey"]


@pytest.fixture(scope="module")
def written(holey: HoleyLimb, tmp_path_factory):
    pytest.importorskip("ezc3d", reason="C3D needs ezc3d: pip install bonetrack[c3d]")
    path = tmp_path_factory.mktemp("c3d") / "motion.c3d"
    assert write_c3d(holey.motion, holey.subject, path) == 0
    return path


def test_the_library_that_wrote_them_finds_points_in_millimetres_and_lost_ones_unknown(written, holey):
    import ezc3d

    read = ezc3d.c3d(str(written))
    point, ours = read["parameters"]["POINT"], c3d_points(holey.motion, holey.subject)
    assert point["LABELS"]["value"] == list(ours)
    assert point["UNITS"]["value"] == ["mm"]
    assert point["RATE"]["value"] == pytest.approx([30.0])
    for k, at in enumerate(ours.values()):
        np.testing.assert_allclose(read["data"]["points"][:3, k].T, 1e3 * at, atol=1e-3, equal_nan=True)


def test_another_reader_finds_residual_minus_one_and_zeros_where_a_point_is_not_known(written, holey):
    c3d = pytest.importorskip("c3d", reason="reads C3D files in tests")
    ours = c3d_points(holey.motion, holey.subject)
    with written.open("rb") as file, warnings.catch_warnings():
        warnings.filterwarnings("ignore", "No analog data")
        reader = c3d.Reader(file)
        frames = [points for _, points, _ in reader.read_frames(copy=True)]
    assert [label.strip() for label in reader.point_labels] == list(ours)
    assert (reader.point_rate, reader.first_frame, reader.last_frame) == (30.0, 1, COUNT)
    unknown = 0
    for t, points in enumerate(frames):
        assert np.isfinite(points).all()
        for point, at in zip(points, ours.values(), strict=True):
            if np.isfinite(at[t]).all():
                np.testing.assert_allclose(point[:4], [*(1e3 * at[t]), 0.0], atol=1e-3)
            else:
                assert point[:4].tolist() == [0.0, 0.0, 0.0, -1.0]
                unknown += 1
    assert unknown > len(LOST) * len(ours)  # the hidden bone's landmarks, too
    assert frames[HIDDEN][:, 3].max() == 0.0


def test_a_frame_that_the_camera_dropped_is_unknown_and_later_ones_keep_their_times(holey, tmp_path):
    ezc3d = pytest.importorskip("ezc3d", reason="C3D needs ezc3d: pip install bonetrack[c3d]")
    times = holey.motion.times.copy()
    times[5:] += 2.0 / 30.0  # two frames never came after the lost one
    write_c3d(replace(holey.motion, times=times), holey.subject, tmp_path / "motion.c3d")
    read = ezc3d.c3d(str(tmp_path / "motion.c3d"))["data"]["points"][:3, 0].T
    ours = 1e3 * next(iter(c3d_points(holey.motion, holey.subject).values()))
    assert len(read) == COUNT + 2
    np.testing.assert_allclose(read[:5], ours[:5], atol=1e-3, equal_nan=True)
    assert np.isnan(read[5:7]).all()
    np.testing.assert_allclose(read[7:], ours[5:], atol=1e-3, equal_nan=True)


def test_clocks_that_tick_in_milliseconds_do_not_drift_and_jitter_is_reckoned_away():
    times = np.round(np.arange(3000) / 30.0, 3)
    even = even_times(times)
    assert even.rate_hz == pytest.approx(30.0, rel=1e-5)
    assert len(even.times) == 3000
    assert even.moved == 0
    late = times + np.where(np.arange(3000) % 2 == 1, 0.008, 0.0)
    even = even_times(late)
    assert even.moved > 1000
    np.testing.assert_allclose(even.at(late), even.times, atol=1.1e-3)


def test_a_file_of_other_programs_is_not_replaced_and_one_of_ours_is(written, holey, tmp_path):
    foreign = tmp_path / "motion.c3d"
    foreign.write_bytes(written.read_bytes().replace(b"bonetrack", b"NexusLab2"))
    with pytest.raises(OutputError, match="not replaced"):
        write_c3d(holey.motion, holey.subject, foreign)
    write_c3d(holey.motion, holey.subject, written)


def test_more_frames_than_such_a_file_counts_are_refused(holey, tmp_path):
    pytest.importorskip("ezc3d", reason="C3D needs ezc3d: pip install bonetrack[c3d]")
    times = np.append(holey.motion.times[:-1], (MOST_FRAMES + 1) / 30.0)
    with pytest.raises(MotionError, match="more than a C3D file holds"):
        write_c3d(replace(holey.motion, times=times), holey.subject, tmp_path / "motion.c3d")
    assert not list(tmp_path.iterdir())
