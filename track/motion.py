"""A motion: what tracking says of every frame, and the folder it is kept in.

MOTION/ holds ``motion.npz`` (everything, exact), ``angles.mot`` (OpenSim), ``centres.trc`` and ``quality.csv``
for people and other tools.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from adapt.anatomy import Anatomy, Floats
from adapt.model.body import bone_transforms, joint_centres
from adapt.subject import Subject
from capture.errors import BonetrackError
from capture.files import UNREADABLE, replaced_when_complete

FORMAT = "bonetrack-motion"
VERSION = 1
TRACKED = ""


class MotionError(BonetrackError):
    """A motion folder is missing or not what it should be."""


@dataclass(frozen=True, eq=False)
class Motion:
    """T frames of one subject.

    A frame whose ``lost`` text is not empty was not tracked, for that reason: its pose is NaN.
    """

    anatomy: str
    coordinates: tuple[str, ...]
    times: Floats  # (T,) s
    thetas: Floats = field(repr=False)  # (T, n) rad, m
    deviations: Floats = field(repr=False)  # (T, n) standard deviations, rad, m
    lost: tuple[str, ...] = field(repr=False)  # (T,) reason, or empty where tracked
    residuals: Floats = field(repr=False)  # (T,) median distance of skin and cloud, m
    coverage: Floats = field(repr=False)  # (T,) share of the skin that should show and has a target
    matches: Floats = field(repr=False)  # (T,) matched skin vertices
    transforms: dict[str, Floats] = field(repr=False)  # bone name -> (T, 4, 4), rest to pose
    centres: dict[str, Floats] = field(repr=False)  # joint name -> (T, 3) m

    @property
    def tracked(self) -> np.ndarray:
        """Which frames (T,) were tracked."""
        return np.array([reason == TRACKED for reason in self.lost])


def bones_and_centres(subject: Subject, thetas: Floats) -> tuple[dict[str, Floats], dict[str, Floats]]:
    """Bone transforms (T, 4, 4) and joint centres (T, 3) of poses (T, n), NaN where the pose is NaN."""
    anatomy = subject.anatomy
    transforms = {bone.name: np.full((len(thetas), 4, 4), np.nan) for bone in anatomy.bones}
    centres = {joint.name: np.full((len(thetas), 3), np.nan) for joint in anatomy.joints}
    for t, theta in enumerate(thetas):
        if not np.isfinite(theta).all():
            continue
        for name, transform in bone_transforms(subject.body, theta).items():
            transforms[name][t] = transform
        for name, centre in joint_centres(subject.body, theta).items():
            centres[name][t] = centre
    return transforms, centres


def save_motion(motion: Motion, folder: Path) -> None:
    """Write ``motion.npz`` into the folder."""
    description = {
        "format": FORMAT,
        "version": VERSION,
        "anatomy": motion.anatomy,
        "coordinates": list(motion.coordinates),
        "lost": list(motion.lost),
    }
    arrays: dict[str, np.ndarray] = {name: getattr(motion, name) for name in _ARRAYS}
    arrays |= {f"transforms/{name}": value for name, value in motion.transforms.items()}
    arrays |= {f"centres/{name}": value for name, value in motion.centres.items()}
    arrays["description"] = np.array(json.dumps(description))
    with replaced_when_complete(folder / "motion.npz") as partial:
        np.savez_compressed(partial, allow_pickle=False, **arrays)


def load_motion(folder: Path) -> Motion:
    """Read a motion folder (or its ``motion.npz``).

    Raises:
        MotionError: missing, not a motion, or a newer format version.
    """
    path = folder / "motion.npz" if folder.is_dir() else folder
    if not path.is_file():
        raise MotionError("no motion here", where=folder, remedy="make one with `bonetrack track`")
    try:
        with np.load(path, allow_pickle=False) as data:
            description = json.loads(str(data["description"]))
            arrays = {key: data[key] for key in data.files if key != "description"}
        if description["format"] != FORMAT:
            raise ValueError(description["format"])
        if description["version"] > VERSION:
            newer = f"format version {description['version']} is newer than {VERSION}"
            raise MotionError(newer, where=path, remedy="update bonetrack")
        return Motion(
            anatomy=description["anatomy"],
            coordinates=tuple(description["coordinates"]),
            lost=tuple(description["lost"]),
            transforms=_group(arrays, "transforms/"),
            centres=_group(arrays, "centres/"),
            **{name: arrays[name] for name in _ARRAYS},
        )
    except UNREADABLE as error:
        raise MotionError("not a motion file", where=path, remedy="make one with `bonetrack track`") from error


def coordinate_names(anatomy: Anatomy) -> tuple[str, ...]:
    """Names of theta's entries."""
    return tuple(coordinate.name for coordinate in anatomy.coordinates)


_ARRAYS = ("times", "thetas", "deviations", "residuals", "coverage", "matches")


def _group(arrays: dict[str, np.ndarray], prefix: str) -> dict[str, Floats]:
    return {key.removeprefix(prefix): value for key, value in arrays.items() if key.startswith(prefix)}
