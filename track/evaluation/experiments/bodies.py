"""Figures 15 and 16: people that are not of our model's making and not moved by it, arms and legs."""

from __future__ import annotations

from functools import lru_cache, partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from adapt.adapt_recording import adapt_recording
from adapt.anatomy import Anatomy, Floats
from adapt.anatomy_file import load_anatomy
from adapt.fit.pose import fit_pose
from adapt.match.correspondences import Target
from adapt.match.skin_sample import sample_skin
from adapt.model.body import pose_skin, posed_bones
from adapt.subject import Subject, load_subject, save_subject
from capture.cloud.fuse import fuse, region_of_interest
from capture.errors import BonetrackError
from capture.recording import Recording, instants
from capture.rigid import apply, inverse
from track.accuracy.mesh_distance import distance_to_mesh
from track.evaluation.centre_deviations import centre_deviations
from track.evaluation.coverage import coordinate_errors
from track.evaluation.experiments.bodies_page import describe, losses
from track.evaluation.experiments.experiment import Experiment, Result
from track.evaluation.foreign_truth import nearest_body, true_thetas
from track.evaluation.known import carried, record_meshes
from track.evaluation.made_up_motions import FPS
from track.evaluation.population import people
from track.evaluation.rigged_limbs import LIMBS, Motions, moving_limb
from track.evaluation.rigged_people import RIGS
from track.evaluation.solved_people import Solved, solved
from track.evaluation.swing import times_and_phase
from track.motion import Motion
from track.track_recording import track_recording
from track.view.render import BONE, SKIN, Layer, framing_camera, look_at, render, save_png

NAME = "figure-15-bodies"
PEOPLE = ("mean man", "mean woman", "man 1", "woman 1", "man 2", "woman 2")
CASES = tuple(f"{limb} {who} {rig}" for who in PEOPLE for rig in reversed(RIGS) for limb in LIMBS)
SECONDS = 2.0
_SEED = 1
_SKIN_FRAMES, _CENTRE_FRAMES = 10, 4  # in which distances of skins, and deviations of centres, are worked out
_FITTED = 0.5  # a vertex of the skin that counts by more than this in fitting is one of the limb proper
_JOINT_RADIUS_M = 0.012
_TRUE = (0.85, 0.15, 0.15)


def case_parts(case: str) -> tuple[str, str, str]:
    """The limb, the person and the rig that a case names, such as "arm man 1 mixamo"."""
    limb, rest = case.split(maxsplit=1)
    who, rig = rest.rsplit(maxsplit=1)
    return limb, who, rig


@lru_cache(maxsize=len(PEOPLE))
def somebody(who: str, data: Path) -> Solved:
    """One of PEOPLE: a body with that person's measures."""
    return solved(people(data, (who,))[who])


def motions_of(case: str, data: Path) -> Motions:
    """What the limb of a case does."""
    name, _, rig = case_parts(case)
    return moving_limb(LIMBS[name], somebody(case_parts(case)[1], data).body, rig, times_and_phase(SECONDS, FPS)[1])


def recorded(moving: Motions, folder: Path) -> tuple[Recording, Floats]:
    """The limb's recording, and where its common frame is (4, 4)."""
    skins = (moving.limb.skin(transforms) for transforms in moving.transforms)
    return record_meshes(
        (skin.vertices for skin in skins),
        moving.limb.skin(moving.transforms[0]).faces,
        times_and_phase(SECONDS, FPS)[0].tolist(),
        folder / "recording",
        points=np.concatenate([moving.limb.skin(transforms).vertices for transforms in moving.transforms[::6]]),
        seed=_SEED,
    )


def adapted(recording: Recording, anatomy: Anatomy, folder: Path) -> Subject:
    """The subject adapted to a recording, or read where that has been done."""
    path = folder / "subject.npz"
    if not path.is_file():
        save_subject(adapt_recording(recording, anatomy), path)
    return load_subject(path)


def run(case: str, folder: Path, *, data: Path) -> Result:
    """Record somebody, adapt and track, all automatic, and compare; what stops that is the result, too."""
    moving = motions_of(case, data)
    recording, world = recorded(moving, folder)
    try:
        subject = adapted(recording, load_anatomy(moving.what.anatomy), folder)
        motion = track_recording(recording, subject, folder / "motion")
    except BonetrackError as error:
        return {"failed": error.problem}
    save_png(_picture(moving, len(moving.transforms) // 2, motion, subject, world), folder / "bones.png")
    return {
        "missed_mm": {name: 1e3 * off for name, off in somebody(case_parts(case)[1], data).missed.items()},
        "yardsticks": {
            "carried": _scored(moving, moving.true, motion, world),
            "rig": _scored(moving, moving.by_rig, motion, world),
        },
        "coordinates": _coordinates(moving, motion, world),
        "centres_z": _centres_z(moving, recording, subject, motion, world),
        "skin_mm": _skins(moving, motion, subject, world),
        "lost": int((~motion.tracked).sum()),
        "frames": len(motion.tracked),
        "picture": str(folder / "bones.png"),
    }


def _scored(moving: Motions, places: dict[str, Floats], motion: Motion, world: Floats) -> Result:
    """Joint centres, lengths and directions of segments against one yardstick, in the frames that were tracked."""
    good, joints = motion.tracked, list(places)
    ours = {joint: apply(world, motion.centres[joint][good]) for joint in joints}
    true, centres = {}, {}
    for joint in joints:
        place, turn = moving.carried(joint, places[joint])
        true[joint] = place[good]
        offset = 1e3 * np.einsum("tji,tj->ti", turn[good], ours[joint] - true[joint])
        centres[joint] = {
            "distance_mm": np.linalg.norm(offset, axis=1).tolist(),
            "offset_mm": offset.mean(axis=0).tolist(),
            "varying_mm": np.linalg.norm(offset - offset.mean(axis=0), axis=1).tolist(),
        }
    ends = zip(moving.what.segments, joints, joints[1:], strict=False)
    spans = {segment: (ours[b] - ours[a], true[b] - true[a]) for segment, a, b in ends}
    return {
        "centres": centres,
        "lengths_mm": {s: [1e3 * float(np.linalg.norm(v, axis=1).mean()) for v in both] for s, both in spans.items()},
        "directions_deg": {s: _between(*both).tolist() for s, both in spans.items()},
    }


def _between(a: Floats, b: Floats) -> Floats:
    """Angles (T,) in degrees between vectors (T, 3)."""
    return np.asarray(np.rad2deg(np.arctan2(np.linalg.norm(np.cross(a, b), axis=1), (a * b).sum(axis=1))))


def _coordinates(moving: Motions, motion: Motion, world: Floats) -> Result:
    """Each coordinate's errors, and what was stated for them (deg, mm), in the frames that were tracked."""
    body, good = nearest_body(moving), np.flatnonzero(motion.tracked)
    true = carried(body.anatomy, true_thetas(moving, body), inverse(world))
    errors = np.array([coordinate_errors(body.anatomy, motion.thetas[t], true[t]) for t in good])
    unit = np.array([180.0 / np.pi if c.unit == "rad" else 1e3 for c in body.anatomy.coordinates])
    return {
        name: {"error": (unit[i] * errors[:, i]).tolist(), "stated": (unit[i] * motion.deviations[good, i]).tolist()}
        for i, name in enumerate(motion.coordinates)
    }


def _centres_z(moving: Motions, recording: Recording, subject: Subject, motion: Motion, world: Floats) -> Result:
    """Errors of the joints' centres in stated standard deviations, axis by axis, in some frames."""
    sample, region, moments = sample_skin(subject.anatomy), region_of_interest(recording), instants(recording)
    true = {joint: moving.carried(joint, place)[0] for joint, place in moving.true.items()}
    z: dict[str, list[float]] = {joint: [] for joint in true}
    for t in _some(motion, _CENTRE_FRAMES):
        fit = fit_pose(subject.body, Target(fuse(recording, moments[t], region=region)), motion.thetas[t], sample)
        deviations = centre_deviations(subject, fit, sample)
        for joint, places in true.items():
            off = motion.centres[joint][t] - apply(inverse(world), places[t][None])[0]
            z[joint] += (off / deviations[joint]).tolist()
    return z


def _some(motion: Motion, count: int) -> NDArray[np.int64]:
    """About so many of the frames that were tracked."""
    frames = np.flatnonzero(motion.tracked)
    return frames[:: max(1, len(frames) // count)]


def _skins(moving: Motions, motion: Motion, subject: Subject, world: Floats) -> list[float]:
    """Mean distances (mm) from our skin, where it counts, to the true one, in some frames."""
    chosen, means = np.flatnonzero(subject.anatomy.fit_weight > _FITTED), []
    for t in _some(motion, _SKIN_FRAMES):
        ours = apply(world, pose_skin(subject.body, motion.thetas[t]))[chosen]
        true = moving.limb.skin(moving.transforms[t])
        means.append(1e3 * float(distance_to_mesh(ours, true.vertices, true.faces).mean()))
    return means


def _picture(moving: Motions, frame: int, motion: Motion, subject: Subject, world: Floats) -> NDArray[np.uint8]:
    """The true skin, the joints in it (red), and our bones, from the front."""
    skin = moving.limb.skin(moving.transforms[frame])
    eye = look_at(skin.vertices, np.array([1.0, 0.15, 0.35]), np.array([0.0, 1.0, 0.0]), distance_m=3.0)
    camera = framing_camera(eye, skin.vertices, width=220, height=340)
    layers = [Layer(skin.vertices, skin.faces, SKIN, 0.3)]
    if motion.tracked[frame]:
        bones = posed_bones(subject.body, motion.thetas[frame])
        layers += [Layer(apply(world, bones[b.name]), b.faces, BONE, 0.9) for b in subject.anatomy.bones]
    ball, faces = _ball()
    places = [moving.carried(joint, place)[0][frame] for joint, place in moving.true.items()]
    layers += [Layer(place + ball, faces, _TRUE, 1.0) for place in places]
    return render(layers, eye, camera)


def _ball() -> tuple[Floats, NDArray[np.int64]]:
    """A small octahedron."""
    corners = _JOINT_RADIUS_M * np.concatenate([np.eye(3), -np.eye(3)])
    faces = [(0, 1, 2), (1, 3, 2), (3, 4, 2), (4, 0, 2), (1, 0, 5), (3, 1, 5), (4, 3, 5), (0, 4, 5)]
    return corners, np.array(faces, dtype=np.int64)


def experiment(data: Path) -> Experiment:
    """The experiment on people drawn from the population below ``data``."""
    title = "Figures 15 and 16: people that are not of our model's making"
    return Experiment(NAME, title, CASES, partial(run, data=data), describe, losses)
