"""Results of the evaluation's experiments, one file a case, with what it took and what it was made with."""

from __future__ import annotations

import hashlib
import json
import time
from dataclasses import asdict, dataclass, field
from functools import lru_cache
from importlib import resources
from pathlib import Path

from capture.console import stdout
from capture.errors import BonetrackError
from capture.files import replaced_when_complete
from track.evaluation.experiments.experiment import Experiment, Result


class EvaluationError(BonetrackError):
    """A result cannot be read."""


@dataclass(frozen=True)
class Case:
    """One case's result, the time (s, wall and processor) it took, and the templates' fingerprints at that time."""

    result: Result = field(repr=False)
    wall_s: float
    processor_s: float
    templates: dict[str, str]


def run_case(experiment: Experiment, case: str, out: Path) -> Case:
    """The result of a case: read, if it has been run; otherwise run and kept."""
    known = read_case(experiment, case, out)
    if known is not None:
        return known
    path = _path(experiment, case, out)
    folder = path.with_suffix("")
    folder.mkdir(parents=True, exist_ok=True)
    with stdout.status(f"{experiment.title}: {case}"):
        start, used = time.perf_counter(), time.process_time()
        result = experiment.run(case, folder)
        done = Case(result, time.perf_counter() - start, time.process_time() - used, dict(template_fingerprints()))
    with replaced_when_complete(path) as partial:
        partial.write_text(json.dumps(asdict(done), indent=1) + "\n", encoding="utf-8")
    return read_case(experiment, case, out) or done  # as a later run will see it


def read_case(experiment: Experiment, case: str, out: Path) -> Case | None:
    """The kept result of a case, None if it has not been run.

    Raises:
        EvaluationError: the file is not a result.
    """
    path = _path(experiment, case, out)
    if not path.is_file():
        return None
    try:
        return Case(**json.loads(path.read_text(encoding="utf-8")))
    except (OSError, ValueError, TypeError) as error:
        raise EvaluationError("is not a result", where=path, remedy="delete it to have the case run again") from error


def _path(experiment: Experiment, case: str, out: Path) -> Path:
    return out / experiment.name / f"{case.replace(' ', '-')}.json"


@lru_cache
def template_fingerprints() -> tuple[tuple[str, str], ...]:
    """Pairs of a shipped anatomy's name and a short digest of its file: another build of it has another digest."""
    folder = Path(str(resources.files("adapt") / "templates"))
    return tuple(
        (path.stem, hashlib.sha256(path.read_bytes()).hexdigest()[:10]) for path in sorted(folder.glob("*.npz"))
    )
