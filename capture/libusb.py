"""The shared library that sensors' packages look for and few systems carry: brought by PyPI's ``libusb-package``."""

from __future__ import annotations

import ctypes
from functools import cache


@cache
def load_libusb() -> None:
    """Load libusb so that packages imported afterwards find it loaded."""
    import libusb_package

    ctypes.CDLL(str(libusb_package.get_library_path()), mode=ctypes.RTLD_GLOBAL)
