"""What is chosen for a run: ``bonetrack.toml`` beside the results, read, checked and written.

A section a step, a key an option of the step's command. What is known of options stands there alone: names,
types, ranges and what they are where nobody chooses. Paths are taken from the file's folder.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import click

from adapt.anatomy_file import is_path
from capture.errors import BonetrackError
from track.run.steps import BY_NAME, MAY_BE_LEFT_OUT, STEPS, Step

FILE = "bonetrack.toml"
FILES, LEAVE_OUT = "files", "leave-out"


class RunError(BonetrackError):
    """A run cannot be begun or gone on with as it is asked for."""


@dataclass(frozen=True)
class Choices:
    """What is chosen: the sensors' ``files`` or a recording, steps to leave out, and values by step and option."""

    files: tuple[str, ...] = ()
    leave_out: tuple[str, ...] = ()
    of_step: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)

    def of(self, step: Step) -> dict[str, Any]:
        """All that is asked of a step, with what is usual where nobody chose; without what the data tell."""
        chosen = self.of_step.get(step.name, {})
        asked = {key: chosen.get(key, step.usual(key)) for key in step.options}
        return {key: value for key, value in asked.items() if value is not None}

    def with_more(self, more: Choices) -> Choices:
        """These with others put over them, as the command line has them."""
        sections = {step.name: {**self.of_step.get(step.name, {}), **more.of_step.get(step.name, {})} for step in STEPS}
        left_out = tuple(dict.fromkeys(self.leave_out + more.leave_out))
        return Choices(more.files or self.files, left_out, sections)


def read_choices(path: Path) -> Choices:
    """The choices that stand in a file; none where there is none. Paths come whole.

    Raises:
        RunError: not TOML, or a key or value that there is not; the line names it and the file.

    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     file = Path(folder, FILE)
    ...     _ = file.write_text("[adapt]\\nposes = 5\\n[track]\\nthreshold = [['least_coverage', 0.6]]")
    ...     choices = read_choices(file)
    >>> choices.of_step
    {'adapt': {'poses': 5}, 'track': {'threshold': [['least_coverage', 0.6]]}}
    """
    try:
        content = tomllib.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        return Choices()
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise RunError(f"is not TOML: {error}", where=path, remedy="mend that line, or move the file away") from error
    return checked(content, where=path)


def checked(content: Mapping[str, Any], *, where: Path) -> Choices:
    """Choices as TOML has them, if there are such options and they can be so; paths from the folder of ``where``.

    Raises:
        RunError: a key or a value that there is not.
    """
    known = [FILES, LEAVE_OUT, *BY_NAME]
    _refuse_unknown(content, known, "", where)
    files, left_out = content.get(FILES, []), content.get(LEAVE_OUT, [])
    _refuse(FILES, files, _texts(files), "a list of texts", where)
    _refuse(LEAVE_OUT, left_out, _texts(left_out), "a list of texts", where)
    for step in left_out:
        _refuse(LEAVE_OUT, step, step in MAY_BE_LEFT_OUT, f"of {', '.join(MAY_BE_LEFT_OUT)}", where)
    sections: dict[str, dict[str, Any]] = {}
    for name in (name for name in content if name in BY_NAME):
        step, section = BY_NAME[name], content[name]
        _refuse(name, section, isinstance(section, dict), "a section", where)
        _refuse_unknown(section, list(step.options), f"[{name}] ", where)
        sections[name] = {key: _value(step, key, value, where) for key, value in section.items()}
    return Choices(tuple(_whole(file, where) for file in files), tuple(left_out), sections)


def _value(step: Step, key: str, value: Any, where: Path) -> Any:
    """The value of an option, if it is one, with a path made whole."""
    option, name = step.options[key], f"[{step.name}] {key}"
    if option.multiple and option.nargs == 1 and not isinstance(value, list):
        value = [value]  # once for all
    wanted = _wanted(option)
    _refuse(name, value, _is_of(option, value), wanted, where)
    try:
        option.type_cast_value(click.Context(step.command), value)
    except click.BadParameter as error:
        problem = f"{name} cannot be {value!r}: {error.message}"
        raise RunError(problem, where=where, remedy=f"give {wanted}") from None
    if not _is_path_option(option, value):
        return value
    return [_whole(one, where) for one in value] if isinstance(value, list) else _whole(value, where)


def _is_path_option(option: click.Option, value: Any) -> bool:
    return isinstance(option.type, click.Path) or (option.name == "anatomy" and is_path(value))


def _whole(path: str, where: Path) -> str:
    return str((where.parent / path).resolve())


def _is_of(option: click.Option, value: Any) -> bool:
    """Whether a value is of the kind that an option takes; none is turned into another kind."""
    if option.is_flag:
        return isinstance(value, bool)
    if not option.multiple:
        return _is_one(option, value)
    return isinstance(value, list) and all(_is_one(option, one) for one in value)


def _is_one(option: click.Option, value: Any) -> bool:
    if option.nargs == 1:
        return _is_scalar(option.type, value)
    types = option.type.types if isinstance(option.type, click.Tuple) else [option.type] * option.nargs
    if not isinstance(value, list) or len(value) != option.nargs:
        return False
    return all(_is_scalar(type, one) for type, one in zip(types, value, strict=True))


def _is_scalar(type: click.ParamType[Any], value: Any) -> bool:
    if isinstance(value, bool):
        return False
    if isinstance(type, click.types.IntParamType):
        return isinstance(value, int)
    if isinstance(type, click.types.FloatParamType):
        return isinstance(value, int | float)
    return isinstance(value, str)


def _wanted(option: click.Option) -> str:
    """What an option takes, in words.

    >>> from track.run.steps import ADAPT, TRACK
    >>> _wanted(ADAPT.options["near"]), _wanted(ADAPT.options["poses"]), _wanted(TRACK.options["keep-searching"])
    ('3 numbers [X, Y, Z]', 'a whole number', 'true or false')
    """
    if option.is_flag:
        return "true or false"
    if option.nargs > 1:
        names = (option.metavar or " ".join(["..."] * option.nargs)).split()
        mixed = isinstance(option.type, click.Tuple) and any(_kind(one) != "a number" for one in option.type.types)
        one = f"{option.nargs} {'values' if mixed else 'numbers'} [{', '.join(names)}]"
        return f"a list of {one}" if option.multiple else one
    kind = _kind(option.type)
    return f"a list, each {kind}" if option.multiple else kind


def _kind(type: click.ParamType[Any]) -> str:
    if isinstance(type, click.types.IntParamType):
        return "a whole number"
    if isinstance(type, click.types.FloatParamType):
        return "a number"
    if isinstance(type, click.Choice):
        return f"one of {', '.join(map(str, type.choices))}"
    return "a text in quotes"


def _texts(value: Any) -> bool:
    return isinstance(value, list) and all(isinstance(one, str) for one in value)


def _refuse(name: str, value: Any, fits: bool, wanted: str, where: Path) -> None:
    if not fits:
        raise RunError(f"{name} cannot be {value!r}", where=where, remedy=f"give {wanted}")


def _refuse_unknown(content: Mapping[str, Any], known: Sequence[str], section: str, where: Path) -> None:
    unknown = next((key for key in content if key not in known), None)
    if unknown is not None:
        raise RunError(f"{section}{unknown} is unknown", where=where, remedy=f"there are {', '.join(known)}")
