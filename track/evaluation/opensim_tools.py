"""OpenSim's own tools on our files: scale a model, place its markers, solve inverse kinematics, read the bones.

Needs the extra ``opensim``. Setup files name other files relative to themselves, which is what the tools expect.
"""

from __future__ import annotations

import ctypes
import os
import sys
import time
import xml.etree.ElementTree as ET
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from adapt.anatomy import Floats
from adapt.model.body import Body
from adapt.model.frames import landmark_mean
from capture.errors import BonetrackError
from capture.rigid import apply, inverse
from track.evaluation.markers import MarkerSet
from track.evaluation.reconstruction import Reconstruction, compared_coordinates
from track.export.opensim_tables import write_trc
from track.export.osim_joints import body_frames


class OpenSimError(BonetrackError):
    """OpenSim is missing, or one of its tools failed."""


@dataclass(frozen=True)
class Solved:
    """Inverse kinematics of one trial: its motion file and the seconds, on the wall and of the processor, it took."""

    motion: Path
    wall_s: float
    processor_s: float


def opensim() -> ModuleType:
    """OpenSim, quiet.

    Raises:
        OpenSimError: it is not installed.
    """
    try:
        import opensim as module
    except ImportError as error:
        raise OpenSimError("OpenSim is not installed", remedy="pip install bonetrack[opensim]") from error
    module.Logger.removeFileSink()  # it would write opensim.log wherever the command was called
    module.Logger.setLevelString("error")
    return module  # type: ignore[no-any-return]


@contextmanager
def _said_to(path: Path) -> Iterator[None]:
    """Send what OpenSim's tools print past Python to a file."""
    flush = ctypes.CDLL(None).fflush
    sys.stdout.flush()
    flush(None)
    kept = os.dup(1)
    try:
        with path.open("ab") as file:
            os.dup2(file.fileno(), 1)
            yield
            flush(None)
    finally:
        os.dup2(kept, 1)
        os.close(kept)


def scaled_model(generic: Path, static: Mapping[str, Floats], times: Floats, markers: MarkerSet, folder: Path) -> Path:
    """Scale a generic model to a static trial (T, 3) by marker pairs and place its markers; returns the new model.

    Raises:
        OpenSimError: the tool failed.
    """
    folder.mkdir(parents=True, exist_ok=True)
    write_trc(folder / "static.trc", times, static)
    result = folder / "scaled.osim"
    span = f"{times[0]:.6f} {times[-1]:.6f}"
    tool = ET.Element("ScaleTool", name=generic.stem)
    _texts(tool, mass="1")  # the whole model's, which inverse kinematics does not use
    _texts(ET.SubElement(tool, "GenericModelMaker"), model_file=_relative(generic, folder))
    scaler = ET.SubElement(tool, "ModelScaler")
    _texts(scaler, scaling_order="measurements", marker_file="static.trc", time_range=span)
    _texts(scaler, preserve_mass_distribution="true", output_model_file="unplaced.osim")
    measurements = ET.SubElement(ET.SubElement(scaler, "MeasurementSet"), "objects")
    measurements.extend(
        _measurement(bone, axes, pairs)
        for bone, by_axes in markers.measurements.items()
        for axes, pairs in by_axes.items()
    )
    placer = ET.SubElement(tool, "MarkerPlacer")
    _texts(placer, marker_file="static.trc", time_range=span, output_model_file=result.name)
    _tasks(placer, ((marker.name, marker.static_weight) for marker in markers.markers))
    module = opensim()
    with _said_to(folder / "said.txt"):
        done = module.ScaleTool(_setup(tool, folder / "scale.xml")).run()
    if not done or not result.is_file():
        raise OpenSimError("could not scale the model", where=folder, remedy="read what OpenSim says in said.txt")
    return result


def solve_kinematics(
    model: Path, trial: Mapping[str, Floats], times: Floats, markers: MarkerSet, accuracy: float, folder: Path
) -> Solved:
    """Inverse kinematics of a trial (T, 3), timed from the loaded model to the written motion.

    Raises:
        OpenSimError: the tool failed.
    """
    folder.mkdir(parents=True, exist_ok=True)
    write_trc(folder / "trial.trc", times, trial)
    tool = ET.Element("InverseKinematicsTool", name=f"ik_{accuracy:g}")
    _texts(tool, model_file=_relative(model, folder), results_directory=".", marker_file="trial.trc")
    _texts(tool, time_range=f"{times[0]:.6f} {times[-1]:.6f}", output_motion_file=f"ik_{accuracy:g}.mot")
    _texts(tool, accuracy=f"{accuracy:g}", report_errors="false", report_marker_locations="false")
    _tasks(tool, ((marker.name, marker.motion_weight) for marker in markers.markers))
    module = opensim()
    runner = module.InverseKinematicsTool(_setup(tool, folder / f"ik_{accuracy:g}.xml"))
    loaded = module.Model(str(model))
    runner.setModel(loaded)
    with _said_to(folder / "said.txt"):
        start, used = time.perf_counter(), time.process_time()
        done = runner.run()
        wall, processor = time.perf_counter() - start, time.process_time() - used
    solved = Solved(folder / f"ik_{accuracy:g}.mot", wall, processor)
    if not done or not solved.motion.is_file():
        raise OpenSimError(
            "could not solve inverse kinematics", where=folder, remedy="read what OpenSim says in said.txt"
        )
    return solved


def replayed(model: Path, motion: Path, template: Body) -> Reconstruction:
    """A model scaled from ``template`` playing a motion: its bones are the template's, scaled as the model's are.

    Raises:
        OpenSimError: the motion lacks a coordinate of the model.
    """
    module = opensim()
    loaded = module.Model(str(model))
    state = loaded.initSystem()
    table = module.TimeSeriesTable(str(motion))
    loaded.getSimbodyEngine().convertDegreesToRadians(table)
    columns = {name: np.array(table.getDependentColumn(name).to_numpy()) for name in table.getColumnLabels()}
    coordinates = list(loaded.getCoordinateSet())
    bodies = [loaded.getBodySet().get(bone.name) for bone in template.anatomy.bones]  # and no phantoms
    missing = [c.getName() for c in coordinates if c.getName() not in columns]
    if missing:
        raise OpenSimError(f"no column {missing[0]}", where=motion, remedy="solve inverse kinematics again")
    motions = {body.getName(): np.tile(np.eye(4), (table.getNumRows(), 1, 1)) for body in bodies}
    for t in range(table.getNumRows()):
        for coordinate in coordinates:
            coordinate.setValue(state, float(columns[coordinate.getName()][t]), False)
        loaded.realizePosition(state)
        for body in bodies:
            motions[body.getName()][t] = _matrix(body.getTransformInGround(state))
    scales = {body.getName(): _vector(body.get_attached_geometry(0).get_scale_factors()) for body in bodies}
    frames = body_frames(template)
    return Reconstruction(
        {name: np.rad2deg(columns[name]) for name in compared_coordinates(template.anatomy)},
        _centres(template, frames, scales, motions),
        {name: apply(inverse(frames[name]), rest) * scales[name] for name, rest in template.rest_bones.items()},
        motions,
    )


def _centres(
    template: Body, frames: Mapping[str, Floats], scales: Mapping[str, Floats], motions: Mapping[str, Floats]
) -> dict[str, Floats]:
    """Joint centres (T, 3), carried and scaled with the parent, or with the child of a free joint."""
    centres = {}
    for joint in template.anatomy.joints:
        carrier = joint.parent or joint.child
        rest, _ = landmark_mean(template.anatomy, template.p, joint.centre)
        local = apply(inverse(frames[carrier]), rest[None])[0] * scales[carrier]
        centres[joint.name] = motions[carrier][:, :3, :3] @ local + motions[carrier][:, :3, 3]
    return centres


def _measurement(bone: str, axes: str, pairs: Iterable[Iterable[str]]) -> ET.Element:
    measurement = ET.Element("Measurement", name=f"{bone}_{axes.replace(' ', '')}")
    _texts(measurement, apply="true")
    objects = ET.SubElement(ET.SubElement(measurement, "MarkerPairSet"), "objects")
    for pair in pairs:
        _texts(ET.SubElement(objects, "MarkerPair"), markers=" ".join(pair))
    scales = ET.SubElement(ET.SubElement(measurement, "BodyScaleSet"), "objects")
    _texts(ET.SubElement(scales, "BodyScale", name=bone), axes=axes)
    return measurement


def _tasks(element: ET.Element, weights: Iterable[tuple[str, float]]) -> None:
    objects = ET.SubElement(ET.SubElement(element, "IKTaskSet"), "objects")
    for name, weight in weights:
        _texts(ET.SubElement(objects, "IKMarkerTask", name=name), apply="true", weight=f"{weight:g}")


def _setup(tool: ET.Element, path: Path) -> str:
    """Write a tool's setup file; returns its path as the tools want it."""
    document = ET.Element("OpenSimDocument", Version="40000")
    document.append(tool)
    ET.indent(document)
    ET.ElementTree(document).write(path, encoding="UTF-8", xml_declaration=True)
    return str(path)


def _texts(element: ET.Element, **texts: str) -> None:
    for tag, text in texts.items():
        ET.SubElement(element, tag).text = text


def _relative(path: Path, folder: Path) -> str:
    return os.path.relpath(path, folder)


def _matrix(placed: Any) -> Floats:
    matrix = np.eye(4)
    matrix[:3, :3] = [[placed.R().get(i, j) for j in range(3)] for i in range(3)]
    matrix[:3, 3] = _vector(placed.p())
    return matrix


def _vector(three: Any) -> Floats:
    return np.array([three.get(k) for k in range(3)])
