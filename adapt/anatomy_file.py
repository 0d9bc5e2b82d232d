"""Anatomies in files: written, read, and loaded by the name of one that ships or the path of one's own.

What the numbers mean is said in ``adapt.anatomy``; whether a user's file is sound, in ``adapt.anatomy_check``.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import asdict, replace
from importlib import resources
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from adapt.anatomy import (
    ARRAYS,
    BONE_ARRAYS,
    Anatomy,
    Bone,
    Coordinate,
    Deformer,
    Frame,
    Handle,
    Joint,
    anatomy_arrays,
)
from adapt.anatomy_check import refuse_unsound
from adapt.mirror import mirrored, mirrored_name, tells_a_side
from adapt.model.parts import refuse_wrong_parts
from capture.errors import AnatomyError
from capture.files import UNREADABLE, read_arrays, replaced_when_complete, unreadable

FORMAT = "bonetrack-anatomy"
_TEMPLATES = Path(str(resources.files("adapt") / "templates"))
VERSION = 3  # 2: ball and spline joints, bend deformers; 3: both sides, bones along a curve


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
    """All of an anatomy but its arrays, as JSON keeps it.

    >>> description = anatomy_description(load_anatomy("upper-limb-right"))
    >>> description["side"], description["bones"][0]["name"], description["coordinates"][6]["unit"]
    ('right', 'humerus', 'rad')
    """
    return {
        "format": FORMAT,
        "version": _version(anatomy),
        "name": anatomy.name,
        "side": anatomy.side,
        "bones": [{"name": bone.name, "frame": asdict(bone.frame)} for bone in anatomy.bones],
        "joints": [_joint_parts(joint) for joint in anatomy.joints],
        "coordinates": [asdict(coordinate) for coordinate in anatomy.coordinates],
        "handles": [asdict(handle) for handle in anatomy.handles],
        "deformers": [asdict(deformer) for deformer in anatomy.deformers],
        "landmark_names": list(anatomy.landmark_names),
        "tetrahedra": list(anatomy.tetrahedra),
    }


def load_anatomy(name_or_path: str | Path) -> Anatomy:
    """Read an anatomy that ships with the package (by name) or any ``.npz`` of the same format (by path).

    One of a file is called as the file is, without ``.npz``. A limb whose other side ships, or lies where the path says
    (``adapt.mirror.mirrored_name``), is the mirror image of that.

    Raises:
        AnatomyError: no such anatomy, not an anatomy file, a newer format version, or a file of parts that do not go
            together.

    >>> left = load_anatomy("lower-limb-left")
    >>> left.name, left.side, [bone.name for bone in left.bones]
    ('lower-limb-left', 'left', ['pelvis', 'femur', 'tibia', 'patella', 'foot'])
    """
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
    """Whether an anatomy is asked for by its file, not by its name.

    >>> is_path("upper-limb-right"), is_path("my-arm-right.npz")
    (False, True)
    """
    return Path(name_or_path).suffix == ".npz"


def anatomy_file(path: str | Path) -> Path | None:
    """The file that an anatomy asked for by path is read from: that one, the other side's beside it, or none."""
    own = Path(path)
    return next((file for file in (own, own.with_stem(mirrored_name(own.stem))) if file.is_file()), None)


def shipped_anatomy(name: str) -> Anatomy | None:
    """The anatomy of that name that ships with the package, or the mirror image of one; None if there is none.

    >>> shipped_anatomy("upper-limb-left").side, shipped_anatomy("tail")
    ('left', None)
    """
    return _from_folder(_TEMPLATES, name)


def former_anatomies(name: str) -> Iterator[Anatomy]:
    """The anatomies of that name as they shipped before it was built anew, the oldest first.

    Subjects and recordings made with them mean nothing without them, and only they ask for them. The oldest is from
    before files told which content their anatomy had; later ones lie in folders named after the day they were built.

    >>> [anatomy.side for anatomy in former_anatomies("lower-limb-left")], list(former_anatomies("tail"))
    (['left'], [])
    """
    folder = _TEMPLATES / "former"
    for place in (folder, *sorted(path for path in folder.iterdir() if path.is_dir())):
        if (anatomy := _from_folder(place, name)) is not None:
            yield anatomy


def _from_folder(folder: Path, name: str) -> Anatomy | None:
    """The anatomy of that name in a folder, or the mirror image of one; None if there is none."""
    own, other = folder / f"{name}.npz", folder / f"{mirrored_name(name)}.npz"
    if own.is_file():
        return read_anatomy(own, where=own)
    return mirrored(read_anatomy(other, where=other)) if other.is_file() else None


def _load_shipped(name: str) -> Anatomy:
    anatomy = shipped_anatomy(name)
    if anatomy is None:
        valid = ", ".join(anatomy_names())
        raise AnatomyError(
            f"no anatomy {name!r}", remedy=f"use one of {valid}, or the path of a file of your own (.npz)"
        )
    return anatomy


def anatomy_names() -> list[str]:
    """Names of all anatomies that ship with the package, with their mirror images.

    >>> anatomy_names()
    ['lower-limb-left', 'lower-limb-right', 'upper-limb-left', 'upper-limb-right']
    """
    names = {path.stem for path in _TEMPLATES.glob("*.npz")}
    return sorted(names | {mirrored_name(name) for name in names if tells_a_side(name)})


def read_anatomy(source: Path | IO[bytes], *, where: Path) -> Anatomy:
    """What ``save_anatomy`` or ``write_anatomy`` wrote, as it is; ``where`` is the file that errors name.

    Raises:
        AnatomyError: not an anatomy file, or a newer format version, or a joint or deformer is none of its type.
    """
    try:
        read = read_arrays(source, _KNOWN)
        description = json.loads(str(read.pop("description")))
        _check_format(description, where)
        arrays = {key: _widen(value) for key, value in read.items()}
        anatomy = _from_parts(description, arrays)
        refuse_wrong_parts(anatomy)
        return anatomy
    except (*UNREADABLE, AttributeError) as error:  # where text or a number stands in the place of a frame
        problem = unreadable("an anatomy file", error)
        raise AnatomyError(problem, where=where, remedy="build or download it again") from error


_MOST_BYTES = 64 << 20  # of one array, fifty times the largest of the shipped anatomies'
_KNOWN = dict.fromkeys((*ARRAYS, "description", "bone/", "tetrahedra/"), _MOST_BYTES)


def _check_format(description: Any, path: Path) -> None:
    if not isinstance(description, dict) or description.get("format") != FORMAT:
        raise AnatomyError("not an anatomy file", where=path, remedy="build or download it again")
    if description["version"] > VERSION:
        raise AnatomyError(
            f"format version {description['version']} is newer than {VERSION}", where=path, remedy="update bonetrack"
        )


def _from_parts(description: dict[str, Any], arrays: dict[str, Any]) -> Anatomy:
    bones = tuple(_bone(b["name"], _frame(b["frame"]), arrays) for b in description["bones"])
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
        **{name: arrays[name] for name in ARRAYS},
    )


def _bone(name: str, frame: Frame, arrays: dict[str, Any]) -> Bone:
    vertices, faces, weights = (arrays[f"bone/{name}/{part}"] for part in BONE_ARRAYS)
    return Bone(name, frame, vertices, faces, weights, arrays.get(f"bone/{name}/along"))


def _version(anatomy: Anatomy) -> int:
    """The first version that reads it: so files and digests of anatomies that need no later one stay as they were."""
    later = anatomy.side == "both" or any(bone.along is not None for bone in anatomy.bones)
    return VERSION if later else 2


def _frame(parts: dict[str, list[str]]) -> Frame:
    return Frame(**{key: tuple(names) for key, names in parts.items()})


def _joint_parts(joint: Joint) -> dict[str, Any]:
    """A second parent is told of joints that have one: what others are in a file, and its digest, stay as they were."""
    return {key: part for key, part in asdict(joint).items() if key != "other" or part is not None}


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
        parts.get("other"),
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
