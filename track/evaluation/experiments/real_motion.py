"""One real man's limbs in motion: his own bones move, his skin follows, our template is adapted to it and tracks it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from itertools import pairwise
from pathlib import Path

import numpy as np

from adapt.adapt_recording import adapt_recording
from adapt.anatomy import Anatomy, Floats
from adapt.anatomy_file import load_anatomy
from adapt.subject import Subject, load_subject, save_subject
from adapt.template_builder.meshes import Mesh, largest_part
from capture.errors import BonetrackError
from capture.recording import Recording
from capture.rigid import apply
from track.accuracy.mesh_distance import distance_to_mesh
from track.evaluation.experiments.experiment import Experiment, Result
from track.evaluation.experiments.movable_limbs import (
    MOVABLE,
    SECONDS,
    degrees_over_time,
    make_movable,
    motions_over_time,
)
from track.evaluation.experiments.real_limbs import LIMBS, RealLimb
from track.evaluation.experiments.real_motion_page import describe, losses
from track.evaluation.experiments.real_person import Posed, axis_between, picture, posed
from track.evaluation.experiments.surface_fit import greatest_length
from track.evaluation.jointed import Jointed
from track.evaluation.known import record_meshes
from track.evaluation.made_up_motions import FPS
from track.evaluation.swing import times_and_phase
from track.motion import Motion
from track.track_recording import track_recording
from track.view.render import save_png

NAME, TITLE = "real-motion", "A real man's limbs in motion"
SEEDS = (1, 2)
_SKIN_FRAMES = 10  # in which distances of skins are measured


def run(case: str, folder: Path, *, data: Path) -> Result:
    """Record him moving, adapt to six poses and track, all automatic, and compare; what stops that is the result."""
    name, seed = case.split()[0], int(case.split()[-1])
    him = make_movable(name, data)
    motions = motions_over_time(name, him)
    skins = [him.posed_skin(moved) for moved in motions]
    times, points = times_and_phase(SECONDS, FPS)[0].tolist(), np.concatenate(skins[::6])
    recording, world = record_meshes(skins, him.skin.faces, times, folder / "recording", points=points, seed=seed)
    try:
        subject = _subject(recording, load_anatomy(LIMBS[name].anatomy), folder / "subject.npz")
        motion = track_recording(recording, subject, folder / "motion")
    except BonetrackError as error:
        return {"failed": error.problem}
    frames = np.flatnonzero(motion.tracked)
    compared = [_compared(name, him, motions[t], subject, motion.thetas[t], world) for t in frames]
    middle = int(frames[len(frames) // 2])
    limb = LIMBS[name]
    there = _moved(name, him, motions[middle], skins[middle])
    save_png(picture(there, posed(subject.body, motion.thetas[middle], limb, world)), folder / "bones.png")
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
    limb, how = LIMBS[name], MOVABLE[name]
    bones = {b: Mesh(apply(motions[b], him.bones[b].vertices), him.bones[b].faces) for b in limb.bones}
    rest = {joint: np.mean([him.landmarks[n] for n in his], axis=0) for joint, (_, his) in limb.centres.items()}
    centres = {joint: apply(motions[how.centres[joint]], rest[joint][None])[0] for joint in limb.centres}
    return RealLimb(Mesh(skin, him.skin.faces), bones, centres, {})


def _compared(
    name: str, him: Jointed, motions: Mapping[str, Floats], subject: Subject, theta: Floats, world: Floats
) -> Result:
    """One frame: offsets of centres in the axes of the bone that carries them (forward, up, right at his rest)."""
    limb, how = LIMBS[name], MOVABLE[name]
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
    limb = next(limb for limb in LIMBS.values() if limb.anatomy == subject.anatomy.name)
    frames = np.flatnonzero(motion.tracked)
    means = []
    for t in frames[:: max(1, len(frames) // _SKIN_FRAMES)]:
        ours = posed(subject.body, motion.thetas[t], limb, world)
        means.append(1e3 * float(distance_to_mesh(ours.skin.vertices[ours.fitted], skins[t], him.skin.faces).mean()))
    return means


def experiment(data: Path) -> Experiment:
    """The experiment on the man below ``data``."""
    cases = tuple(f"{name} seed {seed}" for seed in SEEDS for name in LIMBS)
    return Experiment(NAME, TITLE, cases, partial(run, data=data), describe, losses)
