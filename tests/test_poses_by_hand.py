from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from adapt.anatomy import Anatomy
from adapt.model.body import make_body, rest_theta
from track.poses_by_hand import HandPose, PosesError, read_poses, write_poses


@pytest.fixture
def written(arm: Anatomy, tmp_path: Path) -> tuple[Path, list[HandPose]]:
    theta = rest_theta(make_body(arm))
    bent = theta.copy()
    bent[arm.coordinate_index("elbow_flexion")] = arm.coordinates[arm.coordinate_index("elbow_flexion")].high
    poses = [HandPose("bent", 7, bent), HandPose("start", 0, theta)]
    write_poses(tmp_path / "poses.json", arm, poses)
    return tmp_path / "poses.json", poses


def test_poses_come_back_as_they_were_in_order_of_frames(arm: Anatomy, written: tuple[Path, list[HandPose]]) -> None:
    path, (bent, start) = written
    back = read_poses(path, arm, frames=8)
    assert [(pose.name, pose.frame) for pose in back] == [("start", 0), ("bent", 7)]
    np.testing.assert_allclose(back[0].theta, start.theta, rtol=0, atol=1e-14)
    np.testing.assert_allclose(back[1].theta, bent.theta, rtol=0, atol=1e-14)


def test_the_file_states_degrees_and_metres(arm: Anatomy, written: tuple[Path, list[HandPose]]) -> None:
    coordinates = json.loads(written[0].read_text(encoding="utf-8"))["poses"][1]["coordinates"]
    assert coordinates["elbow_flexion"] == {"value": pytest.approx(130.0), "unit": "deg"}
    assert coordinates["shoulder_tx"]["unit"] == "m"
    assert list(coordinates) == [coordinate.name for coordinate in arm.coordinates]


def _changed(document: dict[str, Any], keys: tuple[Any, ...], value: Any) -> dict[str, Any]:
    inner: Any = document
    for key in keys[:-1]:
        inner = inner[key]
    if value is ...:
        del inner[keys[-1]]
    else:
        inner[keys[-1]] = value
    return document


_ELBOW = ("poses", 0, "coordinates", "elbow_flexion")


@pytest.mark.parametrize(
    ("keys", "value", "words"),
    [
        (("format",), "something", "not a bonetrack-poses file"),
        (("version",), 2, "newer than 1; update"),
        (("version",), True, "no version"),
        (("anatomy",), "lower-limb-right", "not 'upper-limb-right'"),
        (("poses",), {}, "must be a list"),
        (("extra",), 1, "unknown key 'extra'"),
        (("poses", 0, "frame"), 7, "two poses have the frame 7"),
        (("poses", 0, "name"), "bent", "two poses have the name 'bent'"),
        (("poses", 0, "name"), " ", "name must be text"),
        (("poses", 0, "frame"), -1, "whole number from 0"),
        (("poses", 0, "frame"), 1.5, "whole number from 0"),
        (("poses", 0, "frame"), 8, "frames run from 0 to 7"),
        (_ELBOW, ..., "lacks 'elbow_flexion'"),
        (_ELBOW, 0.5, "must be an object"),
        ((*_ELBOW, "unit"), "rad", "unit must be 'deg'"),
        ((*_ELBOW, "value"), 131.0, "its range is 0 to 130 deg"),
        ((*_ELBOW, "value"), 4011.0, "): elbow_flexion is 4011 deg"),
        ((*_ELBOW, "value"), "41", "finite number"),
        ((*_ELBOW, "value"), float("nan"), "finite number"),
        (("poses", 0, "coordinates", "knee"), {"value": 1.0, "unit": "deg"}, "unknown key 'knee'"),
    ],
)
def test_a_wrong_file_is_refused_in_one_line_that_names_it(
    arm: Anatomy, written: tuple[Path, list[HandPose]], keys: tuple[Any, ...], value: Any, words: str
) -> None:
    path = written[0]
    document = _changed(json.loads(path.read_text(encoding="utf-8")), keys, value)
    path.write_text(json.dumps(document), encoding="utf-8")
    with pytest.raises(PosesError) as error:
        read_poses(path, arm, frames=8)
    assert words in str(error.value)
    assert str(path) in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("text", ["", "[1, 2", "[]", "null"])
def test_what_is_no_such_file_is_refused(arm: Anatomy, tmp_path: Path, text: str) -> None:
    (tmp_path / "poses.json").write_text(text, encoding="utf-8")
    with pytest.raises(PosesError):
        read_poses(tmp_path / "poses.json", arm)
    with pytest.raises(PosesError, match="cannot be read"):
        read_poses(tmp_path / "absent.json", arm)


def test_a_pose_that_cannot_be_read_back_is_not_written(arm: Anatomy, tmp_path: Path) -> None:
    theta = rest_theta(make_body(arm))
    theta[arm.coordinate_index("elbow_flexion")] = np.nan
    with pytest.raises(PosesError, match="finite number"):
        write_poses(tmp_path / "poses.json", arm, [HandPose("lost", 3, theta)])
    assert not list(tmp_path.iterdir())
