"""Clouds of other programs: packed ones, and ones whose axes are not the sensor's, come in where they were."""

from __future__ import annotations

import numpy as np
import pytest
from click.testing import CliRunner
from hypothesis import given, settings
from hypothesis import strategies as st

from capture._open3d import open3d
from capture.camera import Camera, backproject
from capture.commands import import_command
from capture.importers import ImportOptions, UserCamera, import_recording
from capture.importers.axes import sensor_from_axes
from capture.importers.lzf import unpack, unpacked
from tests.sensor_files import scene
from tests.test_import_files import images, refused

CAMERA = Camera(64, 48, 60.0, 60.0, 31.5, 23.5)
STATED = UserCamera(fx=60.0, size=(64, 48))


def points() -> np.ndarray:
    organised = backproject(CAMERA, scene.readings(0).astype(float) * 1e-3).reshape(-1, 3)
    return organised[np.isfinite(organised).all(axis=1)]


def ply(path, xyz, *, comment=""):
    """As RealSense's SDK 2.59 writes it as text: colours stand in lines of their own."""
    header = f"ply\nformat ascii 1.0\n{comment}element vertex {len(xyz)}\n"
    header += "".join(f"property float32 {axis}\n" for axis in "xyz")
    header += "".join(f"property uchar {colour}\n" for colour in ("red", "green", "blue"))
    body = "".join(f"{x:.9f} {y:.9f} {z:.9f} \n1 2 3 \n" for x, y, z in xyz)
    path.write_text(f"{header}end_header\n{body}")
    return path


def test_realsense_says_in_the_header_that_its_axes_are_others(tmp_path):
    comment = "comment pointcloud saved from Realsense Viewer\n"
    path = ply(tmp_path / "a.ply", points() * (1.0, -1.0, -1.0), comment=comment)
    np.testing.assert_array_equal(
        images(import_recording(path, tmp_path / "rec", ImportOptions(cameras=STATED)))[0], readings()
    )
    # Programs that copied the header, but not the change of axes, are read as they are.
    path = ply(tmp_path / "b.ply", points(), comment=comment)
    np.testing.assert_array_equal(
        images(import_recording(path, tmp_path / "b", ImportOptions(cameras=STATED)))[0], readings()
    )


def test_clouds_of_other_axes_are_refused_until_they_are_stated(tmp_path):
    path = ply(tmp_path / "a.ply", points() * (1.0, -1.0, -1.0))
    refused(path, tmp_path, r"points behind the sensor, .*--axes x-right,y-up,z-back", cameras=STATED)
    arguments = [str(path), "--out", str(tmp_path / "rec"), "--fx", "60", "--width", "64", "--height", "48"]
    result = CliRunner().invoke(import_command, [*arguments, "--axes", "x-right,y-up,z-back"])
    assert result.exit_code == 0, result.output
    assert CliRunner().invoke(import_command, [*arguments, "--axes", "x-right"]).exit_code == 2


def test_axes_of_either_handedness_put_points_where_they_were(tmp_path):
    # Robots' axes, and a left-handed engine's: x forward, y left, z up; x right, y up, z forward.
    for number, (text, stored) in enumerate(
        [
            ("x-forward,y-left,z-up", points()[:, [2, 0, 1]] * (1, -1, -1)),
            ("x-right,y-up,z-forward", points() * (1, -1, 1)),
        ]
    ):
        path = ply(tmp_path / f"{number}.ply", stored)
        stated = UserCamera(fx=60.0, size=(64, 48), axes=text)
        got = import_recording(path, tmp_path / f"rec{number}", ImportOptions(cameras=stated))
        np.testing.assert_array_equal(images(got)[0], readings())


@pytest.mark.parametrize("text", ["", "x-right", "x-right,y-up,z-up", "x-right,y-left,z-up", "x-right,y-up,z-front"])
def test_axes_that_are_none_are_refused(text):
    with pytest.raises(ValueError, match=r"does not say|along one line"):
        sensor_from_axes(text)


def test_a_packed_pcd_comes_in_as_an_unpacked_one(tmp_path):
    o3d = open3d()
    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points()))
    o3d.io.write_point_cloud(str(tmp_path / "packed.pcd"), cloud, compressed=True)
    data = (tmp_path / "packed.pcd").read_bytes()
    assert b"DATA binary_compressed" in data
    np.testing.assert_array_equal(
        images(import_recording(tmp_path / "packed.pcd", tmp_path / "rec", ImportOptions(cameras=STATED)))[0],
        readings(),
    )
    (tmp_path / "cut.pcd").write_bytes(data[:-20])
    refused(tmp_path / "cut.pcd", tmp_path, "its end is missing", cameras=STATED)
    head, _, body = data.partition(b"DATA binary_compressed\n")
    changed = bytearray(body)
    changed[8:40] = b"\xff" * 32
    (tmp_path / "changed.pcd").write_bytes(head + b"DATA binary_compressed\n" + bytes(changed))
    refused(tmp_path / "changed.pcd", tmp_path, "compressed points are damaged", cameras=STATED)


@settings(max_examples=200)
@given(st.binary(max_size=60), st.integers(1, 80))
def test_any_bytes_unpack_as_the_plain_twin_says_or_are_refused(data, size):
    out = np.zeros(size, np.uint8)
    fits = unpack(np.frombuffer(data, np.uint8), out)
    if fits:
        assert unpacked(data, size) == out.tobytes()
    else:
        with pytest.raises(ValueError, match="damaged"):
            unpacked(data, size)


def readings() -> np.ndarray:
    return scene.readings(0) * 10
