"""What is fuzzed: for each reader valid bytes to begin from, and what reads a file of them to its end.

Only ``BonetrackError`` may come out. Used by tests/test_import_fuzz.py (few inputs) and fuzz_readers.py (many).
"""

from __future__ import annotations

import functools
import io
import json
import tempfile
import zipfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from adapt.anatomy import Anatomy
from adapt.anatomy_file import load_anatomy, write_anatomy
from adapt.model.body import make_body
from adapt.subject import Subject, load_subject, save_subject
from capture.importers import UserCamera, open_source
from capture.importers.openni_codec import decode, decode_with_table
from capture.recording import colour_image, open_recording
from capture.recording.read import read_calibration
from tests.sensor_files import scene
from track.motion import Motion, load_motion, save_motion
from track.poses_by_hand import HandPose, read_poses, write_poses

FILES = Path(__file__).parents[1] / "sensor_files"
STATED = UserCamera(fx=60.0, size=(16, 12))
MOST_FRAMES = 50


@dataclass(frozen=True)
class Target:
    """Valid bytes, and a function that reads changed ones out of a scratch folder."""

    seeds: Callable[[], list[bytes]]
    read: Callable[[bytes, Path], None]


def _file(suffix: str, *seeds: str) -> Target:
    def read(data: bytes, scratch: Path) -> None:
        path = scratch / f"fuzzed{suffix}"
        path.write_bytes(data)
        exhaust(path)

    return Target(lambda: [(FILES / name).read_bytes() for name in seeds], read)


def exhaust(path: Path) -> None:
    """Open with and without a stated camera, and read the frames."""
    for stated in (STATED, UserCamera()):
        for count, _ in enumerate(open_source(path, stated).frames):
            if count == MOST_FRAMES:
                break


def _mkv_seeds() -> list[bytes]:
    from tests.sensor_files import azure_kinect

    with tempfile.TemporaryDirectory() as scratch:
        return [azure_kinect.write(Path(scratch) / "k4a.mkv").read_bytes()]


def _png(image: np.ndarray) -> bytes:
    return cv2.imencode(".png", image)[1].tobytes()


def _pcd_seeds() -> list[bytes]:
    head = "VERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 16\nHEIGHT 12\nDATA "
    v, u = np.mgrid[:12, :16]
    points = np.stack([(u - 8) / 20.0, (v - 6) / 20.0, np.ones_like(u)], axis=-1).reshape(-1, 3).astype("<f4")
    text = "\n".join(" ".join(map(str, point)) for point in points)
    return [head.encode() + b"binary\n" + points.tobytes(), head.encode() + b"ascii\n" + text.encode()]


def _ply_seeds() -> list[bytes]:
    head = "element vertex 4\nproperty float x\nproperty float y\nproperty float z\nend_header\n"
    points = np.ones((4, 3))
    return [
        f"ply\nformat {coding} 1.0\n{head}".encode() + points.astype(kind).tobytes()
        for coding, kind in (("binary_little_endian", "<f4"), ("binary_big_endian", ">f4"))
    ]


def _read_tum(data: bytes, scratch: Path) -> None:
    (scratch / "depth").mkdir(exist_ok=True)
    (scratch / "depth" / "0.png").write_bytes(_png(scene.readings(0)))
    (scratch / "depth.txt").write_bytes(data)
    exhaust(scratch)


def _read_redwood(data: bytes, scratch: Path) -> None:
    (scratch / "depth").mkdir(exist_ok=True)
    (scratch / "depth" / "0.png").write_bytes(_png(scene.readings(0)))
    (scratch / "intrinsic.json").write_bytes(data)
    exhaust(scratch)


def _redwood_seeds() -> list[bytes]:
    matrix = [60.0, 0, 0, 0, 60.0, 0, 31.5, 23.5, 1]
    told = {"width": 64, "height": 48, "intrinsic_matrix": matrix, "depth_scale": 1000.0, "fps": 30.0}
    return [json.dumps(told).encode()]


def _read_codec(data: bytes, _: Path) -> None:
    for count in (1, 12, 100):
        for read in (decode, decode_with_table):
            try:
                read(data, count)
            except ValueError:
                continue  # openni.py makes it one line


def _read_colour(data: bytes, scratch: Path) -> None:
    colour_image.encoded(data, where=scratch)


def _read_recording(data: bytes, scratch: Path) -> None:
    (scratch / "left").mkdir(exist_ok=True)
    (scratch / "left" / "0.png").write_bytes(b"x")
    for name in ("frames.csv", "colour.csv"):
        (scratch / "left" / name).write_text("file,time_s\n0.png,0.0\n")
    (scratch / "recording.json").write_bytes(data)
    open_recording(scratch)


def _recording_seeds() -> list[bytes]:
    camera = {"width": 64, "height": 48, "fx": 60.0, "fy": 60.0, "cx": 31.5, "cy": 23.5, "distortion": []}
    sensor = {"name": "left", "camera": camera, "depth_unit_m": 0.001, "depth_range_m": [0.4, 4.0]}
    colour = {"colour": {"camera": camera, "colour_from_depth": np.eye(4).tolist()}}
    box = {"box": {"size_m": [0.3, 0.2, 0.1]}, "region": {"min": [0, 0, 0], "max": [1, 1, 1]}}
    return [
        json.dumps({"format": "bonetrack-recording", "version": 1, "sensors": [one], **box}).encode()
        for one in (sensor, sensor | colour)
    ]


def _read_calibration(data: bytes, scratch: Path) -> None:
    (scratch / "calibration.json").write_bytes(data)
    read_calibration(scratch / "calibration.json", ["left"])


def _calibration_seeds() -> list[bytes]:
    left = {"world_from_sensor": np.eye(4).tolist(), "residual_mm": 0.5}
    return [json.dumps({"format": "bonetrack-calibration", "version": 1, "sensors": {"left": left}}).encode()]


@functools.cache
def _anatomy() -> Anatomy:
    return load_anatomy("upper-limb-right")


@functools.cache
def _anatomy_file() -> bytes:
    packed = io.BytesIO()
    write_anatomy(_anatomy(), packed)
    return packed.getvalue()


@functools.cache
def made_files() -> tuple[bytes, bytes, bytes]:
    """Files of a subject, of a motion of two frames, and of a pose set by hand."""
    anatomy = _anatomy()
    body, bones, count = make_body(anatomy), len(anatomy.bones), len(anatomy.coordinates)
    subject = Subject(body, np.zeros((2, count)), np.zeros(2), np.eye(len(body.shape)), {"poses": []})
    poses = {bone.name: np.tile(np.eye(4), (2, 1, 1)) for bone in anatomy.bones}
    centres = {joint.name: np.zeros((2, 3)) for joint in anatomy.joints}
    names, per_frame = tuple(c.name for c in anatomy.coordinates), np.zeros(2)
    values = np.zeros((2, count))
    shown = np.ones((2, bones), dtype=bool)
    motion = Motion(
        anatomy.name, names, np.arange(2.0), values, values, ("", ""), *[per_frame] * 3, shown, poses, centres
    )
    with tempfile.TemporaryDirectory() as folder:
        home = Path(folder)
        save_subject(subject, home / "subject.npz")
        save_motion(motion, home)
        write_poses(home / "poses.json", anatomy, [HandPose("one", 0, values[0])])
        one, two, three = ((home / name).read_bytes() for name in ("subject.npz", "motion.npz", "poses.json"))
    return one, two, three


def _members(file: bytes) -> dict[str, bytes]:
    with zipfile.ZipFile(io.BytesIO(file)) as members:
        return {name: members.read(name) for name in members.namelist()}


def _inside(file: Callable[[], bytes], read: Callable[[Path], object], *, array: str = "times") -> Target:
    """What stands inside an ``.npz`` file: its description, and a short array with its header, one after the other.

    A changed byte of the file itself would only fail its checksum.
    """

    def description() -> bytes:
        return str(np.load(io.BytesIO(file()))["description"]).encode()

    def read_changed(data: bytes, scratch: Path) -> None:
        text, _, changed_array = data.partition(_BETWEEN)
        written = io.BytesIO()
        np.save(written, np.array(text.decode("utf-8", errors="replace")))
        changed = _members(file()) | {"description.npy": written.getvalue()}
        changed |= {f"{array}.npy": changed_array} if changed_array else {}
        with zipfile.ZipFile(scratch / "fuzzed.npz", "w") as members:
            for name, content in changed.items():
                members.writestr(name, content)
        read(scratch / "fuzzed.npz")

    return Target(lambda: [description(), description() + _BETWEEN + _members(file())[f"{array}.npy"]], read_changed)


_BETWEEN = b"\0\0\0\0"


def _written(name: str, file: Callable[[], bytes], read: Callable[[Path], object]) -> Target:
    def read_changed(data: bytes, scratch: Path) -> None:
        (scratch / name).write_bytes(data)
        read(scratch / name)

    return Target(lambda: [file()], read_changed)


TARGETS = {
    "openni": _file(".oni", "openni.oni", "openni-mirrored-jpeg.oni"),
    "openni-codec": Target(
        lambda: [b"\x05\x00\x7f\x01\x0f\x66\xe2", b"\x02\x00\x01\x00\x09\x00\x00\x00\x5d"], _read_codec
    ),
    "realsense-bag": _file(".bag", "realsense.bag"),
    "realsense-db3": _file(".db3", "realsense.db3"),
    "azure-kinect": Target(_mkv_seeds, _file(".mkv").read),
    "png": Target(lambda: [_png(scene.readings(0))], _file(".png").read),
    "pcd": Target(_pcd_seeds, _file(".pcd").read),
    "ply": Target(_ply_seeds, _file(".ply").read),
    "tum": Target(lambda: [b"# list\n1.0 depth/0.png\n"], _read_tum),
    "redwood": Target(_redwood_seeds, _read_redwood),
    "colour": Target(lambda: [cv2.imencode(".jpg", scene.colour(0))[1].tobytes(), _png(scene.colour(0))], _read_colour),
    "raw": Target(lambda: [bytes(2 * 16 * 12)], _file(".raw").read),
    "recording": Target(_recording_seeds, _read_recording),
    "calibration": Target(_calibration_seeds, _read_calibration),
    "anatomy": _written("anatomy.npz", _anatomy_file, load_anatomy),
    "inside-an-anatomy": _inside(_anatomy_file, load_anatomy, array="landmarks"),
    "subject": _written("subject.npz", lambda: made_files()[0], load_subject),
    "inside-a-subject": _inside(lambda: made_files()[0], load_subject),
    "motion": _written("motion.npz", lambda: made_files()[1], load_motion),
    "inside-a-motion": _inside(lambda: made_files()[1], load_motion),
    "poses-by-hand": _written("poses.json", lambda: made_files()[2], lambda path: read_poses(path, _anatomy())),
}
