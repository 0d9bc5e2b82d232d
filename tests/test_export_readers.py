"""Every export, with lost frames in it, in the readers it is for: OpenSim, nimblephysics, pandas, trimesh and so on.

nimblephysics (AddBiomechanics) runs in a Python of its own, which BONETRACK_NIMBLE_PYTHON names; see .ci/run.
"""

from __future__ import annotations

import json
import os
import subprocess
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from adapt.anatomy_file import load_anatomy
from adapt.model.body import bone_frames, rest_theta
from adapt.model.pose_space import reported_coordinates
from adapt.subject import Subject
from tests.known_limb import known_subject
from tests.test_gltf import ReadBack
from track.evaluation import opensim_tools
from track.evaluation.random_bodies import random_body
from track.export.files import export_motion, export_subject
from track.export.gltf import write_gltf
from track.export.osim import landmark_markers, marker_paths
from track.export.osim_motion import in_si_with_coupled
from track.export.tables import motion_tables
from track.motion import Motion, bones_and_centres, coordinate_names
from track.observed_bones import known_thetas

LIMBS = ("upper-limb-right", "upper-limb-left", "lower-limb-right", "lower-limb-left")
COUNT = 9
LOST = (0, 4, COUNT - 1)  # the first frame, one amid others, the last
HIDDEN = 6  # in this frame the bone of the last marker does not show
AGREE_M = 1e-6  # two programs that read one model
KNEE_M = 5e-4  # ours and OpenSim's, whose knee turns in proportion


@dataclass(frozen=True, eq=False)
class Exported:
    subject: Subject
    motion: Motion
    folder: Path

    @property
    def model(self) -> Path:
        return self.folder / f"{self.motion.anatomy}.osim"

    @property
    def points(self) -> dict[str, dict[str, np.ndarray]]:
        markers = marker_paths(landmark_markers(self.subject.body), self.motion.transforms)
        return {"centres.trc": self.motion.centres, "markers.trc": markers}

    @property
    def coordinates(self) -> dict[str, np.ndarray]:
        """In radians and metres."""
        anatomy, motion = self.subject.anatomy, self.motion
        known = known_thetas(anatomy, motion.thetas, motion.shown)
        return in_si_with_coupled(anatomy, reported_coordinates(anatomy, known))


def bone_of_last_marker(subject: Subject) -> str:
    return list(landmark_markers(subject.body).values())[-1].bone


def holey_motion(subject: Subject) -> Motion:
    """Poses drawn from all ranges; the first, the last and a middle frame are lost, in one a bone is hidden."""
    anatomy, rng = subject.anatomy, np.random.default_rng(0)
    low, high = (np.array([getattr(c, end) for c in anatomy.coordinates]) for end in ("low", "high"))
    thetas = low + (high - low) * rng.uniform(size=(COUNT, len(low)))
    thetas[:, :3] = rng.normal(size=(COUNT, 3)) * 0.6
    thetas[:, 3:6] = rest_theta(subject.body)[3:6] + 0.1 * rng.normal(size=(COUNT, 3))
    thetas[list(LOST)] = np.nan
    shown = np.isfinite(thetas[:, :1]) & np.ones((1, len(anatomy.bones)), dtype=bool)
    shown[HIDDEN, [bone.name for bone in anatomy.bones].index(bone_of_last_marker(subject))] = False
    transforms, centres = bones_and_centres(subject, thetas, shown)
    number = np.where(shown.any(axis=1), 0.001, np.nan)
    return Motion(
        anatomy=anatomy.name,
        coordinates=coordinate_names(anatomy),
        times=np.arange(COUNT) / 30.0,
        thetas=thetas,
        deviations=np.where(np.isfinite(thetas), 0.02, np.nan),
        lost=tuple("dark" if t in LOST else "" for t in range(COUNT)),
        residuals=number,
        coverage=number,
        matches=np.full(COUNT, 500),
        shown=shown,
        transforms=transforms,
        centres=centres,
    )


@pytest.fixture(scope="module", params=LIMBS)
def exported(request, tmp_path_factory) -> Exported:
    folder = tmp_path_factory.mktemp(request.param)
    body = random_body(load_anatomy(request.param), 3)
    subject = known_subject(body, np.zeros((0, len(body.anatomy.coordinates))), np.zeros(0))
    motion = holey_motion(subject)
    export_subject(subject, folder)
    export_motion(motion, subject, folder, frame=HIDDEN)
    return Exported(subject, motion, folder)


def opensim():
    pytest.importorskip("opensim", reason="OpenSim is not installed: pip install bonetrack[opensim]")
    return opensim_tools.opensim()


def nimble(*arguments: object):
    python = os.environ.get("BONETRACK_NIMBLE_PYTHON")
    if not python:
        pytest.skip("BONETRACK_NIMBLE_PYTHON names no Python 3.11 with nimblephysics 0.10.52.1 and numpy before 2")
    script = Path(__file__).with_name("nimble_reader.py")
    ran = subprocess.run([python, script, *arguments], capture_output=True, text=True, timeout=120, check=False)
    assert ran.returncode == 0, ran.stdout + ran.stderr
    assert "Fail" not in ran.stdout  # as of a mesh that it does not find
    return json.loads(ran.stdout.splitlines()[-1])


@pytest.mark.parametrize("name", ["centres.trc", "markers.trc"])
def test_opensim_opens_a_marker_file_with_the_first_the_last_and_a_middle_frame_lost(exported, name):
    module = opensim()
    points = exported.points[name]
    table = module.TimeSeriesTableVec3(str(exported.folder / name))
    assert list(table.getColumnLabels()) == list(points)
    assert table.getNumRows() == COUNT
    for label, ours in points.items():
        column = table.getDependentColumn(label)
        theirs = np.array([column.getElt(t, 0).to_numpy() for t in range(COUNT)])
        np.testing.assert_allclose(theirs, 1e3 * ours, atol=1e-4, equal_nan=True)
    read = module.MarkerData(str(exported.folder / name))  # what its tools use, in metres or as the file has it
    assert (read.getNumFrames(), read.getNumMarkers()) == (COUNT, len(points))
    last = [np.isfinite(read.getFrame(t).getMarker(len(points) - 1).to_numpy()).all() for t in range(COUNT)]
    assert last == np.isfinite(list(points.values())[-1]).all(axis=1).tolist()


@pytest.mark.parametrize("name", ["centres.trc", "markers.trc"])
def test_nimblephysics_gives_every_marker_its_own_place_where_others_are_unknown(exported, name):
    read, points = nimble("trc", exported.folder / name), exported.points[name]
    np.testing.assert_allclose(read["times"], exported.motion.times, atol=1e-6)
    for t, theirs in enumerate(read["points"]):
        ours = {label: at[t] for label, at in points.items() if np.isfinite(at[t]).all()}
        assert set(theirs) == set(ours)
        for label, at in ours.items():
            np.testing.assert_allclose(theirs[label], at, atol=AGREE_M)


def test_the_motion_that_readers_are_tried_with_has_an_unknown_last_marker_beside_known_ones(exported):
    known = np.array([np.isfinite(at[HIDDEN]).all() for at in exported.points["markers.trc"].values()])
    assert known.any()
    assert not known[-1]
    assert all(not np.isfinite(at[t]).any() for at in exported.points["markers.trc"].values() for t in LOST)


def test_opensim_reads_angles_of_every_frame_and_nan_where_one_was_lost(exported):
    module = opensim()
    model = module.Model(str(exported.model))
    model.initSystem()
    for name in ("angles.mot", "angles_radians.mot"):
        table = module.TimeSeriesTable(str(exported.folder / name))
        if name == "angles.mot":
            model.getSimbodyEngine().convertDegreesToRadians(table)
        assert table.getNumRows() == COUNT
        for coordinate, ours in exported.coordinates.items():
            theirs = table.getDependentColumn(coordinate).to_numpy()
            np.testing.assert_allclose(theirs, ours, atol=1e-7, equal_nan=True, err_msg=f"{name} {coordinate}")


def test_the_states_table_is_read_to_its_end_by_both_of_opensims_readers(exported):
    module = opensim()
    path = str(exported.folder / "coordinates.sto")
    table, storage = module.TimeSeriesTable(path), module.Storage(path)
    whole = np.isfinite(np.column_stack(list(exported.coordinates.values()))).all(axis=1)
    assert table.getNumRows() == storage.getSize() == whole.sum()
    for label in table.getColumnLabels():
        ours = exported.coordinates[label.split("/")[-2]][whole]
        np.testing.assert_allclose(table.getDependentColumn(label).to_numpy(), ours, atol=1e-8)


def test_nimblephysics_reads_angles_in_radians_and_converts_coupled_ones_in_degrees_that_are_none(exported):
    ours = exported.coordinates
    radians = nimble("mot", exported.model, exported.folder / "angles_radians.mot")
    degrees = nimble("mot", exported.model, exported.folder / "angles.mot")
    assert set(radians) == set(ours)
    for name, values in ours.items():
        np.testing.assert_allclose(radians[name], values, atol=1e-7, equal_nan=True, err_msg=name)
        told = np.deg2rad(values) if name.endswith("_beta") else values  # so docs/exports.md sends them to the other
        np.testing.assert_allclose(degrees[name], told, atol=1e-7, equal_nan=True, err_msg=name)


def opensim_bodies(model: Path, poses: list[dict[str, float]], names: list[str]) -> list[dict[str, np.ndarray]]:
    loaded = opensim().Model(str(model))
    state = loaded.initSystem()
    bodies = []
    for pose in poses:
        for coordinate in loaded.getCoordinateSet():
            coordinate.setValue(state, pose[coordinate.getName()], False)
        loaded.realizePosition(state)
        bodies.append({name: _matrix(loaded.getBodySet().get(name).getTransformInGround(state)) for name in names})
    return bodies


def _matrix(placed) -> np.ndarray:
    matrix = np.eye(4)
    matrix[:3, :3] = [[placed.R().get(i, j) for j in range(3)] for i in range(3)]
    matrix[:3, 3] = placed.p().to_numpy()
    return matrix


def test_opensim_and_nimblephysics_put_every_body_where_ours_is_in_random_poses(exported, tmp_path):
    opensim()
    body, known = exported.subject.body, [t for t in range(COUNT) if t not in (*LOST, HIDDEN)]
    names = [bone.name for bone in body.anatomy.bones]
    poses = [{name: float(values[t]) for name, values in exported.coordinates.items()} for t in known]
    (tmp_path / "poses.json").write_text(json.dumps(poses))
    read = nimble("osim", exported.model, tmp_path / "poses.json")
    assert read["markers"] == sorted(landmark_markers(body))
    assert set(read["coordinates"]) == set(exported.coordinates)
    for t, theirs, others in zip(known, opensim_bodies(exported.model, poses, names), read["bodies"], strict=True):
        ours = bone_frames(body, exported.motion.thetas[t])
        for name in names:
            np.testing.assert_allclose(others[name], theirs[name], atol=AGREE_M, err_msg=name)
            np.testing.assert_allclose(theirs[name], ours[name], atol=KNEE_M, err_msg=name)


def test_opensims_inverse_kinematics_finds_our_angles_where_the_last_marker_is_unknown(exported, tmp_path):
    module = opensim()
    model, tool = module.Model(str(exported.model)), module.InverseKinematicsTool()
    tool.setModel(model)  # which it does not keep alive
    tool.setMarkerDataFileName(str(exported.folder / "markers.trc"))
    tool.setStartTime(exported.motion.times[HIDDEN - 1])
    tool.setEndTime(exported.motion.times[HIDDEN + 1])
    tool.setOutputMotionFileName(str(tmp_path / "ik.mot"))
    tool.setResultsDir(str(tmp_path))
    assert tool.run()
    table = module.TimeSeriesTable(str(tmp_path / "ik.mot"))
    anatomy = exported.subject.anatomy
    for joint in anatomy.joints[1:2]:  # elbow, hip: enough markers on both sides of it, whichever bone is hidden
        for name in joint.coordinates:
            ours = np.rad2deg(exported.motion.thetas[HIDDEN - 1 : HIDDEN + 2, anatomy.coordinate_index(name)])
            np.testing.assert_allclose(table.getDependentColumn(name).to_numpy(), ours, atol=0.5, err_msg=name)


def test_tables_are_read_by_pandas_with_what_is_lost_as_missing(exported, tmp_path):
    pandas = pytest.importorskip("pandas", reason="reads tables in tests")
    pytest.importorskip("pyarrow", reason="Parquet needs pyarrow")
    export_motion(exported.motion, exported.subject, tmp_path, parquet=True)
    for name, table in motion_tables(exported.motion, exported.subject.anatomy).items():
        for read in (pandas.read_csv(tmp_path / f"{name}.csv"), pandas.read_parquet(tmp_path / f"{name}.parquet")):
            assert list(read) == list(table)
            for column, values in table.items():
                if values.dtype.kind in "fi":
                    np.testing.assert_allclose(read[column].to_numpy(float), values, atol=1e-8, equal_nan=True)
                else:
                    assert read[column].tolist() == values.tolist()


def test_an_animation_begins_and_ends_with_frames_that_have_a_pose(exported, tmp_path):
    write_gltf(exported.motion, exported.subject, tmp_path / "motion.glb")
    read = ReadBack(tmp_path / "motion.glb")
    kept = np.delete(exported.motion.times, LOST) - exported.motion.times[0]
    for path in ("rotation", "translation"):
        for times, values in read.channels(path).values():
            np.testing.assert_allclose(times, kept, atol=1e-6)
            assert np.isfinite(values).all()
    assert read.gltf.extras["lost_frames"] == list(LOST)


def test_meshes_of_a_frame_leave_out_the_bone_that_does_not_show_and_open_elsewhere(exported):
    trimesh = pytest.importorskip("trimesh", reason="reads meshes in tests")
    bones, hidden = exported.subject.anatomy.bones, bone_of_last_marker(exported.subject)
    assert not (exported.folder / f"{hidden}_{HIDDEN:05d}.ply").exists()
    for bone in (bone for bone in bones if bone.name != hidden):
        read = trimesh.load(exported.folder / f"{bone.name}_{HIDDEN:05d}.ply", process=False)
        turned = exported.motion.transforms[bone.name][HIDDEN]
        ours = exported.subject.body.rest_bones[bone.name] @ turned[:3, :3].T + turned[:3, 3]
        np.testing.assert_allclose(read.vertices, ours, atol=1e-6)
    for bone in bones:
        path = exported.folder / "Geometry" / f"{bone.name}.obj"
        pair = [trimesh.load(path.with_name(path.name + end), process=False) for end in ("", ".ply")]
        np.testing.assert_allclose(*(mesh.vertices for mesh in pair), atol=1e-6)
        np.testing.assert_array_equal(*(mesh.faces for mesh in pair))
