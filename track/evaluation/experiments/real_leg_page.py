"""What the page says of a real woman's leg, and of a man's."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from track.evaluation.experiments.experiment import Result, markdown_table, summary
from track.evaluation.real_legs import BONES

AIMS_MM = {"tibia": 3.0, "fibula": 3.0, "patella": 3.0, "femur": 5.0}
AIM_LENGTH = 2.0  # per cent; of the femur nothing is asked, for it ends where there is no skin of hers
LENGTHS = ("tibia", "fibula", "patella")
_AT_REST, _IN_MOTION = "at rest", "in motion"


def describe(results: Mapping[str, Result], images: Path) -> str:
    """A table of bones, one of depths, and what was followed."""
    return f"""A woman's right leg (n = 1; 59 years, computed tomography of the Visible Human Female), lying, her thigh
and calf flattened by it, skin from the ankle to the upper thigh: nothing is claimed of hip and foot. Beside her the man
of BodyParts3D, whose superficial bones lie 10 to 20 mm too deep (his kneecap 26 mm), so that nobody's model can have
both right.

*At rest*, bones from the skin alone: four exact sensors around the leg; the template in one size, laid on the
landmarks, is adapted to that single cloud. Of hers the skin of pelvis and foot, and what lies within 3 cm of an end,
takes no part. *In motion*: her skin is bound to our deformers about her own bones and posed by our knee and ankle (each
vertex takes the weights of the nearest place on our body laid on her landmarks; its place at rest is solved for, so
that the skin is exactly hers in the pose in which she lay; her bones ride on ours), the whole leg sways, two Carmine
sensors look, and all is automatic where it can be. Surfaces: the mean distance of both bones' vertices from each other,
of the femur where there is skin; **bold** misses the aim.

{_bones(results)}

{_depths(results)}

{_followed(results)}
"""


def _scores(case: str, result: Result, bone: str) -> tuple[list[float], list[float], list[float]]:
    """Surface distances as they lie and moved (mm), and lengths off (%), frame by frame."""
    frames = [result["bones"][bone]] if case.startswith(_AT_REST) else [frame[bone] for frame in result["bones"]]
    lengths = [100.0 * (ours / theirs - 1.0) for ours, theirs in (frame["lengths_mm"] for frame in frames)]
    return [f["as_it_lies_mm"] for f in frames], [f["moved_mm"] for f in frames], lengths


def _bones(results: Mapping[str, Result]) -> str:
    good = {case: result for case, result in results.items() if "failed" not in result}
    rows = [["", "aim", *good]]
    for bone in BONES:
        cells, moved, lengths = [], [], []
        for case, result in good.items():
            lies, after, off = _scores(case, result, bone)
            cells.append(_marked(summary(lies, digits=1), missed=float(np.mean(lies)) > AIMS_MM[bone]))
            moved.append(summary(after, digits=1))
            missed = bone in LENGTHS and abs(np.mean(off)) > AIM_LENGTH
            lengths.append(_marked(f"{np.mean(off):+.1f}", missed=bool(missed)))
        rows.append([f"surface of the {bone}, as it lies (mm)", f"{AIMS_MM[bone]:g}", *cells])
        rows.append([f"surface of the {bone}, moved rigidly (mm)", "", *moved])
        rows.append([f"length of the {bone} (%)", f"{AIM_LENGTH:g}" if bone in LENGTHS else "", *lengths])
    failed = [f"{case}: {result['failed']}.\n" for case, result in results.items() if "failed" in result]
    return markdown_table(rows) + "\n\n" + "".join(failed)


def _depths(results: Mapping[str, Result]) -> str:
    resting = {case: r for case, r in results.items() if case.startswith(_AT_REST) and "failed" not in r}
    if not resting:
        return ""
    rows = [["least depth under their skin (mm): ours, theirs", *resting]]
    for place in next(iter(resting.values()))["depths_mm"]["ours"]:
        of = [(r["depths_mm"]["ours"][place], r["depths_mm"]["theirs"][place]) for r in resting.values()]
        rows.append([place, *(f"{ours:.1f}, {theirs:.1f}" for ours, theirs in of)])
    rows.append(["skin, ours to theirs", *(f"{r['skin_mm']:.1f}" for r in resting.values())])
    return markdown_table(rows)


def _followed(results: Mapping[str, Result]) -> str:
    for case, result in results.items():
        if not case.startswith(_IN_MOTION) or "failed" in result:
            continue
        off, stated = np.array(result["knee_deg"]), np.array(result["knee_stated_deg"])
        within = 100.0 * float((np.abs(off) <= 2.0 * stated).mean())
        return f"""Followed: {result["frames"] - result["lost"]} of {result["frames"]} frames; first poses
{result["start"]}; bones never seen: {", ".join(result["never_seen"]) or "none"}. The knee's angle is off by
{off.mean():+.1f} degrees throughout (its zero is that of our model laid on her landmarks, and how far her thigh goes on
above her skin is a guess) and varies by {np.abs(off - off.mean()).mean():.1f}; {within:.0f} % of the frames are within
two stated deviations."""
    return ""


def _marked(cell: str, *, missed: bool) -> str:
    return f"**{cell}**" if missed else cell


def losses(results: Mapping[str, Result]) -> list[str]:
    """The aims that are missed, case by case."""
    lines = []
    for case, result in results.items():
        if "failed" in result:
            lines.append(f"{case}: {result['failed']}")
            continue
        missed = []
        for bone in BONES:
            lies, _, off = (float(np.mean(values)) for values in _scores(case, result, bone))
            missed += [f"surface of the {bone} {lies:.1f} mm (aim {AIMS_MM[bone]:g})"] if lies > AIMS_MM[bone] else []
            too_long = bone in LENGTHS and abs(off) > AIM_LENGTH
            missed += [f"length of the {bone} {off:+.1f} % (aim {AIM_LENGTH:g})"] if too_long else []
        lines += [f"{case}: {', '.join(missed)}"] if missed else []
    return lines
