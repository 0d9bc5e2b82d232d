#!/usr/bin/env bash
# What RealSense's SDK calls "Inverse Brown Conrady" means two things in it. With pyrealsense2 2.59.1.11053 on x86-64, the
# point cloud puts a pixel's place through the polynomial (as the SDK's own documentation has it: it undistorts), and
# rs2_deproject_pixel_to_point solves for the place that the polynomial takes to the pixel, which bends the other way. With the
# coefficients below (640 x 480 px, f = 476 px) the two are up to 48.9 px apart, with k1 = 0.12 alone 63.9 px; the cloud is up
# to 26.2 and 35.4 px from where a lens without distortion would put it. "Brown Conrady": the point cloud ignores the
# coefficients, the deprojection does not (up to 22.7 px).
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3.11 -m venv sdk && sdk/bin/pip install --quiet pyrealsense2==2.59.1.11053 libusb-package==1.0.30.0 numpy==2.2.6

cat > two_ways.py <<'PY'
import ctypes
from importlib.metadata import version

import libusb_package
import numpy as np

ctypes.CDLL(str(libusb_package.get_library_path()), mode=ctypes.RTLD_GLOBAL)
import pyrealsense2 as rs

WIDTH, HEIGHT, F, CX, CY = 640, 480, 476.0, 313.0, 242.0


def lens(model, coefficients):
    made = rs.intrinsics()
    made.width, made.height, made.fx, made.fy, made.ppx, made.ppy = WIDTH, HEIGHT, F, F, CX, CY
    made.model, made.coeffs = model, list(coefficients)
    return made


def of_cloud(made):
    """Where the point cloud puts each pixel (H, W, 2) at 1 m, from a software device's depth of 1 m everywhere."""
    device = rs.software_device()
    sensor = device.add_sensor("Depth")
    video = rs.video_stream()
    video.type, video.index, video.uid, video.fmt, video.intrinsics = rs.stream.depth, 0, 0, rs.format.z16, made
    video.width, video.height, video.fps, video.bpp = WIDTH, HEIGHT, 30, 2
    profile = sensor.add_video_stream(video)
    sensor.add_read_only_option(rs.option.depth_units, 0.001)
    queue = rs.frame_queue(1, True)
    sensor.open(profile)
    sensor.start(queue)
    given = rs.software_video_frame()
    given.pixels, given.stride, given.bpp = np.full((HEIGHT, WIDTH), 1000, np.uint16), 2 * WIDTH, 2
    given.timestamp, given.frame_number, given.domain = 1.0, 1, rs.timestamp_domain.system_time
    given.profile, given.depth_units = profile.as_video_stream_profile(), 0.001
    sensor.on_video_frame(given)
    points = rs.pointcloud().calculate(queue.wait_for_frame(5000))
    vertices = np.asanyarray(points.get_vertices()).view(np.float32).reshape(HEIGHT, WIDTH, 3).astype(float)
    sensor.stop()
    sensor.close()
    assert np.allclose(vertices[..., 2], 1.0)
    return vertices[..., :2]


def of_deprojection(made):
    return np.array(
        [[rs.rs2_deproject_pixel_to_point(made, [u, v], 1.0)[:2] for u in range(WIDTH)] for v in range(HEIGHT)]
    )


def polynomial(x, y, k1, k2, p1, p2, k3):
    r2 = x * x + y * y
    radial = 1.0 + k1 * r2 + k2 * r2**2 + k3 * r2**3
    dx, dy = 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x), 2.0 * p2 * x * y + p1 * (r2 + 2.0 * y * y)
    return np.stack([x * radial + dx, y * radial + dy], axis=-1)


def apart(one, other):
    """The largest distance (px), as it would show at 1 m."""
    return round(F * float(np.linalg.norm(one - other, axis=-1).max()), 1)


print("pyrealsense2", version("pyrealsense2"))
v, u = np.mgrid[:HEIGHT, :WIDTH].astype(float)
x, y = (u - CX) / F, (v - CY) / F
plain = np.stack([x, y], axis=-1)
for model, coefficients, expected in (
    (rs.distortion.inverse_brown_conrady, (0.12, -0.05, 0.002, -0.001, 0.01), [0.0, 26.2, 48.9, 0.2]),
    (rs.distortion.inverse_brown_conrady, (0.12, 0.0, 0.0, 0.0, 0.0), [0.0, 35.4, 63.9, 0.0]),
    (rs.distortion.brown_conrady, (0.12, -0.05, 0.002, -0.001, 0.01), [26.2, 0.0, 22.7, 0.0]),
):
    made = lens(model, coefficients)
    cloud, deprojected = of_cloud(made), of_deprojection(made)
    seen = {
        "cloud - polynomial": apart(cloud, polynomial(x, y, *coefficients)),
        "cloud - no distortion": apart(cloud, plain),
        "cloud - deprojection": apart(cloud, deprojected),
        "polynomial of the deprojection - pixel": apart(
            polynomial(deprojected[..., 0], deprojected[..., 1], *coefficients), plain
        ),
    }
    print(model.name, coefficients, "px:", seen)
    assert list(seen.values()) == expected
PY
sdk/bin/python two_ways.py
