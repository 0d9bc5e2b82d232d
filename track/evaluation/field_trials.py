"""What people really bring: every situation is made, run through the commands as they are, and judged by the truth.

    python -m track.evaluation.field_trials --out DIR [--only NAME ...] [--split tuning|held] [--sound 50]
        [--real RECORDINGS] [--page docs/field-trials.md]

A heavy evaluation, not a test. Each case's result is a file DIR/SITUATION/SEED.json; a run that was cut short goes on.
The page is written from what has been run, and says what has not; ``--no-run`` only writes the page.
"""

from __future__ import annotations

import json
import shutil
import time
from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path

import click

from capture.console import stdout
from capture.files import replaced_when_complete
from capture.own import page_of, replaced_if_own
from track.evaluation.benchmark.timing import hold_to_one_thread
from track.evaluation.results import EvaluationError
from track.evaluation.trials.page import page_text
from track.evaluation.trials.real import situations_of
from track.evaluation.trials.situation import SEEDS, SOUND_SEED, Outcome, Situation
from track.evaluation.trials.table import SITUATIONS

_AGAIN = "delete it to run the case again"


def outcome_of(situation: Situation, seed: int, out: Path, *, run: bool) -> Outcome | None:
    """The kept outcome of a case; where there is none, it is run and kept, or None without ``run``.

    Raises:
        EvaluationError: the kept file is not an outcome, or something stands where the case is to be run.
    """
    path = out / situation.name.replace(" ", "-").replace("/", "per") / f"{seed}.json"
    if path.is_file():
        try:
            return Outcome(**json.loads(path.read_text(encoding="utf-8")))
        except (OSError, ValueError, TypeError) as error:
            raise EvaluationError("is not an outcome", where=path, remedy=_AGAIN) from error
    if not run:
        return None
    kept, folder = path.with_suffix(""), path.with_suffix(".unfinished")
    if kept.exists():
        raise EvaluationError("stands there without its outcome", where=kept, remedy=_AGAIN)
    shutil.rmtree(folder, ignore_errors=True)  # what a run that was cut short left
    folder.mkdir(parents=True)
    start = time.perf_counter()
    with stdout.status(f"{situation.name}, variant {seed}"):
        outcome = situation.run(seed, folder)
        outcome = replace(outcome, line=outcome.line.replace(f"{folder}/", ""))  # where this machine keeps it
    with replaced_when_complete(path) as partial:
        partial.write_text(json.dumps(asdict(outcome), indent=1) + "\n", encoding="utf-8")
    folder.rename(kept)
    line = f"{situation.name}, variant {seed} ({time.perf_counter() - start:.0f} s): {outcome.verdict}: {outcome.line}"
    stdout.print(line, markup=False, highlight=False, soft_wrap=True)
    return outcome


def _chosen(situations: Sequence[Situation], only: tuple[str, ...], section: int | None) -> list[Situation]:
    return [
        s for s in situations if section in (None, s.section) and (not only or any(name in s.name for name in only))
    ]


def _sound(out: Path, count: int, *, run: bool) -> list[tuple[str, int, Outcome]]:
    """Name, seed and outcome of further sound recordings, each control in its turn."""
    controls = [situation for situation in SITUATIONS if situation.control and situation.section == 1]
    cases = [(controls[k % len(controls)], SOUND_SEED + k // len(controls)) for k in range(count)]
    outcomes = [(case.name, seed, outcome_of(case, seed, out, run=run)) for case, seed in cases]
    return [(name, seed, outcome) for name, seed, outcome in outcomes if outcome is not None]


@click.command()
@click.option("--out", required=True, type=click.Path(path_type=Path), help="Outcomes, case by case.")
@click.option("--only", multiple=True, metavar="NAME", help="Run only situations whose name has this.")
@click.option("--section", type=click.IntRange(1, 6), help="Run only one section of situations.")
@click.option(
    "--split",
    type=click.Choice(list(SEEDS)),
    default="held",
    show_default=True,
    help="Which variants: those that bounds may be set on, or those that are reported.",
)
@click.option("--variants", type=int, help="Run at most so many of them.")
@click.option("--sound", type=click.IntRange(0), default=0, help="Run so many further sound recordings, as well.")
@click.option("--real", type=click.Path(path_type=Path), help="A folder of real recordings, each as published.")
@click.option("--run/--no-run", default=True, show_default=True, help="Run what has no outcome, or only read outcomes.")
@click.option("--page", type=click.Path(path_type=Path), help="The Markdown page to write.")
def main(
    out: Path,
    only: tuple[str, ...],
    section: int | None,
    split: str,
    variants: int | None,
    sound: int,
    real: Path | None,
    run: bool,
    page: Path | None,
) -> None:
    """Run the situations and write the page."""
    hold_to_one_thread()
    clips, why = situations_of(real)
    if why:
        stdout.print(f"skipped: real recordings ({why})", markup=False, highlight=False)
    everything = [*SITUATIONS, *clips]
    wanted = {situation.name for situation in _chosen(everything, only, section)}
    found: dict[str, dict[int, Outcome]] = {}
    for situation in everything:
        seeds = SEEDS[split] if situation.section < 6 else SEEDS[split][:1]
        for seed in seeds[:variants]:
            outcome = outcome_of(situation, seed, out, run=run and situation.name in wanted)
            if outcome is not None:
                found.setdefault(situation.name, {})[seed] = outcome
    further = _sound(out, sound, run=run)
    if page is not None:
        text = page_text(everything, found, sound=further, split=split, skipped=why)
        with replaced_if_own(page, page_of(text)) as partial:
            partial.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
