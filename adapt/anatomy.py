"""An anatomy as data: bones, landmarks, joints, coordinates, handles, deformers, skin. Its file: adapt.anatomy_file.

Code elsewhere in the package names joint TYPES and deformer TYPES, never a bone. Conventions: metres, radians,
X forward, Y up, Z right (ISB) in the rest pose; points are (N, 3); all arrays are given at rest.
"""

from __future__ import annotations

from dataclasses import astuple, dataclass, field
from typing import Any, Literal, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from capture.errors import AnatomyError

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True)
class Coordinate:
    """One degree of freedom, with OpenSim's name, sign and zero.

    From ``low`` to ``high`` is the joint range: its rule, and where the templates have the numbers from, stand in
    ``adapt.fit.priors``. ``rest`` is its value in the template's rest pose; for a free joint it is 0 and has no
    meaning, because the rest values follow from the landmarks.
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
    """A rigid body: one bone, or several that move as one.

    Or the vertebrae and ribs between two: ``along`` says of each vertex on which share of the arc it rides that leads
    to the bone, from 0 at the arc's base to 1 at its top, which moves as the bone does. Without it all vertices do.
    """

    name: str
    frame: Frame
    vertices: Floats = field(repr=False)  # (N, 3) m
    faces: Ints = field(repr=False)  # (M, 3)
    handle_weights: Floats = field(repr=False)  # (N, H): bounded biharmonic, inside the bone
    along: Floats | None = field(default=None, repr=False)  # (N,)


@dataclass(frozen=True)
class Joint:
    """How ``child`` moves relative to ``parent`` (None: relative to the recording's frame).

    What its coordinates (rad, m), axes, knots and frames mean is said where the type is (``adapt.model.joints``). An
    axis is the line from its first landmark to its second; ``frames[i]`` is where the coordinate equals ``knots[i]``.
    ``centre`` names the landmarks whose mean is the joint centre. ``other`` is a second bone that the child reaches to.

    Joints may share a coordinate: a kneecap follows the knee's. Whether the parts make a joint of its type is asked
    when a body is made of them or a file is read (``adapt.model.parts``).
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
    other: str | None = None

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
    """What moves skin, by which bones and frames: what these mean says the type (adapt.model.deformers)."""

    name: str
    type: str  # of adapt.model.deformers.DEFORMER_TYPES
    bones: tuple[str, ...]
    frames: tuple[Frame, ...] = ()


@dataclass(frozen=True, eq=False)
class Anatomy:
    """A template limb, or a body with both sides, at rest. V skin vertices, P landmarks, H handles, D deformers.

    Compared by identity, so that what is prepared from an anatomy can be cached.
    """

    name: str
    side: Literal["right", "left", "both"]
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


ARRAYS = (
    "landmarks",
    "landmark_handle_weights",
    "skin_vertices",
    "skin_faces",
    "skin_handle_weights",
    "deformer_weights",
    "fit_weight",
)
BONE_ARRAYS = ("vertices", "faces", "handle_weights")
"""Names of an anatomy's arrays, and of every bone's."""


def anatomy_arrays(anatomy: Anatomy) -> dict[str, NDArray[Any]]:
    """Every array of an anatomy, by the name that it has in a file.

    >>> from adapt.anatomy_file import load_anatomy
    >>> arrays = anatomy_arrays(load_anatomy("upper-limb-right"))
    >>> [name for name in arrays if name.startswith("bone/ulna/")]
    ['bone/ulna/vertices', 'bone/ulna/faces', 'bone/ulna/handle_weights']
    """
    arrays: dict[str, NDArray[Any]] = {name: getattr(anatomy, name) for name in ARRAYS}
    for bone in anatomy.bones:
        for part in BONE_ARRAYS:
            arrays[f"bone/{bone.name}/{part}"] = getattr(bone, part)
        if bone.along is not None:
            arrays[f"bone/{bone.name}/along"] = bone.along
    for name, (points, tets) in anatomy.tetrahedra.items():
        arrays[f"tetrahedra/{name}/points"], arrays[f"tetrahedra/{name}/tets"] = points, tets
    return arrays
