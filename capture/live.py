"""Recording what RealSense cameras see, as they see it; needs PyPI ``pyrealsense2``.

Each camera's depth goes into the recording frame by frame, so that nothing but a few frames is in memory. Times are the
SDK's; where it gives them in one domain for all cameras (system time, or global time, which D400 cameras have), they
share one clock as they are.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from capture.errors import RecordingError
from capture.importers.realsense import Lens, camera_of
from capture.importers.source import DEPTH_RANGE_M, optional_module
from capture.importers.time_ranges import Parts, ShownBox
from capture.libusb import load_libusb
from capture.recording import Recording, RecordingWriter, Sensor, open_recording

WAITING_FRAMES = 60
"""So many frames of a camera may wait to be written before some are lost."""

_LONGEST_SILENCE_S = 5.0
_ALL_ALIKE = {"system_time", "global_time"}

Progress = Callable[[float, int, int], None]
"""Called after each frame with the seconds recorded, the frames written and the frames lost, of all cameras."""


@dataclass
class _Camera:
    """One camera that runs: its sensor of the SDK, the frames that wait, and how far it has come."""

    sensor: Sensor
    device: Any
    queue: Any
    last_s: float | None = None
    last_number: int | None = None
    written: int = 0
    lost: int = 0


def connected(where: Path) -> list[Any]:
    """The RealSense devices that are connected and have depth.

    Raises:
        RecordingError: there is none, or ``pyrealsense2`` is not installed.
    """
    load_libusb()
    rs = optional_module("pyrealsense2", extra="realsense-live", where=where)
    devices = [device for device in rs.context().query_devices() if any(s.is_depth_sensor() for s in device.sensors)]
    if not devices:
        raise RecordingError("no RealSense camera with depth is connected", where=where, remedy="connect one")
    return devices


def record(
    devices: Sequence[Any],
    out: Path,
    *,
    seconds: float,
    sensor_names: Sequence[str] = (),
    box: ShownBox | None = None,
    overwrite: bool = False,
    progress: Progress | None = None,
) -> Recording:
    """Record devices of ``pyrealsense2`` for so long, each a sensor; time 0 is the first frame of any.

    Frames of the time at which the ``box`` is shown are kept apart from the others. Ctrl-C ends the recording early;
    what was recorded stays.

    Raises:
        RecordingError: a device without usable depth, cameras without a common clock, no frames for five seconds, or
            ``out`` is in use.
    """
    load_libusb()
    rs = optional_module("pyrealsense2", extra="realsense-live", where=out)
    names = _names(sensor_names, len(devices), out)
    profiles = [_depth_profile(rs, device, out) for device in devices]
    cameras = [
        _Camera(_described(rs, device, profile, name, out), device.first_depth_sensor(), rs.frame_queue(WAITING_FRAMES))
        for device, profile, name in zip(devices, profiles, names, strict=True)
    ]
    sensors = [camera.sensor for camera in cameras]
    with RecordingWriter(out, sensors=sensors, created_by="bonetrack record", overwrite=overwrite) as writer:
        if box is not None:
            writer.set_box(box.size_m)
        started: list[_Camera] = []
        try:
            for camera, profile in zip(cameras, profiles, strict=True):
                camera.device.open(profile)
                started.append(camera)
                camera.device.start(camera.queue)
            _write(writer, cameras, seconds, Parts(None if box is None else box.seconds), progress)
        except KeyboardInterrupt:
            if not any(camera.written for camera in cameras):
                raise
        except RuntimeError as error:
            raise RecordingError(
                f"a camera failed ({' '.join(str(error).split())})", where=out, remedy="connect it again"
            ) from error
        finally:
            for camera in started:
                camera.device.stop()
                camera.device.close()
    return open_recording(out)


def _names(given: Sequence[str], count: int, out: Path) -> list[str]:
    """The names of so many cameras, as given, or numbered."""
    names = list(given) or (["sensor"] if count == 1 else [f"sensor-{i + 1}" for i in range(count)])
    if len(set(names)) != count:
        raise RecordingError(
            f"{count} cameras need as many different names", where=out, remedy="give --sensor once for each"
        )
    return names


def _write(
    writer: RecordingWriter, cameras: list[_Camera], seconds: float, parts: Parts, progress: Progress | None
) -> None:
    """Write what the cameras give until ``seconds`` are recorded."""
    zero_s: float | None = None
    heard = time.monotonic()
    while True:
        waited = [(camera, camera.queue.poll_for_frame()) for camera in cameras]
        arrived = [(camera, frame) for camera, frame in waited if frame]
        if not arrived:
            if time.monotonic() - heard > _LONGEST_SILENCE_S:
                raise RecordingError("no camera gives frames any more", where=writer.path, remedy="connect it again")
            time.sleep(0.002)
            continue
        heard = time.monotonic()
        for camera, frame in arrived:
            domain = frame.get_frame_timestamp_domain().name
            if len(cameras) > 1 and domain not in _ALL_ALIKE:
                raise RecordingError(
                    f"the cameras share no clock (times are of {domain})",
                    where=writer.path,
                    remedy="record each to a file of its own and join them with `bonetrack import`",
                )
            time_s = frame.get_timestamp() / 1000.0
            zero_s = time_s if zero_s is None else zero_s
            if time_s - zero_s >= seconds:
                return
            _write_frame(writer, camera, frame, time_s - zero_s, parts)
        if progress is not None and zero_s is not None:
            latest = max(camera.last_s for camera in cameras if camera.last_s is not None)
            progress(latest, sum(camera.written for camera in cameras), sum(camera.lost for camera in cameras))


def _write_frame(writer: RecordingWriter, camera: _Camera, frame: Any, time_s: float, parts: Parts) -> None:
    """Write a frame, unless it is one that was given already; count those that never came."""
    number = int(frame.get_frame_number())
    if camera.last_s is not None and not time_s > camera.last_s:
        return
    if camera.last_number is not None and number > camera.last_number + 1:
        camera.lost += number - camera.last_number - 1
    add = writer.add_box_frame if parts.of(time_s) == "box" else writer.add_frame
    add(camera.sensor.name, np.asanyarray(frame.get_data()), time_s)
    camera.last_s, camera.last_number = time_s, number
    camera.written += 1


def _depth_profile(rs: Any, device: Any, out: Path) -> Any:
    """The depth profile that the device itself proposes, else its first."""
    profiles = [
        profile
        for profile in device.first_depth_sensor().get_stream_profiles()
        if profile.stream_type() == rs.stream.depth and profile.format() == rs.format.z16
    ]
    if not profiles:
        raise RecordingError("a camera has no 16-bit depth", where=out, remedy="disconnect it")
    return next((profile for profile in profiles if profile.is_default()), profiles[0])


def _described(rs: Any, device: Any, profile: Any, name: str, out: Path) -> Sensor:
    """The sensor as recordings know it."""
    told = profile.as_video_stream_profile().get_intrinsics()
    # The SDK's name of a model, brown_conrady, is "Brown Conrady" in its files.
    model = told.model.name.replace("_", " ").title()
    lens = Lens(told.width, told.height, told.fx, told.fy, told.ppx, told.ppy, model, tuple(told.coeffs))
    unit_m = float(f"{device.first_depth_sensor().get_depth_scale():.7g}")
    return Sensor(name, camera_of(lens, out), unit_m, DEPTH_RANGE_M)
