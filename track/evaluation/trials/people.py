"""Section 1: who is before the sensors, and whether it is the one that was asked for."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from adapt.mirror import mirrored_name
from adapt.model.body import joint_centres
from capture.rigid import exp_so3, transform
from track.evaluation.trials import scenes
from track.evaluation.trials.situation import Situation, Trial

ARM, LEG = "upper-limb-right", "lower-limb-right"


def sound(seed: int, folder: Path, *, anatomy: str, scale: float = 1.0) -> Trial:
    """Nothing is wrong."""
    recording = scenes.record(scenes.person(anatomy, seed, scale=scale), folder / "recording", seed=seed)
    return Trial(recording, anatomy, recording)


def wrong_side(seed: int, folder: Path, *, anatomy: str) -> Trial:
    """A right limb, and a user who asks for a left one."""
    return replace(sound(seed, folder, anatomy=anatomy), ask=mirrored_name(anatomy))


def mirrored_images(seed: int, folder: Path, *, anatomy: str) -> Trial:
    """All sensors' drivers mirror their images, and nobody knows."""
    recording = sound(seed, folder, anatomy=anatomy).recording
    flipped = scenes.rewritten(recording, folder / "mirrored", images=lambda name, depth: scenes.flip(depth))
    return Trial(flipped, anatomy, None)


def one_mirrored(seed: int, folder: Path) -> Trial:
    """One sensor's driver mirrors its images, the other's does not."""
    recording = sound(seed, folder, anatomy=ARM).recording
    first = recording.sensors[0].name
    made = scenes.rewritten(
        recording, folder / "half", images=lambda name, depth: scenes.flip(depth) if name == first else depth
    )
    return Trial(made, ARM, made)


def held_wrist(seed: int, folder: Path) -> Trial:
    """A therapist, whose arm is in view as much as the patient's, holds the patient's wrist."""
    patient, therapist = scenes.person(ARM, seed), scenes.person(ARM, seed + 100)
    hand = joint_centres(patient.body, patient.thetas[0])["wrist"]
    own = joint_centres(therapist.body, therapist.thetas[0])["wrist"]
    turn = exp_so3(np.array([0.0, np.pi, 0.0]))
    place = transform(turn, hand - turn @ own + np.array([0.02, 0.05, 0.0]))
    still = replace(therapist, thetas=np.tile(therapist.thetas[0], (len(patient.times), 1)))
    meshes = [scenes.skin_of(patient), scenes.moved(scenes.skin_of(still), place)]
    both = np.concatenate([mesh.at(0) for mesh in meshes])
    rig = scenes.performance_rig(patient, distance_m=1.2 + 0.6 * float(np.ptp(both, axis=0).max() - 0.7), seed=seed)
    recording = scenes.record(patient, folder / "recording", seed=seed, meshes=meshes, rig=rig)
    return Trial(recording, ARM, recording)


def two_arms(seed: int, folder: Path) -> Trial:
    """Two right arms, of two people side by side."""
    one, other = scenes.person(ARM, seed), scenes.person(ARM, seed + 100)
    place = transform(np.eye(3), np.array([0.0, 0.0, 0.45]))
    meshes = [scenes.skin_of(one), scenes.moved(scenes.skin_of(other), place)]
    rig = scenes.performance_rig(one, distance_m=1.5, seed=seed)
    recording = scenes.record(one, folder / "recording", seed=seed, meshes=meshes, rig=rig)
    return Trial(recording, ARM, recording)


def furnished_room(seed: int, folder: Path) -> Trial:
    """A limb before a wall, a cupboard and a table, on a floor, with no region given."""
    who = scenes.person(ARM, seed)
    low, middle, _ = scenes.standing(who)
    around = [
        scenes.block((0.1, 3.0, 5.0), np.array([low[0] - 1.2, middle[1], middle[2]])),
        scenes.block((4.0, 0.1, 5.0), np.array([middle[0], low[1] - 0.9, middle[2]])),
        scenes.block((0.5, 1.2, 0.8), np.array([low[0] - 0.7, middle[1] - 0.4, middle[2] + 1.0])),
        scenes.block((0.6, 0.05, 1.0), np.array([low[0] - 0.4, low[1] - 0.3, middle[2] - 0.6])),
    ]
    recording = scenes.record(who, folder / "recording", seed=seed, meshes=[scenes.skin_of(who), *around])
    return Trial(recording, ARM, recording)


def no_hand(seed: int, folder: Path) -> Trial:
    """The hand is missing: the forearm ends in a stump."""
    who = scenes.person(ARM, seed)
    stump = scenes.Mesh(scenes.skin_of(who).at, scenes.without(who.body, ["hand"]))
    recording = scenes.record(who, folder / "recording", seed=seed, meshes=[stump])
    return Trial(recording, ARM, recording)


def disparity(seed: int, folder: Path) -> Trial:
    """Raw 11-bit disparity of a first Kinect, taken for millimetres."""
    recording = sound(seed, folder, anatomy=ARM).recording

    def raw(name: str, depth: np.ndarray) -> np.ndarray:
        with np.errstate(divide="ignore"):
            steps = (3.3309495161 - 1.0 / depth) / 0.0030711016  # OpenKinect's fit of metres to raw steps, turned round
        return np.where(depth > 0.0, np.clip(np.rint(steps), 0, 2046), 2047.0) * 0.001

    return Trial(scenes.rewritten(recording, folder / "raw", images=raw), ARM, None)


def focal_length(seed: int, folder: Path, *, factor: float) -> Trial:
    """The focal length is another camera's."""
    recording = sound(seed, folder, anatomy=ARM).recording
    made = scenes.rewritten(
        recording, folder / "focal", camera=lambda c: replace(c, fx=factor * c.fx, fy=factor * c.fy)
    )
    return Trial(made, ARM, None)


def depth_unit(seed: int, folder: Path, *, factor: float) -> Trial:
    """Depth is in another unit than the user says."""
    recording = sound(seed, folder, anatomy=ARM).recording
    return Trial(scenes.rewritten(recording, folder / "unit", images=lambda _, d: factor * d), ARM, None)


SITUATIONS = (
    Situation("a sound right arm", "right", partial(sound, anatomy=ARM)),
    Situation("a sound left arm", "right", partial(sound, anatomy=mirrored_name(ARM))),
    Situation("a sound right leg", "right", partial(sound, anatomy=LEG)),
    Situation("a sound left leg", "right", partial(sound, anatomy=mirrored_name(LEG))),
    Situation(
        "a left arm asked of a right one",
        "87 of 87 tracked, forearm off by 83 degrees",
        partial(wrong_side, anatomy=ARM),
    ),
    Situation(
        "a left leg asked of a right one",
        "tracked; a real left foot fitted better as a right one",
        partial(wrong_side, anatomy=LEG),
    ),
    Situation(
        "all images mirrored by the driver",
        "80 of 80 tracked, forearm off by 72 degrees",
        partial(mirrored_images, anatomy=ARM),
    ),
    Situation("all images mirrored, a leg", "not tried", partial(mirrored_images, anatomy=LEG)),
    Situation("one sensor's images mirrored", "not tried", one_mirrored),
    Situation(
        "a therapist holds the patient's wrist", "the therapist's arm adapted, elbow off by 32 degrees", held_wrist
    ),
    Situation("two right arms side by side", "not tried", two_arms),
    Situation("a furnished room, no region", "the region became the room, an arm lay on a wall", furnished_room),
    Situation(
        "a child, 0.60 of the template", "refused: only 0 skin vertices", partial(sound, anatomy=ARM, scale=0.60)
    ),
    Situation(
        "a child, 0.62 of the template", "tracked, forearm off by 21 degrees", partial(sound, anatomy=ARM, scale=0.62)
    ),
    Situation("a child, 0.72 of the template", "refused: which nobody is", partial(sound, anatomy=ARM, scale=0.72)),
    Situation("a child's leg, 0.65 of the template", "not tried", partial(sound, anatomy=LEG, scale=0.65)),
    Situation("a very tall man, 1.25", "not tried", partial(sound, anatomy=ARM, scale=1.25)),
    Situation("a hand is missing", "wrist 37 mm off and claimed in every frame", no_hand),
    Situation("raw Kinect disparity as millimetres", "a subject with all sizes 1.30 is written", disparity),
    Situation(
        "focal length 0.8 of the true",
        "some first poses are wrong, which they were not",
        partial(focal_length, factor=0.8),
    ),
    Situation("focal length 1.25 of the true", "not tried", partial(focal_length, factor=1.25)),
    Situation("depth ten times too large", "not tried", partial(depth_unit, factor=2.0)),
    Situation("depth half of the true", "not tried", partial(depth_unit, factor=0.5)),
)
