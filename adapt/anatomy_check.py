"""Whether the parts of an anatomy go together: a user's own file is told what is wrong with it before any work.

What ships is checked when it is built, and by far more (``adapt.template_builder.checks``).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adapt.anatomy import Anatomy, Bone, anatomy_arrays
from adapt.tissue import MODES
from capture.errors import AnatomyError

_FEWEST_VERTICES = 2 * MODES  # of the skin: its soft tissue varies in so many ways
_FARTHEST_M = 20.0
_ROUNDED = 1e-4  # of weights that sum up to 1, in single precision
_MOST_MOVED_M = 1e-4  # of the skin in the pose that is said to be that of rest
_REMEDY = "mend the anatomy's data"

_Shape = tuple[int | None, ...]


def refuse_unsound(anatomy: Anatomy, *, where: Path) -> None:
    """Raise AnatomyError with the first thing that is wrong with an anatomy from the file ``where``."""
    for checks in (_parts, _tree, _arrays, _weights, _skin, _rest):
        problem = next(_told(checks(anatomy)), None)
        if problem is not None:
            line = " ".join(problem.split())  # names may be of several lines
            raise AnatomyError(f"not a sound anatomy: {line}", where=where, remedy=_REMEDY)


def _told(problems: Iterator[str]) -> Iterator[str]:
    """The problems, and what a lookup of a name that is not there says."""
    try:
        yield from problems
    except AnatomyError as error:
        yield str(error)
    except (TypeError, ValueError, KeyError, IndexError, AttributeError) as error:
        yield f"its description is not of the kind it should be ({error})"


def _parts(anatomy: Anatomy) -> Iterator[str]:
    """Names are told apart, and whatever is named is there."""
    for what, names in (
        ("bones", [bone.name for bone in anatomy.bones]),
        ("joints", [joint.name for joint in anatomy.joints]),
        ("coordinates", [coordinate.name for coordinate in anatomy.coordinates]),
        ("landmarks", list(anatomy.landmark_names)),
        ("handles", [handle.name for handle in anatomy.handles]),
        ("deformers", [deformer.name for deformer in anatomy.deformers]),
    ):
        yield from _names(what, names)
    if anatomy.side not in ("right", "left", "both"):
        yield f"its side is {anatomy.side!r}, neither 'right' nor 'left' nor 'both'"
    for handle in anatomy.handles:
        anatomy.bone(handle.bone)
        if len(handle.position) != 3 or not np.isfinite(handle.position).all():
            yield f"the handle {handle.name!r} has no position"
    for bone in anatomy.bones:
        if not any(handle.bone == bone.name for handle in anatomy.handles):
            yield f"the bone {bone.name} has no handle"
    for deformer in anatomy.deformers:
        for name in deformer.bones:
            anatomy.bone(name)
    for coordinate in anatomy.coordinates:
        values = coordinate.low, coordinate.rest, coordinate.high
        if not (np.isfinite(values).all() and coordinate.low < coordinate.high):
            yield f"the coordinate {coordinate.name} has no range"
        if not coordinate.low <= coordinate.rest <= coordinate.high:
            yield f"the coordinate {coordinate.name} is at rest outside its range"
        if coordinate.unit not in ("rad", "m"):
            yield f"the coordinate {coordinate.name} is in {coordinate.unit!r}, neither 'rad' nor 'm'"


def _names(what: str, names: list[Any]) -> Iterator[str]:
    if not names:
        yield f"it has no {what}"
    for name, times in Counter(map(str, names)).items():
        if times > 1:
            yield f"{times} {what} are called {name!r}"
        if not name or Path(name).name != name:  # bones name files
            yield f"{name!r} cannot name one of the {what}"


def _tree(anatomy: Anatomy) -> Iterator[str]:
    """One free joint first, then every bone hangs by one joint on a bone before it."""
    placed: list[str] = []
    for number, joint in enumerate(anatomy.joints):
        if (joint.parent is None) != (number == 0):
            yield f"the first joint, and only that, is free of a parent, which {joint.name} is not as it stands"
        if joint.parent is not None and joint.parent not in placed:
            yield f"the joint {joint.name} stands before one that carries its parent {joint.parent!r}"
        if joint.other is not None and joint.other not in placed:
            yield f"the joint {joint.name} stands before one that carries its other bone {joint.other!r}"
        anatomy.bone(joint.child)
        if joint.child in placed:
            yield f"the bone {joint.child} is the child of two joints"
        placed.append(joint.child)
        for name in joint.coordinates:
            anatomy.coordinate_index(name)
        for name in joint.landmarks():
            anatomy.landmark_index(name)
    for bone in anatomy.bones:
        if bone.name not in placed:
            yield f"no joint has the bone {bone.name} as its child"
    used = {name for joint in anatomy.joints for name in joint.coordinates}
    for coordinate in anatomy.coordinates:
        if coordinate.name not in used:
            yield f"no joint has the coordinate {coordinate.name}"


def _arrays(anatomy: Anatomy) -> Iterator[str]:
    """Arrays are of the shapes that go with one another, finite, and faces have corners that there are."""
    vertices, handles = len(anatomy.skin_vertices), len(anatomy.handles)
    shapes: dict[str, _Shape] = {
        "landmarks": (len(anatomy.landmark_names), 3),
        "landmark_handle_weights": (len(anatomy.landmark_names), handles),
        "skin_vertices": (None, 3),
        "skin_faces": (None, 3),
        "skin_handle_weights": (vertices, handles),
        "deformer_weights": (vertices, len(anatomy.deformers)),
        "fit_weight": (vertices,),
    }
    for bone in anatomy.bones:
        shapes |= _shapes_of(bone, handles)
    for name in anatomy.tetrahedra:
        shapes |= {f"tetrahedra/{name}/points": (None, 3), f"tetrahedra/{name}/tets": (None, 4)}
    arrays = anatomy_arrays(anatomy)
    for name, shape in shapes.items():
        if not _is_of(arrays[name], shape):
            words = ", ".join("any number" if size is None else str(size) for size in shape)
            yield f"{name} is of shape {arrays[name].shape}, not ({words})"
        if not np.isfinite(arrays[name]).all():
            yield f"{name} has values that are not finite"
        if name.endswith(("landmarks", "vertices", "points")) and np.abs(arrays[name]).max(initial=0.0) > _FARTHEST_M:
            yield f"{name} reach farther than {_FARTHEST_M:.0f} m: are they in metres?"
    indexed = {f"bone/{bone.name}/faces": f"bone/{bone.name}/vertices" for bone in anatomy.bones}
    indexed |= {f"tetrahedra/{name}/tets": f"tetrahedra/{name}/points" for name in anatomy.tetrahedra}
    for name, of in ({"skin_faces": "skin_vertices"} | indexed).items():
        corners, most = arrays[name], len(arrays[of]) - 1
        if corners.dtype.kind not in "iu" or (corners.size and not 0 <= corners.min() <= corners.max() <= most):
            yield f"{name} are not whole numbers from 0 to {most}"
    if "limb" not in anatomy.tetrahedra or not len(anatomy.tetrahedra["limb"][0]):
        yield "there are no tetrahedra called limb, whose points tell how thick it is"


def _shapes_of(bone: Bone, handles: int) -> dict[str, _Shape]:
    name = f"bone/{bone.name}"
    shapes: dict[str, _Shape] = {
        f"{name}/vertices": (None, 3),
        f"{name}/faces": (None, 3),
        f"{name}/handle_weights": (len(bone.vertices), handles),
    }
    return shapes if bone.along is None else shapes | {f"{name}/along": (len(bone.vertices),)}


def _is_of(array: NDArray[Any], shape: _Shape) -> bool:
    if array.ndim != len(shape) or (not len(array) and shape == (None, 3)):
        return False
    return all(wanted in (None, size) for size, wanted in zip(array.shape, shape, strict=True))


def _weights(anatomy: Anatomy) -> Iterator[str]:
    """Weights lie in [0, 1]; what is shared out is shared out whole, a bone's among its own handles."""
    shared = {
        name: array for name, array in anatomy_arrays(anatomy).items() if name.endswith(("handle_weights", "r_weights"))
    }
    for name, weights in shared.items():
        if weights.min() < -_ROUNDED or np.abs(weights.sum(axis=1) - 1.0).max() > _ROUNDED:
            yield f"the rows of {name} are not weights of 0 to 1 that sum up to 1"
    for bone in anatomy.bones:
        others = [handle.bone != bone.name for handle in anatomy.handles]
        if (bone.handle_weights[:, others] > _ROUNDED).any():
            yield f"bone/{bone.name}/handle_weights has weight on handles of other bones"
        if bone.along is not None and not 0.0 <= bone.along.min() <= bone.along.max() <= 1.0:
            yield f"bone/{bone.name}/along is not in 0 to 1"
    if not 0.0 <= anatomy.fit_weight.min() <= anatomy.fit_weight.max() <= 1.0 or not anatomy.fit_weight.any():
        yield "fit_weight is not in 0 to 1, or nowhere more than 0"


def _skin(anatomy: Anatomy) -> Iterator[str]:
    """The skin is closed, faces outward, and has vertices enough."""
    points, faces = anatomy.skin_vertices, anatomy.skin_faces
    if len(points) < _FEWEST_VERTICES:
        yield f"the skin has {len(points)} vertices, and at least {_FEWEST_VERTICES} are needed"
    if len(np.unique(faces)) != len(points):
        yield "some vertices of the skin have no face"
    if not _is_closed(faces):
        yield "the skin is not closed: some edge has not just one face on either side, or they face differently"
    a, b, c = (points[corner] for corner in faces.T)
    if np.einsum("ij,ij->", np.cross(a, b), c) <= 0.0:
        yield "the skin's faces face inward: give their corners in the opposite order"


def _is_closed(faces: NDArray[np.int64]) -> bool:
    """Whether every edge is run through once in either direction."""
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    there, back = (np.unique(one, axis=0, return_counts=True) for one in (edges, edges[:, ::-1]))
    return bool((there[1] == 1).all()) and np.array_equal(there[0], back[0])


def _rest(anatomy: Anatomy) -> Iterator[str]:
    """With every coordinate at rest, the body stands as its rest skin.

    Not by the compiled loops, which take it that all is sound: a share that is no number would be an index to them.
    """
    from adapt.model.body import bone_frames, joint_centres, make_body, pose_skin_by_v_hat, posed_bones, rest_theta

    try:
        body = make_body(anatomy)
        with np.errstate(all="ignore"):  # what comes of an axis without a length is looked for below
            theta = rest_theta(body)
            moved = float(np.abs(pose_skin_by_v_hat(body, theta).value - anatomy.skin_vertices).max())
            told = [*(of(body, theta) for of in (posed_bones, bone_frames, joint_centres))]
            finite = all(np.isfinite(array).all() for by_name in told for array in by_name.values())
    except (ValueError, KeyError, IndexError, TypeError, ZeroDivisionError) as error:
        yield f"it cannot be posed ({error})"
        return
    if not finite:
        yield "a bone or a joint is nowhere: do its frames and axes have lengths, and centres landmarks?"
    if not moved <= _MOST_MOVED_M:
        yield f"posed as at rest, its skin is {1e3 * moved:.1f} mm off: do the deformers' frames have lengths?"
