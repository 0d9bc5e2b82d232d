"""``bonetrack.toml`` written: what was chosen, what is usual, and as comments what the data tell where nobody chooses.

A file that stands there keeps what people wrote into it, comments and order too; only values that the command line has
otherwise are changed.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import click
import tomlkit
from tomlkit.items import Table

from capture.files import replaced_when_complete
from track.run.choices import FILES, LEAVE_OUT, Choices, checked
from track.run.steps import STEPS, Step

_HEAD = (
    "What `bonetrack run` was asked for, and what it took where it was not asked; written by bonetrack.",
    "Change a value, or take a # away, and run again: only what depends on it is done again.",
)


def write_choices(path: Path, choices: Choices) -> None:
    """Write choices into a file, or into one that stands there where it says otherwise.

    Paths beside the folder of results are written as the way there, so that both can be moved together.

    Raises:
        OSError: it cannot be written.
    """
    if path.is_file():
        before = path.read_text(encoding="utf-8")
        document = tomlkit.parse(before)
        _update(document, choices, path)
    else:
        before, document = "", _fresh(choices, path)
    text = tomlkit.dumps(document)
    if text != before:
        with replaced_when_complete(path) as partial:
            partial.write_text(text, encoding="utf-8")


def _update(document: tomlkit.TOMLDocument, choices: Choices, path: Path) -> None:
    """Put into a document what it says otherwise."""
    said = checked(document.unwrap(), where=path)
    if choices.files and choices.files != said.files:
        document[FILES] = _ways(list(choices.files), path)
    if choices.leave_out and choices.leave_out != said.leave_out:
        document[LEAVE_OUT] = list(choices.leave_out)
    for step in STEPS:
        for key, value in choices.of_step.get(step.name, {}).items():
            if key not in said.of_step.get(step.name, {}) or said.of_step[step.name][key] != value:
                document.setdefault(step.name, tomlkit.table())[key] = _ways(value, path)


def _fresh(choices: Choices, path: Path) -> tomlkit.TOMLDocument:
    document = tomlkit.document()
    for line in _HEAD:
        document.add(tomlkit.comment(line))
    document.add(tomlkit.nl())
    document.add(FILES, tomlkit.item(_ways(list(choices.files), path)))
    document.add(LEAVE_OUT, tomlkit.item(list(choices.leave_out)))
    for step in STEPS:
        document.add(tomlkit.nl())
        document.add(step.name, _section(step, choices.of(step), path))
    return document


def _section(step: Step, asked: dict[str, Any], path: Path) -> Table:
    section = tomlkit.table()
    for key, option in step.options.items():
        told = " ".join((option.help or "").split())
        if key in asked:
            value = tomlkit.item(_ways(asked[key], path))
            value.comment(told)
            section.add(key, value)
        else:
            section.add(tomlkit.comment(f"{key} = {_blank(option)}  # {told}"))
    return section


def _ways(value: Any, path: Path) -> Any:
    """A value with paths beside the folder of the file ``path`` as the ways there; others stay whole."""
    if isinstance(value, list):
        return [_ways(one, path) for one in value]
    if not isinstance(value, str) or not Path(value).is_absolute():
        return value
    beside = path.resolve().parent.parent
    if not Path(value).is_relative_to(beside):
        return value
    return Path(os.path.relpath(value, path.resolve().parent)).as_posix()


def _blank(option: click.Option) -> str:
    """What stands for a value that nobody chose.

    >>> from track.run.steps import ADAPT
    >>> _blank(ADAPT.options["near"]), _blank(ADAPT.options["height"])
    ('[X, Y, Z]', '...')
    """
    one = "..." if option.nargs == 1 else f"[{', '.join((option.metavar or '... ' * option.nargs).split())}]"
    return f"[{one}]" if option.multiple else one
