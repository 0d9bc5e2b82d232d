"""A body as a scaled OpenSim model (``.osim``), whose bones stand where ours do when it plays our coordinates.

Body frames are the bones' ISB frames, joints see ``osim_joints``, masses are placeholders (``osim_mass``), markers are
the anatomical landmarks. Needs no OpenSim; written for 4.x (document version 40000) and tested with 4.6.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterable, Mapping
from dataclasses import astuple, dataclass
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from adapt.anatomy import Anatomy, Floats, Ints
from adapt.model.body import Body
from adapt.model.joints.opensim import OsimCoordinate, OsimJoint, TransformAxis
from capture.own import WRITTEN, Mark, refuse_any_foreign, replaced_if_own, words
from capture.rigid import apply, inverse
from track.export.osim_joints import body_frames, coupled_coordinates, osim_joints
from track.export.osim_mass import Mass, segment_masses

GEOMETRY = "Geometry"  # the folder beside a model where OpenSim looks for meshes
_VERSION = "40000"
_CREDITS = (
    "Written by bonetrack. Masses and inertias are placeholders: the volume of flesh around each bone at one density."
)
OSIM = words("<credits>Written by bonetrack.")
_AXES = ("rotation1", "rotation2", "rotation3", "translation1", "translation2", "translation3")


@dataclass(frozen=True, eq=False)
class Marker:
    """A point (3,) of the rest space in metres that rides on a bone."""

    bone: str
    position: Floats


def write_osim(body: Body, folder: Path, *, markers: Mapping[str, Marker] | None = None) -> list[Path]:
    """Write ``<anatomy>.osim`` and its bone meshes in ``Geometry``; markers are the landmarks if none are given.

    Each mesh stands there twice: OpenSim reads ``<bone>.obj``, nimblephysics looks for ``<bone>.obj.ply`` beside it.

    Raises:
        OutputError: something stands there that bonetrack did not write; nothing is written then.
    """
    refuse_any_foreign(osim_files(body, folder))
    (folder / GEOMETRY).mkdir(parents=True, exist_ok=True)
    frames = body_frames(body)
    path = folder / f"{body.anatomy.name}.osim"
    written = [path]
    for bone in body.anatomy.bones:
        mesh = folder / GEOMETRY / f"{bone.name}.obj"
        vertices = apply(inverse(frames[bone.name]), body.rest_bones[bone.name])
        _write_obj(mesh, vertices, bone.faces)
        _write_ply(mesh.with_name(f"{bone.name}.obj.ply"), vertices, bone.faces)
        written.append(mesh)
    document = _document(body, frames, landmark_markers(body) if markers is None else markers)
    with replaced_if_own(path, OSIM) as partial:
        document.write(partial, encoding="UTF-8", xml_declaration=True)
    return written


def osim_files(body: Body, folder: Path) -> dict[Path, Mark]:
    """What ``write_osim`` writes, and the mark of each."""
    meshes = [folder / GEOMETRY / f"{bone.name}.obj" for bone in body.anatomy.bones]
    doubles = [mesh.with_name(f"{mesh.name}.ply") for mesh in meshes]
    return {folder / f"{body.anatomy.name}.osim": OSIM} | dict.fromkeys([*meshes, *doubles], words(WRITTEN))


def landmark_markers(body: Body) -> dict[str, Marker]:
    """The anatomical landmarks, each on the bone whose surface is nearest.

    Without those that only define axes, splines and bends: they are constructed, not anatomical. And without those on
    vertebrae and ribs that ride between two bones: they keep their place on neither.
    """
    anatomy, points = body.anatomy, body.p.value
    trees = {name: cKDTree(surface) for name, surface in body.rest_bones.items()}
    markers = {}
    for name in sorted(set(anatomy.landmark_names) - _constructed(anatomy), key=anatomy.landmark_index):
        point = points[anatomy.landmark_index(name)]
        bone = min(trees, key=lambda b: float(trees[b].query(point)[0]))
        along = anatomy.bone(bone).along
        if along is None or along[trees[bone].query(point)[1]] == 1.0:
            markers[name] = Marker(bone, point)
    return markers


def marker_paths(markers: Mapping[str, Marker], transforms: Mapping[str, Floats]) -> dict[str, Floats]:
    """Where markers are (T, 3) m when ``transforms`` (T, 4, 4), rest to pose, move their bones; NaN stays NaN.

    >>> moved = np.eye(4)[None].repeat(2, axis=0)
    >>> moved[1, :3, 3] = 0.0, 0.0, 0.5
    >>> marker_paths({"wrist": Marker("radius", np.array([0.1, 0.2, 0.3]))}, {"radius": moved})["wrist"].tolist()
    [[0.1, 0.2, 0.3], [0.1, 0.2, 0.8]]
    """
    return {
        name: np.asarray(transforms[m.bone][:, :3, :3] @ m.position + transforms[m.bone][:, :3, 3])
        for name, m in markers.items()
    }


def _constructed(anatomy: Anatomy) -> set[str]:
    lines = {name for joint in anatomy.joints for axis in joint.axes for name in axis}
    frames = [f for joint in anatomy.joints for f in joint.frames] + [f for d in anatomy.deformers for f in d.frames]
    anatomical = {name for bone in anatomy.bones for names in astuple(bone.frame) for name in names}
    in_frames = {name for frame in frames for names in astuple(frame) for name in names}
    return (in_frames - anatomical) | lines


def _document(body: Body, frames: Mapping[str, Floats], markers: Mapping[str, Marker]) -> ET.ElementTree:
    root = ET.Element("OpenSimDocument", Version=_VERSION)
    model = ET.SubElement(root, "Model", name=body.anatomy.name)
    _texts(model, credits=_CREDITS, length_units="meters", force_units="N", gravity=_numbers([0.0, -9.80665, 0.0]))
    ET.SubElement(model, "Ground", name="ground")
    masses, joints = segment_masses(body), osim_joints(body)
    bodies = [_body(name, frame, masses[name]) for name, frame in frames.items()]
    bodies += [_phantom(joint.child) for joint in joints if joint.child not in frames]
    _set(model, "BodySet", bodies)
    _set(model, "JointSet", (_joint(joint) for joint in joints))
    _set(model, "ConstraintSet", (_coupler(*pair) for pair in coupled_coordinates(body.anatomy).items()))
    _set(model, "MarkerSet", (_marker(name, marker, frames) for name, marker in markers.items()))
    ET.indent(root)
    return ET.ElementTree(root)


def _body(name: str, frame: Floats, mass: Mass) -> ET.Element:
    body = ET.Element("Body", name=name)
    geometry = ET.SubElement(body, "attached_geometry")
    mesh = ET.SubElement(geometry, "Mesh", name=f"{name}_mesh")
    # OpenSim takes ones for granted, nimblephysics does not read a mesh without them.
    _texts(mesh, socket_frame="..", scale_factors=_numbers(np.ones(3)), mesh_file=f"{name}.obj")
    turn = frame[:3, :3]
    inertia = turn.T @ mass.inertia @ turn
    six = inertia[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]  # xx yy zz xy xz yz
    centre = apply(inverse(frame), mass.centre[None])[0]
    _texts(body, mass=_numbers([mass.mass]), mass_center=_numbers(centre), inertia=_numbers(six))
    return body


def _phantom(name: str) -> ET.Element:
    """A body of next to no mass between two joints."""
    body = ET.Element("Body", name=name)
    _texts(body, mass="0.0001", mass_center="0 0 0", inertia="1e-07 1e-07 1e-07 0 0 0")
    return body


def _joint(joint: OsimJoint) -> ET.Element:
    element = ET.Element(joint.kind, name=joint.name)
    _texts(element, socket_parent_frame="parent_offset", socket_child_frame="child_offset")
    coordinates = ET.SubElement(element, "coordinates")
    coordinates.extend(_coordinate(coordinate) for coordinate in joint.coordinates)
    frames = ET.SubElement(element, "frames")
    parent = "/ground" if joint.parent is None else f"/bodyset/{joint.parent}"
    frames.append(_offset("parent_offset", parent, joint.in_parent))
    frames.append(_offset("child_offset", f"/bodyset/{joint.child}", joint.in_child))
    _texts(element, **{name: _numbers(values) for name, values in joint.own.items()})
    if joint.axes:
        transform = ET.SubElement(element, "SpatialTransform")
        transform.extend(_axis(name, axis) for name, axis in zip(_AXES, joint.axes, strict=True))
    return element


def _coordinate(coordinate: OsimCoordinate) -> ET.Element:
    element = ET.Element("Coordinate", name=coordinate.name)
    limits = _numbers([coordinate.low, coordinate.high])
    # Not clamped: a tracked pose may lie a little outside the range and is to be shown where it is.
    _texts(element, default_value=_numbers([coordinate.default]), range=limits, clamped="false")
    if coordinate.locked:
        _texts(element, locked="true")
    return element


def _offset(name: str, parent: str, frame: Floats) -> ET.Element:
    element = ET.Element("PhysicalOffsetFrame", name=name)
    orientation = Rotation.from_matrix(frame[:3, :3]).as_euler("XYZ")
    _texts(element, socket_parent=parent, translation=_numbers(frame[:3, 3]), orientation=_numbers(orientation))
    return element


def _axis(name: str, axis: TransformAxis) -> ET.Element:
    element = ET.Element("TransformAxis", name=name)
    _texts(element, coordinates=axis.coordinate or "", axis=_numbers(axis.axis))
    if axis.coordinate is None:
        _texts(ET.SubElement(element, "Constant", name="function"), value="0")
    elif axis.x is None or axis.y is None:
        _texts(ET.SubElement(element, "LinearFunction", name="function"), coefficients="1 0")
    else:
        _texts(ET.SubElement(element, "SimmSpline", name="function"), x=_numbers(axis.x), y=_numbers(axis.y))
    return element


def _coupler(dependent: str, independent: str) -> ET.Element:
    element = ET.Element("CoordinateCouplerConstraint", name=f"{dependent}_coupler")
    function = ET.SubElement(element, "coupled_coordinates_function")
    _texts(ET.SubElement(function, "LinearFunction"), coefficients="1 0")
    _texts(element, independent_coordinate_names=independent, dependent_coordinate_name=dependent)
    return element


def _marker(name: str, marker: Marker, frames: Mapping[str, Floats]) -> ET.Element:
    element = ET.Element("Marker", name=name)
    location = apply(inverse(frames[marker.bone]), marker.position[None])[0]
    _texts(element, socket_parent_frame=f"/bodyset/{marker.bone}", location=_numbers(location))
    return element


def _set(model: ET.Element, kind: str, objects: Iterable[ET.Element]) -> None:
    element = ET.SubElement(model, kind, name=kind.lower())
    ET.SubElement(element, "objects").extend(objects)


def _texts(element: ET.Element, **texts: str) -> None:
    for tag, text in texts.items():
        ET.SubElement(element, tag).text = text


def _numbers(values: Iterable[float]) -> str:
    return " ".join(f"{value:.12g}" for value in values)


def _write_obj(path: Path, vertices: Floats, faces: Ints) -> None:
    """A triangle mesh (m) as Wavefront OBJ, which keeps the order of vertices."""
    lines = [f"# {WRITTEN}", *(f"v {x:.7f} {y:.7f} {z:.7f}" for x, y, z in vertices)]
    lines += [f"f {a} {b} {c}" for a, b, c in np.asarray(faces) + 1]
    with replaced_if_own(path, words(WRITTEN)) as partial:
        partial.write_text("\n".join(lines) + "\n", encoding="utf-8")


def _write_ply(path: Path, vertices: Floats, faces: Ints) -> None:
    """The same as PLY in text."""
    lines = ["ply", "format ascii 1.0", f"comment {WRITTEN}", f"element vertex {len(vertices)}"]
    lines += [f"property float {axis}" for axis in "xyz"]
    lines += [f"element face {len(faces)}", "property list uchar int vertex_indices", "end_header"]
    lines += [f"{x:.7f} {y:.7f} {z:.7f}" for x, y, z in vertices]
    lines += [f"3 {a} {b} {c}" for a, b, c in faces]
    with replaced_if_own(path, words(WRITTEN)) as partial:
        partial.write_text("\n".join(lines) + "\n", encoding="utf-8")
