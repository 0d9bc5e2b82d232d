"""Writes small ``.mkv`` files laid out as Azure Kinect's recorder does (tracks by title, calibration attached)."""

from __future__ import annotations

import copy
import json
import struct
from collections.abc import Mapping
from fractions import Fraction
from pathlib import Path
from types import MappingProxyType

import av
import cv2
import numpy as np
from numpy.typing import NDArray

WIDTH, HEIGHT = 320, 288
FRAMES, FPS = 3, 30
LENS = [0.51, 0.52, 0.49, 0.48, 0.5, -0.02, -0.003, 0.9, 0.08, -0.01, 0, 0, -7e-5, 2e-5]
"""cx, cy, fx, fy by the sensor's side; k1 to k6; centre of distortion; p2, p1."""

CALIBRATION = {
    "CalibrationInformation": {
        "Cameras": [
            {
                "Location": f"CALIBRATION_CameraLocation{place}",
                "Intrinsics": {
                    "ModelParameters": LENS,
                    "ModelType": "CALIBRATION_LensDistortionModelBrownConrady",
                },
                "Rt": {"Rotation": [1, 0, 0, 0, 1, 0, 0, 0, 1], "Translation": shift},
            }
            for place, shift in (("D0", [0, 0, 0]), ("PV0", [-0.032, -0.002, 0.004]))
        ]
    }
}


def readings(frame: int) -> NDArray[np.uint16]:
    """Depth readings (mm)."""
    v, u = np.mgrid[:HEIGHT, :WIDTH]
    return np.where((u - 160) ** 2 + (v - 144) ** 2 < 120**2, 900 + u + 2 * v + 100 * frame, 0).astype(np.uint16)


def changed(*, delete: tuple = (), **values: object) -> dict:
    """The calibration with keys of the depth camera's lens replaced or deleted."""
    calibration = copy.deepcopy(CALIBRATION)
    lens = calibration["CalibrationInformation"]["Cameras"][0]["Intrinsics"]
    lens.update(values)
    for key in delete:
        del lens[key]
    return calibration


def write(
    path: Path,
    *,
    calibration: object = CALIBRATION,
    tracks: tuple[str, ...] = ("COLOR", "DEPTH"),
    with_frames: bool = True,
    tags: Mapping[str, str] = MappingProxyType({}),
) -> Path:
    """Write a recording with these tracks and tags; a calibration that is a string is attached as it is, None not."""
    with av.open(str(path), "w", format="matroska", options={"allow_raw_vfw": "1"}) as container:
        streams = {}
        container.metadata.update(tags)
        for title in tracks:
            stream = container.add_stream("mjpeg" if title == "COLOR" else "rawvideo", rate=FPS)
            stream.width, stream.height = (64, 36) if title == "COLOR" else (WIDTH, HEIGHT)
            stream.pix_fmt = "yuvj420p" if title == "COLOR" else "gray16be"
            stream.time_base = Fraction(1, 1000)
            stream.metadata["title"] = title
            streams[title] = stream
        if calibration is not None:
            text = calibration if isinstance(calibration, str) else json.dumps(calibration)
            container.add_attachment("calibration.json", "application/octet-stream", text.encode())
        for frame in range(FRAMES if with_frames else 0):
            for title, stream in streams.items():
                packet = av.Packet(_jpeg(frame) if title == "COLOR" else readings(frame).astype(">u2").tobytes())
                packet.stream, packet.time_base = stream, Fraction(1, 1000)
                packet.pts = packet.dts = 500 + round(1000 * frame / FPS)
                packet.is_keyframe = True
                container.mux(packet)
        if not with_frames:
            container.start_encoding()
    # The library leaves the code of the pixel format out, which the SDK's recorder writes.
    header = struct.pack("<IiiHH", 40, WIDTH, -HEIGHT, 1, 16)
    path.write_bytes(path.read_bytes().replace(header + bytes(4), header + b"b16g"))
    return path


def _jpeg(frame: int) -> bytes:
    return cv2.imencode(".jpg", np.full((36, 64, 3), 40 * frame, np.uint8))[1].tobytes()
