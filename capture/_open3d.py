"""The one place that imports Open3D, because its wheel needs a shared library that few systems carry."""

from __future__ import annotations

import ctypes
from functools import cache
from types import ModuleType


@cache
def open3d() -> ModuleType:
    """The ``open3d`` module, with libusb loaded first: its import fails where the system has none."""
    import libusb_package

    ctypes.CDLL(str(libusb_package.get_library_path()), mode=ctypes.RTLD_GLOBAL)
    import open3d as module

    return module
