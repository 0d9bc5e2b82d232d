"""The paper's experiments, redone with a truth that its authors could not have.

    python -m track.evaluation.paper --out DIR [--only NAME ...] [--matching TEXT] [--anatomy-data DIR]
        [--motions DIR] [--page docs/evaluation.md]

A heavy evaluation, not a test. Each case's result is a file DIR/EXPERIMENT/CASE.json; a run that was cut short
goes on. The page is written from what has been run, and says what has not; ``--no-run`` only writes the page.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import click

from capture.console import stdout
from capture.errors import BonetrackError
from capture.own import page_of, replaced_if_own
from track.evaluation.benchmark.timing import hold_to_one_thread
from track.evaluation.experiments import (
    bend_and_twist,
    bodies,
    faults,
    forearm,
    foreign_opensim,
    handles,
    oracles,
    poses,
    real_bones,
    real_leg,
    real_motion,
    real_person,
    sensitivity,
    skin,
    starts,
    table_1,
)
from track.evaluation.experiments.experiment import Experiment
from track.evaluation.page import images_of, page_text, section
from track.evaluation.results import Case, read_case, run_case

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
    bodies.NAME: bodies.experiment,
    oracles.NAME: oracles.experiment,
    foreign_opensim.NAME: foreign_opensim.experiment,
    real_bones.NAME: real_bones.experiment,
    real_person.NAME: real_person.experiment,
    real_motion.NAME: real_motion.experiment,
    real_leg.NAME: real_leg.experiment,
}
"""Made of real people's surfaces and measures, which stand in a folder outside the project."""
NAMES = (*(experiment.name for experiment in EXPERIMENTS), table_1.NAME, *ON_REAL_ANATOMY)


def on_real_anatomy(data: Path | None) -> list[Experiment]:
    """The experiments on real anatomy; none, and a line that says why, where its folder is not there."""
    if data is None or not data.is_dir():
        why = "no --anatomy-data given" if data is None else f"{data}: no such folder"
        stdout.print(f"skipped: {', '.join(ON_REAL_ANATOMY)} ({why})", markup=False, highlight=False)
        return []
    return [experiment(data) for experiment in ON_REAL_ANATOMY.values()]


def beside_opensim(motions: Path | None) -> list[Experiment]:
    """The comparison with OpenSim; none, and a line that says why, where it cannot be made."""
    missing = table_1.what_is_missing(motions)
    if motions is None or missing:
        stdout.print(f"skipped: {table_1.NAME} ({missing})", markup=False, highlight=False)
        return []
    return [table_1.experiment(motions)]


def results_of(experiment: Experiment, out: Path, wanted: Sequence[str]) -> dict[str, Case]:
    """An experiment's cases: those ``wanted`` are run, if they have not been, and others read, if they have been."""
    found = {
        case: run_case(experiment, case, out) if case in wanted else read_case(experiment, case, out)
        for case in experiment.cases
    }
    return {case: result for case, result in found.items() if result is not None}


@click.command()
@click.option("--out", required=True, type=click.Path(path_type=Path), help="Results, case by case.")
@click.option("--only", multiple=True, type=click.Choice(NAMES), help="Run some experiments; the page shows all.")
@click.option("--cases", type=int, help="Run at most so many cases of each.")
@click.option(
    "--matching", default="", metavar="TEXT", help="Run only cases whose name has this, such as 'arm clocks'."
)
@click.option("--run/--no-run", default=True, show_default=True, help="Run what has no result, or only read results.")
@click.option("--anatomy-data", type=click.Path(path_type=Path, file_okay=False), help="Folder of real anatomy.")
@click.option("--motions", type=click.Path(path_type=Path, file_okay=False), help="Folder of recorded motions.")
@click.option("--page", type=click.Path(path_type=Path), help="The Markdown page to write; pictures go beside it.")
def main(
    out: Path,
    only: tuple[str, ...],
    cases: int | None,
    matching: str,
    run: bool,
    anatomy_data: Path | None,
    motions: Path | None,
    page: Path | None,
) -> None:
    """Run the experiments and write the page."""
    hold_to_one_thread()
    can_run = [*EXPERIMENTS, *(beside_opensim(motions) + on_real_anatomy(anatomy_data) if run else [])]
    names = {experiment.name for experiment in can_run if run and (not only or experiment.name in only)}
    shown = [make(out) for make in (table_1.experiment, *ON_REAL_ANATOMY.values())]  # needs no data
    others = [experiment for experiment in shown if experiment.name not in {e.name for e in can_run}]
    found: dict[str, dict[str, Case]] = {}
    for experiment in (everything := (*can_run, *others)):
        chosen = experiment.name in names
        wanted = [case for case in experiment.cases[:cases] if chosen and matching in case]
        try:
            found[experiment.name] = results_of(experiment, out, wanted)
        except BonetrackError as error:
            raise click.ClickException(f"{experiment.name}: {error}") from error
        if chosen and page is None:
            stdout.print(section(experiment, found[experiment.name], out / "images"), markup=False, highlight=False)
    if page is not None:
        text = page_text(everything, found, images_of(page))
        with replaced_if_own(page, page_of(text)) as partial:
            partial.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
