"""An anatomy as data: bones, landmarks, joints, coordinates, handles, deformers, skin.

Code elsewhere in the package names joint TYPES and deformer TYPES, never a bone. Conventions: metres, radians,
X forward, Y up, Z right (ISB) in the rest pose; points are (N, 3); all arrays are given at rest.
"""

from __future__ import annotations

import json
from dataclasses import asdict, astuple, dataclass, field, replace
from importlib import resources
from pathlib import Path
from typing import IO, Any, Literal, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from capture.errors import AnatomyError
from capture.files import UNREADABLE, read_arrays, replaced_when_complete, unreadable

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

FORMAT = "bonetrack-anatomy"
VERSION = 2  # 2: ball and spline joints, bend deformers


@dataclass(frozen=True)
class Coordinate:
    """One degree of freedom, with OpenSim's name, sign and zero.

    ``rest`` is its value in the template's rest pose; for a free joint it is 0 and has no meaning, because the
    rest values follow from the landmarks.
    """

    name: str
    unit: Literal["rad", "m"]
    low: float
    high: float
    rest: float


@dataclass(frozen=True)
class Frame:
    """A right-handed frame from landmarks, as ISB writes them down.

    The origin is the mean of ``origin``. ``y`` points from the mean of ``y_from`` to the mean of ``y_to``;
    ``z`` is the part of (mean of ``z_to`` - mean of ``z_from``) perpendicular to ``y``; ``x = y x z``.
    Each entry is a tuple of landmark names.
    """

    origin: tuple[str, ...]
    y_from: tuple[str, ...]
    y_to: tuple[str, ...]
    z_from: tuple[str, ...]
    z_to: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Bone:
    """A rigid body: one bone, or several that move as one."""

    name: str
    frame: Frame
    vertices: Floats = field(repr=False)  # (N, 3) m
    faces: Ints = field(repr=False)  # (M, 3)
    handle_weights: Floats = field(repr=False)  # (N, H): bounded biharmonic, inside the bone


@dataclass(frozen=True)
class Joint:
    """How ``child`` moves relative to ``parent`` (None: relative to the recording's frame).

    What its coordinates (rad, m), axes, knots and frames mean is said where the type is (``adapt.model.joints``). An
    axis is the line from its first landmark to its second; ``frames[i]`` is where the coordinate equals ``knots[i]``.
    ``centre`` names the landmarks whose mean is the joint centre.

    Joints may share a coordinate: a kneecap follows the knee's.
    Raises AnatomyError when the parts do not make a joint of its type.
    """

    name: str
    type: str  # of adapt.model.joints.JOINT_TYPES
    parent: str | None
    child: str
    coordinates: tuple[str, ...]
    axes: tuple[tuple[str, str], ...]
    centre: tuple[str, ...]
    knots: tuple[float, ...] = ()
    frames: tuple[Frame, ...] = ()

    def __post_init__(self) -> None:
        from adapt.model.joints import joint_problem  # which itself needs what is above

        problem = joint_problem(self)
        if problem is not None:
            raise AnatomyError(problem, where=f"joint {self.name}", remedy="mend the anatomy's data")

    def landmarks(self) -> tuple[str, ...]:
        """Names of all landmarks that the joint's motion or centre depends on, each once."""
        in_frames = (name for frame in self.frames for names in astuple(frame) for name in names)
        return tuple(dict.fromkeys([*(name for axis in self.axes for name in axis), *in_frames, *self.centre]))


@dataclass(frozen=True)
class Handle:
    """A point handle in a bone's head (paper, section 3.2). Handles of one ``joint`` move as one similarity."""

    name: str
    bone: str
    joint: str
    position: tuple[float, float, float]


@dataclass(frozen=True)
class Deformer:
    """What moves skin, by which bones and frames: what these mean says the type (adapt.model.deformers).

    Raises AnatomyError where bones and frames make no deformer of the type.
    """

    name: str
    type: str  # of adapt.model.deformers.DEFORMER_TYPES
    bones: tuple[str, ...]
    frames: tuple[Frame, ...] = ()

    def __post_init__(self) -> None:
        from adapt.model.deformers import deformer_problem  # which itself needs what is above

        problem = deformer_problem(self)
        if problem is not None:
            raise AnatomyError(problem, where=f"deformer {self.name}", remedy="mend the anatomy's data")


@dataclass(frozen=True, eq=False)
class Anatomy:
    """A template limb, at rest. V skin vertices, P landmarks, H handles, D deformers.

    Compared by identity, so that what is prepared from an anatomy can be cached.
    Raises AnatomyError where a coordinate has not the unit that its joint's type gives it.
    """

    name: str
    side: Literal["right", "left"]
    bones: tuple[Bone, ...]
    joints: tuple[Joint, ...]  # parents come before their children
    coordinates: tuple[Coordinate, ...]  # in the order of theta
    handles: tuple[Handle, ...]
    deformers: tuple[Deformer, ...]
    landmark_names: tuple[str, ...]
    landmarks: Floats = field(repr=False)  # (P, 3) m
    landmark_handle_weights: Floats = field(repr=False)  # (P, H)
    skin_vertices: Floats = field(repr=False)  # (V, 3) m
    skin_faces: Ints = field(repr=False)  # (F, 3), closed
    skin_handle_weights: Floats = field(repr=False)  # (V, H): bounded biharmonic, inside the limb
    deformer_weights: Floats = field(repr=False)  # (V, D)
    fit_weight: Floats = field(repr=False)  # (V,) in [0, 1]: how much a vertex counts in fitting
    tetrahedra: dict[str, tuple[Floats, Ints]] = field(repr=False)  # "limb" and bone names: (N, 3) m, (T, 4)

    def __post_init__(self) -> None:
        from adapt.model.joints import units_of  # which itself needs what is above

        for joint in self.joints:
            for name, unit in zip(joint.coordinates, units_of(joint), strict=True):
                if self.coordinates[self.coordinate_index(name)].unit != unit:
                    raise AnatomyError(
                        f"its coordinate {name} must be in {unit}",
                        where=f"joint {joint.name}",
                        remedy="mend the anatomy's data",
                    )

    def bone(self, name: str) -> Bone:
        """The bone of that name. Raises AnatomyError with the valid names."""
        return _named(self.bones, name, "bone")

    def joint(self, name: str) -> Joint:
        """The joint of that name. Raises AnatomyError with the valid names."""
        return _named(self.joints, name, "joint")

    def coordinate_index(self, name: str) -> int:
        """Where a coordinate stands in theta. Raises AnatomyError with the valid names."""
        return self.coordinates.index(_named(self.coordinates, name, "coordinate"))

    def landmark_index(self, name: str) -> int:
        """Where a landmark stands in p. Raises AnatomyError with the valid names."""
        try:
            return self.landmark_names.index(name)
        except ValueError:
            valid = ", ".join(self.landmark_names)
            raise AnatomyError(f"no landmark {name!r}", where=self.name, remedy=f"use one of {valid}") from None


class _Named(Protocol):
    @property
    def name(self) -> str: ...


_N = TypeVar("_N", bound=_Named)


def _named(items: tuple[_N, ...], name: str, what: str) -> _N:
    for item in items:
        if item.name == name:
            return item
    valid = ", ".join(item.name for item in items)
    raise AnatomyError(f"no {what} {name!r}", remedy=f"use one of {valid}")


def save_anatomy(anatomy: Anatomy, path: Path) -> None:
    """Write an anatomy as one ``.npz`` (numbers in single precision, the description as JSON text)."""
    with replaced_when_complete(path) as partial, partial.open("wb") as file:
        write_anatomy(anatomy, file)


def write_anatomy(anatomy: Anatomy, file: IO[bytes]) -> None:
    """``save_anatomy`` into an open file."""
    narrow = {key: _narrow(array) for key, array in anatomy_arrays(anatomy).items()}
    narrow["description"] = np.array(json.dumps(anatomy_description(anatomy)))
    np.savez_compressed(file, allow_pickle=False, **narrow)


def anatomy_description(anatomy: Anatomy) -> dict[str, Any]:
    """All of an anatomy but its arrays, as JSON keeps it."""
    return {
        "format": FORMAT,
        "version": VERSION,
        "name": anatomy.name,
        "side": anatomy.side,
        "bones": [{"name": bone.name, "frame": asdict(bone.frame)} for bone in anatomy.bones],
        "joints": [asdict(joint) for joint in anatomy.joints],
        "coordinates": [asdict(coordinate) for coordinate in anatomy.coordinates],
        "handles": [asdict(handle) for handle in anatomy.handles],
        "deformers": [asdict(deformer) for deformer in anatomy.deformers],
        "landmark_names": list(anatomy.landmark_names),
        "tetrahedra": list(anatomy.tetrahedra),
    }


def anatomy_arrays(anatomy: Anatomy) -> dict[str, NDArray[Any]]:
    """Every array of an anatomy, by the name that it has in a file."""
    arrays: dict[str, NDArray[Any]] = {name: getattr(anatomy, name) for name in _ARRAYS}
    for bone in anatomy.bones:
        for part in _BONE_ARRAYS:
            arrays[f"bone/{bone.name}/{part}"] = getattr(bone, part)
    for name, (points, tets) in anatomy.tetrahedra.items():
        arrays[f"tetrahedra/{name}/points"], arrays[f"tetrahedra/{name}/tets"] = points, tets
    return arrays


def load_anatomy(name_or_path: str | Path) -> Anatomy:
    """Read an anatomy that ships with the package (by name) or any ``.npz`` of the same format (by path).

    One of a file is called as the file is, without ``.npz``. A limb whose other side ships, or lies where the path says
    (``adapt.mirror.mirrored_name``), is the mirror image of that.

    Raises:
        AnatomyError: no such anatomy, not an anatomy file, a newer format version, or a file of parts that do not go
            together.
    """
    from adapt.anatomy_check import refuse_unsound  # which themselves need what is above
    from adapt.mirror import mirrored

    if not is_path(name_or_path):
        return _load_shipped(str(name_or_path))
    path, own = Path(name_or_path), anatomy_file(name_or_path)
    if own is None:
        remedy = f"name a file that is there, or use one of {', '.join(anatomy_names())}"
        raise AnatomyError("no such anatomy file", where=path, remedy=remedy)
    anatomy = read_anatomy(own, where=own)
    refuse_unsound(anatomy, where=own)
    return replace(anatomy if own == path else mirrored(anatomy), name=path.stem)


def is_path(name_or_path: str | Path) -> bool:
    """Whether an anatomy is asked for by its file, not by its name."""
    return Path(name_or_path).suffix == ".npz"


def anatomy_file(path: str | Path) -> Path | None:
    """The file that an anatomy asked for by path is read from: that one, the other side's beside it, or none."""
    from adapt.mirror import mirrored_name

    own = Path(path)
    return next((file for file in (own, own.with_stem(mirrored_name(own.stem))) if file.is_file()), None)


def shipped_anatomy(name: str) -> Anatomy | None:
    """The anatomy of that name that ships with the package, or the mirror image of one; None if there is none."""
    from adapt.mirror import mirrored, mirrored_name

    if _shipped(name).is_file():
        return read_anatomy(_shipped(name), where=_shipped(name))
    other = _shipped(mirrored_name(name))
    return mirrored(read_anatomy(other, where=other)) if other.is_file() else None


def _load_shipped(name: str) -> Anatomy:
    anatomy = shipped_anatomy(name)
    if anatomy is None:
        valid = ", ".join(anatomy_names())
        raise AnatomyError(
            f"no anatomy {name!r}", remedy=f"use one of {valid}, or the path of a file of your own (.npz)"
        )
    return anatomy


def _shipped(name: str) -> Path:
    return Path(str(resources.files("adapt") / "templates" / f"{name}.npz"))


def anatomy_names() -> list[str]:
    """Names of all anatomies that ship with the package, with their mirror images."""
    from adapt.mirror import mirrored_name

    names = {path.stem for path in _shipped("any").parent.glob("*.npz")}
    return sorted(names | {mirrored_name(name) for name in names})


def read_anatomy(source: Path | IO[bytes], *, where: Path) -> Anatomy:
    """What ``save_anatomy`` or ``write_anatomy`` wrote, as it is; ``where`` is the file that errors name.

    Raises:
        AnatomyError: not an anatomy file, or a newer format version.
    """
    try:
        read = read_arrays(source, _KNOWN)
        description = json.loads(str(read.pop("description")))
        _check_format(description, where)
        arrays = {key: _widen(value) for key, value in read.items()}
        return _from_parts(description, arrays)
    except (*UNREADABLE, AttributeError) as error:  # where text or a number stands in the place of a frame
        problem = unreadable("an anatomy file", error)
        raise AnatomyError(problem, where=where, remedy="build or download it again") from error


_ARRAYS = (
    "landmarks",
    "landmark_handle_weights",
    "skin_vertices",
    "skin_faces",
    "skin_handle_weights",
    "deformer_weights",
    "fit_weight",
)
_BONE_ARRAYS = ("vertices", "faces", "handle_weights")
_MOST_BYTES = 64 << 20  # of one array, fifty times the largest of the shipped anatomies'
_KNOWN = dict.fromkeys((*_ARRAYS, "description", "bone/", "tetrahedra/"), _MOST_BYTES)


def _check_format(description: Any, path: Path) -> None:
    if not isinstance(description, dict) or description.get("format") != FORMAT:
        raise AnatomyError("not an anatomy file", where=path, remedy="build or download it again")
    if description["version"] > VERSION:
        raise AnatomyError(
            f"format version {description['version']} is newer than {VERSION}", where=path, remedy="update bonetrack"
        )


def _from_parts(description: dict[str, Any], arrays: dict[str, Any]) -> Anatomy:
    bones = tuple(
        Bone(b["name"], _frame(b["frame"]), *(arrays[f"bone/{b['name']}/{part}"] for part in _BONE_ARRAYS))
        for b in description["bones"]
    )
    return Anatomy(
        name=description["name"],
        side=description["side"],
        bones=bones,
        joints=tuple(_joint(j) for j in description["joints"]),
        coordinates=tuple(Coordinate(**c) for c in description["coordinates"]),
        handles=tuple(Handle(**(h | {"position": tuple(h["position"])})) for h in description["handles"]),
        deformers=tuple(_deformer(d) for d in description["deformers"]),
        landmark_names=tuple(description["landmark_names"]),
        tetrahedra={
            name: (arrays[f"tetrahedra/{name}/points"], arrays[f"tetrahedra/{name}/tets"])
            for name in description["tetrahedra"]
        },
        **{name: arrays[name] for name in _ARRAYS},
    )


def _frame(parts: dict[str, list[str]]) -> Frame:
    return Frame(**{key: tuple(names) for key, names in parts.items()})


def _joint(parts: dict[str, Any]) -> Joint:
    return Joint(
        parts["name"],
        parts["type"],
        parts["parent"],
        parts["child"],
        tuple(parts["coordinates"]),
        tuple((first, second) for first, second in parts["axes"]),
        tuple(parts["centre"]),
        tuple(parts.get("knots", ())),  # version 1 had neither knots nor frames
        tuple(_frame(frame) for frame in parts.get("frames", ())),
    )


def _deformer(parts: dict[str, Any]) -> Deformer:
    frames = tuple(_frame(frame) for frame in parts["frames"])
    return Deformer(parts["name"], parts["type"], tuple(parts["bones"]), frames)


def _narrow(array: NDArray[Any]) -> NDArray[Any]:
    return array.astype(np.float32 if array.dtype.kind == "f" else np.int32)


def _widen(array: NDArray[Any]) -> NDArray[Any]:
    if array.dtype.kind not in "biuf":
        raise ValueError(f"an array of {array.dtype} where numbers are expected")
    return array.astype(np.float64 if array.dtype.kind == "f" else np.int64)
