"""OpenNI's files, written by OpenNI's own recorder (sensor_files/make_openni.py), become recordings."""

from __future__ import annotations

import contextlib
import struct
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from capture.importers import ImportOptions, UserCamera, import_recording
from capture.importers.openni_codec import decode, decode_with_table
from tests.sensor_files import scene
from tests.test_import_files import FILES, images, refused


@pytest.mark.parametrize(("name", "unit_m"), [("openni.oni", 0.0001), ("openni-mirrored-jpeg.oni", 0.001)])
def test_depth_is_what_the_driver_showed_and_mirrored_images_are_turned_back(name, unit_m, tmp_path):
    recording = import_recording(FILES / name, tmp_path / "rec")
    (sensor,) = recording.sensors
    assert sensor.depth_unit_m == unit_m
    got = images(recording)
    assert len(got) == scene.FRAMES
    for frame, image in enumerate(got):
        shown = scene.readings(frame)
        np.testing.assert_array_equal(image, shown[:, ::-1] if "mirrored" in name else shown)
    times = [frame.time_s for frame in sensor.frames]
    np.testing.assert_allclose(times, [scene.time_s(frame) for frame in range(scene.FRAMES)], atol=2e-6)


def test_the_camera_comes_from_the_angles_of_view_as_openni_uses_them(tmp_path):
    camera = import_recording(FILES / "openni.oni", tmp_path / "rec").sensors[0].camera
    assert (camera.fx, camera.fy, camera.cx, camera.cy) == pytest.approx((scene.FX, scene.FY, 32.0, 24.0), abs=1e-4)
    # Mirrored, pixel u stands where W - 1 - u stood: the middle W / 2 goes to W / 2 - 1.
    turned = import_recording(FILES / "openni-mirrored-jpeg.oni", tmp_path / "turned").sensors[0].camera
    assert (turned.cx, turned.cy) == (31.0, 24.0)


@pytest.mark.parametrize(("name", "off_by"), [("openni.oni", 0), ("openni-mirrored-jpeg.oni", 8)])
def test_colour_is_kept_whether_raw_or_jpeg(name, off_by, tmp_path):
    colour = import_recording(FILES / name, tmp_path / "rec").sensors[0].colour
    assert len(colour.frames) == scene.FRAMES
    for index, frame in enumerate(colour.frames):
        image = cv2.imread(str(frame.path))[..., ::-1].astype(int)
        shown = scene.colour(index)
        assert np.abs(image - (shown[:, ::-1] if "mirrored" in name else shown)).max() <= off_by


def test_files_without_depth_in_metric_units_say_so(tmp_path):
    refused(FILES / "openni-colour-only.oni", tmp_path, r"no depth stream \(it has colour\)")
    refused(FILES / "openni-uncompressed-shift.oni", tmp_path, "raw disparities")


@pytest.mark.parametrize("size", [20, 700, 20_000, 80_000, -1])
def test_a_truncated_file_is_one_clear_line(size, tmp_path):
    data = (FILES / "openni.oni").read_bytes()
    end = data.index(struct.pack("<II", int.from_bytes(b"NIR\0", "little"), 0x0B)) + 28  # what follows is not read
    (tmp_path / "cut.oni").write_bytes(data[:end][:size])
    refused(tmp_path / "cut.oni", tmp_path, "truncated or damaged")


def changed(tmp_path: Path, old: bytes, new: bytes) -> Path:
    data = (FILES / "openni.oni").read_bytes()
    assert old in data
    (tmp_path / "changed.oni").write_bytes(data.replace(old, new))
    return tmp_path / "changed.oni"


def test_without_angles_of_view_the_focal_length_is_asked_for(tmp_path):
    path = changed(tmp_path, b"xnFOV", b"xnFOX")
    refused(path, tmp_path, r"focal length.*--fx")
    assert (
        import_recording(path, tmp_path / "rec", ImportOptions(cameras=UserCamera(fx=60.0))).sensors[0].camera.cx
        == 31.5
    )


def test_other_faults_are_one_clear_line(tmp_path):
    mode = struct.pack("<III", scene.WIDTH, scene.HEIGHT, 30)
    refused(changed(tmp_path, mode, struct.pack("<III", 60000, 60000, 30)), tmp_path, "impossible size")
    refused(changed(tmp_path, mode, struct.pack("<III", 64, 47, 30)), tmp_path, "not 3008|not 9024")
    refused(changed(tmp_path, b"xnMapOutputMode\0", b"xnMapOutputMore\0"), tmp_path, "how large")
    refused(changed(tmp_path, b"16zT", b"abcd"), tmp_path, "codec that is not known")
    refused(changed(tmp_path, b"NIR\0", b"NIX\0"), tmp_path, "does not begin as it should")


def encoded(values: np.ndarray) -> bytes:
    """The plainest encoding: no runs, and one difference a byte where it is small."""
    out = bytearray(int(values[0]).to_bytes(2, "little"))
    for before, value in zip(values[:-1].tolist(), values[1:].tolist(), strict=True):
        step = before - value
        if abs(step) <= 6:
            out.append((step + 6) << 4 | 0x0D)
        elif abs(step) <= 63:
            out += bytes([0xFF, 192 + step])
        else:
            out += b"\xff" + value.to_bytes(2, "big")
    return bytes(out)


@given(st.lists(st.integers(0, 32767) | st.integers(100, 130), min_size=1, max_size=60))
def test_what_is_encoded_is_decoded(values):
    array = np.array(values)
    np.testing.assert_array_equal(decode(encoded(array), len(array)), array)
    table, places = np.unique(array, return_inverse=True)
    head = struct.pack("<H", len(table)) + table.astype("<u2").tobytes()
    np.testing.assert_array_equal(decode_with_table(head + encoded(places), len(array)), array)


@pytest.mark.parametrize(
    ("code", "values"),
    [
        (b"\x05\x00\x66", [5, 5, 5]),
        (b"\x05\x00\xe2", [5, 5, 5, 5, 5]),
        (b"\x05\x00\xe0\x5d", [5, 6]),
        (b"\x05\x00\x7f\xc9", [5, 4, 251]),
        (b"\x05\x00\xff\x01\x02\x66", [5, 258, 258, 258]),
        (b"\x05\x00\x7f\x01\x0f\x66", [5, 4, 271, 271, 271]),
    ],
)
def test_the_codes_mean_what_openni_says(code, values):
    expected = [value & 0xFFFF if value != 251 else (4 - (0xC9 - 192)) & 0xFFFF for value in values]
    np.testing.assert_array_equal(decode(code, len(values)), expected)


@settings(max_examples=300)
@given(st.binary(max_size=40), st.integers(1, 50))
def test_any_bytes_either_decode_or_are_refused(data, count):
    for read in (decode, decode_with_table):
        with contextlib.suppress(ValueError):
            assert read(data, count).shape == (count,)
