"""The steps of a run: each is a command of its own, whose options are what can be chosen of it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import click

from adapt.commands import adapt_command
from capture.commands import calibrate_command, import_command
from track.command_group import COMMON
from track.commands import track_command
from track.export.commands import export_command
from track.view.commands import report_command


@dataclass(frozen=True)
class Step:
    """A step: its command, and which parameters the run itself states (files of the steps before, where to write)."""

    name: str
    command: click.Command
    stated_by_run: frozenset[str]

    @cached_property
    def options(self) -> dict[str, click.Option]:
        """What can be chosen, under the option's long name without its dashes."""
        left_out = self.stated_by_run | set(COMMON)
        return {
            max(option.opts, key=len).lstrip("-"): option
            for option in self.command.params
            if isinstance(option, click.Option) and option.name not in left_out
        }

    def usual(self, key: str) -> Any:
        """What an option is where nobody chooses; None where that is found out by the data."""
        value = self.options[key].get_default(click.Context(self.command))
        if isinstance(value, tuple | list):
            return list(value) or None
        return value if isinstance(value, bool | int | float | str) else None

    def arguments(self, chosen: Mapping[str, Any]) -> list[str]:
        """The command line that asks for what is chosen.

        >>> TRACK.arguments({"keep-searching": True, "near": [-0.5, 0.0, 2.0], "threshold": [["least_coverage", 0.6]]})
        ['--keep-searching', '--near', '-0.5', '0.0', '2.0', '--threshold', 'least_coverage', '0.6']
        """
        words: list[str] = []
        for key, value in chosen.items():
            option = self.options[key]
            if option.is_flag:
                words += [f"--{key}"] if value else option.secondary_opts[:1]
            elif option.multiple:
                words += [word for one in value for word in (f"--{key}", *_words(one))]
            elif option.nargs > 1:
                words += [f"--{key}", *_words(value)]
            else:
                words.append(f"--{key}={value}")
        return words


def _words(value: Any) -> Sequence[str]:
    return [str(part) for part in value] if isinstance(value, list) else [str(value)]


# Known matrices are a choice of the calibration, though import takes them, too.
IMPORT = Step("import", import_command, frozenset({"sources", "out", "overwrite", "extrinsics"}))
CALIBRATE = Step("calibrate", calibrate_command, frozenset({"recording"}))
ADAPT = Step("adapt", adapt_command, frozenset({"recording", "out"}))
TRACK = Step("track", track_command, frozenset({"recording", "subject", "out", "anatomy"}))
EXPORT = Step("export", export_command, frozenset({"source", "subject", "out"}))
REPORT = Step("report", report_command, frozenset({"motion", "subject", "recording", "out"}))

STEPS = (IMPORT, CALIBRATE, ADAPT, TRACK, EXPORT, REPORT)
BY_NAME = {step.name: step for step in STEPS}
MAY_BE_LEFT_OUT = (EXPORT.name, REPORT.name)
