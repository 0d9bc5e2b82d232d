"""Tables of joint coordinates: their unit is read where it is said, and a value that no joint takes is refused."""

from __future__ import annotations

import numpy as np
import pytest

from adapt.fit.first_poses import read_first_poses
from adapt.model.body import make_body
from capture.errors import BonetrackError
from track.simulation.motion_table import read_motion_table


def table(path, *lines):
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


@pytest.mark.parametrize(
    "lines",
    [
        ["frame,elbow_flexion", "3,1.2217304763960306"],
        ["frame,elbow_flexion_deg", "3,70"],
        ["# inDegrees=yes", "frame,elbow_flexion", "3,70"],
    ],
)
def test_first_poses_are_read_in_the_unit_that_they_say(arm, tmp_path, lines):
    theta = read_first_poses(table(tmp_path / "poses.csv", *lines), arm)[3]
    assert theta[arm.coordinate_index("elbow_flexion")] == pytest.approx(np.deg2rad(70.0))


def test_a_motion_is_read_in_the_unit_that_it_says(arm, tmp_path):
    path = table(tmp_path / "motion.csv", "time,elbow_flexion_deg,pro_sup", "0,20,0.1", "0.1,30,0.2")
    thetas = read_motion_table(path, make_body(arm)).thetas
    np.testing.assert_allclose(thetas[:, arm.coordinate_index("elbow_flexion")], np.deg2rad([20.0, 30.0]))
    np.testing.assert_allclose(thetas[:, arm.coordinate_index("pro_sup")], [0.1, 0.2])


def test_degrees_taken_for_radians_are_refused_with_row_value_and_remedy(arm, tmp_path):
    poses = table(tmp_path / "poses.csv", "frame,elbow_flexion", "3,70")
    with pytest.raises(
        BonetrackError, match=r"frame 3: elbow_flexion is 4011 degrees .* its range is 0 to 130"
    ) as said:
        read_first_poses(poses, arm)
    assert "elbow_flexion_deg" in said.value.remedy
    motion = table(tmp_path / "motion.csv", "time,elbow_flexion", "0,0.1", "0.5,70")
    with pytest.raises(BonetrackError, match=r"at 0.5 s: elbow_flexion is 4011 degrees"):
        read_motion_table(motion, make_body(arm))


def test_people_who_go_a_little_beyond_a_models_range_are_taken_as_they_are(arm, tmp_path):
    path = table(tmp_path / "motion.csv", "time,elbow_flexion_deg", "0,-10", "0.1,150")
    assert len(read_motion_table(path, make_body(arm)).times) == 2
