"""The command line: the whole chain on a small recording, and one clear line for everything that is wrong."""

from __future__ import annotations

import csv
import json
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from adapt.anatomy_file import load_anatomy
from adapt.subject import load_subject, save_subject
from capture.recording import open_recording
from capture.recording.depth_png import write_readings
from capture.rigid import inverse
from tests.command_line import bonetrack
from tests.known_limb import ANATOMY, bending_and_twisting
from track.accuracy.truth import read_truth, world_from_common
from track.demo import samples
from track.evaluation.known import carried
from track.motion import load_motion
from track.poses_by_hand import HandPose, write_poses

FRAMES = 8


def fails(*arguments, saying: str) -> str:
    """The command ends with code 1 and exactly one line on standard error that says so, without a traceback."""
    ran = bonetrack(*arguments)
    assert ran.code == 1, ran
    lines = ran.err.splitlines()
    assert len(lines) == 1, ran.err
    assert lines[0].startswith("error: "), lines
    assert "Traceback" not in ran.err
    assert "unexpected" not in ran.err
    assert saying in lines[0], lines[0]
    assert "; " in lines[0], f"does not say what to do: {lines[0]}"
    return lines[0]


def write_motion_table(path: Path, anatomy) -> None:
    from adapt.model.body import make_body

    performance = bending_and_twisting(make_body(anatomy), count=FRAMES, swing=1.0)
    names = [c.name for c in anatomy.coordinates]
    moving = [names.index(n) for n in ("elbow_flexion", "pro_sup", "deviation", "flexion")]
    with path.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["time", *(names[i] for i in moving)])
        writer.writerows(
            [time, *theta[moving]] for time, theta in zip(performance.times, performance.thetas, strict=True)
        )


def write_first_poses(path: Path, recording_path: Path, anatomy, frames) -> None:
    """First poses near the truth, so that the chain need not search."""
    recording = open_recording(recording_path)
    truth = read_truth(recording)
    thetas = carried(truth.body.anatomy, truth.thetas, inverse(world_from_common(recording, truth)))
    with path.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["frame", *(c.name for c in anatomy.coordinates)])
        writer.writerows([frame, *(thetas[frame] + 0.01)] for frame in frames)


@pytest.fixture(scope="module")
def chain(arm, tmp_path_factory):
    """Everything from a motion table to exported files, each step by its command; what each said, and the folder."""
    folder = tmp_path_factory.mktemp("chain")
    write_motion_table(folder / "motion.csv", arm)
    said = {}

    def step(name, *arguments):
        said[name] = bonetrack(name, *arguments)
        assert said[name].code == 0, said[name]

    recording, subject, motion = folder / "rec", folder / "subject.npz", folder / "motion"
    step("simulate", "--anatomy", ANATOMY, "--motion", folder / "motion.csv", "--out", recording, "--seed", 5)
    step("calibrate", recording)
    step("fuse", recording, "--frame", 2, "--out", folder / "cloud.ply")
    frames = (0, 2, 3, 5)
    write_first_poses(folder / "first.csv", recording, arm, frames)
    chosen = ("--frames", ",".join(map(str, frames)), "--first-poses", folder / "first.csv", "--poses", len(frames))
    step("adapt", recording, "--anatomy", ANATOMY, "--out", subject, *chosen)
    step("track", recording, "--subject", subject, "--out", motion, "--anatomy", ANATOMY)
    step("evaluate", motion, "--truth", recording, "--subject", subject, "--out", folder / "errors.json")
    step("export", motion, "--subject", subject, "--frame", 1, "--gltf", "--out", folder / "exported")
    return folder, said


def test_the_whole_chain_runs_and_says_what_it_did(chain):
    folder, said = chain
    assert f"{FRAMES} frames by 2 sensors" in said["simulate"].out
    assert "residual" in said["calibrate"].out
    assert "points from 2 sensor(s)" in said["fuse"].out
    assert "subject written to" in said["adapt"].out
    assert f"{FRAMES} of {FRAMES} frames tracked" in said["track"].out
    assert "errors against the truth" in said["evaluate"].out
    assert "motion.glb: its skin is off the model's by" in said["export"].out
    assert all(not ran.err for ran in said.values())
    assert not list(folder.rglob("*partial*"))


def test_what_the_chain_wrote_is_right(chain):
    folder, _ = chain
    subject = load_subject(folder / "subject.npz", anatomy=ANATOMY)
    assert len(subject.thetas) == 4
    assert load_motion(folder / "motion").tracked.all()
    errors = json.loads((folder / "errors.json").read_text())
    assert (errors["frames"], errors["lost"]) == (FRAMES, 0)
    assert errors["errors"]["skin"]["mean"] < 10.0
    assert errors["errors"]["angle elbow_flexion"]["mean"] < 10.0
    exported = {path.name for path in (folder / "exported").iterdir()}
    assert {"angles.mot", "angles.csv", "centres.trc", "coordinates.sto", "skin_00001.ply", "motion.glb"} <= exported


def test_a_subject_is_exported_too(chain, tmp_path):
    ran = bonetrack("export", chain[0] / "subject.npz", "--out", tmp_path / "meshes")
    assert ran.code == 0
    written = {path.name for path in (tmp_path / "meshes").rglob("*")}
    assert {"skin.ply", "humerus.ply", f"{ANATOMY}.osim", "humerus.obj"} <= written


def test_a_left_limb_is_simulated_by_its_name(tmp_path):
    (tmp_path / "motion.csv").write_text("time,elbow_flexion\n0,1.0\n0.1,1.2\n")
    arguments = ("--anatomy", "upper-limb-left", "--motion", tmp_path / "motion.csv", "--out", tmp_path / "rec")
    assert bonetrack("simulate", *arguments, "--noise", "none").code == 0
    truth = read_truth(open_recording(tmp_path / "rec"))
    assert (truth.body.anatomy.name, truth.body.anatomy.side) == ("upper-limb-left", "left")


# ---- what is wrong is said in one line


@pytest.fixture
def recording(limb, tmp_path):
    """A copy of the small calibrated recording that a test may break."""
    shutil.copytree(limb.recording.path, tmp_path / "rec")
    return tmp_path / "rec"


@pytest.fixture
def subject(limb, tmp_path):
    save_subject(limb.subject, tmp_path / "subject.npz")
    return tmp_path / "subject.npz"


def header_of(recording: Path) -> dict:
    return json.loads((recording / "recording.json").read_text())


def rewrite(recording: Path, header: dict) -> None:
    (recording / "recording.json").write_text(json.dumps(header))


def first_image(recording: Path) -> Path:
    return open_recording(recording).sensors[0].frames[0].path


def adapt(recording, out, *more):
    return ("adapt", recording, "--anatomy", ANATOMY, "--out", out, "--frames", "0,1,2,3", "--poses", 4, *more)


@pytest.mark.parametrize("command", ["calibrate", "adapt", "track", "fuse", "evaluate"])
def test_a_folder_that_is_no_recording(tmp_path, subject, command):
    (tmp_path / "empty").mkdir()
    for name in ("empty", "nowhere"):
        folder, out = tmp_path / name, tmp_path / "out"
        arguments = {
            "calibrate": ("calibrate", folder),
            "adapt": adapt(folder, out),
            "track": ("track", folder, "--subject", subject, "--out", out),
            "fuse": ("fuse", folder, "--frame", 0, "--out", out),
            "evaluate": ("evaluate", tmp_path, "--truth", folder, "--subject", subject),
        }[command]
        said = fails(*arguments, saying="motion" if command == "evaluate" else name)
        assert "error: " in said
        assert not out.exists()


def test_a_truncated_image(recording, subject, tmp_path):
    image = first_image(recording)
    image.write_bytes(image.read_bytes()[:1000])
    said = fails(*adapt(recording, tmp_path / "out.npz", "--region", -1, -1, -1, 1, 1, 1), saying=str(image))
    assert "truncated" in said
    assert "copy it again" in said
    fails("track", recording, "--subject", subject, "--out", tmp_path / "motion", saying=str(image))
    assert not (tmp_path / "out.npz").exists()
    assert not (tmp_path / "motion" / "motion.npz").exists()


def test_an_image_of_another_size(recording, tmp_path):
    image = first_image(recording)
    write_readings(image, np.full((240, 320), 1000, np.uint16))
    said = fails(*adapt(recording, tmp_path / "out.npz"), saying=str(image))
    assert "320 x 240" in said
    assert not (tmp_path / "out.npz").exists()


def test_missing_intrinsics(recording, tmp_path):
    header = header_of(recording)
    cameras = [key for key, value in header["sensors"][0].items() if isinstance(value, dict) and "fx" in value]
    owner = header["sensors"][0][cameras[0]] if cameras else header["sensors"][0]
    del owner["fx"]
    rewrite(recording, header)
    said = fails(*adapt(recording, tmp_path / "out.npz"), saying="recording.json")
    assert "fx" in said


def test_an_empty_region(recording, tmp_path):
    empty = ("--region", 50, 50, 50, 51, 51, 51)
    for arguments in (
        adapt(recording, tmp_path / "out", *empty),
        ("fuse", recording, "--frame", 0, "--out", tmp_path / "out", *empty),
    ):
        said = fails(*arguments, saying="inside the region")
        assert "check the region" in said
        assert not (tmp_path / "out").exists()


def test_a_frame_that_a_motion_does_not_have(chain, tmp_path):
    folder, _ = chain
    arguments = ("export", folder / "motion", "--subject", folder / "subject.npz", "--frame", 999)
    said = fails(*arguments, "--out", tmp_path / "out", saying=str(folder / "motion"))
    assert "frames run from 0 to" in said


def test_no_box_in_view(recording):
    for sensor in open_recording(recording).sensors:
        for frame in sensor.box_frames:
            write_readings(frame.path, np.zeros((480, 640), np.uint16))
    before = (recording / "calibration.json").read_bytes()
    said = fails("calibrate", recording, saying=str(recording))
    assert "box" in said
    assert (recording / "calibration.json").read_bytes() == before


def test_a_box_of_the_wrong_size(recording):
    header = header_of(recording)
    header["box"]["size_m"] = [0.5, 0.3, 0.1]
    rewrite(recording, header)
    before = (recording / "calibration.json").read_bytes()
    said = fails("calibrate", recording, saying=str(recording))
    assert "box" in said
    assert (recording / "calibration.json").read_bytes() == before


def test_a_recording_that_nobody_calibrated(recording, subject, tmp_path):
    (recording / "calibration.json").unlink()
    said = fails("track", recording, "--subject", subject, "--out", tmp_path / "motion", saying=str(recording))
    assert "bonetrack calibrate" in said


def test_fewer_poses_than_needed(recording, tmp_path):
    arguments = ("adapt", recording, "--anatomy", ANATOMY, "--out", tmp_path / "out.npz")
    assert "at least 4" in fails(*arguments, "--frames", "0,1", saying=str(recording))
    assert "0 to 11" in fails(*arguments, "--frames", "0,1,2,99", saying=str(recording))
    assert not (tmp_path / "out.npz").exists()


def test_an_anatomy_that_does_not_exist(recording, tmp_path):
    said = fails("adapt", recording, "--anatomy", "tail", "--out", tmp_path / "o.npz", saying="tail")
    assert ANATOMY in said
    assert "upper-limb-left" in said


def test_a_subject_of_another_anatomy(recording, subject, tmp_path):
    arguments = ("track", recording, "--subject", subject, "--out", tmp_path / "motion", "--anatomy", "lower-limb-left")
    assert "adapt one with" in fails(*arguments, saying=str(subject))
    assert not (tmp_path / "motion").exists()


def test_a_missing_subject(recording, tmp_path):
    missing = tmp_path / "nobody.npz"
    assert "bonetrack adapt" in fails(
        "track", recording, "--subject", missing, "--out", tmp_path / "m", saying=str(missing)
    )
    assert "bonetrack adapt" in fails("export", missing, "--out", tmp_path / "e", saying=str(missing))
    assert not (tmp_path / "m").exists()
    assert not (tmp_path / "e").exists()


def test_something_else_than_a_motion_folder(recording, subject, tmp_path):
    (tmp_path / "empty").mkdir()
    for folder in (tmp_path / "empty", tmp_path / "nowhere", subject):
        said = fails("evaluate", folder, "--truth", recording, "--subject", subject, saying=str(folder))
        assert "bonetrack track" in said
    fails("export", tmp_path / "empty", "--subject", subject, "--out", tmp_path / "out", saying="empty")
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("text", ["time,mood\n0,1\n", "", "time,elbow_flexion\n0,fast\n"])
def test_a_motion_table_without_what_is_needed(tmp_path, text):
    (tmp_path / "m.csv").write_text(text)
    fails("simulate", "--anatomy", ANATOMY, "--motion", tmp_path / "m.csv", "--out", tmp_path / "r", saying="m.csv")
    assert not (tmp_path / "r").exists()
    missing = tmp_path / "none.csv"
    fails("simulate", "--anatomy", ANATOMY, "--motion", missing, "--out", tmp_path / "r", saying=str(missing))


def test_a_recording_without_truth_cannot_be_evaluated(chain, recording, limb):
    (recording / "truth.npz").unlink()
    folder, _ = chain
    said = fails(
        "evaluate", folder / "motion", "--truth", recording, "--subject", folder / "subject.npz", saying="truth"
    )
    assert "bonetrack simulate" in said


def test_a_truncated_truth(chain, recording):
    data = (recording / "truth.npz").read_bytes()
    (recording / "truth.npz").write_bytes(data[: len(data) // 2])
    folder, _ = chain
    fails("evaluate", folder / "motion", "--truth", recording, "--subject", folder / "subject.npz", saying="truth.npz")


@pytest.mark.parametrize(
    "arguments",
    [
        (),
        ("fly",),
        ("track",),
        ("track", "rec", "--subject", "s", "--out", "o", "--colour", "red"),
        ("adapt", "rec", "--anatomy", ANATOMY, "--out", "o", "--poses", "six"),
        ("simulate", "--out", "o"),
        ("simulate", "--out", "o", "--anatomy", ANATOMY),
        ("simulate", "--out", "o", "--mesh", "m.npz", "--noise", "loud"),
        ("simulate", "--out", "o", "--mesh", "m.npz", "--up", "+z"),
        ("simulate", "--out", "o", "--anatomy", "a", "--motion", "m", "--up", "+z", "--forward", "+x"),
    ],
)
def test_a_wrong_command_line_ends_with_code_2(arguments):
    ran = bonetrack(*arguments)
    assert ran.code == 2
    assert "Usage: bonetrack" in ran.err + ran.out
    assert "Traceback" not in ran.err


def test_a_folder_is_not_written_over_as_a_file_and_an_empty_one_is_no_motion(recording, tmp_path):
    fails(*adapt(recording, tmp_path), saying="is a folder, not a file")
    (tmp_path / "motion").mkdir()
    fails("export", tmp_path / "motion", "--out", tmp_path / "out", saying="no motion here")


def test_wrong_numbers_in_options_end_with_code_2(recording, subject, tmp_path):
    out = ("--out", tmp_path / "out")
    assert bonetrack("adapt", recording, "--anatomy", ANATOMY, *out, "--frames", "0,x").code == 2
    assert bonetrack("fuse", recording, "--frame", 0, *out, "--region", 1, 0, 0, 0, 1, 1).code == 2
    assert bonetrack("export", subject, "--gltf", *out).code == 2
    assert not (tmp_path / "out").exists()


def test_debug_shows_the_traceback(tmp_path):
    command = [sys.executable, "-c", "from track.cli import main; main()", "--debug", "calibrate", str(tmp_path)]
    ran = subprocess.run(command, capture_output=True, text=True)
    assert ran.returncode == 1
    assert "Traceback" in ran.stderr
    assert "RecordingError" in ran.stderr


def test_help_lists_every_command_and_loads_nothing_heavy():
    ran = bonetrack("--help")
    assert ran.code == 0
    for name in (
        "demo",
        "simulate",
        "import",
        "record",
        "calibrate",
        "fuse",
        "adapt",
        "track",
        "batch",
        "evaluate",
        "export",
    ):
        assert f"\n  {name} " in ran.out
        assert bonetrack(name, "--help").code == 0
    code = "import sys, track.cli; print(*{'numpy', 'scipy', 'open3d', 'cv2', 'igl', 'matplotlib'} & set(sys.modules))"
    loaded = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert not loaded.strip()


def test_a_demo_without_a_sample_says_which_there_are(tmp_path):
    said = fails("demo", "--anatomy", "upper-limb-left", "--out", tmp_path / "demo", saying="upper-limb-left")
    assert "upper-limb-right" in said
    assert not (tmp_path / "demo").exists()


def test_every_sample_recording_is_of_a_known_anatomy():
    assert {"upper-limb-right", "lower-limb-right"} <= set(samples())
    for anatomy, path in samples().items():
        assert load_anatomy(anatomy).name == anatomy
        assert read_truth(open_recording(path)).body.anatomy.name == anatomy


def test_tracking_starts_from_a_pose_set_by_hand(chain, tmp_path):
    folder, _ = chain
    anatomy, theta = load_subject(folder / "subject.npz").anatomy, load_motion(folder / "motion").thetas[3]
    write_poses(tmp_path / "poses.json", anatomy, [HandPose("here", 3, theta)])
    command = ("track", folder / "rec", "--subject", folder / "subject.npz", "--out", tmp_path / "motion", "--poses")
    ran = bonetrack(*command, tmp_path / "poses.json")
    assert ran.code == 0, ran
    assert "1 tracked from poses set by hand" in ran.out
    assert load_motion(tmp_path / "motion").how[3] == "by hand"
    fails(*command, tmp_path / "none.json", saying="cannot be read")


@pytest.mark.parametrize("foreign", ["notes.txt", "sensor1/000000.png"])
def test_a_demo_replaces_nothing_that_it_did_not_write(tmp_path, foreign):
    kept = tmp_path / "recording" / foreign
    kept.parent.mkdir(parents=True)
    kept.write_text("mine")
    (tmp_path / "motion").mkdir()
    (tmp_path / "motion" / "thesis.txt").write_text("mine, too")
    fails("demo", "--out", tmp_path, saying=f"holds {foreign}, which is not of the demo's sample")
    assert kept.read_text() == "mine"
    assert (tmp_path / "motion" / "thesis.txt").read_text() == "mine, too"
