"""Import believes nothing: readings are looked at, axes and units are told, and what is none is called by its name."""

from __future__ import annotations

import json

import numpy as np
import pytest

from capture.errors import BonetrackError, RecordingError
from capture.importers import Stated, import_recording
from capture.importers.adjusted import millimetres
from capture.importers.axes import sensor_from_axes
from capture.recording import depth_png, open_recording, read_depth

SIZE = (40, 30)
CAMERA = Stated(fx=40.0, size=SIZE)


def scene(scale: float = 1000.0) -> np.ndarray:
    """A slope from 1 to 1.5 m with a gap, in steps of 1 / scale m."""
    depth = np.linspace(1.0, 1.5, SIZE[0] * SIZE[1]).reshape(SIZE[1], SIZE[0]) * scale
    depth[:5, :5] = 0.0
    return np.rint(depth)


def pngs(folder, readings, count=3):
    folder.mkdir()
    for k in range(count):
        depth_png.write_readings(folder / f"{k:03d}.png", np.asarray(readings, dtype=np.uint16))
    return folder


def depths(recording) -> np.ndarray:
    (sensor,) = recording.sensors
    return read_depth(sensor, sensor.frames[0])


@pytest.mark.parametrize(
    ("readings", "saying", "remedy"),
    [
        (np.zeros((30, 40)), "has no reading in its first images", "again"),
        (np.full((30, 40), 65535), "0 % of its readings in the sensor's range", "--depth-range"),
        (scene(10_000.0), "typical is 12.6", "is a step 0.1 mm"),
        (np.full((30, 40), 2), "typical is 0.002 m", "is a step 1000 mm"),
        (np.full((30, 40), 120), "typical is 0.12 m", "is a step 10 mm"),
    ],
)
def test_readings_that_no_sensor_measures_are_refused_with_the_likely_unit(tmp_path, readings, saying, remedy):
    with pytest.raises(RecordingError, match=saying) as refused:
        import_recording(pngs(tmp_path / "in", readings), tmp_path / "out", stated=CAMERA)
    assert remedy in refused.value.remedy


def test_the_summary_says_share_range_and_step(tmp_path):
    recording = import_recording(pngs(tmp_path / "in", scene()), tmp_path / "out", stated=CAMERA)
    assert (
        "98 % of the pixels have a reading, 100 % of these between 0.2 and 4 m: 1.00 to 1.50 m" in recording.created_by
    )
    assert "in steps of 1 mm" in recording.created_by


def test_another_range_can_be_trusted(tmp_path):
    far = pngs(tmp_path / "in", scene() + 4000.0)
    with pytest.raises(RecordingError, match="2 % of its readings"):
        import_recording(far, tmp_path / "out", stated=CAMERA)
    stated = Stated(fx=40.0, depth_range_m=(0.5, 8.0))
    assert depths(import_recording(far, tmp_path / "again", stated=stated)).max() == pytest.approx(5.5)


def raw_disparity() -> np.ndarray:
    depth = scene() / 1000.0
    with np.errstate(divide="ignore"):
        steps = np.rint((3.3309495161 - 1.0 / depth) / 0.0030711016)
    return np.where(depth > 0.0, steps, 2047.0)


def test_raw_kinect_disparity_is_never_taken_for_millimetres(tmp_path):
    raw = pngs(tmp_path / "in", raw_disparity())
    with pytest.raises(RecordingError, match="raw 11-bit disparity") as refused:
        import_recording(raw, tmp_path / "out", stated=CAMERA)
    assert "--kinect-disparity" in refused.value.remedy
    recording = import_recording(raw, tmp_path / "again", stated=Stated(fx=40.0, kinect_disparity=True))
    found = depths(recording)
    assert np.abs(found - scene() / 1000.0)[5:].max() < 0.004  # half a step of disparity at 1.5 m
    assert (found[:5, :5] == 0.0).all()
    assert millimetres(np.array([[0, 2046, 2047]], dtype=np.uint16))[0, 2] == 0


def test_grey_maps_and_tables_of_numbers_come_in(tmp_path):
    folder = tmp_path / "pgm"
    folder.mkdir()
    rows = "\n".join(" ".join(f"{value:.0f}" for value in row) for row in scene())
    (folder / "0.pgm").write_text(f"P2\n# a comment\n40 30\n65535\n{rows}\n")
    np.testing.assert_allclose(
        depths(import_recording(folder, tmp_path / "a", stated=CAMERA)), scene() / 1e3, atol=1e-6
    )
    table = tmp_path / "depth.csv"
    np.savetxt(table, scene(), fmt="%d", delimiter=",")
    np.testing.assert_allclose(depths(import_recording(table, tmp_path / "b", stated=CAMERA)), scene() / 1e3, atol=1e-6)
    metres = tmp_path / "metres.txt"
    np.savetxt(metres, scene() / 1e3, fmt="%.4f")
    with pytest.raises(RecordingError, match="no whole readings"):
        import_recording(metres, tmp_path / "c", stated=CAMERA)
    stated = Stated(fx=40.0, depth_unit_m=1.0)
    np.testing.assert_allclose(
        depths(import_recording(metres, tmp_path / "d", stated=stated)), scene() / 1e3, atol=1e-4
    )


@pytest.mark.parametrize(
    "text", ["time,joint\n", "hello\n", "1 2\n3\n", "P2\n-3 5\n9\n", "P5\n99999999 99999999\n255\n"]
)
def test_text_that_is_no_image_is_refused(tmp_path, text):
    path = tmp_path / ("a.pgm" if text[0] == "P" else "a.csv")
    path.write_text(text)
    with pytest.raises(RecordingError, match="a.(pgm|csv)"):
        import_recording(path, tmp_path / "out", stated=CAMERA)


def test_a_git_lfs_pointer_is_called_one(tmp_path):
    pointer = "version https://git-lfs.github.com/spec/v1\noid sha256:0\nsize 5\n"
    (tmp_path / "a.bag").write_text(pointer)
    with pytest.raises(RecordingError, match="Git LFS pointer"):
        import_recording(tmp_path / "a.bag", tmp_path / "out")
    (tmp_path / "in").mkdir()
    (tmp_path / "in" / "0.png").write_text(pointer)
    with pytest.raises(RecordingError, match="Git LFS pointer"):
        import_recording(tmp_path / "in", tmp_path / "out", stated=CAMERA)


def test_a_recording_is_recognised_as_one(tmp_path):
    recording = import_recording(pngs(tmp_path / "in", scene()), tmp_path / "out", stated=CAMERA)
    with pytest.raises(RecordingError, match="is a recording already"):
        import_recording(recording.path, tmp_path / "again", stated=CAMERA)


def test_a_pattern_holds_before_the_format_is_recognised(tmp_path):
    folder = pngs(tmp_path / "in", scene())
    (folder / "notes.ply").write_text("ply\n")
    (folder / "a.csv").write_text("some,thing,else\n")
    recording = import_recording(folder, tmp_path / "out", stated=Stated(fx=40.0, pattern="00*.png"))
    assert len(recording.sensors[0].frames) == 3


def test_each_source_may_have_its_own_camera(tmp_path):
    one, two = pngs(tmp_path / "one", scene()), pngs(tmp_path / "two", scene())
    stated = [Stated(fx=40.0), Stated(fx=50.0, cx=3.0)]
    recording = import_recording([one, two], tmp_path / "out", stated=stated, offset="clock")
    assert [(sensor.camera.fx, sensor.camera.cx) for sensor in recording.sensors] == [(40.0, 19.5), (50.0, 3.0)]


def cloud_file(path, turn, *, comment: str = "") -> None:
    depth = scene() / 1e3
    v, u = np.nonzero(depth)
    z = depth[v, u]
    points = np.stack([(u - 19.5) * z / 40.0, (v - 14.5) * z / 40.0, z], axis=1) @ turn
    lines = [f"comment {comment}"] if comment else []
    axes = [f"property float {axis}" for axis in "xyz"]
    head = ["ply", "format ascii 1.0", *lines, f"element vertex {len(points)}", *axes, "end_header"]
    path.write_text("\n".join([*head, *(" ".join(f"{x:.6f}" for x in point) for point in points)]) + "\n")


def test_clouds_with_other_axes_come_in_by_word_or_by_what_the_file_says(tmp_path):
    turn = np.diag([1.0, -1.0, -1.0])
    cloud_file(tmp_path / "a.ply", turn)
    with pytest.raises(RecordingError, match="no points in front of the camera|--axes"):
        import_recording(tmp_path / "a.ply", tmp_path / "out", stated=CAMERA)
    stated = Stated(fx=40.0, size=SIZE, axes="x-right, y-up, z-back")
    np.testing.assert_allclose(
        depths(import_recording(tmp_path / "a.ply", tmp_path / "b", stated=stated)), scene() / 1e3, atol=2e-4
    )
    cloud_file(tmp_path / "rs.ply", turn, comment="pointcloud saved from Realsense Viewer")
    recording = import_recording(tmp_path / "rs.ply", tmp_path / "c", stated=CAMERA)
    np.testing.assert_allclose(depths(recording), scene() / 1e3, atol=2e-4)
    assert "axes x-right,y-up,z-back" in recording.created_by


@pytest.mark.parametrize("axes", ["x-right,y-up,z-forward", "x-right,y-left,z-up", "right,up,back", "x-right,y-up"])
def test_axes_that_mirror_or_are_none_are_refused(axes):
    with pytest.raises(BonetrackError):
        sensor_from_axes(axes)


# ---- where the sensors stand, by a calibration of the user's own


def named(recording, matrices) -> dict:
    return {sensor.name: matrix.tolist() for sensor, matrix in zip(recording.sensors, matrices, strict=True)}


@pytest.fixture
def rig(limb, tmp_path):
    """A calibrated recording's matrices, and the recording without them."""
    import shutil

    copy = tmp_path / "rec"
    shutil.copytree(limb.recording.path, copy)
    (copy / "calibration.json").unlink()
    true = [limb.recording.calibration.sensors[s.name].world_from_sensor for s in limb.recording.sensors]
    return open_recording(copy), true


def test_a_users_own_extrinsics_come_in_as_json_text_and_yaml(rig, tmp_path):
    from capture.calibration.extrinsics import calibrate_by_file

    recording, true = rig
    files = {"a.json": json.dumps(named(recording, true))}
    files["b.json"] = json.dumps({"sensors": [{"name": n, "sensor_from_world": np.linalg.inv(m).tolist()} for n, m in zip([s.name for s in recording.sensors], true, strict=True)]})  # fmt: skip
    files["c.txt"] = "\n".join("\n".join(" ".join(f"{x:.9f}" for x in row) for row in matrix) for matrix in true)
    blocks = [f"{name}: !!opencv-matrix\n  rows: 4\n  cols: 4\n  dt: d\n  data: {np.ravel(m).tolist()}" for name, m in named(recording, true).items()]  # fmt: skip
    files["d.yaml"] = "%YAML:1.0\n---\n" + "\n".join(blocks) + "\n"
    for name, text in files.items():
        (tmp_path / name).write_text(text)
        calibration = calibrate_by_file(recording, tmp_path / name)
        for sensor, matrix in zip(recording.sensors, true, strict=True):
            np.testing.assert_allclose(calibration.sensors[sensor.name].world_from_sensor, matrix, atol=1e-6)


def test_extrinsics_that_mirror_scale_or_contradict_the_clouds_are_refused(rig, tmp_path):
    from capture.calibration.extrinsics import calibrate_by_file

    recording, true = rig
    file = tmp_path / "rig.json"

    def refused(matrices, saying):
        file.write_text(json.dumps(named(recording, matrices)))
        with pytest.raises(BonetrackError, match=saying):
            calibrate_by_file(recording, file)

    mirror = np.diag([-1.0, 1.0, 1.0, 1.0])
    refused([matrix @ mirror for matrix in true], "left-handed")
    refused([true[0] * np.array([[1000.0]] * 3 + [[1.0]]), true[1]], "scales by 1e\\+03")
    shifted = true[1].copy()
    shifted[:3, 3] += 0.03
    refused([true[0], shifted], "puts the clouds of 'sensor2'")
    refused([np.linalg.inv(matrix) for matrix in true], "puts the clouds of 'sensor2'")
    file.write_text("not matrices at all")
    with pytest.raises(BonetrackError, match="holds no 4 x 4 matrices"):
        calibrate_by_file(recording, file)
