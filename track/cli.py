"""The command ``bonetrack``: joins the commands of the three packages and turns errors into one line."""

from __future__ import annotations

import errno
import os
import sys

import click

from adapt.commands import adapt_command
from capture.commands import calibrate_command, fuse_command, import_command, record_command
from capture.console import end_log, stderr
from capture.errors import BonetrackError
from track.accuracy.commands import evaluate_command
from track.batch.commands import batch_command
from track.command_group import StepGroup
from track.commands import demo_command, track_command
from track.curves.commands import curves_command
from track.curves.compare_command import compare_command
from track.doctor.commands import doctor_command
from track.export.commands import export_command
from track.markers.commands import import_markers_command
from track.run.commands import run_command
from track.simulation.commands import simulate_command
from track.view.commands import report_command, view_command
from track.view.film_commands import movie_command


@click.group(cls=StepGroup, context_settings={"help_option_names": ["-h", "--help"]})
@click.option("--debug", is_flag=True, help="Show the whole traceback of an error.")
@click.version_option(package_name="bonetrack")
def bonetrack(debug: bool) -> None:
    """From depth-sensor recordings of a person to the motion of the bones inside."""


bonetrack.add_section("All at once", [run_command, demo_command])
bonetrack.add_section(
    "Capture",
    [import_command, import_markers_command, record_command, simulate_command, calibrate_command, fuse_command],
)
bonetrack.add_section("Adapt", [adapt_command])
bonetrack.add_section("Track", [track_command, batch_command])
bonetrack.add_section(
    "Take out",
    [export_command, report_command, curves_command, compare_command, view_command, movie_command],
)
bonetrack.add_section("Check", [doctor_command, evaluate_command])


def main() -> None:
    """Run the command line: exit code 0 done, 2 wrong command line, 1 any other failure."""
    # The matrices here are small: more BLAS threads cost more than they give. Read once, when numpy is imported.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    try:
        bonetrack.main(prog_name="bonetrack", standalone_mode=False)
    except click.ClickException as error:
        error.show()
        sys.exit(error.exit_code)
    except (click.Abort, KeyboardInterrupt):
        stderr.print("stopped; the same command goes on from here" if _command() in _GO_ON else "stopped")
        sys.exit(1)
    except Exception as error:
        if "--debug" in sys.argv:
            raise
        stderr.print(f"error: {_one_line(error)}", markup=False, highlight=False, soft_wrap=True)
        sys.exit(1)
    finally:
        end_log()


_FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
_MAY_NOT = (errno.EACCES, errno.EPERM, errno.EROFS)

_GO_ON = ("adapt", "batch", "demo", "run", "track")
"""Commands that go on where they stopped; the others are done anew."""


def _command() -> str:
    """The command that is run."""
    return next((word for word in sys.argv[1:] if word in bonetrack.commands), "")


def _one_line(error: Exception) -> str:
    if isinstance(error, BonetrackError):
        return str(error)
    if isinstance(error, OSError):
        return f"{error.filename or 'a file'}: {error.strerror or error}; {_remedy(error)}"
    return f"unexpected {type(error).__name__}: {error}; run again with --debug and report it"


def _remedy(error: OSError) -> str:
    """What to do about an error of the operating system, in the command that is run."""
    if error.errno in _FULL:
        goes_on = "it goes on where it stopped" if _command() in _GO_ON else "it is done anew"
        return f"make room, then give the same command again: {goes_on}"
    if error.errno in _MAY_NOT:
        return "give a folder that you may write to, or check the file's permissions"
    return "check its name and path"
