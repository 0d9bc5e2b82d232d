"""Writes the ``.oni`` files of this folder with OpenNI 2's own recorder and a driver that shows known images.

Run as ``python -m tests.sensor_files.make_openni`` with PyPI ``openni``, g++, and OpenNI 2 (Debian: libopenni2-0 and
libopenni2-dev; ``--root`` names where they were unpacked).
"""

from __future__ import annotations

import argparse
import math
import os
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from tests.sensor_files import scene

FOLDER = Path(__file__).parent
DEPTH_MM, DEPTH_100_UM, SHIFT = 100, 101, 102

FILES = {
    "openni.oni": {"SCENE_DEPTH_FORMAT": DEPTH_100_UM, "SCENE_MIRRORED": 0, "streams": "depth colour"},
    "openni-mirrored-jpeg.oni": {"SCENE_DEPTH_FORMAT": DEPTH_MM, "SCENE_MIRRORED": 1, "streams": "depth lossy"},
    "openni-colour-only.oni": {"SCENE_DEPTH_FORMAT": DEPTH_MM, "SCENE_MIRRORED": 0, "streams": "colour"},
    "openni-uncompressed-shift.oni": {"SCENE_DEPTH_FORMAT": SHIFT, "SCENE_MIRRORED": 0, "streams": "depth"},
}
"""What each file is for: 16zT depth and raw colour; a mirrored one with JPEG; no depth; depth that is none."""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--root", type=Path, default=Path("/"))
    parser.add_argument("--one", help=argparse.SUPPRESS)  # OpenNI starts once in a process
    options = parser.parse_args()
    if options.one:
        record(FOLDER / options.one, FILES[options.one]["streams"].split())
        return
    with tempfile.TemporaryDirectory() as scratch:
        redist = Path(scratch)
        environment = os.environ | prepare(redist, options.root)
        for name, settings in FILES.items():
            settings = {key: str(value) for key, value in settings.items() if key.startswith("SCENE")}
            command = [sys.executable, "-m", __spec__.name, "--one", name]
            subprocess.run(command, env=environment | settings, check=True)


def prepare(redist: Path, root: Path) -> dict[str, str]:
    """A folder with OpenNI, this driver and no other; the settings that all files share."""
    drivers = redist / "OpenNI2" / "Drivers"
    drivers.mkdir(parents=True)
    library = next(root.glob("usr/lib/*/libOpenNI2.so.0"))
    shutil.copy(library, redist / "libOpenNI2.so")
    include = root / "usr" / "include" / "openni2"
    build = ["g++", "-O1", "-shared", "-fPIC", f"-I{include}", str(FOLDER / "openni_driver.cpp")]
    subprocess.run([*build, "-o", str(drivers / "libscene.so.0"), "-lpthread"], check=True)
    np.stack([scene.readings(frame) for frame in range(scene.FRAMES)]).tofile(redist / "depth")
    np.stack([scene.colour(frame) for frame in range(scene.FRAMES)]).tofile(redist / "colour")
    return {
        "SCENE_REDIST": str(redist),
        "SCENE_DEPTH": str(redist / "depth"),
        "SCENE_COLOUR": str(redist / "colour"),
        "SCENE_WIDTH": str(scene.WIDTH),
        "SCENE_HEIGHT": str(scene.HEIGHT),
        "SCENE_HFOV": repr(2.0 * math.atan(scene.WIDTH / 2.0 / scene.FX)),
        "SCENE_VFOV": repr(2.0 * math.atan(scene.HEIGHT / 2.0 / scene.FY)),
    }


def record(path: Path, streams: list[str]) -> None:
    """Record the driver's images."""
    from openni import openni2

    openni2.initialize(os.environ["SCENE_REDIST"])
    device = openni2.Device.open_any()
    opened = []
    recorder = None
    for stream in streams:
        video = device.create_depth_stream() if stream == "depth" else device.create_color_stream()
        recorder = recorder or openni2.Recorder(str(path).encode())
        recorder.attach(video, stream == "lossy")
        opened.append(video)
    recorder.start()
    for video in opened:
        video.start()
    time.sleep(1.5)
    recorder.stop()
    for video in opened:
        video.stop()
    openni2.unload()


if __name__ == "__main__":
    main()
