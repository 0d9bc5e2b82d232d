"""What the page says of a real man's limbs in motion."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from adapt.anatomy import Floats
from track.evaluation.experiments.drawing import new_figure, save_figure
from track.evaluation.experiments.experiment import Result, markdown_table, summary
from track.evaluation.experiments.movable_limbs import MOVABLE, SECONDS
from track.evaluation.experiments.real_limbs import CREDIT, LIMBS
from track.evaluation.experiments.real_person_page import (
    AIM_AXIS_DEG,
    AIM_CENTRE_MM,
    AIM_DEPTH_FREE_MM,
    AIM_LENGTH_PERCENT,
    missed_aims,
)
from track.evaluation.made_up_motions import FPS


def describe(results: Mapping[str, Result], images: Path) -> str:
    """A table and a picture for each limb."""
    parts = [_limb(n, {c: r for c, r in results.items() if c.split()[0] == n}, images) for n in LIMBS]
    return f"""The same man (n = 1), made movable by his own bones: turns about lines through landmarks of his bones
(head centres, epicondyles, ends of radius and ulna, malleoli), bones that move as rigid bodies, and skin that follows
them by weights found on his own skin (heat from the nearest bone), blended by dual quaternions; the forearm's skin
turns with the radius in proportion to the way from elbow to wrist. His knee is a hinge, shoulder blade and pelvis do
not move by themselves, and nothing slides or bulges. Nothing of it is our model's. He moves for {SECONDS:g} s at
{FPS:g} frames a second before two Carmine sensors; calibration, first poses, adaptation to six poses and tracking are
automatic. What was said of the depth of his bones holds here: "without depth" leaves out forward and backward, in the
axes of the bone that carries the joint. At the shoulder depth is to the side as well, and it is counted. Aims as above,
**bold** where the mean over frames misses them. Angles are compared with the turns that he was given, whose zeros are
other ones than ours: the constant difference is apart. Mean ± SD (maximum) over frames.

{"".join(parts).strip()}
"""


def _limb(name: str, results: Mapping[str, Result], images: Path) -> str:
    if not results:
        return ""
    good = {case: result for case, result in results.items() if "failed" not in result}
    rows = [["error", *(case.split(maxsplit=1)[1] for case in good)]]
    kinds = [_kinds(result) for result in good.values()]
    for title in kinds[0] if kinds else ():
        cells = [
            (summary(values[title][0], digits=1), float(np.mean(values[title][0])), values[title][1])
            for values in kinds
        ]
        rows.append([title, *(f"**{text}**" if mean > aim else text for text, mean, aim in cells)])
    for joint in LIMBS[name].centres:
        constant = [np.mean(result["offsets_mm"][joint], axis=0) for result in good.values()]
        rows.append(
            [f"{joint}, constant: forward, up, right (mm)", *(", ".join(f"{v:+.0f}" for v in c) for c in constant)]
        )
    for joint in LIMBS[name].centres:
        depths = [np.mean(result["depths_mm"][joint], axis=0) for result in good.values()]
        rows.append([f"{joint}, below the nearest skin, ours and his (mm)", *(f"{a:.0f}, {b:.0f}" for a, b in depths)])
    for coordinate, _, _ in MOVABLE[name].angles:
        apart = [
            np.subtract(r["angles"][coordinate]["tracked"], r["angles"][coordinate]["true"]) for r in good.values()
        ]
        rows.append([f"{coordinate}, varying (deg)", *(summary(np.abs(a - a.mean()), digits=1) for a in apart)])
        rows.append([f"{coordinate}, constant (deg)", *(f"{a.mean():+.1f}" for a in apart)])
    rows.append(["skin (mm)", *(summary(result["skin_mm"], digits=1) for result in good.values())])
    rows.append(["frames lost", *(f"{result['lost']} of {result['frames']}" for result in good.values())])
    failed = [f"{case}: {result['failed']}.\n" for case, result in results.items() if "failed" in result]
    return f"### {name.capitalize()}\n\n{markdown_table(rows)}\n\n{''.join(failed)}{_figure(name, good, images)}\n"


def _kinds(result: Result) -> dict[str, tuple[Floats, float]]:
    """Errors over the frames, with the aim for their mean, by title."""
    kinds: dict[str, tuple[Floats, float]] = {}
    for joint, offsets in result["offsets_mm"].items():
        kinds[f"{joint} centre (mm)"] = np.linalg.norm(offsets, axis=1), AIM_CENTRE_MM
        kinds[f"{joint} centre without depth (mm)"] = (
            np.linalg.norm(np.array(offsets)[:, 1:], axis=1),
            AIM_DEPTH_FREE_MM,
        )
    for segment, lengths in result["lengths_mm"].items():
        ours, his = np.transpose(lengths)
        kinds[f"{segment} (%)"] = 100.0 * np.abs(ours / his - 1.0), AIM_LENGTH_PERCENT
    for bone, (length, his_length) in result["bones_m"].items():
        kinds[f"length of the {bone} (%)"] = np.array([100.0 * abs(length / his_length - 1.0)]), AIM_LENGTH_PERCENT
        kinds[f"shaft of the {bone} (deg)"] = np.array(result["axes_deg"][bone]), AIM_AXIS_DEG
    return kinds


def _figure(name: str, results: Mapping[str, Result], images: Path) -> str:
    """The first case: his bones and ours, angles over time, centres over time."""
    from matplotlib.image import imread

    result = next(iter(results.values()), None)
    if result is None or not Path(result["picture"]).is_file():
        return ""
    figure = new_figure(10.0, 3.9)
    bones, angles, centres = figure.subplots(1, 3, width_ratios=(1.3, 1.0, 1.0))
    bones.imshow(imread(result["picture"]))
    bones.axis("off")
    for k, (coordinate, curve) in enumerate(result["angles"].items()):
        constant = np.mean(np.subtract(curve["tracked"], curve["true"]))
        angles.plot(curve["times_s"], np.add(curve["true"], constant), color=f"C{k}", lw=1.0, label=coordinate)
        angles.plot(curve["times_s"], curve["tracked"], ".", color=f"C{k}", ms=3)
    for k, (joint, offsets) in enumerate(result["offsets_mm"].items()):
        times = next(iter(result["angles"].values()))["times_s"]
        centres.plot(times, np.linalg.norm(offsets, axis=1), color=f"C{k}", label=joint)
    angles.set(xlabel="time (s)", ylabel="angle (deg)")
    centres.set(xlabel="time (s)", ylabel="joint centre, error (mm)", ylim=(0.0, None))
    for axes in (angles, centres):
        axes.grid(alpha=0.3)
        axes.legend(fontsize="small")
    save_figure(figure, images / f"real-motion-{name}.png")
    return f"""![His bones and ours, angles and errors over time](images/real-motion-{name}.png)

Left: his bones (green) and ours (bone) inside his skin halfway through, from the front and from the right. Lines: the
turns he was given, shifted by the constant difference; dots: what was tracked. {CREDIT}
"""


def losses(results: Mapping[str, Result]) -> list[str]:
    """The aims that the mean over frames misses."""
    lines = []
    for case, result in results.items():
        if "failed" in result:
            lines.append(f"{case}: {result['failed']}")
            continue
        missed = missed_aims([{title: (float(np.mean(v)), aim) for title, (v, aim) in _kinds(result).items()}])
        lines += [f"{case}: {missed}"] if missed else []
    return lines
