"""What version 0.1.0 wrote in November (commit b072a01) is read; a run that it left cut short is said to begin anew.

Its subjects and motions are made here, as it laid them out: reports and settings told less. The journal is its own,
after one frame.
"""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result

from adapt.adapt_to_file import adapt_into, journal_path
from adapt.options import AdaptOptions
from adapt.subject import save_subject
from capture.errors import FitError
from capture.journal import BEGUN_ANEW
from tests.known_limb import KnownLimb
from tests.known_motion import known_motion, reported_subject
from track.accuracy.commands import evaluate_command
from track.commands import track_command
from track.export.commands import export_command
from track.motion import load_motion, save_motion
from track.settings import Settings
from track.track_recording import JOURNAL
from track.view.commands import report_command
from track.view.scene import open_scene

OLDER_JOURNAL = Path(__file__).parent / "older_files" / "frames.jsonl"
VERSIONS = {"Python": "3.11.7", "bonetrack": "0.1.0"}
REGION = {"region": "automatic", "region_minimum_m": [-2.0, -2.0, -2.0], "region_maximum_m": [2.0, 2.0, 2.0]}
ADAPTED = {"example_poses": 6, "frames_given": None, "first_poses_given": []}
TRACKED = {"poses_by_hand": [], "world_from_thorax": None}
THRESHOLDS = {"sampled_vertices": 2000, "largest_residual_m": 0.006, "least_coverage": 0.75, "back_to_rest_s": 1.0}


@pytest.fixture(scope="module")
def older(limb: KnownLimb, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with ``subject.npz`` and ``motion/`` as they were."""
    folder, where = tmp_path_factory.mktemp("older"), {"recording": limb.recording.path.name} | REGION
    report = reported_subject(limb).report | {
        "unseen_noise_mm": None,
        "settings": {"versions": VERSIONS} | where | ADAPTED,
    }
    save_subject(replace(limb.subject, report=report), folder / "subject.npz")
    _as_of_version_2(folder / "subject.npz")
    settings = Settings(VERSIONS, where | TRACKED, THRESHOLDS)
    (folder / "motion").mkdir()
    save_motion(replace(known_motion(limb), settings=settings), folder / "motion")
    return folder


def _as_of_version_2(path: Path) -> None:
    """The digest stays: the limb is made of today's template. Subjects of the former one: ``test_own_anatomy``."""
    with np.load(path) as arrays:
        kept = dict(arrays)
    told = json.loads(str(kept["description"])) | {"version": 2}
    np.savez_compressed(path, **(kept | {"description": np.array(json.dumps(told))}))


def run(command, *arguments: object) -> Result:
    result = CliRunner().invoke(command, [str(argument) for argument in arguments])
    assert result.exit_code == 0, result.exception
    return result


def test_the_files_are_laid_out_as_they_were(older: Path) -> None:
    kept = [
        json.loads(str(np.load(path)["description"])) for path in (older / "subject.npz", older / "motion/motion.npz")
    ]
    assert [(one["format"], one["version"]) for one in kept] == [("bonetrack-subject", 2), ("bonetrack-motion", 2)]
    settings = kept[0]["report"]["settings"], kept[1]["settings"]["options"]
    for what in settings:
        assert not {"recording_fingerprint", "frames_used", "mended", "left_out", "subject_fingerprint"} & set(what)
    assert not {"side", "left_out", "bones_never_seen"} & set(kept[0]["report"])


def test_an_older_subject_and_motion_are_exported_and_evaluated(older: Path, limb: KnownLimb, tmp_path: Path) -> None:
    motion, subject = older / "motion", older / "subject.npz"
    run(export_command, subject, "--out", tmp_path / "subject")
    run(export_command, motion, "--subject", subject, "--gltf", "--frame", 2, "--out", tmp_path / "motion")
    assert (tmp_path / "motion" / "motion.glb").is_file()
    run(evaluate_command, motion, "--truth", limb.recording.path, "--subject", subject)


def test_an_older_subject_and_motion_are_viewed_and_reported(older: Path, limb: KnownLimb, tmp_path: Path) -> None:
    pytest.importorskip("plotly", reason="the report needs plotly")
    motion, subject = older / "motion", older / "subject.npz"
    for source, of in ((subject, None), (motion, subject)):
        assert open_scene(source, subject=of, recording=limb.recording.path).subject is not None
    run(report_command, motion, "--subject", subject, "--out", tmp_path / "report.html")
    assert "0.1.0" in (tmp_path / "report.html").read_text()


def test_an_older_subject_is_tracked_and_tracking_that_was_cut_short_begins_anew(
    older: Path, limb: KnownLimb, tmp_path: Path
) -> None:
    (tmp_path / "motion").mkdir()
    shutil.copy(OLDER_JOURNAL, tmp_path / "motion" / JOURNAL)
    command = [limb.recording.path, "--subject", older / "subject.npz", "--out", tmp_path / "motion"]
    assert run(track_command, *command).output.count(f"{tmp_path / 'motion' / JOURNAL}: {BEGUN_ANEW}\n") == 1
    assert len(load_motion(tmp_path / "motion").times) == len(limb.times)
    assert BEGUN_ANEW not in run(track_command, *command).output


def test_an_adaptation_that_was_cut_short_begins_anew(limb: KnownLimb, tmp_path: Path) -> None:
    out, told = tmp_path / "subject.npz", []
    shutil.copy(OLDER_JOURNAL, journal_path(out))
    with pytest.raises(FitError):  # of too few frames: told before that
        adapt_into(out, limb.recording, limb.subject.anatomy, AdaptOptions(frames=[0]), told=told.append)
    assert told == [f"{journal_path(out)}: {BEGUN_ANEW}"]
