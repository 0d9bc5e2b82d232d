"""Writes ``realsense.bag`` or ``realsense.db3`` with the recorder of the RealSense SDK itself and its software device.

Run as ``python -m tests.sensor_files.make_realsense tests/sensor_files/realsense.bag`` with pyrealsense2 2.55 (which
writes bags), and with 2.59 and ``.db3``. ``--colour-only`` leaves the depth sensor out.
"""

from __future__ import annotations

import math
import sys
import time

import pyrealsense2 as rs

from tests.sensor_files import scene


def main(path: str, *, with_depth: bool) -> None:
    device = rs.software_device()
    depth, depth_profile = (
        _sensor(device, "Depth", rs.stream.depth, rs.format.z16, 2, 0) if with_depth else (None, None)
    )
    colour, colour_profile = _sensor(device, "Color", rs.stream.color, rs.format.rgb8, 3, 1)
    if depth is not None:
        depth.add_read_only_option(rs.option.depth_units, scene.DEPTH_UNIT_M)
        turn = math.radians(scene.COLOUR_FROM_DEPTH_TURN_DEG)
        moved = rs.extrinsics()
        moved.rotation = [math.cos(turn), math.sin(turn), 0, -math.sin(turn), math.cos(turn), 0, 0, 0, 1]
        moved.translation = list(scene.COLOUR_FROM_DEPTH_SHIFT_M)
        depth_profile.register_extrinsics_to(colour_profile, moved)
    recorder = rs.recorder(path, device)
    queue = rs.frame_queue(100)
    for sensor in recorder.query_sensors():
        sensor.open(sensor.get_stream_profiles())
        sensor.start(queue)
    for frame in range(scene.FRAMES):
        if depth is not None:
            _give(depth, depth_profile, scene.readings(frame), frame, depth_unit_m=scene.DEPTH_UNIT_M)
        _give(colour, colour_profile, scene.colour(frame), frame)
        time.sleep(0.05)
    for sensor in recorder.query_sensors():
        sensor.stop()
        sensor.close()


def _sensor(device, name, stream, pixel_format, bytes_a_pixel, unique):
    lens = rs.intrinsics()
    lens.width, lens.height, lens.fx, lens.fy = scene.WIDTH, scene.HEIGHT, scene.FX, scene.FY
    lens.ppx, lens.ppy, lens.model, lens.coeffs = scene.CX, scene.CY, rs.distortion.brown_conrady, [0.0] * 5
    video = rs.video_stream()
    video.type, video.index, video.uid, video.fmt = stream, 0, unique, pixel_format
    video.width, video.height, video.fps, video.bpp = scene.WIDTH, scene.HEIGHT, int(scene.FPS), bytes_a_pixel
    video.intrinsics = lens
    sensor = device.add_sensor(name)
    return sensor, sensor.add_video_stream(video)


def _give(sensor, profile, image, frame, *, depth_unit_m=None):
    given = rs.software_video_frame()
    given.pixels, given.stride, given.bpp = image, image.strides[0], image.strides[1]
    given.timestamp, given.domain = 1000.0 * (5.0 + scene.time_s(frame)), rs.timestamp_domain.hardware_clock
    given.frame_number, given.profile = frame + 1, profile.as_video_stream_profile()
    if depth_unit_m is not None:
        given.depth_units = depth_unit_m
    sensor.on_video_frame(given)


if __name__ == "__main__":
    main(sys.argv[1], with_depth="--colour-only" not in sys.argv)
