"""No command deletes or replaces what it did not write; what it wrote itself it writes again."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import pytest

from adapt.adapt_to_file import adapt_into, journal_path
from adapt.anatomy_file import load_anatomy
from adapt.subject import save_subject
from capture.errors import OutputError
from capture.own import PNG, arrays_of, json_of, marked_png, page_of, refuse_foreign, replaced_if_own, table_of, words
from capture.recording import RecordingWriter, Sensor, open_recording
from tests.command_line import bonetrack
from tests.known_limb import ANATOMY, KnownLimb
from tests.known_motion import known_motion, reported_subject
from tests.test_cli import fails
from tests.test_recording import CAMERA
from track.batch.items import Item
from track.batch.run_batch import TABLE, run_batch
from track.batch.work import Row
from track.demo import _draw
from track.poses_by_hand import write_poses
from track.track_recording import track_recording, write_motion_folder
from track.view.render import save_png

REMEDY = "move it away, or give another"


@dataclass(frozen=True)
class Made:
    """A recording, a subject and a motion that commands can start from."""

    recording: Path
    subject: Path
    motion: Path


@pytest.fixture(scope="module")
def made(limb: KnownLimb, tmp_path_factory: pytest.TempPathFactory) -> Made:
    folder = tmp_path_factory.mktemp("made")
    shutil.copytree(limb.recording.path, folder / "rec")
    save_subject(reported_subject(limb), folder / "subject.npz")
    (folder / "motion").mkdir()
    write_motion_folder(known_motion(limb), limb.subject, folder / "motion")
    return Made(folder / "rec", folder / "subject.npz", folder / "motion")


Command = Callable[[Made, Path], tuple[object, ...]]
"""The command line that writes a file, or the folder it stands in."""

OF_FILES: dict[str, Command] = {
    "cloud.ply": lambda m, out: ("fuse", m.recording, "--frame", 1, "--out", out),
    "errors.json": lambda m, out: ("evaluate", m.motion, "--truth", m.recording, "--subject", m.subject, "--out", out),
    "report.html": lambda m, out: ("report", m.motion, "--subject", m.subject, "--out", out),
    "film.mp4": lambda m, out: ("movie", m.motion, "--subject", m.subject, "--width", 160, "--out", out),
    "scene.html": lambda m, out: ("view", m.motion, "--subject", m.subject, "--html", out),
}

MOTION_FILES = ("angles.mot", "angles_radians.mot", "coordinates.sto", "centres.trc", "markers.trc", "motion.glb")
MOTION_FILES += tuple(f"{name}.{kind}" for name in ("angles", "centres", "bones") for kind in ("csv", "parquet"))
MOTION_FILES += ("skin_00001.ply", "hand_00001.ply", "motion.usdc", "motion.bvh", "motion.c3d")
SUBJECT_FILES = ("skin.ply", "hand.ply", f"{ANATOMY}.osim", "Geometry/hand.obj", "Geometry/hand.obj.ply")


def exports_motion(m: Made, out: Path) -> tuple[object, ...]:
    files = ("--gltf", "--usd", "--bvh", "--gaps", "bridge", "--c3d", "--parquet")
    return ("export", m.motion, "--subject", m.subject, "--frame", 1, *files, "--out", out)


def exports_subject(m: Made, out: Path) -> tuple[object, ...]:
    return ("export", m.subject, "--out", out)


def tracks(m: Made, out: Path) -> tuple[object, ...]:
    return ("track", m.recording, "--subject", m.subject, "--out", out)


IN_FOLDERS: list[tuple[Command, str]] = [
    *((exports_motion, name) for name in MOTION_FILES),
    *((exports_subject, name) for name in SUBJECT_FILES),
    *((tracks, name) for name in ("motion.npz", "angles.mot", "centres.trc", "quality.csv", "frames.jsonl")),
    (lambda m, out: ("adapt", m.recording, "--anatomy", ANATOMY, "--out", out / "subject.npz"), "subject.npz"),
    (
        lambda m, out: ("adapt", m.recording, "--anatomy", ANATOMY, "--out", out / "subject.npz"),
        "subject.npz.partial-journal",
    ),
    (lambda m, out: ("batch", m.recording.parent, "--anatomy", ANATOMY, "--out", out), TABLE),
    (lambda m, out: ("demo", "--out", out), "subject.npz"),
    (lambda m, out: ("demo", "--out", out), "errors.json"),
    (lambda m, out: ("demo", "--out", out), "angles.png"),
]


def by_another(path: Path) -> None:
    """Write a file of the same kind as other programs do."""
    path.parent.mkdir(parents=True, exist_ok=True)
    mesh = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"
    corners = "0 0 0\n1 0 0\n0 1 0\n"
    texts = {
        ".ply": "ply\nformat ascii 1.0\ncomment Created by Open3D\nelement vertex 3\nproperty float x\n"
        f"property float y\nproperty float z\nend_header\n{corners}",
        ".obj": f"# Blender\n{mesh}",
        ".json": '{"format": "mine", "frames": 3}\n',
        ".html": "<!doctype html>\n<html>\n<head>\n<title>bonetrack: my notes</title>\n</head>\n<body></body></html>\n",
        ".mot": "Coordinates\nversion=1\nnRows=1\nnColumns=2\ninDegrees=yes\n\nendheader\ntime\telbow\n0\t1\n",
        ".sto": "coordinates\nDataType=double\nversion=3\nOpenSimVersion=4.6\ninDegrees=no\nendheader\ntime\ta\n0\t1\n",
        ".trc": f"PathFileType\t4\t(X/Y/Z)\t{path.name}\nDataRate\tCameraRate\tNumFrames\n100\t100\t1\n",
        ".csv": "time_s,what_i_measured\n0,1\n",
        ".osim": "<?xml version='1.0'?>\n<OpenSimDocument Version='40000'><Model name='mine'/></OpenSimDocument>\n",
        ".jsonl": '{"my": "log"}\n',
        ".partial-journal": "notes\n",
        ".usdc": "#usda 1.0\n",
        ".mp4": "\0\0\0\x20ftypisom\n",
        ".bvh": "HIERARCHY\nROOT Hips\n{\n\tOFFSET 0.0 0.0 0.0\n\tCHANNELS 3 Zrotation Xrotation Yrotation\n",
        ".c3d": "\2P MANUFACTURER SOFTWARE Nexus\n",
    }
    if path.suffix in texts:
        path.write_text(texts[path.suffix], encoding="utf-8")
    elif path.suffix == ".npz":
        np.savez(path, description=np.array(json.dumps({"format": "mine"})), shape=np.zeros(3))
    elif path.suffix == ".png":
        cv2.imwrite(str(path), np.zeros((4, 4, 3), np.uint8))
    elif path.suffix == ".glb":
        path.write_bytes(b'glTF\2\0\0\0\x50\0\0\0\x3c\0\0\0JSON{"asset":{"version":"2.0","generator":"Blender"}}   ')
    else:
        parquet = pytest.importorskip("pyarrow.parquet")
        import pyarrow

        parquet.write_table(pyarrow.table({"time_s": [0.0]}), str(path))


def refused(kept: Path, *command: object) -> None:
    before, beside = kept.read_bytes(), sorted(kept.parent.iterdir())
    line = fails(*command, saying=REMEDY)
    assert str(kept) in line, line
    assert kept.read_bytes() == before
    assert sorted(kept.parent.iterdir()) == beside  # nothing is done by halves


@pytest.mark.parametrize("name", OF_FILES)
def test_a_foreign_file_is_kept_and_an_own_one_replaced(made: Made, tmp_path: Path, name: str) -> None:
    out = tmp_path / name
    command = OF_FILES[name](made, out)
    by_another(out)
    refused(out, *command)
    out.unlink()
    out.mkdir()
    assert str(out) in fails(*command, saying="is a folder, not a file")
    out.rmdir()
    out.touch()  # an empty file is nobody's work
    for _ in range(2):
        ran = bonetrack(*command)
        assert ran.code == 0, ran
        assert out.stat().st_size


@pytest.mark.parametrize(("command", "name"), IN_FOLDERS)
def test_a_foreign_file_in_the_folder_is_kept(made: Made, tmp_path: Path, command: Command, name: str) -> None:
    by_another(tmp_path / "out" / name)
    refused(tmp_path / "out" / name, *command(made, tmp_path / "out"))


@pytest.mark.parametrize("command", [exports_motion, exports_subject])
def test_what_was_exported_is_exported_again(made: Made, tmp_path: Path, command: Command) -> None:
    pytest.importorskip("pyarrow")
    out = tmp_path / "out"
    contents = []
    (tmp_path / "out").mkdir()
    (out / "notes.txt").write_text("mine")
    for _ in range(2):
        ran = bonetrack(*command(made, out))
        assert ran.code == 0, ran
        contents.append({path: path.read_bytes() for path in out.rglob("*") if path.is_file()})
    assert contents[0] == contents[1]
    names = MOTION_FILES if command is exports_motion else SUBJECT_FILES
    assert {out / name for name in names} <= set(contents[0])


def test_a_motion_is_tracked_again_into_its_folder(limb: KnownLimb, made: Made, tmp_path: Path) -> None:
    recording = open_recording(made.recording)
    (tmp_path / "motion").mkdir()
    write_motion_folder(known_motion(limb), limb.subject, tmp_path / "motion")
    (tmp_path / "motion" / ".angles.partial-7.mot").write_text("cut sh")
    motion = track_recording(recording, limb.subject, tmp_path / "motion")
    assert motion.tracked.all()
    assert not list((tmp_path / "motion").glob(".*"))


def test_a_motions_folder_with_hidden_files_of_others_is_not_touched(made: Made, tmp_path: Path) -> None:
    strange = tmp_path / "out" / ".thesis.partial-1.txt"
    strange.parent.mkdir()
    strange.write_text("mine")
    fails(*tracks(made, tmp_path / "out"), saying="holds .thesis.partial-1.txt, which is not a motion's")
    assert strange.read_text() == "mine"


def test_a_subject_is_adapted_again_into_its_file(limb: KnownLimb, made: Made, tmp_path: Path, monkeypatch) -> None:  # type: ignore[no-untyped-def]
    monkeypatch.setattr("adapt.adapt_to_file.adapt_recording", lambda *_, **__: limb.subject)
    out = tmp_path / "subject.npz"
    others = [tmp_path / name for name in (".subject.old.partial-1.npz", ".subject-of-mine.partial-journal")]
    for other in others:
        other.write_text("mine")
    recording, anatomy = open_recording(made.recording), load_anatomy(ANATOMY)
    for _ in range(2):
        (tmp_path / ".subject.partial-3.npz").write_bytes(b"cut sh")
        journal_path(out).write_text("0" * 64 + "\n")
        adapt_into(out, recording, anatomy)
        assert sorted(tmp_path.iterdir()) == sorted([out, *others])


def test_the_table_of_a_batch_is_written_again(tmp_path: Path, monkeypatch) -> None:  # type: ignore[no-untyped-def]
    monkeypatch.setattr("track.batch.run_batch.finished", lambda item, folder: Row(item.name, frames=3))
    for _ in range(2):
        tmp_path.joinpath("out").mkdir(exist_ok=True)
        run_batch([Item("one", tmp_path / "one", ANATOMY)], tmp_path / "out")
    assert (tmp_path / "out" / TABLE).read_text().splitlines()[1].startswith("one,3,")


@pytest.mark.parametrize("content", ['{"mine": 1}', "[1, 2]", "no JSON"])
def test_a_batch_works_in_no_folder_that_is_not_its_own(made: Made, tmp_path: Path, content: str) -> None:
    kept = tmp_path / "out" / "rec" / "item.json"
    kept.parent.mkdir(parents=True)
    kept.write_text(content)
    ran = bonetrack("batch", made.recording.parent, "--anatomy", ANATOMY, "--out", tmp_path / "out")
    assert ran.code == 1
    assert "unexpected" not in ran.err
    assert [path.name for path in kept.parent.iterdir()] == ["item.json"]
    assert kept.read_text() == content


def test_a_calibration_of_others_is_kept_and_an_own_one_replaced(made: Made, tmp_path: Path) -> None:
    shutil.copytree(made.recording, tmp_path / "rec")
    kept = tmp_path / "rec" / "calibration.json"
    assert bonetrack("calibrate", tmp_path / "rec").code == 0
    kept.write_text('{"cameras": "mine"}')
    line = fails("calibrate", tmp_path / "rec", saying="calibration.json")
    assert str(kept) in line
    assert kept.read_text() == '{"cameras": "mine"}'


def test_poses_are_not_saved_into_a_file_of_others(limb: KnownLimb, tmp_path: Path) -> None:
    by_another(tmp_path / "poses.json")
    before = (tmp_path / "poses.json").read_bytes()
    with pytest.raises(OutputError, match=r"poses\.json"):
        write_poses(tmp_path / "poses.json", limb.subject.anatomy, [])
    assert (tmp_path / "poses.json").read_bytes() == before


def records(path: Path, *names: str, overwrite: bool = True, frames: int = 2) -> None:
    sensors = [Sensor(name, CAMERA) for name in names]
    with RecordingWriter(path, sensors=sensors, created_by="test", overwrite=overwrite) as writer:
        for name in names:
            for k in range(frames):
                writer.add_frame(name, np.ones((30, 40)), float(k))


def contents(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.mark.parametrize(
    "foreign",
    [
        {"recording.json": '{"format": "mine", "sensors": [{"name": "s"}]}', "s/000000.png": "mine"},
        {"recording.unfinished.json": "{}"},
        {".recording.partial-1.json": "mine", "notes.txt": "mine"},
    ],
)
@pytest.mark.parametrize("command", ["import", "simulate", "record"])
def test_a_recording_is_made_in_no_folder_of_others(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, foreign: dict[str, str], command: str
) -> None:
    for name, text in foreign.items():
        (tmp_path / "rec" / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / "rec" / name).write_text(text)
    before = contents(tmp_path / "rec")
    out = ("--out", tmp_path / "rec", "--overwrite")
    if command == "import":
        (tmp_path / "raw").mkdir()
        cv2.imwrite(str(tmp_path / "raw" / "0.png"), np.full((48, 64), 900, np.uint16))
        line = fails("import", tmp_path / "raw", "--fx", 60, *out, saying="not a recording")
    elif command == "simulate":
        np.savez(tmp_path / "mesh.npz", vertices=np.eye(3)[None], faces=np.array([[0, 1, 2]]), fps=30.0)
        line = fails("simulate", "--mesh", tmp_path / "mesh.npz", *out, saying="not a recording")
    else:
        from tests.test_live import Player

        with Player() as device:
            monkeypatch.setattr("capture.live.connected", lambda _: [device])
            line = fails("record", "--seconds", 0.2, *out, saying="not a recording")
    assert str(tmp_path / "rec") in line
    assert contents(tmp_path / "rec") == before


def test_of_a_recording_that_is_replaced_only_its_own_files_go(tmp_path: Path) -> None:
    path = tmp_path / "rec"
    records(path, "left")
    (path / "left" / "frames.csv").write_text("file,time_s\nfrom-another-tool.png,0\n../outside.png,1\n")
    mine = ("notes.txt", "outside.png", "left/plot.png", "left/file", "left/colour-of-the-sky.jpg")
    for name in (*mine, "left/from-another-tool.png", "left/box-000003.png", "left/colour-000001.jpg"):
        (path / name).write_text("mine")
    records(path, "left", frames=1)
    own = {"recording.json", "left/frames.csv", "left/000000.png"}
    assert set(contents(path)) == own | set(mine)


@pytest.mark.parametrize("source", ["left", "."])
def test_a_recording_is_not_replaced_by_what_is_read_from_it(tmp_path: Path, source: str) -> None:
    records(tmp_path / "rec", "left")
    before = contents(tmp_path / "rec")
    command = ("import", tmp_path / "rec" / source, "--fx", 60, "--out", tmp_path / "rec", "--overwrite")
    fails(*command, saying="lies in the folder that is to be written")
    assert contents(tmp_path / "rec") == before


@pytest.mark.parametrize("name", ["right/000000.png", "right/frames.csv", "truth.npz", "calibration.json"])
def test_a_recording_is_not_replaced_where_a_file_of_others_is_in_the_way(tmp_path: Path, name: str) -> None:
    path = tmp_path / "rec"
    records(path, "left")
    (path / name).parent.mkdir(exist_ok=True)
    (path / name).write_text("mine")
    before = contents(path)
    with pytest.raises(Exception, match=Path(name).name) as told:
        records(path, "left", "right")
    assert str(path / name) in str(told.value)
    assert contents(path) == before


def test_a_page_is_replaced_by_one_of_the_same_title(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text("# How fast\n\nold\n")
    assert page_of("# How fast\n\nnew\n").is_on(page)
    assert not page_of("# How fast it was\n").is_on(page)
    assert not page_of("# How\n").is_on(page)


def test_marks_tell_own_files_by_a_few_kilobytes(tmp_path: Path) -> None:
    late = tmp_path / "late.txt"
    late.write_bytes(b" " * 20_000 + b"written by bonetrack")
    assert not words("written by bonetrack").is_on(late)
    (tmp_path / "a.csv").write_text("a,b,c\n1,2,3\n")
    assert table_of(["a", "b", "c"]).is_on(tmp_path / "a.csv")
    assert not table_of(["a", "b"]).is_on(tmp_path / "a.csv")
    (tmp_path / "a.json").write_text('{"format":"bonetrack-x"}')
    assert json_of("bonetrack-x").is_on(tmp_path / "a.json")
    assert not json_of("bonetrack").is_on(tmp_path / "a.json")
    np.savez(tmp_path / "a.npz", description=np.array(json.dumps({"format": "x", "rest": "y" * 50_000})))
    assert arrays_of("x").is_on(tmp_path / "a.npz")
    assert not arrays_of("x").is_on(tmp_path / "a.json")
    assert not arrays_of("x").is_on(tmp_path / "none.npz")


def test_a_marked_image_is_the_same_image(tmp_path: Path) -> None:
    image = np.arange(48, dtype=np.uint8).reshape(4, 4, 3)
    _, encoded = cv2.imencode(".png", image)
    (tmp_path / "a.png").write_bytes(marked_png(encoded.tobytes()))
    assert PNG.is_on(tmp_path / "a.png")
    np.testing.assert_array_equal(cv2.imread(str(tmp_path / "a.png")), image)
    from PIL import Image

    with Image.open(tmp_path / "a.png") as read:
        read.verify()
        assert read.info["Software"] == "bonetrack"


def test_what_is_no_plain_file_is_not_replaced(tmp_path: Path) -> None:
    (tmp_path / "link").symlink_to(tmp_path / "nowhere")
    with pytest.raises(OutputError, match="link"), replaced_if_own(tmp_path / "link", PNG):
        pytest.fail("would have been written")
    with pytest.raises(OutputError, match="null"):
        refuse_foreign(Path("/dev/null"), PNG)


def test_pictures_bear_the_mark_and_the_demo_keeps_those_of_others(
    limb: KnownLimb, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    motion, recording = known_motion(limb), limb.recording
    monkeypatch.setattr("track.demo.picture_fit", lambda *told, **_: save_png(np.zeros((4, 4, 3), np.uint8), told[3]))
    for _ in range(2):
        pictures = _draw(recording, limb.subject, motion, tmp_path)
        assert len(pictures) > 1
        assert all(PNG.is_on(path) for path in pictures)
    by_another(pictures[-1])
    before = pictures[-1].read_bytes()
    with pytest.raises(OutputError, match=pictures[-1].name):
        _draw(recording, limb.subject, motion, tmp_path)
    assert pictures[-1].read_bytes() == before
