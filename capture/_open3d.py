"""The one place that imports Open3D, because its wheel needs a shared library that few systems carry."""

from __future__ import annotations

from functools import cache
from types import ModuleType

from capture.libusb import load_libusb


@cache
def open3d() -> ModuleType:
    """The ``open3d`` module, with libusb loaded first: its import fails where the system has none."""
    load_libusb()
    import open3d as module

    return module
