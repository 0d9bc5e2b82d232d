"""Wrong minimum, or wrong model? The unchanged adaptation started from the exact body, and from its own result.

The exact start is the body of our model that is nearest to the true one: landmarks where the skin carries them, the
skin itself vertex by vertex, and in every example pose the bones where they truly are. What the same energy makes of
the same clouds from there is compared with what it makes of its present result. If the exact start stays near the truth
at a lower energy, the search stops in a wrong minimum; if it drifts to where the present result is, or ends higher, the
energy is content with what is wrong: the model is.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from pathlib import Path

import numpy as np

from adapt.anatomy import Floats
from adapt.anatomy_file import load_anatomy
from adapt.fit.alternate import Adaptation, adapt_body
from adapt.fit.noise import trusted
from adapt.fit.pose import match_pose
from adapt.fit.problem import SIGMA_M, Unknowns
from adapt.fit.shape import ShapeEnergy, split_tissue
from adapt.match.correspondences import Target
from adapt.match.skin_sample import sample_skin, weighted_by_tissue
from adapt.model.body import Body, joint_centres
from adapt.tissue import tissue_field
from capture.cloud.fuse import fuse, region_of_interest
from capture.errors import BonetrackError
from capture.recording import instants
from capture.rigid import apply, inverse
from track.evaluation.experiments.bodies import CASES, adapted, motions_of, recorded
from track.evaluation.experiments.bodies import NAME as BODIES
from track.evaluation.experiments.experiment import Experiment, Result, markdown_table
from track.evaluation.foreign_truth import nearest_body, true_thetas
from track.evaluation.known import carried

NAME, TITLE = "oracles", "Wrong minimum, or wrong model?"
_CASES = tuple(case for case in CASES if "mean" in case)
_GATE_M = 0.02  # within which a match counts for the energy that is printed
STARTS = ("exact, before", "from exact", "from present", "present")


def run(case: str, folder: Path, *, data: Path) -> Result:
    """Adapt to the same clouds from the exact body and from the present result; energies and joint centres of all."""
    moving = motions_of(case, data)
    kept = folder.parents[1] / BODIES / folder.name  # what was recorded and adapted there is not made anew
    recording, world = recorded(moving, kept)
    try:
        subject = adapted(recording, load_anatomy(moving.what.anatomy), kept)
    except BonetrackError as error:
        return {"failed": error.problem}
    moments, region = instants(recording), region_of_interest(recording)
    at = [int(np.argmin([abs(m.time_s - t) for m in moments])) for t in subject.times]
    targets = [Target(fuse(recording, moments[t], region=region)) for t in at]
    exact = nearest_body(moving, with_skin=True)
    thetas = carried(exact.anatomy, true_thetas(moving, exact)[at], inverse(world))
    places = {joint: moving.carried(joint, place)[0][at] for joint, place in moving.true.items()}
    true = {joint: apply(inverse(world), place) for joint, place in places.items()}
    ends = {
        "exact, before": (exact, thetas),
        "from exact": _end(adapt_body(exact, targets, thetas)),
        "from present": _end(adapt_body(subject.body, targets, subject.thetas)),
        "present": (subject.body, subject.thetas),
    }
    return {"ends": {start: _scored(*end, targets, true) for start, end in ends.items()}}


def _end(adaptation: Adaptation) -> tuple[Body, Floats]:
    return adaptation.body, adaptation.thetas


def _scored(body: Body, thetas: Floats, targets: list[Target], true: Mapping[str, Floats]) -> Result:
    """The energy of shape, tissue and poses for their own matches, how many these are, and joint centres (mm)."""
    sample = sample_skin(body.anatomy)
    matches = [match_pose(body, *pose, sample, gate_m=_GATE_M) for pose in zip(targets, thetas, strict=True)]
    fine, c = split_tissue(body, tissue_field(body.anatomy))
    of = Unknowns(len(body.shape), len(c), len(body.anatomy.coordinates))
    weighed = trusted(weighted_by_tissue(sample, body.anatomy), SIGMA_M)
    energy = ShapeEnergy(body, fine, matches, weighed, of)
    x = np.concatenate([body.shape, c, thetas.ravel()])
    ours = [joint_centres(body, theta) for theta in thetas]
    off = {j: np.linalg.norm([at[j] for at in ours] - places, axis=1) for j, places in true.items()}
    return {
        "energy": energy.value(x),
        "matches": sum(len(match) for match in matches),
        "skin_mm": 1e3 * float(np.mean(np.abs(np.concatenate([match.distance for match in matches])))),
        "centres_mm": {joint: 1e3 * float(distances.mean()) for joint, distances in off.items()},
    }


def describe(results: Mapping[str, Result], images: Path) -> str:
    """A row for each end of each body."""
    rows = [["", "energy", "matches", "skin to cloud (mm)", "joint centres (mm)"]]
    for case, result in results.items():
        if "failed" in result:
            continue
        for start, end in result["ends"].items():
            centres = ", ".join(f"{joint} {value:.1f}" for joint, value in end["centres_mm"].items())
            numbers = [f"{end['energy']:.0f}", f"{end['matches']}", f"{end['skin_mm']:.2f}"]
            rows.append([f"{case}: {start}", *numbers, centres])
    failed = [f"{case}: {result['failed']}.\n" for case, result in results.items() if "failed" in result]
    return f"""The people of the section before, the same six clouds, the same energy, started twice: from the body of
our model that is nearest to the true one, in the true poses ("exact, before" is that start itself), and from the
present result. Where "from exact" ends near the truth and lower than "from present", the search has stopped in a wrong
minimum; where it ends as far off or higher, the energy is content with what is wrong, and the model is to blame. The
energy is that of shape, tissue and poses for matches within {100 * _GATE_M:g} cm; the fine skin, which is fitted apart,
has no share in it.

{markdown_table(rows)}

{"".join(failed)}"""


def experiment(data: Path) -> Experiment:
    """The experiment on people drawn from the population below ``data``."""
    return Experiment(NAME, TITLE, _CASES, partial(run, data=data), describe)
