"""Recordings of other programs, brought into this program's format: one module for each kind of file."""

from capture.importers.formats import FORMATS, open_source
from capture.importers.images import Kind, import_images, source_files
from capture.importers.names import natural_order
from capture.importers.offset import Motion, Offset, estimate_offset, motion_of
from capture.importers.parts import ShownBox
from capture.importers.run import import_recording
from capture.importers.source import ColourFrame, DepthFrame, Source, Stated

__all__ = [
    "FORMATS",
    "ColourFrame",
    "DepthFrame",
    "Kind",
    "Motion",
    "Offset",
    "ShownBox",
    "Source",
    "Stated",
    "estimate_offset",
    "import_images",
    "import_recording",
    "motion_of",
    "natural_order",
    "open_source",
    "source_files",
]
