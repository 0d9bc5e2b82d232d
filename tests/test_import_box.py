"""An imported recording knows which of its frames show the box, so that it can be calibrated and tracked."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result

from capture.commands import calibrate_command, import_command
from capture.errors import BonetrackError, RecordingError
from capture.importers import ShownBox
from capture.recording import Recording, open_recording, read_depth
from tests.known_limb import FPS, FRAMES, KnownLimb
from track.commands import track_command
from track.motion import load_motion

BOX = ("--box", 0.30, 0.20, 0.15)


def run(command, *arguments) -> Result:
    result = CliRunner().invoke(command, [str(argument) for argument in arguments])
    if isinstance(result.exception, BonetrackError):
        raise result.exception
    return result


def folders(recording: Recording, home: Path, *, pause: int = 1) -> list[Path]:
    """What plain programs would have left of a recording: a folder of PNG each; box, somebody's hand, the person."""
    made = []
    for sensor in recording.sensors:
        folder = home / sensor.name
        folder.mkdir(parents=True)
        frames = [*sensor.box_frames, *[sensor.frames[0]] * pause, *sensor.frames]
        for number, frame in enumerate(frames):
            shutil.copy(frame.path, folder / f"{number}.png")
        made.append(folder)
    return made


def plain(recording: Recording) -> tuple:
    """What plain images do not tell of their camera and clock."""
    camera = recording.sensors[0].camera
    return ("--fx", camera.fx, "--fy", camera.fy, "--fps", FPS, "--offset", 0)


def test_two_folders_are_imported_calibrated_and_tracked(limb: KnownLimb, tmp_path: Path) -> None:
    shown = len(limb.recording.sensors[0].box_frames)
    last, begins = (shown - 0.5) / FPS, (shown + 0.5) / FPS
    sources = folders(limb.recording, tmp_path / "from")
    times = ("--box-seconds", 0, last, "--seconds", begins, 1e3)
    out = tmp_path / "rec"
    said = run(import_command, *sources, "--out", out, *plain(limb.recording), *BOX, *times).output
    assert said.count(f"{FRAMES} frames of 640 x 480 px") == 2
    assert said.count(f"{shown} of the box") == 2
    assert run(calibrate_command, out).exit_code == 0
    run(track_command, out, "--subject", limb.recording.path.parent / "subject.npz", "--out", tmp_path / "motion")
    motion = load_motion(tmp_path / "motion")
    assert motion.tracked.all()
    elbow = limb.subject.anatomy.coordinate_index("elbow_flexion")
    assert np.rad2deg(np.abs(motion.thetas - limb.thetas)[:, elbow]).max() < 2.0


def test_the_box_may_come_from_files_of_its_own(limb: KnownLimb, tmp_path: Path) -> None:
    sensor = limb.recording.sensors[0]
    (both, _), box = folders(limb.recording, tmp_path / "all", pause=0), tmp_path / "box"
    box.mkdir()
    for frame in sensor.box_frames:
        shutil.move(both / f"{int(frame.path.stem[4:])}.png", box / frame.path.name)
    out, options = tmp_path / "rec", plain(limb.recording)
    run(import_command, both, "--out", out, *options, *BOX, "--box-source", box)
    (made,) = open_recording(out).sensors
    assert len(made.frames) == FRAMES
    assert [frame.time_s for frame in made.box_frames] == pytest.approx(np.arange(len(sensor.box_frames)) / FPS)
    assert np.array_equal(read_depth(made, made.box_frames[-1]), read_depth(sensor, sensor.box_frames[-1]))
    run(calibrate_command, out)
    assert open_recording(out).calibration is not None
    with pytest.raises(RecordingError, match="1 sensors need as many files of the box, not 2"):
        run(import_command, both, "--out", out, *options, *BOX, "--box-source", box, "--box-source", box)


@pytest.mark.parametrize(
    ("options", "saying"),
    [
        ((*BOX, "--box-seconds", 90, 91), "has no frames of the box, from 90 to 91 s; state --box-seconds .* ends at"),
        ((*BOX, "--box-seconds", 0, 99), "has no frames but those of the box; state other times"),
        ((*BOX, "--box-seconds", 0, 0.4, "--seconds", 50, 60), "has no frames of a person, from 50 to 60 s; state"),
        (BOX, "either when it is shown or files of it.*--box-seconds FROM TO, or --box-source"),
        (("--box", 0.3, 0.2, 0.195, "--box-seconds", 0, 1), "200 and 195 mm are too alike"),
    ],
)
def test_times_without_frames_and_boxes_half_told_are_one_clear_line(
    limb: KnownLimb, tmp_path: Path, options: tuple, saying: str
) -> None:
    source = folders(limb.recording, tmp_path / "from")[0]
    with pytest.raises(RecordingError, match=saying) as error:
        run(import_command, source, "--out", tmp_path / "rec", *plain(limb.recording), *options)
    assert "\n" not in str(error.value)


def test_wrong_options_are_refused_before_anything_is_read(tmp_path: Path) -> None:
    import_nothing = (import_command, tmp_path / "nothing", "--out", tmp_path / "rec")
    assert "its sides are needed" in run(*import_nothing, "--box-seconds", 0, 1).output
    assert "the first must be before" in run(*import_nothing, *BOX, "--box-seconds", 1, 0).output
    assert "the first must be before" in run(*import_nothing, "--seconds", 1, 1).output


def test_files_of_a_box_taken_by_another_camera_are_refused(limb: KnownLimb, tmp_path: Path) -> None:
    tum = Path(__file__).parent / "sensor_files"
    with pytest.raises(RecordingError, match=r"realsense.*another camera than 'sensor' or in another mode; give"):
        run(import_command, tum / "openni.oni", "--out", tmp_path / "rec", *BOX, "--box-source", tum / "realsense.db3")


def test_a_box_is_either_somewhere_in_the_recording_or_in_files_of_its_own() -> None:
    with pytest.raises(RecordingError, match="either"):
        ShownBox((0.3, 0.2, 0.1), seconds=(0.0, 1.0), paths=(Path("box"),))
