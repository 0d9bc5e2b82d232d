"""Every coordinate and landmark that ships is called by words that people use, and the words mean what is so."""

from __future__ import annotations

import numpy as np
import pytest

from adapt.anatomy_file import anatomy_names, load_anatomy
from adapt.model.body import bone_transforms, make_body, rest_theta
from adapt.model.pose_space import root_coordinates
from adapt.plain_words import landmark_words, plain_words
from track.curves.motion_curves import angles_of

OF_A_BODY = (
    *("lumbar_bending", "lumbar_extension", "lumbar_twist", "thorax_bending", "thorax_extension", "thorax_twist"),
    *("head_bending", "head_extension", "head_twist", "scapula_abduction_r", "scapula_elevation_l"),
    *(
        "scapula_upward_rot_r",
        "shoulder_x_r",
        "wrist_flexion_l",
        "wrist_deviation_r",
        "subtalar_angle_r",
        "mtp_angle_l",
    ),
)


@pytest.mark.parametrize("anatomy", anatomy_names())
def test_every_angle_that_ships_has_its_words_a_direction_and_a_zero(anatomy: str) -> None:
    for _, coordinate in angles_of(load_anatomy(anatomy)):
        words = plain_words(coordinate.name)
        assert words.name != coordinate.name.replace("_", " ") or coordinate.name == "elbow_flexion"
        assert words.positive
        assert words.zero


@pytest.mark.parametrize("coordinate", OF_A_BODY)
def test_angles_of_a_whole_body_have_their_words(coordinate: str) -> None:
    assert plain_words(coordinate).name != coordinate.replace("_", " ")


@pytest.mark.parametrize("anatomy", ["upper-limb-right", "lower-limb-right"])
def test_short_names_of_landmarks_are_spelled_out(anatomy: str) -> None:
    short = [name for name in load_anatomy(anatomy).landmark_names if name.isupper() or name[:2] in ("MC", "MT")]
    assert len(short) > 5
    assert not [name for name in short if landmark_words(name) == name.replace("_", " ")]


def test_a_side_is_no_part_of_the_words() -> None:
    assert plain_words("ankle_angle_r").label == plain_words("ankle_angle_l").label == "ankle flexion (dorsiflexion +)"


@pytest.mark.parametrize(
    ("anatomy", "coordinate", "bone", "point", "moves_to"),
    [  # at zero in all other angles: the point of the bone moves so where the limb stands upright (X forward, Z right)
        ("upper-limb-right", "elbow_flexion", "hand", "MC3_head", [1.0, 0.0, 0.0]),
        ("lower-limb-right", "hip_flexion_r", "foot", "heel", [1.0, 0.0, 0.0]),
        ("lower-limb-right", "hip_adduction_r", "foot", "heel", [0.0, 0.0, -1.0]),
        ("lower-limb-right", "knee_angle_r", "foot", "heel", [-1.0, 0.0, 0.0]),
        ("lower-limb-right", "ankle_angle_r", "foot", "toe1_tip", [0.0, 1.0, 0.0]),
        ("lower-limb-right", "hip_rotation_r", "foot", "toe1_tip", [0.0, 0.0, -1.0]),
        ("upper-limb-right", "pro_sup", "hand", "thumb_tip", [0.0, 0.0, -1.0]),
    ],
)
def test_a_positive_angle_does_what_its_words_say(anatomy, coordinate, bone, point, moves_to) -> None:
    limb = load_anatomy(anatomy)
    body = make_body(limb)
    theta = rest_theta(body)
    theta[[i for i, _ in angles_of(limb)]] = 0.0
    theta[root_coordinates(limb)[:3]] = 0.0
    more = theta.copy()
    more[limb.coordinate_index(coordinate)] = 0.3
    at = np.append(limb.landmarks[limb.landmark_index(point)], 1.0)
    before, after = ((bone_transforms(body, pose)[bone] @ at)[:3] for pose in (theta, more))
    move = (after - before) / np.linalg.norm(after - before)
    assert float(move @ np.array(moves_to)) > 0.7, move
