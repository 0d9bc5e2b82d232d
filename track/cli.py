"""The command ``bonetrack``: joins the commands of the three packages and turns errors into one line."""

from __future__ import annotations

import errno
import os
import sys

import click

from adapt.commands import adapt_command
from capture.commands import calibrate_command, fuse_command, import_command, record_command
from capture.console import stderr
from capture.errors import BonetrackError
from track.accuracy.commands import evaluate_command
from track.batch.commands import batch_command
from track.commands import demo_command, track_command
from track.curves.commands import curves_command
from track.curves.compare_command import compare_command
from track.export.commands import export_command
from track.markers.commands import import_markers_command
from track.simulation.commands import simulate_command
from track.view.commands import report_command, view_command
from track.view.film_commands import movie_command


@click.group(context_settings={"help_option_names": ["-h", "--help"]})
@click.option("--debug", is_flag=True, help="Show the whole traceback of an error.")
@click.version_option(package_name="bonetrack")
def bonetrack(debug: bool) -> None:
    """From depth-sensor recordings of a person to the motion of the bones inside."""


for command in (
    demo_command,
    simulate_command,
    import_command,
    record_command,
    calibrate_command,
    fuse_command,
    adapt_command,
    track_command,
    batch_command,
    evaluate_command,
    export_command,
    curves_command,
    compare_command,
    import_markers_command,
    view_command,
    movie_command,
    report_command,
):
    bonetrack.add_command(command)


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
        stderr.print("stopped")
        sys.exit(1)
    except Exception as error:
        if "--debug" in sys.argv:
            raise
        stderr.print(f"error: {_one_line(error)}", markup=False, highlight=False, soft_wrap=True)
        sys.exit(1)


_REMEDIES = (
    (
        (errno.ENOSPC, errno.EDQUOT, errno.EFBIG),
        "make room, then give the same command again: adapt and track go on where they stopped",
    ),
    ((errno.EACCES, errno.EPERM, errno.EROFS), "give a folder that you may write to, or check the file's permissions"),
)


def _one_line(error: Exception) -> str:
    if isinstance(error, BonetrackError):
        return str(error)
    if isinstance(error, OSError):
        remedy = next((words for numbers, words in _REMEDIES if error.errno in numbers), "check its name and path")
        return f"{error.filename or 'a file'}: {error.strerror or error}; {remedy}"
    return f"unexpected {type(error).__name__}: {error}; run again with --debug and report it"
