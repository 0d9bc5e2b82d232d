"""Figures 15 and 16: clearly different bodies, arms and legs, not of our model's making and not moved by it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from adapt.adapt_recording import adapt_recording
from adapt.anatomy import Anatomy, Floats
from adapt.anatomy_file import load_anatomy
from adapt.model.body import pose_skin, posed_bones
from adapt.subject import Subject, load_subject, save_subject
from adapt.template_builder.meshes import Mesh
from capture.errors import BonetrackError
from capture.recording import Recording
from capture.rigid import apply
from track.accuracy.mesh_distance import distance_to_mesh
from track.evaluation.experiments.drawing import new_figure, save_figure
from track.evaluation.experiments.experiment import Experiment, Result, markdown_table, summary
from track.evaluation.experiments.real_person_page import AIM_AXIS_DEG, AIM_CENTRE_MM, AIM_LENGTH_PERCENT, missed_aims
from track.evaluation.known import record_meshes
from track.evaluation.made_up_motions import FPS
from track.evaluation.rigged_limbs import LIMBS, Limb, Motions, definition, limb_plan, moving_limb
from track.evaluation.rigged_people import Build
from track.evaluation.swing import times_and_phase
from track.motion import Motion
from track.track_recording import track_recording
from track.view.render import BONE, SKIN, Layer, framing_camera, look_at, render, save_png

BUILDS = (
    Build(
        "tall and thin",
        1.95,
        muscle="minmuscle",
        weight="minweight",
        more={"height/male-young-minmuscle-minweight-maxheight": 0.6},
    ),
    Build(
        "short and heavy",
        1.62,
        weight="maxweight",
        more={"height/male-young-averagemuscle-maxweight-minheight": 0.6},
    ),
    Build(
        "muscular",
        1.80,
        muscle="maxmuscle",
        more={"proportions/male-young-maxmuscle-averageweight-idealproportions": 1.0},
    ),
    Build("a woman", 1.63, sex="female"),
)
_SEED = 1
_SECONDS = 2.0
_SKIN_FRAMES = 10  # in which distances of skins are measured
_FITTED = 0.5  # a vertex of the skin that counts by more than this in fitting is one of the limb proper
_JOINT_RADIUS_M = 0.012
_TRUE = (0.85, 0.15, 0.15)


def case_parts(case: str) -> tuple[str, Build]:
    """The limb and the build that a case names, such as "arm tall and thin"."""
    name, _, build = case.partition(" ")
    return name, next(b for b in BUILDS if b.name == build)


def run(case: str, folder: Path) -> Result:
    """Record somebody, adapt and track, all automatic, and compare; what stops that is the result, too."""
    name, build = case_parts(case)
    limb = LIMBS[name]
    times, u = times_and_phase(_SECONDS, FPS)
    moving = moving_limb(limb, build, u)
    skins = [moving.limb.skin(transforms) for transforms in moving.transforms]
    points = np.concatenate([skin.vertices for skin in skins[::6]])
    recording, world = record_meshes(
        (skin.vertices for skin in skins),
        skins[0].faces,
        times.tolist(),
        folder / "recording",
        points=points,
        seed=_SEED,
    )
    try:
        subject = _subject(recording, load_anatomy(limb.anatomy), folder / "subject.npz")
        motion = track_recording(recording, subject, folder / "motion")
    except BonetrackError as error:
        return {"failed": error.problem}
    middle = len(skins) // 2
    save_png(_picture(limb, moving, skins[middle], motion, subject, middle, world), folder / "bones.png")
    scored = _scored(name, build, moving, motion, world)
    return scored | {"skin_mm": _skins(skins, motion, subject, world), "picture": str(folder / "bones.png")}


def _subject(recording: Recording, anatomy: Anatomy, path: Path) -> Subject:
    if not path.is_file():
        save_subject(adapt_recording(recording, anatomy), path)
    return load_subject(path)


def _scored(name: str, build: Build, moving: Motions, motion: Motion, world: Floats) -> Result:
    """Joint centres, lengths and directions of segments, and angles, in the frames that were tracked."""
    limb, good = LIMBS[name], motion.tracked
    scale = build.stature / limb_plan(limb.anatomy).skin.stature
    ours, true, offsets = {}, {}, {}
    own = definition(limb)
    for joint, head, carrier in limb.joints:
        place, turn = moving.at(head, carrier)
        ours[joint] = (motion.centres[joint] @ world[:3, :3].T + world[:3, 3])[good]
        true[joint] = (place + turn @ (scale * own[joint]))[good]
        offsets[joint] = 1e3 * np.einsum("tji,tj->ti", turn[good], ours[joint] - true[joint])
    centres = {
        joint: {
            "distance_mm": np.linalg.norm(offset, axis=1).tolist(),
            "offset_mm": offset.mean(axis=0).tolist(),
            "varying_mm": np.linalg.norm(offset - offset.mean(axis=0), axis=1).tolist(),
        }
        for joint, offset in offsets.items()
    }
    ends = [(a[0], b[0]) for a, b in zip(limb.joints, limb.joints[1:], strict=False)]
    spans = {s: (ours[b] - ours[a], true[b] - true[a]) for s, (a, b) in zip(limb.segments, ends, strict=True)}
    return {
        "centres": centres,
        "lengths_mm": {s: [1e3 * float(np.linalg.norm(v, axis=1).mean()) for v in both] for s, both in spans.items()},
        "directions_deg": {s: _between(*both).tolist() for s, both in spans.items()},
        "angles_deg": {c: _followed(c, sign * moving.degrees[k], motion) for c, k, sign in limb.angles},
        "lost": int((~good).sum()),
        "frames": len(good),
    }


def _between(a: Floats, b: Floats) -> Floats:
    """Angles (T,) in degrees between vectors (T, 3)."""
    return np.asarray(np.rad2deg(np.arctan2(np.linalg.norm(np.cross(a, b), axis=1), (a * b).sum(axis=1))))


def _followed(coordinate: str, true: Floats, motion: Motion) -> Result:
    """How a coordinate follows the turn (T,) in degrees of the rig's bone: the rig has another zero."""
    tracked = np.rad2deg(motion.thetas[:, motion.coordinates.index(coordinate)])
    apart = (tracked - true)[motion.tracked]
    return {"varying": np.abs(apart - apart.mean()).tolist(), "constant": float(apart.mean())}


def _skins(skins: Sequence[Mesh], motion: Motion, subject: Subject, world: Floats) -> list[float]:
    """Mean distances (mm) from our skin, where it counts, to the true one, in some frames."""
    chosen = np.flatnonzero(subject.anatomy.fit_weight > _FITTED)
    frames = np.flatnonzero(motion.tracked)
    return [
        1e3
        * float(
            distance_to_mesh(_our_skin(motion, subject, t, world)[chosen], skins[t].vertices, skins[t].faces).mean()
        )
        for t in frames[:: max(1, len(frames) // _SKIN_FRAMES)]
    ]


def _our_skin(motion: Motion, subject: Subject, frame: int, world: Floats) -> Floats:
    return apply(world, pose_skin(subject.body, motion.thetas[frame]))


def _picture(
    limb: Limb, moving: Motions, skin: Mesh, motion: Motion, subject: Subject, frame: int, world: Floats
) -> NDArray[np.uint8]:
    """The true skin, the rig's joints in it (red), and our bones, from the front."""
    eye = look_at(skin.vertices, np.array([1.0, 0.15, 0.35]), np.array([0.0, 1.0, 0.0]), distance_m=3.0)
    camera = framing_camera(eye, skin.vertices, width=260, height=340)
    layers = [Layer(skin.vertices, skin.faces, SKIN, 0.3)]
    if motion.tracked[frame]:
        bones = posed_bones(subject.body, motion.thetas[frame])
        layers += [Layer(apply(world, bones[b.name]), b.faces, BONE, 0.9) for b in subject.anatomy.bones]
    ball, faces = _ball()
    places = [moving.at(head, carrier)[0][frame] for _, head, carrier in limb.joints]
    layers += [Layer(place + ball, faces, _TRUE, 1.0) for place in places]
    return render(layers, eye, camera)


def _ball() -> tuple[Floats, NDArray[np.int64]]:
    """A small octahedron."""
    corners = _JOINT_RADIUS_M * np.concatenate([np.eye(3), -np.eye(3)])
    faces = [(0, 1, 2), (1, 3, 2), (3, 4, 2), (4, 0, 2), (1, 0, 5), (3, 1, 5), (4, 3, 5), (0, 4, 5)]
    return corners, np.array(faces, dtype=np.int64)


def describe(results: Mapping[str, Result], images: Path) -> str:
    """A table and a picture for each limb."""
    parts = [_limb(n, {c: r for c, r in results.items() if case_parts(c)[0] == n}, images) for n in LIMBS]
    return f"""People by MakeHuman's shape targets, not by our handles, moved by MakeHuman's own default rig (its
joints, its weights, dual quaternions, then subdivision), {_SECONDS:g} s at {FPS:g} frames a second before two Carmine
sensors, one seed of noise. Calibration, first poses, adaptation to six poses and tracking are automatic. There are no
bones to compare with: the truth is where the rig's joints are, and the skin. Our template's skin was made of the same
base mesh by the same targets at their middle: the bodies are strange to its proportions and its way of moving, not to
its style.

Joint centres: the rig's joints are not where ours are even in the body that our template was made of
({"; ".join(_own(name) for name in LIMBS)}). That difference, in the axes of the segment and scaled with stature, is
counted as definition; *distance* is what is left, *varying* what is left after each person's constant offset is removed
as well. Lengths and directions are of the segments between joint centres. Angles: the difference between our coordinate
and the turn of the rig's bone, whose zero is another; the constant part is apart. Skin: mean distance from ours to the
true one.

{"".join(parts).strip()}
"""


def _own(name: str) -> str:
    sizes = [f"{joint} {1e3 * float(np.linalg.norm(apart)):.0f}" for joint, apart in definition(LIMBS[name]).items()]
    return f"{name}: {', '.join(sizes)} mm"


def _limb(name: str, results: Mapping[str, Result], images: Path) -> str:
    if not results:
        return ""
    limb, good = LIMBS[name], {case: result for case, result in results.items() if "failed" not in result}
    rows = [["mean ± SD (maximum)", *(case_parts(case)[1].name for case in good)]]
    for joint, *_ in limb.joints:
        of = [result["centres"][joint] for result in good.values()]
        rows.append([f"{joint}, distance (mm)", *(summary(c["distance_mm"], digits=1) for c in of)])
        rows.append([f"{joint}, constant: forward, up, right (mm)", *(_offset(c["offset_mm"]) for c in of)])
        rows.append([f"{joint}, varying (mm)", *(summary(c["varying_mm"], digits=1) for c in of)])
    for segment in limb.segments:
        rows.append(
            [f"length of the {segment}, ours of true (mm)", *(_length(r["lengths_mm"][segment]) for r in good.values())]
        )
        rows.append(
            [f"direction of the {segment} (deg)", *(summary(r["directions_deg"][segment]) for r in good.values())]
        )
    for coordinate, *_ in limb.angles:
        of = [result["angles_deg"][coordinate] for result in good.values()]
        rows.append([f"{coordinate}, varying (deg)", *(summary(a["varying"]) for a in of)])
        rows.append([f"{coordinate}, constant (deg)", *(f"{a['constant']:+.1f}" for a in of)])
    rows.append(["skin (mm)", *(summary(result["skin_mm"]) for result in good.values())])
    rows.append(["frames lost", *(f"{result['lost']} of {result['frames']}" for result in good.values())])
    failed = [f"{case}: {result['failed']}.\n" for case, result in results.items() if "failed" in result]
    return f"### {name.capitalize()}\n\n{markdown_table(rows)}\n\n{''.join(failed)}{_figure(name, good, images)}\n"


def _offset(offset: Sequence[float]) -> str:
    return ", ".join(f"{value:+.0f}" for value in offset)


def _length(both: Sequence[float]) -> str:
    ours, true = both
    return f"{ours:.0f} of {true:.0f} ({100 * (ours / true - 1):+.1f} %)"


def _figure(name: str, results: Mapping[str, Result], images: Path) -> str:
    """All bodies of a limb side by side, from the cases' own pictures."""
    from matplotlib.image import imread

    drawn = {case: Path(result["picture"]) for case, result in results.items() if Path(result["picture"]).is_file()}
    if not drawn:
        return ""
    figure = new_figure(2.4 * len(drawn), 3.3)
    for axes, (case, path) in zip(figure.subplots(1, len(drawn), squeeze=False)[0], drawn.items(), strict=True):
        axes.imshow(imread(path))
        axes.set_title(case_parts(case)[1].name, fontsize="small")
        axes.axis("off")
    save_figure(figure, images / f"figure-15-bodies-{name}.png")
    return f"""![Four bodies with our bones inside](images/figure-15-bodies-{name}.png)

Halfway through: the true skin, our bones in it, and the rig's joints (red).
"""


def losses(results: Mapping[str, Result]) -> list[str]:
    """Lengths, directions, joint centres beyond the aims that are set for a real person."""
    lines = []
    for case, result in results.items():
        if "failed" in result:
            lines.append(f"{case}: {result['failed']}")
            continue
        missed = missed_aims([_measures(result)])
        lines += [f"{case}: {missed}"] if missed else []
    return lines


def _measures(result: Result) -> dict[str, tuple[float, float]]:
    """Means with their aims, by title."""
    measures = {
        f"{j} centre (mm)": (float(np.mean(c["distance_mm"])), AIM_CENTRE_MM) for j, c in result["centres"].items()
    }
    for segment, (ours, true) in result["lengths_mm"].items():
        measures[f"length of the {segment} (%)"] = 100.0 * abs(ours / true - 1.0), AIM_LENGTH_PERCENT
        measures[f"direction of the {segment} (deg)"] = float(np.mean(result["directions_deg"][segment])), AIM_AXIS_DEG
    return measures


EXPERIMENT = Experiment(
    "figure-15-bodies",
    "Figures 15 and 16: different bodies that are not of our model's making",
    tuple(f"{name} {build.name}" for build in BUILDS for name in LIMBS),
    run,
    describe,
    losses,
)
