"""What all commands have in common: help grouped by step and not cut off, ``--log``, ``--quiet``."""

from __future__ import annotations

import shlex
import shutil
import sys
from collections.abc import Sequence
from pathlib import Path

import click

from capture.console import be_quiet, begin_log

WIDEST = 120
"""Columns of help; less where the terminal has fewer."""


def _columns() -> int:
    """Of the terminal that help goes to, if it goes to one."""
    return min(WIDEST, shutil.get_terminal_size((WIDEST, 24)).columns) if sys.stdout.isatty() else WIDEST


def _log(context: click.Context, parameter: click.Parameter, path: Path | None) -> None:
    if path is not None:
        try:
            begin_log(path, shlex.join(["bonetrack", *sys.argv[1:]]))
        except OSError as error:
            raise click.BadParameter(f"{path}: {error.strerror}", param_hint="--log") from None


def _quiet(context: click.Context, parameter: click.Parameter, quiet: bool) -> None:
    if quiet:
        be_quiet()


def _common() -> list[click.Parameter]:
    """Options that every command has."""
    return [
        click.Option(
            ["--log"],
            type=click.Path(path_type=Path, dir_okay=False),
            expose_value=False,
            is_eager=True,
            callback=_log,
            help="Also add all that is said, and how far the work has come, to this file.",
        ),
        click.Option(
            ["--quiet"], is_flag=True, expose_value=False, is_eager=True, callback=_quiet, help="Say problems alone."
        ),
    ]


COMMON = ("log", "quiet")
"""Names of those options."""


class StepGroup(click.Group):
    """Commands in sections, one for each step of the work.

    >>> group = StepGroup("bonetrack")
    >>> group.add_section("Look", [click.Command("look", help="Look at it. With all that is known.")])
    >>> print(group.get_help(click.Context(group, info_name="bonetrack")))
    Usage: bonetrack [OPTIONS] COMMAND [ARGS]...
    <BLANKLINE>
    Options:
      --help  Show this message and exit.
    <BLANKLINE>
    Look:
      look  Look at it.
    """

    sections: dict[str, list[str]]

    def add_section(self, title: str, commands: Sequence[click.Command]) -> None:
        """Add commands under a title; each gets the common options."""
        self.sections = {**getattr(self, "sections", {}), title: [str(command.name) for command in commands]}
        for command in commands:
            known = {parameter.name for parameter in command.params}
            command.params += [option for option in _common() if option.name not in known]
            self.add_command(command)

    def make_context(
        self, info_name: str | None, args: list[str], parent: click.Context | None = None, **extra: object
    ) -> click.Context:
        """The context of a command line; commands take their width from it."""
        return super().make_context(info_name, args, parent, terminal_width=_columns(), **extra)

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Names in the order of the work."""
        return [name for names in self.sections.values() for name in names]

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """The commands by section, each with its first sentence, whole."""
        widest = max(map(len, self.list_commands(ctx)))
        for title, names in self.sections.items():
            rows = [(name.ljust(widest), self.commands[name].get_short_help_str(limit=1000)) for name in names]
            with formatter.section(title):
                formatter.write_dl(rows)
