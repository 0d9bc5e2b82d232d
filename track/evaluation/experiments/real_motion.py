"""One real man's limbs in motion: his own bones move, his skin follows, our template is adapted to it and tracks it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from itertools import pairwise
from pathlib import Path

import numpy as np

from adapt.anatomy import Anatomy, Floats
from adapt.anatomy_file import load_anatomy
from adapt.build.meshes import Mesh, largest_part
from adapt.fit.recording import adapt_recording
from adapt.subject import Subject, load_subject, save_subject
from capture.errors import BonetrackError
from capture.recording import Recording
from capture.rigid import apply, exp_so3, transform
from track.evaluation.errors import distance_to_mesh
from track.evaluation.experiments import real_person
from track.evaluation.experiments.drawing import new_figure, save_figure
from track.evaluation.experiments.experiment import Experiment, Result, markdown_table, summary
from track.evaluation.experiments.real_person import (
    AIM_AXIS_DEG,
    AIM_CENTRE_MM,
    AIM_DEPTH_FREE_MM,
    AIM_LENGTH_PERCENT,
    CREDIT,
    Posed,
    RealLimb,
    axis_between,
    in_world,
    missed_aims,
    posed,
)
from track.evaluation.experiments.surface_fit import greatest_length, read_mesh
from track.evaluation.jointed import Jointed, Turn, heat_weights, shared_along
from track.evaluation.known import record_meshes
from track.evaluation.performance import FPS
from track.evaluation.swing import Swing, times_and_phase
from track.motion import Motion
from track.run import track_recording
from track.view.render import save_png

NAME, TITLE = "real-motion", "A real man's limbs in motion"
SEEDS = (1, 2)
_SECONDS = 2.0
_SKIN_FRAMES = 10  # in which distances of skins are measured
_SWAY_DEG = 14.0


@dataclass(frozen=True, eq=False)
class Movable:
    """How his limb moves.

    ``rides``: bones by the turn that carries them. ``forearm``: two bones that share the skin between landmarks. In
    ``centres``, the bone that carries each joint's centre. ``angles``: our coordinate, the turn it follows, its sign.
    """

    turns: tuple[Turn, ...]
    rides: dict[str, str | None]
    forearm: tuple[str, str, str, str] | None
    swings: dict[str, Swing]
    centres: dict[str, str]
    angles: tuple[tuple[str, str, float], ...] = field(repr=False)


MOVABLE = {
    "arm": Movable(
        (
            Turn("shoulder flexion", None, "humeral_head_centre", "right"),
            Turn("shoulder abduction", "shoulder flexion", "humeral_head_centre", "forward"),
            Turn("elbow", "shoulder abduction", "medial_epicondyle", "lateral_epicondyle"),
            Turn("forearm", "elbow", "ulnar_head_centre", "radial_head_centre"),
            Turn("wrist", "forearm", "ulnar_styloid", "radial_styloid"),
        ),
        {
            "scapula": None,
            "clavicle": None,
            "humerus": "shoulder abduction",
            "ulna": "elbow",
            "radius": "forearm",
            "hand": "wrist",
        },
        ("ulna", "radius", "elbow_centre_epicondyle_mid", "wrist_centre_styloid_mid"),
        {
            "shoulder flexion": Swing(12.0, 14.0, 1.0, 0.4),
            "shoulder abduction": Swing(-10.0, 8.0, 1.5),
            "elbow": Swing(50.0, 42.0, 1.0, -0.25),
            "forearm": Swing(55.0, 42.0, 2.0),
            "wrist": Swing(0.0, 15.0, 3.0),
        },
        {"shoulder": "humerus", "elbow": "humerus", "wrist": "radius"},
        (("elbow_flexion", "elbow", 1.0), ("pro_sup", "forearm", 1.0), ("flexion", "wrist", 1.0)),
    ),
    "leg": Movable(
        (
            Turn("hip flexion", None, "femoral_head_centre", "right"),
            Turn("hip adduction", "hip flexion", "femoral_head_centre", "forward"),
            Turn("knee", "hip adduction", "lateral_femoral_epicondyle", "medial_femoral_epicondyle"),
            Turn("kneecap", "hip adduction", "lateral_femoral_epicondyle", "medial_femoral_epicondyle", share=0.6),
            Turn("ankle", "knee", "medial_malleolus_tip", "lateral_malleolus_tip"),
        ),
        {
            "pelvis": None,
            "femur": "hip adduction",
            "patella": "kneecap",
            "tibia": "knee",
            "fibula": "knee",
            "foot": "ankle",
        },
        None,
        {
            "hip flexion": Swing(16.0, 20.0, 1.0, -0.1),
            "hip adduction": Swing(0.0, 7.0, 1.5),
            "knee": Swing(33.0, 31.0, 1.0, -0.25),
            "ankle": Swing(0.0, 12.0, 2.0),
        },
        {"hip": "femur", "knee": "femur", "ankle": "tibia"},
        (("knee_angle_r", "knee", 1.0), ("ankle_angle_r", "ankle", 1.0)),
    ),
}


def make_movable(name: str, data: Path) -> Jointed:
    """His limb with joints."""
    him, how = real_person.read_limb(real_person.LIMBS[name], data), MOVABLE[name]
    folder = data / real_person.FOLDER / real_person.LIMBS[name].folder / "bones"
    bones = {bone: in_world(read_mesh(folder / f"{bone}.ply")) for bone in how.rides}
    skin = him.skin
    weights = heat_weights(skin, list(bones.values()))
    if how.forearm is not None:
        first, second = (list(bones).index(bone) for bone in how.forearm[:2])
        start, end = (him.landmarks[landmark] for landmark in how.forearm[2:])
        weights = shared_along(weights, skin.vertices, first, second, start, end)
    return Jointed(skin, bones, him.landmarks, how.turns, how.rides, weights)


def degrees_over_time(name: str) -> dict[str, Floats]:
    """Degrees (T,) of his turns."""
    _, u = times_and_phase(_SECONDS, FPS)
    degrees = {turn: swing.degrees(u) for turn, swing in MOVABLE[name].swings.items()}
    return degrees | {"kneecap": degrees["knee"]} if "knee" in degrees else degrees


def motions_over_time(name: str, him: Jointed) -> list[dict[str, Floats]]:
    """Each frame's motions (4, 4) of his bones, the whole limb swaying about the middle of its skin."""
    degrees = degrees_over_time(name)
    middle, count = him.skin.vertices.mean(axis=0), len(next(iter(degrees.values())))
    frames = []
    for t in range(count):
        turn = exp_so3(np.array([0.0, np.deg2rad(_SWAY_DEG) * np.sin(2.0 * np.pi * t / count + 0.6), 0.0]))
        world = transform(turn, middle - turn @ middle)
        frames.append(him.motions({turn: values[t] for turn, values in degrees.items()}, world))
    return frames


def run(case: str, folder: Path, *, data: Path) -> Result:
    """Record him moving, adapt to six poses and track, all automatic, and compare; what stops that is the result."""
    name, seed = case.split()[0], int(case.split()[-1])
    him = make_movable(name, data)
    motions = motions_over_time(name, him)
    skins = [him.posed_skin(moved) for moved in motions]
    times, points = times_and_phase(_SECONDS, FPS)[0].tolist(), np.concatenate(skins[::6])
    recording, world = record_meshes(skins, him.skin.faces, times, folder / "recording", points=points, seed=seed)
    try:
        subject = _subject(recording, load_anatomy(real_person.LIMBS[name].anatomy), folder / "subject.npz")
        motion = track_recording(recording, subject, folder / "motion")
    except BonetrackError as error:
        return {"failed": error.problem}
    frames = np.flatnonzero(motion.tracked)
    compared = [_compared(name, him, motions[t], subject, motion.thetas[t], world) for t in frames]
    middle = int(frames[len(frames) // 2])
    limb = real_person.LIMBS[name]
    there = _moved(name, him, motions[middle], skins[middle])
    save_png(real_person.picture(there, posed(subject.body, motion.thetas[middle], limb, world)), folder / "bones.png")
    return {
        "frames": len(motion.tracked),
        "lost": int((~motion.tracked).sum()),
        "offsets_mm": {joint: [c[joint] for c in (c["offsets_mm"] for c in compared)] for joint in limb.centres},
        "lengths_mm": {s: [c["lengths_mm"][s] for c in compared] for s in compared[0]["lengths_mm"]},
        "axes_deg": {bone: [c["axes_deg"][bone] for c in compared] for bone in limb.bones},
        "bones_m": {bone: _bone_lengths(subject, him, bone) for bone in limb.bones},
        "depths_mm": {joint: [c["depths_mm"][joint] for c in compared] for joint in limb.centres},
        "angles": _angles(name, motion),
        "skin_mm": _skins(skins, him, subject, motion, world),
        "picture": str(folder / "bones.png"),
    }


def _subject(recording: Recording, anatomy: Anatomy, path: Path) -> Subject:
    if not path.is_file():
        save_subject(adapt_recording(recording, anatomy), path)
    return load_subject(path)


def _moved(name: str, him: Jointed, motions: Mapping[str, Floats], skin: Floats) -> RealLimb:
    """His limb in a pose."""
    limb, how = real_person.LIMBS[name], MOVABLE[name]
    bones = {b: Mesh(apply(motions[b], him.bones[b].vertices), him.bones[b].faces) for b in limb.bones}
    rest = {joint: np.mean([him.landmarks[n] for n in his], axis=0) for joint, (_, his) in limb.centres.items()}
    centres = {joint: apply(motions[how.centres[joint]], rest[joint][None])[0] for joint in limb.centres}
    return RealLimb(Mesh(skin, him.skin.faces), bones, centres, {})


def _compared(
    name: str, him: Jointed, motions: Mapping[str, Floats], subject: Subject, theta: Floats, world: Floats
) -> Result:
    """One frame: offsets of centres in the axes of the bone that carries them (forward, up, right at his rest)."""
    limb, how = real_person.LIMBS[name], MOVABLE[name]
    true, ours = _moved(name, him, motions, him.posed_skin(motions)), posed(subject.body, theta, limb, world)
    offsets = {
        joint: (1e3 * motions[how.centres[joint]][:3, :3].T @ (ours.centres[joint] - true.centres[joint])).tolist()
        for joint in limb.centres
    }
    joints, depths = list(limb.centres), [depths_mm(of) for of in (ours, true)]
    return {
        "offsets_mm": offsets,
        "lengths_mm": {
            f"{a} to {b}": [1e3 * float(np.linalg.norm(of.centres[a] - of.centres[b])) for of in (ours, true)]
            for a, b in pairwise(joints)
        },
        "axes_deg": {bone: axis_between(ours.bones[bone], true.bones[bone]) for bone in limb.bones},
        "depths_mm": {joint: [of[joint] for of in depths] for joint in joints},
    }


def depths_mm(limb: Posed | RealLimb) -> dict[str, float]:
    """How far (mm) each joint's centre lies from the nearest skin."""
    centres = np.array(list(limb.centres.values()))
    distances = 1e3 * distance_to_mesh(centres, limb.skin.vertices, limb.skin.faces)
    return dict(zip(limb.centres, distances.tolist(), strict=True))


def _bone_lengths(subject: Subject, him: Jointed, bone: str) -> list[float]:
    """Greatest lengths (m) of our bone and his."""
    ours = Mesh(subject.body.rest_bones[bone], subject.anatomy.bone(bone).faces)
    return [greatest_length(largest_part(ours)), greatest_length(him.bones[bone])]


def _angles(name: str, motion: Motion) -> Result:
    """Coordinates over time and the turns that they follow (deg), whose zeros are other ones."""
    degrees, good = degrees_over_time(name), motion.tracked
    return {
        coordinate: {
            "times_s": motion.times[good].tolist(),
            "tracked": np.rad2deg(motion.thetas[good, motion.coordinates.index(coordinate)]).tolist(),
            "true": (sign * degrees[turn][good]).tolist(),
        }
        for coordinate, turn, sign in MOVABLE[name].angles
    }


def _skins(skins: Sequence[Floats], him: Jointed, subject: Subject, motion: Motion, world: Floats) -> list[float]:
    """Mean distances (mm) from our skin, where it counts, to his, in some frames."""
    limb = next(limb for limb in real_person.LIMBS.values() if limb.anatomy == subject.anatomy.name)
    frames = np.flatnonzero(motion.tracked)
    means = []
    for t in frames[:: max(1, len(frames) // _SKIN_FRAMES)]:
        ours = posed(subject.body, motion.thetas[t], limb, world)
        means.append(1e3 * float(distance_to_mesh(ours.skin.vertices[ours.fitted], skins[t], him.skin.faces).mean()))
    return means


def describe(results: Mapping[str, Result], images: Path) -> str:
    """A table and a picture for each limb."""
    parts = [_limb(n, {c: r for c, r in results.items() if c.split()[0] == n}, images) for n in real_person.LIMBS]
    return f"""The same man (n = 1), made movable by his own bones: turns about lines through landmarks of his bones
(head centres, epicondyles, ends of radius and ulna, malleoli), bones that move as rigid bodies, and skin that follows
them by weights found on his own skin (heat from the nearest bone), blended by dual quaternions; the forearm's skin
turns with the radius in proportion to the way from elbow to wrist. His knee is a hinge, shoulder blade and pelvis do
not move by themselves, and nothing slides or bulges. Nothing of it is our model's. He moves for {_SECONDS:g} s at
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
    for joint in real_person.LIMBS[name].centres:
        constant = [np.mean(result["offsets_mm"][joint], axis=0) for result in good.values()]
        rows.append(
            [f"{joint}, constant: forward, up, right (mm)", *(", ".join(f"{v:+.0f}" for v in c) for c in constant)]
        )
    for joint in real_person.LIMBS[name].centres:
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


def experiment(data: Path) -> Experiment:
    """The experiment on the man below ``data``."""
    cases = tuple(f"{name} seed {seed}" for seed in SEEDS for name in real_person.LIMBS)
    return Experiment(NAME, TITLE, cases, partial(run, data=data), describe, losses)
