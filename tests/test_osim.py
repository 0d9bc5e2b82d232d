"""The exported OpenSim model: OpenSim itself loads it, plays our coordinates, and its bones land where ours are."""

from __future__ import annotations

import xml.etree.ElementTree as ET

import numpy as np
import pytest

from adapt.anatomy import Anatomy
from adapt.anatomy_file import load_anatomy
from adapt.model.body import Body, bone_frames, make_body, posed_bones, rest_theta
from adapt.model.pose_space import reported_coordinates
from track.evaluation import opensim_tools
from track.evaluation.made_up_motions import motion_names, perform
from track.evaluation.random_bodies import random_body
from track.export.opensim_tables import write_mot
from track.export.osim import landmark_markers, write_osim
from track.export.osim_joints import body_frames, coupled_coordinates, osim_joints
from track.export.osim_mass import DENSITY_KG_M3, segment_masses
from track.export.osim_motion import with_coupled, write_states
from track.simulation.performance import Performance

LIMBS = ("upper-limb-right", "upper-limb-left", "lower-limb-right", "lower-limb-left")


@pytest.fixture(scope="module", params=LIMBS)
def anatomy(request) -> Anatomy:
    return load_anatomy(request.param)


@pytest.fixture(scope="module")
def body(anatomy) -> Body:
    return random_body(anatomy, 3)


@pytest.fixture(scope="module")
def exported(body, tmp_path_factory):
    folder = tmp_path_factory.mktemp(body.anatomy.name)
    write_osim(body, folder)
    return folder


def whole_range(body: Body, count: int = 12) -> Performance:
    """The made-up motions, and every coordinate from the low to the high end of its range."""
    made_up = perform(body, motion_names(body.anatomy), seconds_each=0.5, fps=10.0, seed=1)
    sweeps = []
    for i, coordinate in enumerate(body.anatomy.coordinates):
        if any(coordinate.name in joint.coordinates for joint in body.anatomy.joints if joint.type == "free"):
            continue
        sweep = np.tile(rest_theta(body), (count, 1))
        sweep[:, i] = np.linspace(coordinate.low, coordinate.high, count)
        sweeps.append(sweep)
    thetas = np.concatenate([made_up.thetas, *sweeps])
    return Performance(body, np.arange(len(thetas)) / 30.0, thetas)


def opensim():
    pytest.importorskip("opensim", reason="OpenSim is not installed: pip install bonetrack[opensim]")
    return opensim_tools.opensim()


def ground_transform(frame, state):
    placed = frame.getTransformInGround(state)
    matrix = np.eye(4)
    matrix[:3, :3] = [[placed.R().get(i, j) for j in range(3)] for i in range(3)]
    matrix[:3, 3] = [placed.p().get(i) for i in range(3)]
    return matrix


def mesh_vertices(folder, bone):
    lines = (folder / "Geometry" / f"{bone}.obj").read_text().splitlines()
    return np.array([line.split()[1:] for line in lines if line.startswith("v ")], dtype=float)


def apart_mm(model, states, folder, performance: Performance) -> dict[str, float]:
    """The largest distance of a mesh vertex that OpenSim poses from ours, over the motion, by bone."""
    body = performance.body
    meshes = {bone.name: mesh_vertices(folder, bone.name) for bone in body.anatomy.bones}
    worst = dict.fromkeys(meshes, 0.0)
    for state, theta in zip(states, performance.thetas, strict=True):
        model.realizePosition(state)
        ours = posed_bones(body, theta)
        for name in meshes:
            placed = ground_transform(model.getBodySet().get(name), state)
            theirs = meshes[name] @ placed[:3, :3].T + placed[:3, 3]
            worst[name] = max(worst[name], 1e3 * float(np.linalg.norm(theirs - ours[name], axis=1).max()))
    return worst


def states_of_mot(module, model, path):
    """One state after the other, as OpenSim reads a motion file: it converts what it takes for degrees."""
    state = model.initSystem()
    table = module.TimeSeriesTable(str(path))
    model.getSimbodyEngine().convertDegreesToRadians(table)
    values = {name: table.getDependentColumn(name).to_numpy() for name in table.getColumnLabels()}
    coordinates = list(model.getCoordinateSet())
    assert {coordinate.getName() for coordinate in coordinates} <= set(values)
    for t in range(table.getNumRows()):
        for coordinate in coordinates:
            coordinate.setValue(state, float(values[coordinate.getName()][t]), False)
        yield state


def test_opensim_poses_the_bones_where_ours_are_from_the_mot_file(exported, body, tmp_path):
    module = opensim()
    performance = whole_range(body)
    columns = with_coupled(body.anatomy, reported_coordinates(body.anatomy, performance.thetas))
    write_mot(tmp_path / "angles.mot", performance.times, columns)
    model = module.Model(str(exported / f"{body.anatomy.name}.osim"))
    worst = apart_mm(model, states_of_mot(module, model, tmp_path / "angles.mot"), exported, performance)
    assert max(worst.values()) < 0.3, worst


def test_opensim_reads_the_states_table_and_keeps_the_couplings(exported, body, tmp_path):
    module = opensim()
    performance = whole_range(body, count=4)
    columns = reported_coordinates(body.anatomy, performance.thetas)
    write_states(tmp_path / "coordinates.sto", performance.times, body.anatomy, columns)
    model = module.Model(str(exported / f"{body.anatomy.name}.osim"))
    model.initSystem()
    table = module.TimeSeriesTable(str(tmp_path / "coordinates.sto"))
    states = module.StatesTrajectory.createFromStatesTable(model, table, True, False)
    each = (states[t] for t in range(states.getSize()))
    worst = apart_mm(model, each, exported, performance)
    assert max(worst.values()) < 0.3, worst
    state = states.back()
    model.assemble(state)  # satisfied already: nothing moves
    assert (
        max(
            apart_mm(
                model, [state], exported, Performance(body, performance.times[-1:], performance.thetas[-1:])
            ).values()
        )
        < 0.3
    )


def test_the_states_table_holds_the_frames_and_coordinates_that_are_known(tmp_path):
    leg = load_anatomy("lower-limb-right")
    thetas = np.tile(rest_theta(make_body(leg)), (4, 1))
    thetas[2] = np.nan  # a lost frame
    thetas[:, leg.coordinate_index("ankle_angle_r")] = np.nan
    columns = reported_coordinates(leg, thetas) | {"thoracohumeral_elevation": np.zeros(4)}
    write_states(tmp_path / "c.sto", np.arange(4.0), leg, columns)
    lines = (tmp_path / "c.sto").read_text().splitlines()
    names, *rows = (line.split("\t") for line in lines[lines.index("endheader") + 1 :])
    assert [float(row[0]) for row in rows] == [0.0, 1.0, 3.0]
    assert names[-2:] == ["/jointset/knee/knee_angle_r/value", "/jointset/patellofemoral/knee_angle_r_beta/value"]
    rest = leg.coordinates[leg.coordinate_index("knee_angle_r")].rest
    np.testing.assert_allclose([float(cell) for row in rows for cell in row[-2:]], rest, atol=1e-8)


def test_the_model_stands_as_the_subject_rests_and_names_its_coordinates_and_markers(exported, body):
    module = opensim()
    model = module.Model(str(exported / f"{body.anatomy.name}.osim"))
    state = model.initSystem()
    rest = rest_theta(body)
    frames = bone_frames(body, rest)
    for name, frame in frames.items():
        placed = ground_transform(model.getBodySet().get(name), state)
        np.testing.assert_allclose(placed, frame, atol=5e-4)
    for coordinate, i in ((c, body.anatomy.coordinate_index(c.name)) for c in body.anatomy.coordinates[3:]):
        theirs = model.getCoordinateSet().get(coordinate.name)
        ours = (coordinate.low, coordinate.high, rest[i])
        np.testing.assert_allclose(
            (theirs.getRangeMin(), theirs.getRangeMax(), theirs.getDefaultValue()), ours, atol=1e-9
        )
        assert theirs.getMotionType() == (1 if coordinate.unit == "rad" else 2)  # so that degrees are converted
    points = dict(zip(body.anatomy.landmark_names, body.p.value, strict=True))
    assert model.getMarkerSet().getSize() > 10
    for marker in model.getMarkerSet():
        place = marker.getLocationInGround(state)
        np.testing.assert_allclose([place.get(k) for k in range(3)], points[marker.getName()], atol=5e-4)


def test_a_first_turn_is_the_coordinate_itself_so_that_degrees_mean_degrees(body):
    dependent = coupled_coordinates(body.anatomy)
    for joint in osim_joints(body):
        for coordinate in joint.coordinates if joint.axes else ():
            proportional = [a for a in joint.axes if a.coordinate == coordinate.name and a.x is None]
            assert bool(proportional) != (coordinate.name in dependent)


def test_landmarks_ride_on_the_bone_they_are_of(body):
    carriers = {name: marker.bone for name, marker in landmark_markers(body).items()}
    expected = {"EM": "humerus", "RS": "radius", "US": "ulna", "MC3_head": "hand"}
    if "FME" in carriers:
        expected = {"ASIS": "pelvis", "FLE": "femur", "LM": "tibia", "patella_apex": "patella", "heel": "foot"}
    assert {name: carriers[name] for name in expected} == expected
    assert not [name for name in carriers if "axis" in name or "bend" in name or name[-1].isdigit()]


def test_masses_fill_the_skin_and_are_those_of_possible_bodies(body):
    import igl

    masses = segment_masses(body)
    volume = igl.volume(
        np.vstack([body.v_tilde.value, np.zeros((1, 3))]),
        np.column_stack([body.anatomy.skin_faces, np.full(len(body.anatomy.skin_faces), len(body.v_tilde.value))]),
    )
    total = sum(mass.mass for mass in masses.values())
    assert total == pytest.approx(DENSITY_KG_M3 * abs(float(np.sum(volume))), rel=0.02)
    for mass in masses.values():
        principal = np.linalg.eigvalsh(mass.inertia)
        assert principal[0] > 0.0
        assert principal[0] + principal[1] >= principal[2]


def test_the_model_file_is_whole_xml_with_a_mesh_for_every_bone(exported, body):
    model = ET.parse(exported / f"{body.anatomy.name}.osim").getroot().find("Model")
    meshes = {element.text for element in model.iter("mesh_file")}
    assert meshes == {f"{bone.name}.obj" for bone in body.anatomy.bones}
    frames = body_frames(body)
    for bone in body.anatomy.bones:
        vertices = mesh_vertices(exported, bone.name)
        back = vertices @ frames[bone.name][:3, :3].T + frames[bone.name][:3, 3]
        np.testing.assert_allclose(back, body.rest_bones[bone.name], atol=1e-6)
    assert not list(exported.rglob("*partial*"))
