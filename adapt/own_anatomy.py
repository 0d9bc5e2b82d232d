"""A user's own anatomy inside the files that are made with it: a subject, the truth of a simulated recording.

A subject means nothing without the very anatomy it was adapted from: its proportions are those of that anatomy's
handles, its skin is told as a displacement of that anatomy's. An anatomy that ships with the package is named, with a
digest of what it holds, for it may be built anew: what shipped before still lies in the package for files of then, the
oldest of which have no digest. A user's own is kept whole, so that the file can be copied, sent
and tracked elsewhere, and says the same after the anatomy's file was changed, moved or lost. It is read as any
anatomy's file: arrays of bounded sizes, nothing is unpickled.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import replace
from functools import lru_cache
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adapt.anatomy import Anatomy, anatomy_arrays
from adapt.anatomy_check import refuse_unsound
from adapt.anatomy_file import (
    anatomy_description,
    former_anatomies,
    load_anatomy,
    read_anatomy,
    shipped_anatomy,
    write_anatomy,
)
from adapt.mirror import mirrored_name
from capture.errors import AnatomyError

KEY = "anatomy_file"
"""The array (bytes) that an own anatomy is in a file; there is none where the anatomy ships with the package."""

DIGEST = "anatomy_content"
"""The array (text) that tells which content an anatomy that ships with the package had."""

MOST_BYTES = 16 << 20
"""Of either array: eight times the largest of the shipped anatomies'."""


_AGAIN = "use the version of bonetrack that it was made with, or make it anew"


@lru_cache(maxsize=8)
def content(anatomy: Anatomy) -> str:
    """A digest of all that an anatomy is, but for its name; numbers in single precision, as files have them.

    >>> arm = load_anatomy("upper-limb-left")
    >>> content(arm) == content(replace(arm, name="another"))
    True
    >>> content(arm) == content(replace(arm, landmarks=1.01 * arm.landmarks))
    False
    """
    digest = hashlib.sha256(json.dumps(anatomy_description(anatomy) | {"name": ""}, sort_keys=True).encode())
    for name, array in sorted(anatomy_arrays(anatomy).items()):
        narrow = np.ascontiguousarray(array, dtype=np.float32 if array.dtype.kind == "f" else np.int32)
        digest.update(f"{name} {narrow.shape}".encode())
        digest.update(narrow.tobytes())
    return digest.hexdigest()


def is_shipped(anatomy: Anatomy) -> bool:
    """Whether an anatomy is the one of its name that ships with the package, or the mirror image of one.

    >>> arm = load_anatomy("upper-limb-left")
    >>> is_shipped(arm), is_shipped(replace(arm, landmarks=1.01 * arm.landmarks))
    (True, False)
    """
    return content(anatomy) == _shipped_content(anatomy.name)


def other_side_asked(anatomy: Anatomy) -> str:
    """How the mirror image of an anatomy is asked for, as messages say it.

    >>> arm = load_anatomy("upper-limb-left")
    >>> other_side_asked(arm), other_side_asked(replace(arm, name="thin-arm-left"))
    ('`--anatomy upper-limb-right`', '`--anatomy thin-arm-right.npz` (one file serves both sides)')
    """
    other = mirrored_name(anatomy.name)
    return f"`--anatomy {other}`" if is_shipped(anatomy) else f"`--anatomy {other}.npz` (one file serves both sides)"


def is_comparable(one: Anatomy, other: Anatomy) -> bool:
    """Whether bodies of two anatomies go point by point: of one name, with the same coordinates, bones and meshes.

    >>> arm = load_anatomy("upper-limb-left")
    >>> is_comparable(arm, replace(arm, landmarks=1.01 * arm.landmarks)), is_comparable(arm, replace(arm, name="mine"))
    (True, False)
    """

    def names(anatomy: Anatomy) -> list[tuple[str, ...]]:
        parts = (anatomy.bones, anatomy.joints, anatomy.coordinates)
        return [tuple(part.name for part in some) for some in parts]

    def meshes(anatomy: Anatomy) -> list[NDArray[Any]]:
        return [anatomy.skin_faces, *(bone.faces for bone in anatomy.bones)]

    same = one.name == other.name and names(one) == names(other)
    same = same and [len(b.vertices) for b in one.bones] == [len(b.vertices) for b in other.bones]
    return same and all(np.array_equal(*pair) for pair in zip(meshes(one), meshes(other), strict=True))


@lru_cache(maxsize=8)
def _shipped_content(name: str) -> str | None:
    shipped = shipped_anatomy(name)
    return None if shipped is None else content(shipped)


def kept_anatomy(anatomy: Anatomy) -> dict[str, NDArray[Any]]:
    """What a file keeps of an anatomy beside its name: all of a user's own, a digest of one that ships.

    Raises:
        AnatomyError: it would take more than ``MOST_BYTES``.

    >>> arm = load_anatomy("upper-limb-left")
    >>> list(kept_anatomy(arm)), list(kept_anatomy(replace(arm, landmarks=1.01 * arm.landmarks)))
    (['anatomy_content'], ['anatomy_file'])
    """
    if is_shipped(anatomy):
        return {DIGEST: np.array(content(anatomy))}
    packed = BytesIO()
    write_anatomy(anatomy, packed)
    size = packed.getbuffer().nbytes
    if size > MOST_BYTES:
        raise AnatomyError(
            f"the anatomy takes {size / 1e6:.1f} MB, and a subject's file has room for one of {MOST_BYTES / 1e6:.1f}",
            where=anatomy.name,
            remedy="give its skin, bones and tetrahedra fewer vertices",
        )
    return {KEY: np.frombuffer(packed.getvalue(), dtype=np.uint8)}


def anatomy_kept(name: str, arrays: Mapping[str, NDArray[Any]], *, where: Path) -> Anatomy:
    """The anatomy of a file ``where``, from its name and what ``kept_anatomy`` gave, among the file's ``arrays``.

    Raises:
        AnatomyError: it is not there, or not sound, or ships with another content now.
        ValueError: no name of an anatomy.

    >>> left = load_anatomy("upper-limb-left")
    >>> content(anatomy_kept("upper-limb-left", kept_anatomy(left), where=Path("subject.npz"))) == content(left)
    True
    """
    kept = arrays.get(KEY)
    if Path(name).name != name or (kept is None and Path(name).suffix):
        raise ValueError("an anatomy's name is expected")
    if kept is None:
        return _that_shipped(name, arrays.get(DIGEST), where=where)
    anatomy = read_anatomy(BytesIO(np.asarray(kept, dtype=np.uint8).tobytes()), where=where)
    refuse_unsound(anatomy, where=where)
    return replace(anatomy, name=name)


def _that_shipped(name: str, digest: NDArray[Any] | None, *, where: Path) -> Anatomy:
    """The anatomy of that name that ships, or shipped when a file ``where`` without a ``digest`` was made."""
    if digest is None and (oldest := next(former_anatomies(name), None)) is not None:
        return oldest
    try:
        anatomy = load_anatomy(name)
    except AnatomyError as error:
        raise AnatomyError(error.problem, where=where, remedy=error.remedy) from error
    if digest is None or str(digest) == _shipped_content(name):
        return anatomy
    for former in former_anatomies(name):
        if str(digest) == content(former):
            return former
    raise AnatomyError(f"made with another template of {name}", where=where, remedy=_AGAIN)
