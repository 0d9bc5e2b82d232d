"""Options: one object has them for the command, the key of the journal, and the settings that a result keeps."""

from __future__ import annotations

from dataclasses import asdict, fields, replace

import click
import numpy as np
import pytest
from click.testing import CliRunner

from adapt.commands import adapt_command
from adapt.model.shape.population import Person
from adapt.options import AdaptOptions
from adapt.subject import save_subject
from capture.cloud.fuse import Region
from capture.commands.import_files import import_command
from capture.importers import ImportOptions
from track.commands import track_command
from track.motion import MotionError
from track.options import TrackOptions
from track.poses_by_hand import HandPose
from track.thresholds import Thresholds, thresholds_of
from track.tracker import make_tracker

NEAR_BY = Region(np.full(3, -1.0), np.full(3, 1.0))
ADAPT = {"poses": 5, "frames": [4, 2], "first_poses": {3: np.zeros(10)}, "region": NEAR_BY, "person": Person(1.8)}
TRACK = {"poses": [HandPose("raised", 1, np.zeros(10))], "thresholds": Thresholds(least_coverage=0.6)}
CHANGES_NO_POSE = {"world_from_thorax", "keep_searching"}
UNDER_ANOTHER_NAME = {
    "world_from_thorax": "thorax",
    "thresholds": "threshold",
    "cameras": "fx",
    "person": "height",
    "sensor_names": "sensor",
}


def flat(parts):
    return [part if isinstance(part, str) else part.tobytes() for part in parts]


COMMANDS = [(adapt_command, AdaptOptions), (track_command, TrackOptions), (import_command, ImportOptions)]


@pytest.mark.parametrize(("command", "options"), COMMANDS)
def test_a_command_asks_for_every_option_and_leaves_it_as_usual(command: click.Command, options: type) -> None:
    asked = {parameter.name: parameter for parameter in command.params}
    for field in fields(options):
        parameter = asked[UNDER_ANOTHER_NAME.get(field.name, field.name)]
        usual = getattr(options(), field.name)
        if isinstance(usual, bool | int | str):
            assert (parameter.get_default(click.Context(command)) or False) == usual, field.name
        else:
            assert not parameter.required, field.name


@pytest.mark.parametrize("name", [field.name for field in fields(AdaptOptions)])
def test_an_adaptation_asked_for_otherwise_is_begun_anew(limb, name: str) -> None:
    usual = AdaptOptions()
    changed = replace(usual, **{name: ADAPT[name]})
    assert flat(changed.decide(limb.recording)) != flat(usual.decide(limb.recording))


@pytest.mark.parametrize("name", [field.name for field in fields(TrackOptions) if field.name != "region"])
def test_tracking_asked_for_otherwise_is_begun_anew_if_a_pose_may_change(name: str) -> None:
    usual = TrackOptions()
    changed = replace(usual, **{name: TRACK.get(name, np.eye(4))})
    assert (flat(changed.decide(NEAR_BY)) == flat(usual.decide(NEAR_BY))) == (name in CHANGES_NO_POSE)


def test_frames_in_another_order_are_the_same_frames(limb) -> None:
    one, other = (AdaptOptions(frames=frames).decide(limb.recording) for frames in ([4, 2, 7], (2, 4, 7, 7)))
    assert flat(one) == flat(other)


@pytest.mark.parametrize("name", [field.name for field in fields(Thresholds)])
def test_every_threshold_changes_the_key_and_stands_in_the_settings(limb, name: str) -> None:
    usual = Thresholds()
    changed = thresholds_of([(name, 0.5 * getattr(usual, name))])
    keys = [flat(TrackOptions(thresholds=thresholds).decide(NEAR_BY)) for thresholds in (usual, changed)]
    assert keys[0] != keys[1]
    assert make_tracker(limb.subject, changed).decided_by()[name] == getattr(changed, name)
    assert type(getattr(changed, name)) is type(getattr(usual, name))


def test_a_frame_is_judged_by_the_thresholds_that_are_stated(limb) -> None:
    usual, _ = make_tracker(limb.subject).first(limb.targets[3], 0.0)
    strict, state = make_tracker(limb.subject, Thresholds(largest_skin_to_cloud_m=1e-5)).first(limb.targets[3], 0.0)
    assert not usual.lost
    assert "of the skin in sight was found" in strict.lost
    assert state is None


def test_a_bone_shows_by_the_threshold_that_is_stated_for_skin(limb, monkeypatch) -> None:
    asked = []
    monkeypatch.setattr(
        "track.tracker.bones_shown", lambda anatomy, skin, bounds: asked.append(bounds) or np.ones(4, bool)
    )
    make_tracker(limb.subject, Thresholds(least_coverage=0.6)).first(limb.targets[3], 0.0)
    assert asked[0].coverage == 0.6


@pytest.mark.parametrize("value", [0.0, -1.0, float("nan"), float("inf")])
def test_a_threshold_that_cannot_be_is_refused(value: float) -> None:
    with pytest.raises(MotionError, match="least_coverage cannot be"):
        Thresholds(least_coverage=value)


def test_the_command_refuses_a_threshold_that_there_is_not(limb, tmp_path) -> None:
    save_subject(limb.subject, tmp_path / "s.npz")
    command = [str(limb.recording.path), "--subject", str(tmp_path / "s.npz"), "--out", str(tmp_path / "m")]
    result = CliRunner().invoke(track_command, [*command, "--threshold", "coverage", "0.6"])
    assert "no threshold is called coverage" in str(result.exception)
    assert not (tmp_path / "m").exists()


def test_motions_name_their_thresholds_as_ever() -> None:
    assert set(asdict(Thresholds())) >= {"sampled_vertices", "largest_residual_m", "least_coverage", "back_to_rest_s"}
