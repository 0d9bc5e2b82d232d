"""The command ``bonetrack run``."""

from __future__ import annotations

import tomllib
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from track.run.steps import ADAPT, BY_NAME, CALIBRATE, EXPORT, IMPORT, MAY_BE_LEFT_OUT, TRACK, Step

if TYPE_CHECKING:
    from track.run.choices import Choices

_PATH = click.Path(path_type=Path)

_ALSO_HERE: dict[str, tuple[Step, ...]] = {
    "anatomy": (ADAPT,),
    "height": (ADAPT,),
    "mass": (ADAPT,),
    "sex": (ADAPT,),
    "near": (ADAPT, TRACK),
    "region": (ADAPT, TRACK),
    "format": (IMPORT,),
    "fx": (IMPORT,),
    "unit-mm": (IMPORT,),
    "mirrored": (IMPORT,),
    "sensor": (IMPORT,),
    "offset": (IMPORT,),
    "seconds": (IMPORT,),
    "box": (IMPORT,),
    "box-seconds": (IMPORT,),
    "box-source": (IMPORT,),
    "extrinsics": (CALIBRATE,),
    "gltf": (EXPORT,),
}
"""Options of steps that are options of the run, too, because most people need one of them; ``--set`` has the others."""


def _with_options_of_steps(command: click.Command) -> click.Command:
    """The command with those options, each as its step has it, but never required and with no value of its own."""
    for key, steps in _ALSO_HERE.items():
        option = steps[0].options[key]
        named = [max(option.opts, key=len), key.replace("-", "_")]
        kind: Any = {"is_flag": True} if option.is_flag else {"type": option.type, "nargs": option.nargs}
        more: Any = {"multiple": option.multiple, "default": None, "metavar": option.metavar, "help": option.help}
        command.params.append(click.Option(named, **kind, **more))
    return command


@click.command("run")
@click.argument("files", type=_PATH, nargs=-1, metavar="FILES...")
@click.option("--out", required=True, type=_PATH, help="The folder of results to make, or to go on with.")
@click.option(
    "--set",
    "set_",
    nargs=2,
    type=str,
    multiple=True,
    metavar="STEP.OPTION VALUE",
    help="Any other option of a step, such as --set adapt.poses 8.",
)
@click.option(
    "--settings",
    type=_PATH,
    default=None,
    help="Begin with the choices of this file, a bonetrack.toml; those in the folder of results go before them.",
)
@click.option(
    "--leave-out", type=click.Choice(MAY_BE_LEFT_OUT), multiple=True, help="Do without this step; once for each."
)
def run_command(
    files: tuple[Path, ...],
    out: Path,
    set_: tuple[tuple[str, str], ...],
    settings: Path | None,
    leave_out: tuple[str, ...],
    **options: Any,
) -> None:
    """Do all steps: import FILES, calibrate, adapt, track, export, report; go on where a run stopped.

    FILES are those of the sensors, of any kind that `bonetrack import` takes, or the folder of a recording. All that is
    chosen stands in bonetrack.toml in the folder of results, and may be changed there: the same command, for which
    --out is then enough, does again what depends on it, and nothing else.
    """
    from track.run.choices import FILE, checked
    from track.run.run_steps import Run
    from track.run.written_choices import write_choices

    content: dict[str, Any] = {"files": [str(path) for path in files], "leave-out": list(leave_out)}
    content |= _sections(options, set_)
    # Paths on the command line are taken from where it is given.
    asked = checked(content, where=Path.cwd() / "the command line")
    choices = _before(out, settings, asked).with_more(asked)
    run = Run(out.resolve(), choices)
    run.refuse_what_cannot_be()
    out.mkdir(parents=True, exist_ok=True)
    write_choices(run.out / FILE, choices)
    run.go()


def _before(out: Path, settings: Path | None, asked: Choices) -> Choices:
    """The choices that stand in the folder of results, or those of another run to begin with.

    Raises:
        RunError: they cannot be read, or the results are those of other files.
    """
    from track.run.choices import FILE, RunError, read_choices

    kept = read_choices(out / FILE)
    if kept.files and asked.files and kept.files != asked.files:
        told = f"has results of other files: {', '.join(Path(file).name for file in kept.files)}"
        raise RunError(told, where=out, remedy="give another --out")
    if settings is None:
        return kept
    if not settings.is_file():
        raise RunError("does not exist", where=settings, remedy="give the bonetrack.toml of another run")
    return replace(read_choices(settings), files=()).with_more(kept)


def _sections(options: dict[str, Any], set_: tuple[tuple[str, str], ...]) -> dict[str, Any]:
    """What the command line chooses, as the file would have it.

    Raises:
        click.BadParameter: ``--set`` names no step.
    """
    sections: dict[str, Any] = {}
    for key, steps in _ALSO_HERE.items():
        value = options[key.replace("-", "_")]
        if value in (None, (), False):
            continue
        for step in steps:
            sections.setdefault(step.name, {})[key] = _plain(value)
    for name, text in set_:
        step_name, dot, key = name.partition(".")
        if step_name not in BY_NAME or not dot:
            raise click.BadParameter(f"{name}: name a step and its option, as adapt.poses", param_hint="--set")
        sections.setdefault(step_name, {})[key] = _toml(text)
    return sections


def _plain(value: Any) -> Any:
    if isinstance(value, tuple | list):
        return [_plain(one) for one in value]
    return str(value) if isinstance(value, Path) else value


def _toml(text: str) -> Any:
    """A value as TOML has it; what is no TOML is a text.

    >>> _toml("8"), _toml("[0, 0.5, 2]"), _toml("depth-*")
    (8, [0, 0.5, 2], 'depth-*')
    """
    try:
        return tomllib.loads(f"value = {text}")["value"]
    except tomllib.TOMLDecodeError:
        return text


_with_options_of_steps(run_command)
