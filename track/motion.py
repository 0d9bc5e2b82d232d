"""A motion: what tracking says of every frame, and the folder it is kept in.

MOTION/ holds ``motion.npz`` (everything, exact), ``angles.mot`` (OpenSim), ``centres.trc`` and ``quality.csv``
for people and other tools.
"""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from adapt.anatomy import Anatomy, Floats
from adapt.fit.never_seen import ends
from adapt.model.body import bone_transforms, joint_centres
from adapt.subject import Subject
from capture.errors import BonetrackError
from capture.files import UNREADABLE, read_arrays, unreadable
from capture.own import arrays_of, replaced_if_own
from capture.recording.types import HEADER_FILE
from track.observed_bones import Bools, centres_known
from track.settings import Settings
from track.strip import strip

FORMAT = "bonetrack-motion"
MARK = arrays_of(FORMAT)
VERSION = 2  # 2: which bones show
TRACKED = ""
_TRACK = "make one with `bonetrack track`"


class MotionError(BonetrackError):
    """A motion folder is missing or not what it should be."""


@dataclass(frozen=True, eq=False)
class Motion:
    """T frames of one subject.

    A frame whose ``lost`` text is not empty was not tracked, for that reason: its pose is NaN. Of a frame that was
    tracked ``thetas`` are whole, so that they pose a body; where a bone at either end of a joint does not show they are
    guesses, and the deviations say so (``track.observed_bones.known_thetas`` leaves guesses out). Transforms and
    centres that are not known are NaN. ``how`` says of tracked frames how their pose was come by
    (``track.tracked_frame.FOLLOWED`` and so on), ``settings`` with what it was tracked; motions written before that was
    kept have none.
    """

    anatomy: str
    coordinates: tuple[str, ...]
    times: Floats  # (T,) s
    thetas: Floats = field(repr=False)  # (T, n) rad, m
    deviations: Floats = field(repr=False)  # (T, n) standard deviations, rad, m
    lost: tuple[str, ...] = field(repr=False)  # (T,) reason, or empty where tracked
    residuals: Floats = field(repr=False)  # (T,) median distance of skin and cloud, m
    coverage: Floats = field(repr=False)  # (T,) share of the skin in sight that was found
    matches: Floats = field(repr=False)  # (T,) matched skin vertices
    shown: Bools = field(repr=False)  # (T, B), bones in the order of the anatomy's and of ``transforms``
    transforms: dict[str, Floats] = field(repr=False)  # bone name -> (T, 4, 4), rest to pose
    centres: dict[str, Floats] = field(repr=False)  # joint name -> (T, 3) m
    how: tuple[str, ...] = field(default=(), repr=False)  # (T,) empty where lost
    settings: Settings | None = field(default=None, repr=False)

    @property
    def tracked(self) -> np.ndarray:
        """Which frames (T,) were tracked."""
        return np.array([reason == TRACKED for reason in self.lost])

    def _repr_html_(self) -> str:
        """What a notebook shows of a motion: which frames were tracked."""
        return strip(self.anatomy, self.times, self.tracked, self.shown)

    def hidden(self, frame: int) -> list[str]:
        """Names of the bones that do not show in a frame."""
        return [name for name, shows in zip(self.transforms, self.shown[frame], strict=True) if not shows]


def bones_and_centres(subject: Subject, thetas: Floats, shown: Bools) -> tuple[dict[str, Floats], dict[str, Floats]]:
    """Bone transforms (T, 4, 4) and joint centres (T, 3) of poses (T, n) where bones (T, B) show, elsewhere NaN."""
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
    for name, shows in zip(transforms, shown.T, strict=True):
        transforms[name][~shows] = np.nan
    for name, known in centres_known(anatomy, shown).items():
        centres[name][~known] = np.nan
    for name in ends(anatomy, subject.never_seen):
        centres[name][:] = np.nan
    return transforms, centres


def save_motion(motion: Motion, folder: Path) -> None:
    """Write ``motion.npz`` into the folder.

    Raises:
        OutputError: one stands there that is no motion.
    """
    description = {
        "format": FORMAT,
        "version": VERSION,
        "anatomy": motion.anatomy,
        "coordinates": list(motion.coordinates),
        "lost": list(motion.lost),
        "how": list(motion.how),
        "settings": None if motion.settings is None else asdict(motion.settings),
    }
    arrays: dict[str, np.ndarray] = {name: getattr(motion, name) for name in _ARRAYS}
    arrays |= {f"transforms/{name}": value for name, value in motion.transforms.items()}
    arrays |= {f"centres/{name}": value for name, value in motion.centres.items()}
    arrays["description"] = np.array(json.dumps(description))
    with replaced_if_own(folder / "motion.npz", MARK) as partial:
        np.savez_compressed(partial, allow_pickle=False, **arrays)


def refuse_recording(folder: Path) -> None:
    """Raise MotionError where a recording's folder is named in the place of a motion's."""
    if (folder / HEADER_FILE).is_file() and not (folder / "motion.npz").is_file():
        raise MotionError("is a recording, not a motion", where=folder, remedy=_TRACK)


def load_motion(folder: Path) -> Motion:
    """Read a motion folder (or its ``motion.npz``).

    Raises:
        MotionError: missing, not a motion, or a newer format version.

    Version 1 told nothing of single bones: all of them show where the frame was tracked.
    """
    path = folder / "motion.npz" if folder.is_dir() else folder
    if not path.is_file():
        refuse_recording(folder)
        raise MotionError("no motion here", where=folder, remedy=_TRACK)
    try:
        arrays = read_arrays(path, _KNOWN)
        description = json.loads(str(arrays.pop("description")))
        if description["format"] != FORMAT:
            raise ValueError(description["format"])
        if description["version"] > VERSION:
            newer = f"format version {description['version']} is newer than {VERSION}"
            raise MotionError(newer, where=path, remedy="update bonetrack")
        transforms = _group(arrays, "transforms/")
        if description["version"] < 2:
            tracked = np.array([reason == TRACKED for reason in description["lost"]])
            arrays["shown"] = np.tile(tracked[:, None], (1, len(transforms)))
        motion = Motion(
            anatomy=description["anatomy"],
            coordinates=tuple(description["coordinates"]),
            lost=tuple(description["lost"]),
            how=tuple(description.get("how", ())),
            settings=_settings(description.get("settings")),
            transforms=transforms,
            centres=_group(arrays, "centres/"),
            **{name: arrays[name] for name in _ARRAYS},
        )
        _refuse_other_shapes(motion)
        return motion
    except UNREADABLE as error:
        problem = unreadable("a motion file", error)
        raise MotionError(problem, where=path, remedy="make one with `bonetrack track`") from error


def _refuse_other_shapes(motion: Motion) -> None:
    """Raise ValueError for a motion whose parts are not of one number of frames, coordinates and bones."""
    frames, coordinates = len(motion.times), len(motion.coordinates)
    shapes = {
        "times": (frames,),
        "thetas": (frames, coordinates),
        "deviations": (frames, coordinates),
        "lost": (frames,),
        "how": (len(motion.how) and frames,),
        "residuals": (frames,),
        "coverage": (frames,),
        "matches": (frames,),
        "shown": (frames, len(motion.transforms)),
    }
    told = {name: np.shape(getattr(motion, name)) for name in shapes}
    told |= {name: pose.shape for name, pose in motion.transforms.items()}
    shapes |= dict.fromkeys(motion.transforms, (frames, 4, 4))
    told |= {f"centre of {name}": centre.shape for name, centre in motion.centres.items()}
    shapes |= {f"centre of {name}": (frames, 3) for name in motion.centres}
    if told != shapes or not isinstance(motion.anatomy, str):
        wrong = [name for name in shapes if told[name] != shapes[name]]
        raise ValueError(f"of another shape than the times: {', '.join(wrong)}")


def coordinate_names(anatomy: Anatomy) -> tuple[str, ...]:
    """Names of theta's entries.

    >>> from adapt.anatomy_file import load_anatomy
    >>> coordinate_names(load_anatomy("upper-limb-right"))[6:]
    ('elbow_flexion', 'pro_sup', 'deviation', 'flexion')
    """
    return tuple(coordinate.name for coordinate in anatomy.coordinates)


_ARRAYS = ("times", "thetas", "deviations", "shown", "residuals", "coverage", "matches")
_MOST_BYTES = 64 << 20  # of one array: half a million frames of a bone's transforms
_KNOWN = dict.fromkeys((*_ARRAYS, "description", "transforms/", "centres/"), _MOST_BYTES)


def _settings(kept: dict[str, Any] | None) -> Settings | None:
    if kept is None:
        return None
    settings = Settings(kept["versions"], kept["options"], kept["thresholds"], kept.get("places", {}))
    if not all(
        np.isfinite(end).all() and end.shape == (3,) for end in (settings.region.minimum, settings.region.maximum)
    ):
        raise ValueError("a region that is none")
    return settings


def _group(arrays: dict[str, np.ndarray], prefix: str) -> dict[str, Floats]:
    return {key.removeprefix(prefix): value for key, value in arrays.items() if key.startswith(prefix)}
