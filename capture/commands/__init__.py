"""The command line of the capture package: a module for each command, and for options that several have."""

from capture.commands.calibrate import calibrate_command
from capture.commands.fuse import fuse_command
from capture.commands.import_files import import_command
from capture.commands.record import record_command

__all__ = ["calibrate_command", "fuse_command", "import_command", "record_command"]
