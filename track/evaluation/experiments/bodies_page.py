"""What the page says of people that are not of our model's making."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np

from track.evaluation.experiments.drawing import new_figure, save_figure
from track.evaluation.experiments.experiment import Result, markdown_table
from track.evaluation.rigged_limbs import LIMBS
from track.evaluation.rigged_people import RIGS

AIMS_MM = {"hip": 10.0, "shoulder": 8.0, "knee": 6.0, "elbow": 6.0, "ankle": 4.0, "wrist": 4.0}
AIMS_DEG = {"knee_angle_r": 0.7, "ankle_angle_r": 1.2, "elbow_flexion": 0.8, "pro_sup": 2.5}
AIM_LENGTH, WORST_LENGTH = 2.0, 3.5  # per cent, in the mean and in the worst
AIM_COVERED = 90.0  # per cent within two stated deviations
_SIGMAS = 2.0
HELD = ("woman 1", "man 2", "woman 2")
"""People whom nothing of the program was set by: what was looked into, and what was changed, was by the other three."""

Results = Mapping[str, Result]


def describe(results: Results, images: Path) -> str:
    """Two tables and a picture for each limb."""
    parts = [_limb(name, {c: r for c, r in results.items() if c.split()[0] == name}, images) for name in LIMBS]
    return f"""Whose body: people drawn from ANSUR II (means and correlations of stature, lengths and girths; soldiers):
both sexes' means and two draws of each. MakeHuman's shape targets are solved for by least squares so that a body
has that person's stature, lengths and girths; height targets, which move skin and leave joints behind, take no part.

Where their joints are: where ours are in the template's body, carried by the skin. All these bodies have the same
vertices, and the biharmonic map that takes the template's skin around the limb to theirs takes our joints and
landmarks to theirs as well (*carried*; this yardstick decides). They turn about these very places. For the second
yardstick the rig's own joint is taken, with the difference from ours that it has in the template's body, scaled with
stature (*by rig*): until now that one was called true, while bodies turned about a third place.

How they move: by two riggings that know nothing of each other, Mixamo's (`mixamo`) and MakeHuman's own (`default`;
`game_engine` and `cmu_mb` are the same family), by dual quaternions, then subdivided. Mixamo's has no bone that twists
the forearm: there its weight is shared linearly from elbow to wrist. 2 s at 30 frames a second before two Carmine
sensors; calibration, first poses, adaptation to six poses and tracking are automatic. Our template's skin was made of
the same base mesh: the bodies are strange to its proportions and its way of moving, not to its style.

Our coordinates have a truth here, too, zero included: the pose of our bones that lie where the rig's bones carry them
from rest. *Varying* is the mean absolute error once each body's constant error is removed. *Within 2 SD*: the share of
frames whose error is at most two stated deviations, the bodies' mean; of joint centres, axis by axis, with the
deviation that subject and pose together state. Numbers are means over bodies (the worst body); **bold** misses the aim.
What was looked into and set, the width of stated deviations included, was by the first three people; *held* are the
cases of {", ".join(HELD)}.

{"".join(parts).strip()}
"""


def _limb(name: str, results: Results, images: Path) -> str:
    if not results:
        return ""
    good = {case: result for case, result in results.items() if "failed" not in result}
    failed = [f"{case}: {result['failed']}.\n" for case, result in results.items() if "failed" in result]
    groups = {title: bodies for title, bodies in _groups(good).items() if bodies}
    rows = [["", "aim", *(f"{title} ({len(bodies)} {_counted(bodies)})" for title, bodies in groups.items())]]
    for title, aim, of in _measures(name):
        cells = [of(bodies) for bodies in groups.values()]
        rows.append([title, aim, *(f"**{text}**" if missed else text for text, missed in cells)])
    return f"""### {name.capitalize()}

{markdown_table(rows)}

Body by body: {_reached(good)}

{markdown_table(_by_body(name, good))}

{"".join(failed)}{_figure(name, good, images)}
"""


def _groups(results: Results) -> dict[str, list[Result]]:
    """The results rig by rig, and those of the half of the people that was looked at and of the half that was held."""
    rigs = {rig: [r for c, r in results.items() if c.endswith(rig)] for rig in reversed(RIGS)}
    held = {case for case in results if case.split(maxsplit=1)[1].rsplit(maxsplit=1)[0] in HELD}
    return rigs | {
        "looked at": [r for c, r in results.items() if c not in held],
        "held": [r for c, r in results.items() if c in held],
    }


def _counted(bodies: Sequence[Result]) -> str:
    return "body" if len(bodies) == 1 else "bodies"


Measure = tuple[str, str, Callable[[Sequence[Result]], tuple[str, bool]]]


def _measures(name: str) -> list[Measure]:
    """Rows of a limb's table: title, aim, and what makes a cell of the bodies' results, with whether it misses."""
    limb, rows = LIMBS[name], []
    joints = [joint for joint, _, _ in limb.joints]
    for joint in joints:
        rows.append((f"{joint} centre, carried (mm)", f"{AIMS_MM[joint]:g}", _far("carried", joint, AIMS_MM[joint])))
    for joint in joints:
        rows.append((f"{joint} centre, by rig (mm)", "", _far("rig", joint, np.inf)))
    for joint in joints:
        rows.append((f"{joint}, constant: forward, up, right (mm)", "", _constant(joint)))
    for segment in limb.segments:
        rows.append((f"length of the {segment} (%)", f"{AIM_LENGTH:g} ({WORST_LENGTH:g})", _length(segment)))
        rows.append((f"direction of the {segment} (deg)", "", _direction(segment)))
    for coordinate in limb.turned:
        aim = AIMS_DEG.get(coordinate, np.inf)
        rows.append((f"{coordinate}, varying (deg)", f"{aim:g}" if np.isfinite(aim) else "", _varying(coordinate, aim)))
        rows.append((f"{coordinate}, constant (deg)", "", _lasting(coordinate)))
    rows.append(("skin (mm)", "", lambda bodies: (_mean_worst([float(np.mean(b["skin_mm"])) for b in bodies]), False)))
    rows.append(("frames lost", "", lambda bodies: (f"{sum(b['lost'] for b in bodies)}", False)))
    rows += [(f"{joint} centre within 2 SD (%)", f"{AIM_COVERED:g}", _covered_centre(joint)) for joint in joints]
    rows += [(f"{c} within 2 SD (%)", f"{AIM_COVERED:g}", _covered(c)) for c in _coordinates(name)]
    return rows


def _coordinates(name: str) -> list[str]:
    from adapt.anatomy_file import load_anatomy

    return [coordinate.name for coordinate in load_anatomy(LIMBS[name].anatomy).coordinates]


def _mean_worst(values: Sequence[float], *, sign: str = "") -> str:
    worst = max(values, key=abs)
    return f"{np.mean(values):{sign}.1f} ({worst:{sign}.1f})"


def far_mm(result: Result, yardstick: str, joint: str) -> float:
    """How far a joint's centre is from a yardstick's (mm): the mean over frames."""
    return float(np.mean(result["yardsticks"][yardstick]["centres"][joint]["distance_mm"]))


def length_percent(result: Result, segment: str) -> float:
    """How much too long a segment is (%)."""
    ours, true = result["yardsticks"]["carried"]["lengths_mm"][segment]
    return float(100.0 * (ours / true - 1.0))


def varying_deg(result: Result, coordinate: str) -> float:
    """A coordinate's mean absolute error without its constant part (deg)."""
    error = np.array(result["coordinates"][coordinate]["error"])
    return float(np.abs(error - error.mean()).mean())


def covered_percent(result: Result, coordinate: str) -> float:
    """The share of frames (%) in which a coordinate is within two stated deviations of the truth."""
    of = result["coordinates"][coordinate]
    return 100.0 * float((np.abs(of["error"]) <= _SIGMAS * np.array(of["stated"])).mean())


def _far(yardstick: str, joint: str, aim: float) -> Callable[[Sequence[Result]], tuple[str, bool]]:
    def cell(bodies: Sequence[Result]) -> tuple[str, bool]:
        values = [far_mm(body, yardstick, joint) for body in bodies]
        return _mean_worst(values), bool(np.mean(values) > aim)

    return cell


def _constant(joint: str) -> Callable[[Sequence[Result]], tuple[str, bool]]:
    def cell(bodies: Sequence[Result]) -> tuple[str, bool]:
        offsets = [body["yardsticks"]["carried"]["centres"][joint]["offset_mm"] for body in bodies]
        return ", ".join(f"{value:+.0f}" for value in np.mean(offsets, axis=0)), False

    return cell


def _length(segment: str) -> Callable[[Sequence[Result]], tuple[str, bool]]:
    def cell(bodies: Sequence[Result]) -> tuple[str, bool]:
        values = [length_percent(body, segment) for body in bodies]
        missed = abs(np.mean(values)) > AIM_LENGTH or np.abs(values).max() > WORST_LENGTH
        return _mean_worst(values, sign="+"), bool(missed)

    return cell


def _direction(segment: str) -> Callable[[Sequence[Result]], tuple[str, bool]]:
    return lambda bodies: (
        _mean_worst([float(np.mean(body["yardsticks"]["carried"]["directions_deg"][segment])) for body in bodies]),
        False,
    )


def _varying(coordinate: str, aim: float) -> Callable[[Sequence[Result]], tuple[str, bool]]:
    def cell(bodies: Sequence[Result]) -> tuple[str, bool]:
        values = [varying_deg(body, coordinate) for body in bodies]
        return _mean_worst(values), bool(np.mean(values) > aim)

    return cell


def _lasting(coordinate: str) -> Callable[[Sequence[Result]], tuple[str, bool]]:
    return lambda bodies: (
        _mean_worst([float(np.mean(body["coordinates"][coordinate]["error"])) for body in bodies], sign="+"),
        False,
    )


def _covered(coordinate: str) -> Callable[[Sequence[Result]], tuple[str, bool]]:
    def cell(bodies: Sequence[Result]) -> tuple[str, bool]:
        values = [covered_percent(body, coordinate) for body in bodies]
        return f"{np.mean(values):.0f} ({min(values):.0f})", bool(np.mean(values) < AIM_COVERED)

    return cell


def _covered_centre(joint: str) -> Callable[[Sequence[Result]], tuple[str, bool]]:
    def cell(bodies: Sequence[Result]) -> tuple[str, bool]:
        values = [100.0 * float((np.abs(body["centres_z"][joint]) <= _SIGMAS).mean()) for body in bodies]
        return f"{np.mean(values):.0f} ({min(values):.0f})", bool(np.mean(values) < AIM_COVERED)

    return cell


def _by_body(name: str, results: Results) -> list[list[str]]:
    limb = LIMBS[name]
    joints = [joint for joint, _, _ in limb.joints]
    header = [*(f"{joint} (mm)" for joint in joints), *(f"{s} (%)" for s in limb.segments)]
    angles = [c for c in limb.turned if c in AIMS_DEG]
    rows = [["", *header, *(f"{angle}, varying (deg)" for angle in angles)]]
    for case, result in results.items():
        cells = [f"{far_mm(result, 'carried', joint):.1f}" for joint in joints]
        cells += [f"{length_percent(result, segment):+.1f}" for segment in limb.segments]
        cells += [f"{varying_deg(result, angle):.1f}" for angle in angles]
        rows.append([case.partition(" ")[2], *cells])
    return rows


def _reached(results: Results) -> str:
    """How well the bodies have the measures that were wanted."""
    if not results:
        return "none."
    worst = max(((abs(v), m) for result in results.values() for m, v in result["missed_mm"].items()), default=(0.0, ""))
    return f"their measures are those of the people drawn to {worst[0]:.0f} mm at worst ({worst[1]})."


def _figure(name: str, results: Results, images: Path) -> str:
    """Some bodies of a limb side by side, from the cases' own pictures."""
    from matplotlib.image import imread

    drawn = {case: Path(result["picture"]) for case, result in results.items() if Path(result["picture"]).is_file()}
    drawn = {case: path for case, path in drawn.items() if case.endswith(RIGS[-1])}
    if not drawn:
        return ""
    figure = new_figure(1.9 * len(drawn), 3.3)
    for axes, (case, path) in zip(figure.subplots(1, len(drawn), squeeze=False)[0], drawn.items(), strict=True):
        axes.imshow(imread(path))
        axes.set_title(case.partition(" ")[2].rpartition(" ")[0], fontsize="small")
        axes.axis("off")
    save_figure(figure, images / f"figure-15-bodies-{name}.png")
    return f"""![Bodies with our bones inside](images/figure-15-bodies-{name}.png)

Halfway through ({RIGS[-1]}): the true skin, our bones in it, and the true joints (red).
"""


def losses(results: Results) -> list[str]:
    """The aims that the mean over bodies misses, limb by limb and rig by rig."""
    lines = [f"{case}: {result['failed']}" for case, result in results.items() if "failed" in result]
    for name in LIMBS:
        for rig in reversed(RIGS):
            bodies = [
                r for c, r in results.items() if c.startswith(f"{name} ") and c.endswith(rig) and "failed" not in r
            ]
            missed = [(title, aim, of(bodies)) for title, aim, of in _measures(name) if bodies and aim]
            text = ", ".join(f"{title} {cell} (aim {aim})" for title, aim, (cell, misses) in missed if misses)
            lines += [f"{name}, {rig}, mean (worst): {text}"] if text else []
    return lines
