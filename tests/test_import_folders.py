"""Folders in the layouts of data sets, and point clouds, become recordings."""

from __future__ import annotations

import json

import cv2
import numpy as np
import pytest

from capture.camera import Camera, backproject
from capture.importers import ImportOptions, UserCamera, import_recording
from capture.recording import RecordingWriter, Sensor, open_recording, read_depth
from tests.sensor_files import scene
from tests.test_import_files import images, refused
from tests.two_sensors import CAMERA, limb_depth, poses

STATED = UserCamera(fx=scene.FX)


def write_images(folder, *, colour=None, name="{:03d}.png"):
    (folder / "depth").mkdir(parents=True)
    if colour:
        (folder / colour).mkdir()
    for frame in range(3):
        cv2.imwrite(str(folder / "depth" / name.format(frame)), scene.readings(frame))
        if colour:
            cv2.imwrite(str(folder / colour / name.format(frame)), scene.colour(frame)[..., ::-1])
    return folder


@pytest.fixture
def tum(tmp_path):
    folder = write_images(tmp_path / "tum", colour="rgb")
    times = [1305031102.16 + 0.033 * frame for frame in range(3)]
    for name, home, shift in (("depth.txt", "depth", 0.0), ("rgb.txt", "rgb", 0.01)):
        lines = [f"{time + shift:.6f} {home}/{frame:03d}.png" for frame, time in enumerate(times)]
        (folder / name).write_text("\n".join(["# images", "# time file", *lines, ""]))
    return folder


def test_a_tum_sequence_keeps_its_times_factor_and_colour(tum, tmp_path):
    recording = import_recording(tum, tmp_path / "rec", ImportOptions(cameras=STATED))
    (sensor,) = recording.sensors
    assert sensor.depth_unit_m == 1.0 / 5000.0
    np.testing.assert_allclose([frame.time_s for frame in sensor.frames], [0.0, 0.033, 0.066], atol=1e-6)
    np.testing.assert_allclose([frame.time_s for frame in sensor.colour.frames], [0.01, 0.043, 0.076], atol=1e-6)
    for frame, image in enumerate(images(recording)):
        np.testing.assert_array_equal(image, scene.readings(frame))
    np.testing.assert_array_equal(sensor.colour.colour_from_depth, np.eye(4))


def test_faults_of_a_tum_sequence_are_one_clear_line(tum, tmp_path):
    refused(tum, tmp_path, r"focal length.*--fx")
    for text, match in (
        ("", "lists no images"),
        ("1.0", "line 1: expected a time"),
        ("x depth/000.png", "line 1: expected a time"),
        ("1.0 ../../secret.png", "line 1: expected .* in this folder"),
        ("1.0 /etc/passwd", "line 1: expected .* in this folder"),
        ("# a\n1.0 depth/999.png", "line 2: image depth/999.png is missing"),
        ("2.0 depth/000.png\n1.0 depth/001.png", "does not come after"),
    ):
        (tum / "depth.txt").write_text(text)
        refused(tum, tmp_path, match, cameras=STATED)
    (tum / "depth.txt").write_bytes(b"\xff\xfe\x00")
    refused(tum, tmp_path, "not text", cameras=STATED)


def write_camera(folder, **changes):
    matrix = [scene.FX, 0, 0, 0, scene.FY, 0, scene.CX, scene.CY, 1]
    told = {"width": scene.WIDTH, "height": scene.HEIGHT, "intrinsic_matrix": matrix} | changes
    (folder / "intrinsic.json").write_text(json.dumps(told))


def test_a_redwood_scan_keeps_its_camera_scale_and_rate(tmp_path):
    folder = write_images(tmp_path / "redwood", colour="color")
    write_camera(folder, depth_scale=2000.0, fps=15.0)
    recording = import_recording(folder, tmp_path / "rec")
    (sensor,) = recording.sensors
    assert (sensor.camera.fx, sensor.camera.cx, sensor.camera.cy) == (scene.FX, scene.CX, scene.CY)
    assert sensor.depth_unit_m == 0.0005
    np.testing.assert_allclose([frame.time_s for frame in sensor.frames], [0.0, 1 / 15, 2 / 15])
    assert len(sensor.colour.frames) == 3
    np.testing.assert_array_equal(images(recording)[2], scene.readings(2))


def test_times_in_the_names_of_a_redwood_scan_count(tmp_path):
    folder = write_images(tmp_path / "redwood", name="{0:06d}-{0:08d}0100.png")
    write_camera(folder)
    recording = import_recording(folder, tmp_path / "rec")
    np.testing.assert_allclose([frame.time_s for frame in recording.sensors[0].frames], [0.0, 0.01, 0.02], atol=1e-9)
    assert "times by the file names" in recording.created_by


def test_the_rate_and_length_that_open3ds_reader_notes_are_held_against_the_images(tmp_path):
    folder = write_images(tmp_path / "redwood")
    write_camera(folder, fps=15.0, stream_length_usec=133_000)
    words = import_recording(folder, tmp_path / "rec").created_by
    assert "a nominal rate of 15 Hz (as intrinsic.json tells: the names tell no time but count, 000 to 002" in words
    assert "and its length of 0.13 s agrees" in words
    write_camera(folder, fps=15.0, stream_length_usec=2_000_000)
    words = import_recording(folder, tmp_path / "rec", ImportOptions(overwrite=True)).created_by
    assert "warning: the recording was 2.00 s long and these images make 0.13 s" in words


def test_faults_of_a_redwood_scan_are_one_clear_line(tmp_path):
    folder = write_images(tmp_path / "redwood")
    refused(folder, tmp_path, r"focal length.*--fx")
    for changes, match in (
        ({"width": 63}, "its camera has 63 x 48"),
        ({"width": 10**9}, "whole number from 1"),
        ({"intrinsic_matrix": [1, 2]}, "list of 9 numbers"),
        ({"intrinsic_matrix": [60, 0, 31, 0, 60, 23, 0, 0, 1]}, "column by column"),
        ({"depth_scale": 0.001}, "readings a metre"),
        ({"fps": "x"}, "finite number"),
    ):
        write_camera(folder, **changes)
        refused(folder, tmp_path, match)
    (folder / "intrinsic.json").write_text("{")
    refused(folder, tmp_path, "not valid JSON")


def write_pcd(path, points, size, *, coding="binary", extra=True):
    fields = [("x", "F4"), ("y", "F4"), ("z", "F4")] + ([("rgb", "F4")] if extra else [])
    names, kinds = zip(*fields, strict=True)
    header = (
        "# .PCD v0.7\nVERSION 0.7\n"
        f"FIELDS {' '.join(names)}\nSIZE {' '.join(kind[1] for kind in kinds)}\n"
        f"TYPE {' '.join(kind[0] for kind in kinds)}\nCOUNT {' '.join('1' for _ in kinds)}\n"
        f"WIDTH {size[0]}\nHEIGHT {size[1]}\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS {len(points)}\nDATA {coding}\n"
    )
    rows = np.zeros((len(points), len(fields)), "<f4")
    rows[:, :3] = points
    with path.open("wb") as file:
        file.write(header.encode())
        if coding == "binary":
            file.write(rows.tobytes())
        else:
            np.savetxt(file, rows, fmt="%.7g")
    return path


def write_ply(path, points, *, order="little"):
    kind = {"little": "<f4", "big": ">f4"}.get(order, "<f4")
    coding = "ascii" if order == "ascii" else f"binary_{order}_endian"
    header = f"ply\nformat {coding} 1.0\nelement vertex {len(points)}\n"
    header += "".join(f"property float {axis}\n" for axis in "xyz") + "element face 0\n"
    header += "property list uchar int vertex_indices\nend_header\n"
    body = (
        points.astype(kind).tobytes() if order != "ascii" else "\n".join(" ".join(map(str, p)) for p in points).encode()
    )
    path.write_bytes(header.encode() + body + b"\n")
    return path


@pytest.fixture(scope="module")
def limb():
    depth = limb_depth(poses()["left"])
    return depth, backproject(CAMERA, depth).reshape(-1, 3)


@pytest.mark.parametrize("coding", ["binary", "ascii"])
def test_an_organised_cloud_tells_its_camera_and_depth(limb, coding, tmp_path):
    depth, points = limb
    path = write_pcd(tmp_path / "0.pcd", points, (CAMERA.width, CAMERA.height), coding=coding)
    (sensor,) = import_recording(path, tmp_path / "rec").sensors
    camera = sensor.camera
    assert (camera.fx, camera.fy, camera.cx, camera.cy) == pytest.approx(
        (CAMERA.fx, CAMERA.fy, CAMERA.cx, CAMERA.cy), abs=0.01
    )
    np.testing.assert_allclose(read_depth(sensor, sensor.frames[0]), depth, atol=0.00006)


@pytest.mark.parametrize("order", ["little", "big", "ascii"])
def test_other_clouds_are_projected_by_a_stated_camera(limb, order, tmp_path):
    depth, points = limb
    write_ply(tmp_path / "0.ply", points[np.isfinite(points).all(axis=1)][::-1], order=order)
    refused(tmp_path / "0.ply", tmp_path, r"focal length.*--fx")
    stated = UserCamera(fx=CAMERA.fx, size=(CAMERA.width, CAMERA.height))
    (sensor,) = import_recording(tmp_path / "0.ply", tmp_path / "rec", ImportOptions(cameras=stated)).sensors
    np.testing.assert_allclose(read_depth(sensor, sensor.frames[0]), depth, atol=0.00006)


def test_of_points_in_one_pixel_the_nearest_counts(tmp_path):
    points = np.array([[0.0, 0.0, 2.0], [0.0, 0.0, 1.0], [0.0, 0.0, 3.0]])
    stated = UserCamera(fx=50.0, size=(11, 11))
    sensor = import_recording(
        write_ply(tmp_path / "a.ply", points), tmp_path / "rec", ImportOptions(cameras=stated)
    ).sensors[0]
    assert read_depth(sensor, sensor.frames[0])[5, 5] == pytest.approx(1.0)


def test_faults_of_clouds_are_one_clear_line(limb, tmp_path):
    _, points = limb
    path = write_pcd(tmp_path / "0.pcd", points, (CAMERA.width, CAMERA.height))
    data = path.read_bytes()
    refused(write_pcd(path, -points, (CAMERA.width, CAMERA.height)), tmp_path, "points behind the sensor, .*--axes")
    shuffled = np.random.default_rng(0).permutation(points)
    refused(write_pcd(path, shuffled, (CAMERA.width, CAMERA.height)), tmp_path, "off any camera's pixels")
    stated = UserCamera(fx=287.0, size=(320, 240))
    refused(write_ply(tmp_path / "b.ply", -points), tmp_path, "points behind the sensor, .*--axes", cameras=stated)
    for old, new, match in (
        (b"DATA binary", b"DATA binary_compressed", "its end is missing, or its points"),
        (b"WIDTH 320", b"WIDTH 320000000", "claims"),
        (b"FIELDS x y", b"FIELDS a b", "no x, y and z"),
        (b"SIZE 4 4", b"SIZE 4 q", "damaged"),
        (b"HEIGHT 240\n", b"", "damaged"),
        (b"COUNT 1 1 1 1", b"COUNT 1 1 1 999999999", "too many bytes"),
    ):
        path.write_bytes(data.replace(old, new))
        refused(path, tmp_path, match)
    path.write_bytes(data[:-100])
    refused(path, tmp_path, "its end is missing")
    path.write_bytes(b"ply\nelement vertex 1\nproperty float x\nend_header\n")
    refused(path, tmp_path, "damaged .*format")
    path.write_bytes(b"nothing of the kind")
    refused(path, tmp_path, "neither a .pcd nor a .ply")


def test_a_file_in_place_of_a_folder_is_refused(tmp_path):
    (tmp_path / "depth.txt").write_text("1.0 a.png")
    for name in ("tum", "redwood"):
        refused(tmp_path / "depth.txt", tmp_path, "is a folder", format_name=name)


def test_a_sensors_folder_of_a_recording_gives_its_frames_and_their_times_and_no_image_of_the_box(tmp_path):
    camera = Camera(scene.WIDTH, scene.HEIGHT, scene.FX, scene.FX, scene.CX, scene.CY)
    with RecordingWriter(tmp_path / "whole", sensors=[Sensor("left", camera)], created_by="a test") as writer:
        writer.set_box((0.3, 0.2, 0.15))
        writer.add_box_frame("left", scene.readings(0), 0.0)
        for frame, time_s in enumerate((0.5, 0.54, 0.63)):
            writer.add_frame("left", scene.readings(frame), time_s)
    sensor = open_recording(tmp_path / "whole").sensors[0]
    recording = import_recording(tmp_path / "whole" / "left", tmp_path / "rec", ImportOptions(cameras=STATED))
    (taken,) = recording.sensors
    np.testing.assert_allclose([frame.time_s for frame in taken.frames], [0.0, 0.04, 0.13], atol=1e-9)
    assert not taken.box_frames
    for one, other in zip(taken.frames, sensor.frames, strict=True):
        np.testing.assert_array_equal(read_depth(taken, one), read_depth(taken, other))
    assert "frames.csv (images of the box left out: 1)" in recording.created_by


def test_a_table_that_only_has_the_name_of_a_list_of_frames_is_left_aside(tmp_path):
    folder = write_images(tmp_path / "images")
    (folder / "depth" / "frames.csv").write_text("image;taken\n000.png;noon\n")
    recording = import_recording(folder / "depth", tmp_path / "rec", ImportOptions(cameras=STATED))
    assert len(recording.sensors[0].frames) == 3


def test_a_list_without_frames_is_refused(tmp_path):
    (tmp_path / "sensor").mkdir()
    (tmp_path / "sensor" / "frames.csv").write_text("file,time_s\n")
    refused(tmp_path / "sensor", tmp_path, "lists no frames", cameras=STATED)
