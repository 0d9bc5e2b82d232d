"""The other side's limb: an anatomy reflected in the plane z = 0, between left and right.

With S = diag(1, 1, -1), every point x goes to S x, and the mirrored limb must pose as the mirror image: the same
coordinates, every bone's motion T to S T S. The same value then means the same movement on both sides: flexion,
pronation. What that asks of each part:

- A turn R(u, q) about an axis u becomes S R(u, q) S = R(-S u, q). An axis runs from its first landmark to its second,
  which gives S u, so the two change places.
- A frame C = [x y z] stays right-handed as S C S = [Sx, Sy, -Sz]: from the same y, and z from the opposite ends.
  z points to the body's right on both sides. This is ISB's rule for left limbs: mirror the data, use the definitions
  of the right (Wu et al. 2005, J Biomech 38:981).
- A rotation vector r becomes -S r = (-rx, -ry, rz), a translation t becomes S t. Which coordinates change their signs
  a joint's type states.
- Faces and tetrahedra change their orientation twice: by S, and by the order of their corners.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from adapt.anatomy import Anatomy, Bone, Coordinate, Floats, Handle, Ints, Joint
from adapt.model.body import Body, make_body
from adapt.model.deformers import DEFORMER_TYPES
from adapt.model.frames import mirrored_frame
from adapt.model.joints import JOINT_TYPES
from capture.errors import AnatomyError

_OTHER = {"right": "left", "left": "right"}
_MIRRORED = "-mirrored"
_SIGNS = np.array([1.0, 1.0, -1.0])


def mirrored(anatomy: Anatomy) -> Anatomy:
    """The same limb of the other side. Names stay, but for coordinates whose OpenSim name tells the side.

    Raises:
        AnatomyError: it has both sides.

    >>> from adapt.anatomy_file import load_anatomy
    >>> right = load_anatomy("lower-limb-right")
    >>> left = mirrored(right)
    >>> left.name, left.coordinates[right.coordinate_index("knee_angle_r")].name
    ('lower-limb-left', 'knee_angle_l')
    """
    if anatomy.side == "both":
        raise AnatomyError("it has both sides, and no mirror image", where=anatomy.name, remedy="ask for it as it is")
    return Anatomy(
        name=mirrored_name(anatomy.name),
        side="left" if anatomy.side == "right" else "right",
        bones=tuple(_bone(bone) for bone in anatomy.bones),
        joints=tuple(_joint(joint) for joint in anatomy.joints),
        coordinates=_coordinates(anatomy),
        handles=tuple(_handle(handle) for handle in anatomy.handles),
        deformers=tuple(DEFORMER_TYPES[deformer.type].mirrored(deformer) for deformer in anatomy.deformers),
        landmark_names=anatomy.landmark_names,
        landmarks=mirrored_points(anatomy.landmarks),
        landmark_handle_weights=anatomy.landmark_handle_weights,
        skin_vertices=mirrored_points(anatomy.skin_vertices),
        skin_faces=_turned_over(anatomy.skin_faces),
        skin_handle_weights=anatomy.skin_handle_weights,
        deformer_weights=anatomy.deformer_weights,
        fit_weight=anatomy.fit_weight,
        tetrahedra={
            name: (mirrored_points(points), _turned_over(tets)) for name, (points, tets) in anatomy.tetrahedra.items()
        },
    )


def mirrored_body(body: Body) -> Body:
    """The mirror image of a body, of the other side's anatomy: same proportions, same soft tissue.

    >>> from adapt.anatomy_file import load_anatomy
    >>> arm = make_body(load_anatomy("upper-limb-right"))
    >>> mirrored_body(arm).anatomy.side, bool((mirrored_body(mirrored_body(arm)).shape == arm.shape).all())
    ('left', True)
    """
    shape = body.affine.mirrored(body.shape)
    return make_body(mirrored(body.anatomy), shape=shape, v_hat=mirrored_points(body.v_hat))


def mirrored_name(name: str) -> str:
    """The name of the other side's limb; one that tells no side gets, or loses, ``-mirrored``.

    >>> mirrored_name("upper-limb-right"), mirrored_name("tail"), mirrored_name("tail-mirrored")
    ('upper-limb-left', 'tail-mirrored', 'tail')
    """
    stem, dash, side = name.rpartition("-")
    if side in _OTHER:
        return stem + dash + _OTHER[side]
    return name.removesuffix(_MIRRORED) if name.endswith(_MIRRORED) else name + _MIRRORED


def tells_a_side(name: str) -> bool:
    """Whether an anatomy's name tells which side it is of.

    >>> tells_a_side("upper-limb-right"), tells_a_side("tail")
    (True, False)
    """
    return name.rpartition("-")[2] in _OTHER


def mirrored_coordinate(name: str) -> str:
    """The name of the other side's coordinate, as OpenSim has it; a name that tells no side stays.

    >>> mirrored_coordinate("knee_angle_r"), mirrored_coordinate("elbow_flexion")
    ('knee_angle_l', 'elbow_flexion')
    """
    other = {"_r": "_l", "_l": "_r"}.get(name[-2:])
    return name if other is None else name[:-2] + other


def mirrored_points(points: Floats) -> Floats:
    """Points (..., 3) on the other side of the plane z = 0.

    >>> mirrored_points(np.array([[0.1, 0.2, 0.3]])).tolist()
    [[0.1, 0.2, -0.3]]
    """
    return np.asarray(points * _SIGNS)


def _turned_over(corners: Ints) -> Ints:
    """Faces (M, 3) or tetrahedra (M, 4) of the opposite orientation."""
    swapped = corners.copy()
    swapped[:, [-2, -1]] = corners[:, [-1, -2]]
    return swapped


def _bone(bone: Bone) -> Bone:
    frame, vertices = mirrored_frame(bone.frame), mirrored_points(bone.vertices)
    return replace(bone, frame=frame, vertices=vertices, faces=_turned_over(bone.faces))


def _handle(handle: Handle) -> Handle:
    x, y, z = handle.position
    return replace(handle, position=(x, y, -z))


def _joint(right: Joint) -> Joint:
    named = replace(right, coordinates=tuple(mirrored_coordinate(name) for name in right.coordinates))
    return JOINT_TYPES[right.type].mirrored(named)


def _coordinates(anatomy: Anatomy) -> tuple[Coordinate, ...]:
    """Coordinates keep their ranges, but those that change their signs turn them over."""
    turned = {joint.coordinates[k] for joint in anatomy.joints for k in JOINT_TYPES[joint.type].turned_over}
    named = {c.name: replace(c, name=mirrored_coordinate(c.name)) for c in anatomy.coordinates}
    return tuple(_turned(c) if name in turned else c for name, c in named.items())


def _turned(coordinate: Coordinate) -> Coordinate:
    return replace(coordinate, low=-coordinate.high, high=-coordinate.low, rest=0.0 - coordinate.rest)
