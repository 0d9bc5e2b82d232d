"""The paper's experiments, redone with a truth that its authors could not have.

    python -m track.evaluation.paper --out DIR [--only NAME ...] [--matching TEXT] [--anatomy-data DIR]
        [--page docs/evaluation.md]

A heavy evaluation, not a test. Each case's result is a file DIR/EXPERIMENT/CASE.json; a run that was cut short
goes on. The page is written from what is to be run and what has been run before.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import click

from capture.console import stdout
from capture.files import replaced_when_complete
from track.evaluation.experiments import (
    bend_and_twist,
    faults,
    forearm,
    handles,
    poses,
    real_bones,
    real_person,
    sensitivity,
    skin,
    starts,
)
from track.evaluation.experiments.experiment import Experiment, Result

EXPERIMENTS: tuple[Experiment, ...] = (
    poses.EXPERIMENT,
    forearm.EXPERIMENT,
    bend_and_twist.EXPERIMENT,
    skin.EXPERIMENT,
    starts.EXPERIMENT,
    handles.EXPERIMENT,
    sensitivity.EXPERIMENT,
    faults.EXPERIMENT,
)
ON_REAL_ANATOMY: dict[str, Callable[[Path], Experiment]] = {
    real_bones.NAME: real_bones.experiment,
    real_person.NAME: real_person.experiment,
}
"""Made of real people's surfaces, which stand in a folder outside the project."""
NAMES = (*(experiment.name for experiment in EXPERIMENTS), *ON_REAL_ANATOMY)


def result_file(experiment: Experiment, case: str, out: Path) -> Path:
    """Where the result of a case is kept."""
    return out / experiment.name / f"{case.replace(' ', '-')}.json"


def run_case(experiment: Experiment, case: str, out: Path) -> Result:
    """The result of a case: read, if it has been run; otherwise run and kept."""
    done = result_file(experiment, case, out)
    folder = done.with_suffix("")
    if not done.is_file():
        folder.mkdir(parents=True, exist_ok=True)
        with stdout.status(f"{experiment.title}: {case}"):
            result = experiment.run(case, folder)
        with replaced_when_complete(done) as partial:
            partial.write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")
    return dict(json.loads(done.read_text(encoding="utf-8")))


def section(experiment: Experiment, results: dict[str, Result], images: Path) -> str:
    """The experiment's part of the page."""
    images.mkdir(parents=True, exist_ok=True)
    return f"## {experiment.title}\n\n{experiment.describe(results, images).strip()}\n"


def on_real_anatomy(data: Path | None) -> list[Experiment]:
    """The experiments on real anatomy; none, and a line that says why, where its folder is not there."""
    if data is None or not data.is_dir():
        why = "no --anatomy-data given" if data is None else f"{data}: no such folder"
        stdout.print(f"skipped: {', '.join(ON_REAL_ANATOMY)} ({why})", markup=False, highlight=False)
        return []
    return [experiment(data) for experiment in ON_REAL_ANATOMY.values()]


@click.command()
@click.option("--out", required=True, type=click.Path(path_type=Path), help="Results, case by case.")
@click.option(
    "--only",
    multiple=True,
    type=click.Choice([*(e.name for e in EXPERIMENTS), *ON_REAL_ANATOMY]),
    help="Some experiments.",
)
@click.option("--cases", type=int, help="At most so many cases of each.")
@click.option(
    "--matching", default="", metavar="TEXT", help="Run only cases whose name has this, such as 'arm clocks'."
)
@click.option("--anatomy-data", type=click.Path(path_type=Path, file_okay=False), help="Folder of real anatomy.")
@click.option("--page", type=click.Path(path_type=Path), help="The Markdown page to write; pictures go beside it.")
def main(
    out: Path, only: tuple[str, ...], cases: int | None, matching: str, anatomy_data: Path | None, page: Path | None
) -> None:
    """Run the experiments and write the page."""
    sections = []
    for experiment in (*EXPERIMENTS, *on_real_anatomy(anatomy_data)):
        if only and experiment.name not in only:
            continue
        asked = [case for case in experiment.cases[:cases] if matching in case]
        told = [case for case in experiment.cases if case in asked or result_file(experiment, case, out).is_file()]
        results = {case: run_case(experiment, case, out) for case in told}
        images = (page.parent if page else out) / "images"
        sections.append(section(experiment, results, images))
        stdout.print(sections[-1], markup=False, highlight=False, soft_wrap=True)
    if page is not None:
        with replaced_when_complete(page) as partial:
            partial.write_text("\n".join([_HEAD, *sections]), encoding="utf-8")


_HEAD = """# Evaluation: the paper's experiments, with truth

Made by `python -m track.evaluation.paper --out DIR --page docs/evaluation.md`; every number is of that run. Errors are
absolute, mean ± SD (maximum) over frames, unless said otherwise.
"""


if __name__ == "__main__":
    main()
