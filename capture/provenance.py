"""With what a result was made: the versions of the software, and where the limb was looked for.

Results keep this as plain JSON, so that whoever finds one years later can tell, and make it again.
"""

from __future__ import annotations

import platform
from collections.abc import Mapping
from dataclasses import asdict
from importlib import metadata
from typing import Any

from capture.cloud.fuse import found_region, region_of_interest
from capture.recording import FramesUsed, Recording, Region, frames_used, used_in_words
from capture.recording.fingerprint import fingerprint

_DECIDING = ("bonetrack", "numpy", "scipy", "numba", "open3d", "opencv-contrib-python-headless", "libigl")
"""Distributions that numbers depend on."""


def version_of(distribution: str) -> str:
    """An installed distribution's version.

    >>> version_of("no such thing")
    'not installed'
    """
    try:
        return metadata.version(distribution)
    except metadata.PackageNotFoundError:
        return "run from a checkout" if distribution == "bonetrack" else "not installed"


def versions() -> dict[str, str]:
    """Versions of the program, of Python, and of what the numbers depend on."""
    return {"Python": platform.python_version()} | {name: version_of(name) for name in _DECIDING}


def recording_used(recording: Recording) -> dict[str, str]:
    """Which recording a result is made from: what its folder is called, and what tells it from others."""
    return {"recording": recording.path.resolve().name, "recording_fingerprint": fingerprint(recording)}


def region_used(recording: Recording, given: Region | None) -> dict[str, Any]:
    """The region (m, in the common frame) that a recording's clouds are cut out with, and where it comes from.

    Of an automatic one also lines that say what else was there of a person's size.

    >>> from pathlib import Path
    >>> import numpy as np
    >>> region_used(Recording(Path("walk"), ()), Region(np.zeros(3), np.array([1.0, 1.0, 2.0])))
    {'region': 'given', 'region_minimum_m': [0.0, 0.0, 0.0], 'region_maximum_m': [1.0, 1.0, 2.0]}
    """
    region = given or region_of_interest(recording)
    source = "given" if given is not None else "automatic" if recording.region is None else "of the recording"
    used = {"region": source, "region_minimum_m": region.minimum.tolist(), "region_maximum_m": region.maximum.tolist()}
    return used | ({"left_out": list(found_region(recording).left_out)} if source == "automatic" else {})


def sensors_used(recording: Recording) -> dict[str, Any]:
    """How many frames of each sensor its instants use, and what was mended of the recording as it was opened."""
    return {"frames_used": [asdict(used) for used in frames_used(recording)], "mended": list(recording.mended)}


def sensors_in_words(settings: Mapping[str, Any]) -> list[str]:
    """What people are told of ``sensors_used`` and ``region_used``, which stand in settings; nothing of others.

    >>> sensors_in_words({"frames_used": [{"sensor": "a", "total": 9, "used": 9, "stale": 0}], "mended": []})
    ['frames used: a 9 of 9']
    """
    used = [FramesUsed(**one) for one in settings.get("frames_used", [])]
    told = [f"mended: {line}" for line in settings.get("mended", [])]
    told += [f"left out of the region: {line}" for line in settings.get("left_out", [])]
    return told + (used_in_words(used) if used else [])
