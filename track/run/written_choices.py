"""``bonetrack.toml`` written: what was chosen, what is usual, and as comments what the data tell where nobody chooses.

A file that stands there keeps what people wrote into it, comments and order too; only values that the command line has
otherwise are changed.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click
import tomlkit
from tomlkit.items import Table

from capture.files import replaced_when_complete
from track.run.choices import FILES, LEAVE_OUT, Choices
from track.run.steps import STEPS, Step

_HEAD = (
    "What `bonetrack run` was asked for, and what it took where it was not asked; written by bonetrack.",
    "Change a value, or take a # away, and run again: only what depends on it is done again.",
)


def write_choices(path: Path, choices: Choices) -> None:
    """Write choices into a file, or into one that stands there where it says otherwise.

    Raises:
        OSError: it cannot be written.
    """
    if path.is_file():
        before = path.read_text(encoding="utf-8")
        document = tomlkit.parse(before)
        _update(document, choices)
    else:
        before, document = "", _fresh(choices)
    text = tomlkit.dumps(document)
    if text != before:
        with replaced_when_complete(path) as partial:
            partial.write_text(text, encoding="utf-8")


def _update(document: tomlkit.TOMLDocument, choices: Choices) -> None:
    top = {FILES: list(choices.files), LEAVE_OUT: list(choices.leave_out)}
    for key, value in top.items():
        if value and document.get(key) != value:
            document[key] = value
    for step in STEPS:
        for key, value in choices.of_step.get(step.name, {}).items():
            section = document.setdefault(step.name, tomlkit.table())
            if key not in section or section[key] != value:
                section[key] = value


def _fresh(choices: Choices) -> tomlkit.TOMLDocument:
    document = tomlkit.document()
    for line in _HEAD:
        document.add(tomlkit.comment(line))
    document.add(tomlkit.nl())
    document.add(FILES, tomlkit.item(list(choices.files)).multiline(len(choices.files) > 1))
    document.add(LEAVE_OUT, tomlkit.item(list(choices.leave_out)))
    for step in STEPS:
        document.add(tomlkit.nl())
        document.add(step.name, _section(step, choices.of(step)))
    return document


def _section(step: Step, asked: dict[str, Any]) -> Table:
    section = tomlkit.table()
    for key, option in step.options.items():
        told = " ".join((option.help or "").split())
        if key in asked:
            value = tomlkit.item(asked[key])
            value.comment(told)
            section.add(key, value)
        else:
            section.add(tomlkit.comment(f"{key} = {_blank(option)}  # {told}"))
    return section


def _blank(option: click.Option) -> str:
    """What stands for a value that nobody chose.

    >>> from track.run.steps import ADAPT
    >>> _blank(ADAPT.options["near"]), _blank(ADAPT.options["height"])
    ('[X, Y, Z]', '...')
    """
    one = "..." if option.nargs == 1 else f"[{', '.join((option.metavar or '... ' * option.nargs).split())}]"
    return f"[{one}]" if option.multiple else one
