"""What is written for people and other tools: motion files, subjects, angles, meshes."""

from __future__ import annotations

import csv
import json
from dataclasses import replace

import numpy as np
import pytest
from click.testing import CliRunner
from scipy.spatial.transform import Rotation

from adapt.fit.pose import fit_pose
from adapt.fit.posterior import pose_covariance
from adapt.match.skin_sample import sample_skin
from adapt.model.body import joint_centres, pose_skin, posed_bones, rest_theta
from adapt.model.pose_space import reported_coordinates
from adapt.subject import load_subject, save_subject
from capture.errors import AnatomyError
from capture.rigid import exp_so3, log_so3
from tests.toy_anatomy import toy_anatomy
from track.angles import read_thorax, refuse_without_humerus, thoraco_humeral
from track.evaluation.made_up_motions import perform_tables
from track.export.commands import export_command
from track.export.files import export_motion, export_subject
from track.export.opensim_tables import write_mot, write_trc
from track.export.osim import landmark_markers
from track.export.quality_table import write_quality
from track.motion import Motion, MotionError, bones_and_centres, coordinate_names, load_motion, save_motion
from track.motion_summary import print_motion
from track.observed_bones import skin_shown
from track.simulation.motion_table import read_motion_table
from track.simulation.performance import PerformanceError
from track.track_recording import write_motion_folder
from track.view.charts import plot_angles

LOST = 3


@pytest.fixture(scope="module")
def motion(limb):
    """The known motion, as if tracked without error; one frame is lost."""
    thetas = limb.thetas.copy()
    thetas[LOST] = np.nan
    shown = np.tile(np.isfinite(thetas[:, :1]), (1, len(limb.subject.anatomy.bones)))
    transforms, centres = bones_and_centres(limb.subject, thetas, shown)
    lost = tuple("nobody, there" if t == LOST else "" for t in range(len(thetas)))
    deviations = np.where(np.isfinite(thetas), 0.01, np.nan)
    quality = np.where(np.isfinite(thetas[:, 0]), 0.002, np.nan)
    return Motion(
        anatomy=limb.subject.anatomy.name,
        coordinates=coordinate_names(limb.subject.anatomy),
        times=limb.times,
        thetas=thetas,
        deviations=deviations,
        lost=lost,
        residuals=quality,
        coverage=np.ones(len(thetas)),
        matches=np.full(len(thetas), 900),
        shown=shown,
        transforms=transforms,
        centres=centres,
    )


def table_of(path):
    """Header and numbers of a .mot file, read as its format says."""
    lines = path.read_text().splitlines()
    end = lines.index("endheader")
    header = dict(line.split("=") for line in lines[1:end] if "=" in line)
    rows = [[float(cell) for cell in line.split("\t")] for line in lines[end + 2 :]]
    return header, lines[end + 1].split("\t"), np.array(rows)


def test_mot_files_state_their_rows_columns_and_degrees(tmp_path, motion, limb):
    columns = reported_coordinates(limb.subject.anatomy, motion.thetas)
    write_mot(tmp_path / "a.mot", motion.times, columns)
    header, names, table = table_of(tmp_path / "a.mot")
    assert (tmp_path / "a.mot").read_text().startswith("Coordinates\nversion=1\n")
    assert header["inDegrees"] == "yes"
    assert table.shape == (int(header["nRows"]), int(header["nColumns"])) == (len(motion.times), len(names))
    np.testing.assert_allclose(table[:, 0], motion.times, atol=1e-7)
    i = limb.subject.anatomy.coordinate_index("elbow_flexion")
    np.testing.assert_allclose(table[:, names.index("elbow_flexion")], np.rad2deg(motion.thetas[:, i]), atol=1e-6)
    k = limb.subject.anatomy.coordinate_index(limb.subject.anatomy.joints[0].coordinates[4])
    in_metres = table[:, names.index(limb.subject.anatomy.coordinates[k].name)]
    np.testing.assert_allclose(in_metres, motion.thetas[:, k], atol=1e-7)
    assert np.isnan(table[LOST, 1:]).all()
    assert np.isfinite(np.delete(table, LOST, axis=0)).all()


def test_trc_files_hold_millimetres_and_nan_for_lost_frames(tmp_path, motion):
    write_trc(tmp_path / "c.trc", motion.times, motion.centres)
    lines = (tmp_path / "c.trc").read_text().split("\n")
    assert lines[0].split("\t")[:3] == ["PathFileType", "4", "(X/Y/Z)"]
    stated = dict(zip(lines[1].split("\t"), lines[2].split("\t"), strict=True))
    assert (stated["NumFrames"], stated["NumMarkers"], stated["Units"]) == ("12", str(len(motion.centres)), "mm")
    assert float(stated["DataRate"]) == pytest.approx(30.0, abs=0.01)
    assert lines[3].split("\t")[:2] == ["Frame#", "Time"]
    assert [name for name in lines[3].split("\t")[2:] if name] == list(motion.centres)
    assert lines[4].split("\t")[2:5] == ["X1", "Y1", "Z1"]
    rows = [line.split("\t") for line in lines[6:] if line]
    assert {len(row) for row in rows} == {2 + 3 * len(motion.centres)}
    assert [row[0] for row in rows] == [str(k + 1) for k in range(12)]
    assert set(rows[LOST][2:]) == {"nan"}
    second = list(motion.centres.values())[1]
    np.testing.assert_allclose([float(x) for x in rows[5][5:8]], 1e3 * second[5], atol=1e-4)


def test_virtual_markers_keep_their_places_on_the_bones_they_ride_on(tmp_path, motion, limb):
    assert tmp_path / "markers.trc" in export_motion(motion, limb.subject, tmp_path)
    lines = (tmp_path / "markers.trc").read_text().split("\n")
    names = [name for name in lines[3].split("\t")[2:] if name]
    rows = [line.split("\t") for line in lines[6:] if line]
    markers = landmark_markers(limb.subject.body)
    assert names == list(markers)
    assert set(rows[LOST][2:]) == {"nan"}
    at = np.array(rows[5][2:], dtype=float).reshape(-1, 3) / 1e3
    bones, rest = posed_bones(limb.subject.body, motion.thetas[5]), limb.subject.body.rest_bones
    for name, place in zip(names, at, strict=True):
        bone = markers[name].bone
        apart = np.linalg.norm(bones[bone] - place, axis=1)
        np.testing.assert_allclose(apart, np.linalg.norm(rest[bone] - markers[name].position, axis=1), atol=1e-6)


def test_the_quality_table_says_why_a_frame_was_lost(tmp_path, motion, limb):
    write_quality(tmp_path / "quality.csv", motion, limb.subject.anatomy)
    with (tmp_path / "quality.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [row["tracked"] for row in rows] == ["0" if k == LOST else "1" for k in range(12)]
    assert rows[LOST]["lost_because"] == "nobody, there"
    assert float(rows[0]["residual_mm"]) == pytest.approx(2.0)
    assert float(rows[0]["sd_elbow_flexion_deg"]) == pytest.approx(np.rad2deg(0.01), abs=1e-3)
    millimetres = [key for key in rows[0] if key.endswith("_mm") and key.startswith("sd_")]
    assert [float(rows[0][key]) for key in millimetres] == pytest.approx([10.0] * 3)


def test_a_free_joint_is_reported_as_three_body_fixed_turns(limb):
    anatomy = limb.subject.anatomy
    columns = reported_coordinates(anatomy, limb.thetas)
    joint = anatomy.joints[0].name
    for theta, x, y, z in zip(limb.thetas, *(columns[f"{joint}_euler_{c}"] for c in "xyz"), strict=True):
        turns = [exp_so3(np.deg2rad(angle) * axis) for angle, axis in zip((x, y, z), np.eye(3), strict=True)]
        np.testing.assert_allclose(turns[0] @ turns[1] @ turns[2], exp_so3(theta[:3]), atol=1e-12)


def test_reported_turns_do_not_jump_when_they_pass_half_a_turn(arm):
    thetas = np.zeros((40, len(arm.coordinates)))
    thetas[:, :3] = Rotation.from_euler("X", np.linspace(150.0, 210.0, 40)[:, None], degrees=True).as_rotvec()
    thetas[7] = np.nan
    angle = reported_coordinates(arm, thetas)[f"{arm.joints[0].name}_euler_x"]
    known = np.delete(np.arange(40), 7)
    assert np.isnan(angle[7])
    assert np.abs(np.diff(angle[known])).max() < 4.0
    assert abs(angle[-1] - angle[0]) == pytest.approx(60.0)


HANGING = np.eye(3)
ABDUCTED = exp_so3(np.deg2rad([-90.0, 0.0, 0.0]))  # the elbow points right (+Z): Y of the humerus to the left
FLEXED = np.column_stack([[0.0, 0.0, -1.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])  # the elbow points forward (+X)


@pytest.mark.parametrize(("humerus", "plane", "elevation"), [(ABDUCTED, 0.0, 90.0), (FLEXED, 90.0, 90.0)])
def test_a_raised_arm_has_the_angles_that_isb_gives_it(humerus, plane, elevation):
    for turned in (np.eye(3), exp_so3(np.array([0.3, -0.7, 1.1]))):
        thorax = np.eye(4)
        thorax[:3, :3] = turned
        theta = np.zeros((2, 6))
        theta[0, :3], theta[1] = log_so3(turned @ humerus), np.nan
        angles = thoraco_humeral(thorax, theta, [0, 1, 2], side="right")
        assert angles["thoracohumeral_plane_of_elevation"][0] == pytest.approx(plane, abs=1e-6)
        assert angles["thoracohumeral_elevation"][0] == pytest.approx(elevation)
        assert np.isnan(angles["thoracohumeral_elevation"][1])


@pytest.mark.filterwarnings("ignore:Gimbal lock")
def test_a_hanging_arm_is_not_elevated():
    angles = thoraco_humeral(np.eye(4), log_so3(HANGING)[None], [0, 1, 2], side="right")
    assert angles["thoracohumeral_elevation"][0] == pytest.approx(0.0, abs=1e-6)


def test_isb_angles_compose_to_the_arms_rotation():
    for seed in range(20):
        arm = Rotation.random(rng=np.random.default_rng(seed))
        angles = thoraco_humeral(np.eye(4), arm.as_rotvec()[None], [0, 1, 2], side="right")
        plane, elevation, axial = (np.deg2rad(values[0]) for values in angles.values())
        y = np.array([0.0, 1.0, 0.0])
        composed = exp_so3(plane * y) @ exp_so3(np.array([-elevation, 0.0, 0.0])) @ exp_so3(axial * y)
        np.testing.assert_allclose(composed, arm.as_matrix(), atol=1e-9)


def test_thoraco_humeral_angles_are_refused_where_there_is_no_humerus_to_speak_of():
    with pytest.raises(MotionError, match="the free bone of toy is the upper, not the humerus"):
        refuse_without_humerus(toy_anatomy())


def test_a_thorax_file_must_hold_a_rigid_transform(tmp_path):
    path = tmp_path / "thorax.json"
    path.write_text(json.dumps(np.eye(4).tolist()))
    np.testing.assert_array_equal(read_thorax(path), np.eye(4))
    for wrong in ("[[1, 2], [3, 4]]", "{", '"x"', json.dumps((2 * np.eye(4)).tolist()), "[[1], [2, 3]]", "null"):
        path.write_text(wrong)
        with pytest.raises(MotionError, match=r"thorax\.json"):
            read_thorax(path)
    with pytest.raises(MotionError, match="cannot be read"):
        read_thorax(tmp_path / "none.json")


def test_a_motion_comes_back_as_it_was_saved(tmp_path, motion):
    save_motion(motion, tmp_path)
    for path in (tmp_path, tmp_path / "motion.npz"):
        back = load_motion(path)
        assert (back.anatomy, back.coordinates, back.lost) == (motion.anatomy, motion.coordinates, motion.lost)
        for name in ("times", "thetas", "deviations", "shown", "residuals", "coverage", "matches"):
            np.testing.assert_array_equal(getattr(back, name), getattr(motion, name))
        for name in motion.transforms:
            np.testing.assert_array_equal(back.transforms[name], motion.transforms[name])
        assert list(back.centres) == list(motion.centres)


def test_in_a_motion_of_the_first_version_all_bones_show_where_it_was_tracked(tmp_path, motion):
    save_motion(motion, tmp_path)
    rewritten(tmp_path / "motion.npz", version=1, shown=None)
    np.testing.assert_array_equal(load_motion(tmp_path).shown, motion.shown)
    assert not motion.shown[LOST].any()


def test_a_motion_written_before_settings_were_kept_has_none(tmp_path, motion):
    save_motion(motion, tmp_path)
    with np.load(tmp_path / "motion.npz", allow_pickle=False) as data:
        arrays = {key: data[key] for key in data.files}
    description = json.loads(str(arrays["description"]))
    del description["settings"]
    np.savez(tmp_path / "motion.npz", **arrays | {"description": np.array(json.dumps(description))})
    assert load_motion(tmp_path).settings is None


def test_settings_that_are_none_are_refused(tmp_path, motion):
    save_motion(motion, tmp_path)
    rewritten(tmp_path / "motion.npz", settings={"versions": {}})
    with pytest.raises(MotionError, match="not a motion file"):
        load_motion(tmp_path)


def test_a_motion_of_this_version_must_say_which_bones_show(tmp_path, motion):
    save_motion(motion, tmp_path)
    rewritten(tmp_path / "motion.npz", shown=None)
    with pytest.raises(MotionError, match="not a motion file"):
        load_motion(tmp_path)


def test_a_subject_comes_back_as_it_was_saved(tmp_path, limb):
    subject = replace(limb.subject, report={"poses": [1, 2], "note": "µ"})
    save_subject(subject, tmp_path / "new folder" / "subject.npz")
    back = load_subject(tmp_path / "new folder" / "subject.npz", anatomy=subject.anatomy.name)
    np.testing.assert_array_equal(back.body.shape, subject.body.shape)
    np.testing.assert_allclose(back.body.v_hat, subject.body.v_hat, atol=1e-8)
    np.testing.assert_array_equal(back.thetas, subject.thetas)
    np.testing.assert_array_equal(back.times, subject.times)
    np.testing.assert_array_equal(back.covariance, subject.covariance)
    assert back.report == subject.report


def test_a_subject_may_be_kept_under_any_file_name(tmp_path, limb):
    save_subject(limb.subject, tmp_path / "ann")
    assert [path.name for path in tmp_path.iterdir()] == ["ann"]
    np.testing.assert_array_equal(load_subject(tmp_path / "ann").body.shape, limb.subject.body.shape)


def rewritten(path, **changes):
    """The same .npz with other contents under some keys; None takes a key away."""
    with np.load(path, allow_pickle=False) as data:
        arrays = {key: data[key] for key in data.files}
    description = json.loads(str(arrays["description"]))
    for key, value in changes.items():
        if key in arrays:
            arrays[key] = value
        else:
            description[key] = value
    arrays["description"] = np.array(json.dumps(description))
    np.savez(path, **{key: value for key, value in arrays.items() if value is not None})


def test_a_subject_of_the_first_format_tells_of_its_shape_alone(tmp_path, limb):
    """Files of version 1 hold the shape's covariance only; tracking goes on as it did with them."""
    m = len(limb.subject.body.shape)
    path = tmp_path / "subject.npz"
    save_subject(replace(limb.subject, covariance=np.eye(m + 150)), path)
    assert len(load_subject(path).covariance) == m + 150
    rewritten(path, version=1, covariance=2e-6 * np.eye(m))
    old = load_subject(path)
    np.testing.assert_array_equal(old.covariance, 2e-6 * np.eye(m))
    sample = sample_skin(old.anatomy, at_most=1500)
    fit = fit_pose(old.body, limb.targets[2], limb.thetas[2], sample, updates=1)
    assert (np.diag(pose_covariance(old, fit, sample)) > 0.0).all()


def test_a_subject_with_a_covariance_of_something_else_is_refused(tmp_path, limb):
    path = tmp_path / "subject.npz"
    save_subject(replace(limb.subject, covariance=np.eye(7)), path)
    with pytest.raises(AnatomyError, match=r"\(7, 7\).*adapt the subject again"):
        load_subject(path)


WRONG_FILES = {
    "empty": b"",
    "text": b"hello",
    "a zip's beginning": b"PK\x03\x04" + bytes(40),
    "an array": None,
}


def write_wrong(path, kind):
    if kind == "an array":
        with path.open("wb") as file:
            np.save(file, np.zeros(3))
    else:
        path.write_bytes(WRONG_FILES[kind])


@pytest.mark.parametrize("kind", WRONG_FILES)
def test_what_is_no_subject_or_motion_is_refused_in_one_line(tmp_path, kind):
    write_wrong(tmp_path / "motion.npz", kind)
    for read, error in ((load_subject, AnatomyError), (load_motion, MotionError)):
        with pytest.raises(error, match=r"motion\.npz.*bonetrack") as caught:
            read(tmp_path / "motion.npz")
        assert "\n" not in str(caught.value)


@pytest.mark.parametrize("share", [0.1, 0.5, 0.9, 0.999])
def test_a_truncated_subject_or_motion_is_refused_in_one_line(tmp_path, limb, motion, share):
    save_subject(limb.subject, tmp_path / "subject.npz")
    save_motion(motion, tmp_path)
    for name, read, error in (("subject", load_subject, AnatomyError), ("motion", load_motion, MotionError)):
        path = tmp_path / f"{name}.npz"
        data = path.read_bytes()
        path.write_bytes(data[: int(share * len(data))])
        with pytest.raises(error, match=rf"{name}\.npz") as caught:
            read(path)
        assert "\n" not in str(caught.value)


def test_a_damaged_subject_is_refused_in_one_line(tmp_path, limb):
    save_subject(limb.subject, tmp_path / "subject.npz")
    data = bytearray((tmp_path / "subject.npz").read_bytes())
    data[len(data) // 3 : len(data) // 3 + 200] = bytes(200)
    (tmp_path / "subject.npz").write_bytes(data)
    with pytest.raises(AnatomyError, match=r"subject\.npz"):
        load_subject(tmp_path / "subject.npz")


def test_newer_subjects_and_motions_ask_for_an_update(tmp_path, limb, motion):
    save_subject(limb.subject, tmp_path / "subject.npz")
    save_motion(motion, tmp_path)
    for name in ("subject", "motion"):
        rewritten(tmp_path / f"{name}.npz", version=99)
    with pytest.raises(AnatomyError, match=r"subject\.npz: format version 99 .* update bonetrack"):
        load_subject(tmp_path / "subject.npz")
    with pytest.raises(MotionError, match=r"motion\.npz: format version 99 .* update bonetrack"):
        load_motion(tmp_path)


def test_a_subject_of_another_anatomy_or_template_is_refused(tmp_path, limb):
    path = tmp_path / "subject.npz"
    save_subject(limb.subject, path)
    with pytest.raises(AnatomyError, match=r"subject\.npz: a subject of anatomy 'upper-limb-right', not 'leg'"):
        load_subject(path, anatomy="leg")
    rewritten(path, skin_vertices=17)
    with pytest.raises(AnatomyError, match=r"subject\.npz: made with another template"):
        load_subject(path)


@pytest.mark.parametrize(
    "changes",
    [{"shape": None}, {"displacement": np.zeros((4, 3))}, {"shape": np.ones(3)}, {"version": "x"}, {"format": 5}],
    ids=["no shape", "wrong displacement", "wrong shape", "version in words", "other format"],
)
def test_a_subject_whose_parts_do_not_fit_is_refused(tmp_path, limb, changes):
    save_subject(limb.subject, tmp_path / "subject.npz")
    rewritten(tmp_path / "subject.npz", **changes)
    with pytest.raises(AnatomyError, match=r"subject\.npz"):
        load_subject(tmp_path / "subject.npz")


def test_exported_meshes_are_what_other_tools_read_back(tmp_path, limb, motion):
    from capture._open3d import open3d

    subject, frame = limb.subject, 5
    written = export_subject(subject, tmp_path / "rest") + export_motion(motion, subject, tmp_path / "all", frame=frame)
    assert all(path.is_file() for path in written)
    read = open3d().io.read_triangle_mesh
    skin = read(str(tmp_path / "rest" / "skin.ply"))
    np.testing.assert_allclose(np.asarray(skin.vertices), subject.body.v_tilde.value, atol=1e-6)
    np.testing.assert_array_equal(np.asarray(skin.triangles), subject.anatomy.skin_faces)
    bones = posed_bones(subject.body, motion.thetas[frame])
    for bone in subject.anatomy.bones:
        mesh = read(str(tmp_path / "all" / f"{bone.name}_{frame:05d}.ply"))
        np.testing.assert_allclose(np.asarray(mesh.vertices), bones[bone.name], atol=1e-6)
        assert len(mesh.triangles) == len(bone.faces)
    assert table_of(tmp_path / "all" / "angles.mot")[2].shape[0] == len(motion.times)


def hand_hidden(motion, limb):
    """The same motion in which the hand never shows."""
    shown = motion.shown & [name != "hand" for name in motion.transforms]
    transforms, centres = bones_and_centres(limb.subject, motion.thetas, shown)
    return replace(motion, shown=shown, transforms=transforms, centres=centres)


def test_bones_that_do_not_show_are_not_exported_nor_the_skin_that_rides_on_them(tmp_path, limb, motion):
    from capture._open3d import open3d

    subject, frame, hidden = limb.subject, 5, hand_hidden(motion, limb)
    written = export_motion(hidden, subject, tmp_path, frame=frame)
    names = {path.name for path in written}
    assert {f"{name}_00005.ply" for name in ("humerus", "ulna", "radius", "skin")} < names
    assert "hand_00005.ply" not in names
    assert {path.name for path in tmp_path.iterdir()} == names
    skin = open3d().io.read_triangle_mesh(str(tmp_path / "skin_00005.ply"))
    kept = skin_shown(subject.body, hidden.shown[frame])
    posed = pose_skin(subject.body, motion.thetas[frame])
    np.testing.assert_allclose(np.asarray(skin.vertices), posed[kept], atol=1e-6)
    assert 0.5 < len(skin.vertices) / len(posed) < 0.95
    edges = np.asarray(skin.vertices)[np.asarray(skin.triangles)] - np.asarray(skin.vertices).mean(axis=0)
    assert np.ptp(edges, axis=1).max() < 0.05  # triangles still join neighbours
    _, columns, table = table_of(tmp_path / "angles.mot")
    assert np.isnan(table[:, columns.index("flexion")]).all()
    assert np.isfinite(np.delete(table[:, columns.index("elbow_flexion")], LOST)).all()
    with (tmp_path / "angles.csv").open(newline="") as file:
        assert {row["flexion"] for row in csv.DictReader(file)} == {"nan"}


def test_centres_that_are_not_known_are_nan_and_no_cell_is_empty(tmp_path, limb, motion):
    shown = motion.shown & [name == "hand" for name in motion.transforms]
    _, centres = bones_and_centres(limb.subject, motion.thetas, shown)
    assert all(np.isnan(centre).all() for centre in centres.values())
    shown[5] = True
    _, centres = bones_and_centres(limb.subject, motion.thetas, shown)
    write_trc(tmp_path / "c.trc", motion.times, centres)
    rows = [line.split("\t") for line in (tmp_path / "c.trc").read_text().split("\n")[6:] if line]
    assert {len(row) for row in rows} == {2 + 3 * len(centres)}
    assert ["nan" not in row for row in rows] == [t == 5 for t in range(len(rows))]
    assert set(rows[4][2:]) == {"nan"}


def test_a_chart_has_a_gap_where_an_angle_is_not_known(tmp_path, limb, motion, monkeypatch):
    from matplotlib.axes import Axes

    drawn = []
    plot = Axes.plot
    monkeypatch.setattr(Axes, "plot", lambda self, *given, **how: drawn.append(given[1]) or plot(self, *given, **how))
    plot_angles(hand_hidden(motion, limb), limb.subject.anatomy, tmp_path / "angles.png")
    assert [bool(np.isfinite(line).any()) for line in drawn] == [True, True, False, False]  # elbow, forearm, wrist


def test_the_summary_names_bones_that_did_not_show(limb, motion, capsys):
    print_motion(hand_hidden(motion, limb), limb.subject)
    said = capsys.readouterr().out
    assert "11 of 12 frames tracked" in said
    assert "hand does not show in 11 of the frames tracked" in said
    assert "ulna" not in said


@pytest.mark.parametrize(("frame", "said"), [(LOST, "was lost: nobody, there"), (12, "frames run from 0 to 11")])
def test_a_frame_that_cannot_be_exported_leaves_nothing_behind(tmp_path, limb, motion, frame, said):
    with pytest.raises(MotionError, match=said):
        export_motion(motion, limb.subject, tmp_path / "out", frame=frame)
    assert not (tmp_path / "out").exists()


def test_a_motion_is_not_exported_with_a_subject_of_another_anatomy(tmp_path, limb, motion):
    with pytest.raises(MotionError, match="anatomy"):
        export_motion(replace(motion, anatomy="leg"), limb.subject, tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_a_motion_folder_agrees_with_itself(tmp_path, limb, motion):
    thorax = np.eye(4)
    write_motion_folder(motion, limb.subject, tmp_path, world_from_thorax=thorax)
    assert {path.name for path in tmp_path.iterdir()} == {"motion.npz", "angles.mot", "centres.trc", "quality.csv"}
    _, names, table = table_of(tmp_path / "angles.mot")
    assert {"thoracohumeral_plane_of_elevation", "thoracohumeral_elevation"} <= set(names)
    elevation = table[0, names.index("thoracohumeral_elevation")]
    up = exp_so3(motion.thetas[0, :3])[:, 1]
    assert elevation == pytest.approx(np.rad2deg(np.arccos(up[1])), abs=1e-5)
    centres = joint_centres(limb.subject.body, motion.thetas[4])
    for name, centre in load_motion(tmp_path).centres.items():
        np.testing.assert_allclose(centre[4], centres[name])


def test_a_motion_table_moves_the_named_coordinates_only(tmp_path, limb):
    path, body = tmp_path / "motion.csv", limb.subject.body
    path.write_text("﻿# a comment\ntime, elbow_flexion ,mood\n0,0.5,1\n\n0.1,0.6,2\n", encoding="utf-8")
    path.write_text(path.read_text(encoding="utf-8").replace("﻿# a comment\n", "﻿"), encoding="utf-8")
    performance = read_motion_table(path, body)
    np.testing.assert_array_equal(performance.times, [0.0, 0.1])
    i = body.anatomy.coordinate_index("elbow_flexion")
    np.testing.assert_array_equal(performance.thetas[:, i], [0.5, 0.6])
    np.testing.assert_array_equal(performance.thetas[0, :6], rest_theta(body)[:6])


@pytest.mark.parametrize(
    "text",
    [
        "",
        "time,mood\n0,1\n",
        "elbow_flexion\n0\n",
        "time,elbow_flexion\n",
        "time,elbow_flexion\n0,x\n",
        "time,elbow_flexion\n0,nan\n",
        "time,elbow_flexion\n0,1\n0,2\n",
        "time,elbow_flexion\n0,1\n1\n",
        "time,elbow_flexion,pro_sup\n0,1\n0.1,2\n0.2,3\n",
    ],
    ids=["empty", "unknown", "no time", "no rows", "words", "nan", "times", "ragged", "rows too short alike"],
)
def test_a_motion_table_that_makes_no_sense_is_refused(tmp_path, limb, text):
    (tmp_path / "motion.csv").write_text(text)
    with pytest.raises(PerformanceError, match=r"motion\.csv"):
        read_motion_table(tmp_path / "motion.csv", limb.subject.body)


def test_tables_are_performed_at_their_liveliest_one_after_the_other(limb, tmp_path):
    body = limb.subject.body
    elbow = body.anatomy.coordinate_index("elbow_flexion")
    time = np.arange(0.0, 4.0, 0.02)
    still_then_bending = np.where(time < 2.0, 0.5, 0.5 + 0.5 * np.sin(np.pi * (time - 2.0)))
    path = tmp_path / "table.csv"
    rows = ["time,elbow_flexion", *(f"{t:.3f},{angle:.5f}" for t, angle in zip(time, still_then_bending, strict=True))]
    path.write_text("\n".join(rows), encoding="utf-8")
    performance = perform_tables(body, [path, path], seconds_each=1.0, fps=30.0)
    assert len(performance.times) == 30 + 10 + 30
    np.testing.assert_allclose(np.diff(performance.times), 1.0 / 30.0)
    for part in (performance.thetas[:30, elbow], performance.thetas[-30:, elbow]):
        assert np.ptp(part) > 0.45


@pytest.mark.parametrize("unseen", [5, "hand", ["tail"], [["hand"]]])
def test_a_subject_whose_unseen_bones_are_none_of_its_anatomy_is_refused(tmp_path, limb, unseen):
    was = limb.subject
    report = was.report | {"bones_never_seen": unseen}
    save_subject(replace(was, report=report), tmp_path / "subject.npz")
    with pytest.raises(AnatomyError, match="not a subject file"):
        load_subject(tmp_path / "subject.npz")


@pytest.mark.parametrize("more", [[], ["--subject", "nobody.npz"]])
def test_a_recording_is_not_exported_as_if_it_were_a_motion(limb, tmp_path, more):
    result = CliRunner().invoke(export_command, [str(limb.recording.path), "--out", str(tmp_path / "out"), *more])
    assert "is a recording, not a motion; make one with `bonetrack track`" in str(result.exception)
    assert not (tmp_path / "out").exists()
