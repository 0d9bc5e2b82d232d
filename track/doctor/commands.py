"""The command ``bonetrack doctor``."""

from __future__ import annotations

from pathlib import Path

import click

from capture.console import tell


@click.command("doctor")
@click.argument("place", type=click.Path(path_type=Path), default=Path())
def doctor_command(place: Path) -> None:
    """Say what is installed, what is missing for what, and whether this machine is fit.

    PLACE is the folder where results are to be written; the present one if none is named. Ends with code 1 where
    something is missing without which nothing runs; a missing package of one format or feature is no failure.
    """
    from capture.errors import BonetrackError
    from capture.progress import progress
    from track.doctor.machine import machine
    from track.doctor.packages import extras, program

    with progress("looking"):
        sections = {
            "The program": program(),
            "Formats and features": extras(),
            "The machine": machine(place),
        }
    for title, findings in sections.items():
        tell(title)
        for finding in findings:
            tell(finding.line())
    every = [finding for findings in sections.values() for finding in findings]
    if bad := [finding for finding in every if finding.state == "bad"]:
        told = "; ".join(finding.told for finding in bad)
        raise BonetrackError(f"not fit: {told}", remedy="the lines marked bad say what to do")
    missing = sum(finding.state == "missing" for finding in every)
    tell("fit" if not missing else f"fit, but for {missing} thing{'s' if missing > 1 else ''} marked missing")
