"""Recordings of other programs, brought into this program's format: one module for each kind of file."""

from capture.importers.formats import FORMATS, open_source
from capture.importers.images import Kind, import_images, source_files
from capture.importers.into_recording import import_recording
from capture.importers.names import natural_order
from capture.importers.offset import MotionSignal, Offset, estimate_offset, motion_of
from capture.importers.options import ImportOptions
from capture.importers.source import ColourFrame, DepthFrame, Source, UserCamera
from capture.importers.time_ranges import ShownBox

__all__ = [
    "FORMATS",
    "ColourFrame",
    "DepthFrame",
    "ImportOptions",
    "Kind",
    "MotionSignal",
    "Offset",
    "ShownBox",
    "Source",
    "UserCamera",
    "estimate_offset",
    "import_images",
    "import_recording",
    "motion_of",
    "natural_order",
    "open_source",
    "source_files",
]
