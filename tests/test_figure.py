"""The first pose from depth alone: windows, decoding, joining of sensors, sides; without any trained weights."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from adapt.search.figure import names
from adapt.search.figure.decode import CELL, CELLS, chances_of_cells, decode_joints, mirrored_back
from adapt.search.figure.join import join_views
from adapt.search.figure.names import JOINTS, LIMBS, MIRRORED_JOINTS, MIRRORED_PARTS, PARTS
from adapt.search.figure.network import FigureNetwork
from adapt.search.figure.sides import side_of_limb
from adapt.search.figure.view import FigureView, figure_of_window, see_figure
from adapt.search.figure.window import (
    JUMP_M,
    NOTHING_M,
    PIXEL_M,
    PIXELS,
    STEEPEST,
    Window,
    cut_window,
    features,
    mirrored,
    window_about,
)
from capture.camera import Camera
from capture.errors import BonetrackError
from capture.projection import project
from capture.rigid import transform

CAMERA = Camera(320, 240, 285.0, 285.0, 159.5, 119.5)
BENT = Camera(320, 240, 285.0, 285.0, 159.5, 119.5, (0.1, -0.05, 0.001, 0.002, 0.0))
WINDOW = Window(2.0, 0.05, -0.02)


def some_places(seed: int = 0) -> np.ndarray:
    """Places (19, 3) well inside a window."""
    rng = np.random.default_rng(seed)
    return np.column_stack([rng.uniform(12, 116, (19, 2)), rng.uniform(-0.3, 0.3, 19)])


def numbers_of(places: np.ndarray) -> np.ndarray:
    """What a network that knows the places would give (76, 32, 32): the inverse of decoding."""
    numbers = np.zeros((4, 19, CELLS, CELLS), np.float32)
    middles = np.arange(CELLS) + 0.5
    for joint, (u, v, d) in enumerate(places):
        numbers[0, joint, int(v / CELL), int(u / CELL)] = 30.0
        numbers[1, joint], numbers[2, joint] = u / CELL - middles, (v / CELL - middles)[:, None]
        numbers[3, joint] = d
    return numbers.reshape(76, CELLS, CELLS)


def reflected(places: np.ndarray) -> np.ndarray:
    """Places in the mirror image."""
    turned = places[list(MIRRORED_JOINTS)]
    turned[:, 0] = PIXELS - turned[:, 0]
    return turned


def knowing(places: np.ndarray, parts: np.ndarray | None = None):
    """A network that gives these places, whatever it is fed, and mirrored ones for the mirror image."""
    scores = np.zeros((15, 64, 64), np.float32) if parts is None else parts

    def network(fed: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        assert fed.shape == (2, 4, PIXELS, PIXELS)
        back = scores[list(MIRRORED_PARTS)][:, :, ::-1]
        return np.stack([numbers_of(places), numbers_of(reflected(places))]), np.stack([scores, back])

    return network


def a_view(joints: np.ndarray, confidence: float = 0.9, chances: np.ndarray | None = None) -> FigureView:
    even = np.full((15, 64, 64), 1.0 / 15.0, np.float32) if chances is None else chances
    return FigureView(joints, np.full(19, confidence), even, np.ones((64, 64), bool), WINDOW)


def test_left_and_right_are_each_others_mirror_image():
    assert [names.other_side(names.other_side(name)) for name in (*JOINTS, *PARTS)] == [*JOINTS, *PARTS]
    assert [MIRRORED_JOINTS[k] for k in MIRRORED_JOINTS] == list(range(19))
    assert [PARTS[MIRRORED_PARTS[k]] for k in LIMBS["arm_l"]] == [PARTS[k] for k in LIMBS["arm_r"]]


def test_places_in_a_window_and_points_before_the_sensor_are_the_same_thing():
    places = some_places()
    assert WINDOW.place(WINDOW.points(places)) == pytest.approx(places, abs=1e-9)
    behind = WINDOW.place(np.array([[0.0, 0.0, -1.0]]))
    assert (np.abs(behind[0, :2]) > 1000.0).all()


@pytest.mark.parametrize("camera", [CAMERA, BENT], ids=["pinhole", "lens with distortion"])
def test_a_surface_is_cut_out_where_its_points_are_placed(camera):
    depth = np.full((camera.height, camera.width), 2.0, np.float32)
    corner = np.array([[0.25, -0.35, 1.8]])  # of a plate nearer than the wall
    (u, v), _ = project(camera, corner)[0][0], None
    depth[: round(v), round(u) :] = 1.8
    window = Window(2.0, 0.0, 0.0)
    cut = cut_window(depth, camera, window)
    column, row, beyond = window.place(corner)[0]
    assert beyond == pytest.approx(-0.2)
    assert cut[int(row) - 3, int(column) + 3] == pytest.approx(-0.2, abs=1e-6)
    for down, right in ((3, 3), (-3, -3), (3, -3)):
        assert cut[int(row) + down, int(column) + right] == pytest.approx(0.0, abs=1e-6)


def test_depth_far_from_the_windows_and_outside_the_image_is_left_out():
    depth = np.full((240, 320), 3.5, np.float32)
    depth[100:140] = 2.2
    cut = cut_window(depth, CAMERA, Window(2.0, 0.45, 0.0))
    assert np.isnan(cut[10]).all()  # 1.5 m beyond
    assert cut[64, 10] == pytest.approx(0.2)
    assert np.isnan(cut[:, -5:]).all()  # past the image's edge


def test_the_window_stands_about_the_persons_pixels_alone():
    depth = np.full((240, 320), 4.0, np.float32)
    person = np.zeros((240, 320), bool)
    person[60:180, 200:240] = True
    depth[person] = 2.0
    window = window_about(depth, CAMERA, person)
    assert window.depth == 2.0
    assert (window.x, window.y) == (pytest.approx((219.5 - 159.5) / 285.0), pytest.approx(0.0))
    with pytest.raises(ValueError, match="no pixel of the person has depth"):
        window_about(depth, CAMERA, np.zeros((240, 320), bool))


def plain_features(beyond: np.ndarray) -> np.ndarray:
    """The same as ``features`` by whole arrays."""
    valid = np.isfinite(beyond)
    z = np.where(valid, beyond, 0.0).astype(np.float32)
    total = cv2.boxFilter(z, -1, (3, 3), normalize=False, borderType=cv2.BORDER_CONSTANT)
    count = cv2.boxFilter(valid.astype(np.float32), -1, (3, 3), normalize=False, borderType=cv2.BORDER_CONSTANT)
    smooth, fed = total / np.maximum(count, 1.0), np.zeros((4, *z.shape), np.float32)
    fed[0], fed[1] = np.where(valid, z, NOTHING_M), valid
    for channel, axis in ((2, 1), (3, 0)):
        before, after = np.roll(smooth, 1, axis), np.roll(smooth, -1, axis)
        there = valid & np.roll(valid, 1, axis) & np.roll(valid, -1, axis)
        edge = np.zeros_like(valid)
        edge[(slice(None), [0, -1]) if axis else [0, -1]] = True
        slope = np.clip((after - before) / (2.0 * PIXEL_M), -STEEPEST, STEEPEST)
        fed[channel] = np.where(there & ~edge & (np.abs(after - before) < JUMP_M), slope, 0.0)
    return fed


def a_bumpy_window(seed: int = 3) -> np.ndarray:
    rng = np.random.default_rng(seed)
    beyond = cv2.GaussianBlur(rng.normal(0.0, 1.0, (PIXELS, PIXELS)), (0, 0), 4.0).astype(np.float32)
    beyond[:, 70:] += 0.4
    beyond[rng.random(beyond.shape) < 0.15] = np.nan
    return beyond


def test_the_features_compiled_are_those_by_whole_arrays():
    beyond = a_bumpy_window()
    assert features(beyond) == pytest.approx(plain_features(beyond), abs=2e-5)


def test_the_features_of_a_mirror_image_are_the_features_mirrored():
    beyond = a_bumpy_window()
    assert mirrored(features(beyond)) == pytest.approx(features(np.ascontiguousarray(beyond[:, ::-1])), abs=2e-5)


def test_a_surface_that_turns_away_to_the_right_has_that_slope():
    leaning = np.tile(0.5 * PIXEL_M * (np.arange(PIXELS) - 64), (PIXELS, 1)).astype(np.float32)
    fed = features(leaning)
    assert fed[2, 5:-5, 5:-5] == pytest.approx(0.5, abs=1e-4)
    assert fed[3, 5:-5, 5:-5] == pytest.approx(0.0, abs=1e-4)


def test_joints_are_decoded_where_they_were_put_and_surely():
    places = some_places()
    found, confidence = decode_joints(*chances_of_cells(numbers_of(places)))
    assert found == pytest.approx(places, abs=1e-3)
    assert confidence == pytest.approx(1.0, abs=1e-6)


def test_confidence_is_the_chance_that_the_joint_is_about_there():
    numbers = numbers_of(some_places()).reshape(4, 19, CELLS, CELLS)
    numbers[0] = 0.0  # anywhere
    _, confidence = decode_joints(*chances_of_cells(numbers.reshape(76, CELLS, CELLS)))
    assert confidence == pytest.approx(9.0 / CELLS**2, rel=1e-4)


def test_what_is_found_in_a_mirror_image_is_turned_back():
    places = some_places()
    found, _ = decode_joints(*mirrored_back(*chances_of_cells(numbers_of(reflected(places)))))
    assert found == pytest.approx(places, abs=1e-3)


def test_a_window_and_its_mirror_image_are_read_together():
    places, scores = some_places(), np.random.default_rng(1).normal(0.0, 2.0, (15, 64, 64)).astype(np.float32)
    view = figure_of_window(knowing(places, scores), a_bumpy_window(), WINDOW)
    assert view.joints == pytest.approx(WINDOW.points(places), abs=1e-4)
    assert view.chances.sum(axis=0) == pytest.approx(1.0, abs=1e-5)
    assert (view.chances.argmax(axis=0) == scores.argmax(axis=0)).all()
    assert view.is_person


def test_parts_come_out_at_the_sensors_own_pixels():
    scores = np.zeros((15, 64, 64), np.float32)
    scores[0] = 5.0
    scores[PARTS.index("hand_l"), 10:20, 40:50] = 20.0
    view = figure_of_window(knowing(some_places(), scores), a_bumpy_window(), WINDOW)
    parts = view.parts(CAMERA)
    middle = WINDOW.points(np.array([[2 * 45.0 + 1.0, 2 * 15.0 + 1.0, 0.0]]))
    (u, v) = project(CAMERA, middle)[0][0]
    assert parts[round(v), round(u)] == PARTS.index("hand_l")
    held = np.argwhere(parts == PARTS.index("hand_l"))
    expected = 20.0 * PIXEL_M / WINDOW.depth * CAMERA.fx  # pixels across 10 labels
    assert np.ptp(held, axis=0) == pytest.approx([expected, expected], abs=2.0)
    assert parts[0, 0] == PARTS.index("nothing")  # outside the window


def test_the_second_look_is_about_the_joints_that_the_first_found():
    looked = []
    places = some_places()

    def network(fed):
        looked.append(fed)
        return knowing(places)(fed)

    depth = np.full((240, 320), 2.0, np.float32)
    one = see_figure(network, depth, CAMERA, depth > 0.0, passes=1)
    two = see_figure(network, depth, CAMERA, depth > 0.0)
    middle = (places[:, :2].min(axis=0) + places[:, :2].max(axis=0)) / 2.0 - PIXELS / 2
    assert len(looked) == 3
    assert two.parts(CAMERA).shape == depth.shape
    assert two.window.x - one.window.x == pytest.approx(middle[0] * one.window.step, abs=1e-4)
    assert two.window.y - one.window.y == pytest.approx(middle[1] * one.window.step, abs=1e-4)


PLACED = [np.eye(4), transform(np.diag([-1.0, 1.0, -1.0]), np.array([0.0, 0.0, 4.0]))]


def seen_by(joints: np.ndarray) -> list[np.ndarray]:
    """The joints in the frames of two sensors that face each other."""
    return [(joints - placed[:3, 3]) @ placed[:3, :3] for placed in PLACED]


def test_two_sensors_that_agree_are_joined_in_the_room():
    joints = WINDOW.points(some_places())
    one, other = seen_by(joints)
    joined = join_views([a_view(one), a_view(other)], PLACED)
    assert joined.joints == pytest.approx(joints, abs=1e-9)


def test_a_sensor_that_has_the_sides_exchanged_is_read_as_the_surer_one_has_them():
    joints = WINDOW.points(some_places())
    one, other = seen_by(joints)
    exchanged = a_view(other[list(MIRRORED_JOINTS)], 0.7)
    for views, placed in (([a_view(one), exchanged], PLACED), ([exchanged, a_view(one)], PLACED[::-1])):
        assert join_views(views, placed).joints == pytest.approx(joints, abs=1e-9)


def test_a_joint_that_one_sensor_has_far_off_is_left_to_the_surer_one():
    joints = WINDOW.points(some_places())
    one, other = seen_by(joints)
    other[5] += [0.4, 0.0, 0.0]
    other[6] += [0.0, 0.1, 0.0]
    joined = join_views([a_view(one, 0.8), a_view(other, 0.4)], PLACED)
    assert joined.joints[5] == pytest.approx(joints[5], abs=1e-9)
    assert joined.joints[6] == pytest.approx(joints[6] + [0.0, 0.1 * 0.16 / 0.8, 0.0], abs=1e-4)
    assert joined.confidence == pytest.approx(0.8)


def test_a_figure_that_is_unsure_is_no_person():
    joints = WINDOW.points(some_places())
    assert not a_view(joints, 0.3).is_person
    assert not join_views([a_view(joints, 0.3)], PLACED[:1]).is_person
    assert join_views([a_view(joints, 0.5)], PLACED[:1]).is_person
    with pytest.raises(ValueError, match="no view"):
        join_views([], [])


def leaning_to(part_left: float, part_right: float) -> np.ndarray:
    """Chances of which so much goes to the left and to the right forearm, everywhere."""
    chances = np.zeros((15, 64, 64), np.float32)
    chances[PARTS.index("lower_arm_l")], chances[PARTS.index("lower_arm_r")] = part_left, part_right
    chances[0] = 1.0 - part_left - part_right
    return chances


def test_the_side_of_a_lone_limb_is_said_only_where_it_is_clear():
    joints = WINDOW.points(some_places())
    assert side_of_limb(a_view(joints, chances=leaning_to(0.1, 0.7)), "arm").side == "right"
    assert side_of_limb(a_view(joints, chances=leaning_to(0.7, 0.1)), "arm").side == "left"
    undecided = side_of_limb(a_view(joints, chances=leaning_to(0.3, 0.5)), "arm")
    assert undecided.side is None
    assert undecided.share == pytest.approx(0.625)


def test_what_hardly_looks_like_that_limb_has_no_side():
    view = a_view(WINDOW.points(some_places()), chances=leaning_to(0.0, 0.2))
    assert side_of_limb(view, "arm").side is None
    assert side_of_limb(view, "leg").limb == 0.0


def test_the_side_is_asked_of_some_pixels_if_wanted():
    chances = np.where(np.arange(64) < 32, leaning_to(0.9, 0.0), leaning_to(0.0, 0.9)).astype(np.float32)
    view = a_view(WINDOW.points(some_places()), chances=chances)
    left_half = np.zeros((64, 64), bool)
    left_half[:, :32] = True
    assert side_of_limb(view, "arm").side is None
    assert side_of_limb(view, "arm", left_half).side == "left"
    with pytest.raises(ValueError, match="no pixel has depth"):
        side_of_limb(view, "arm", np.zeros((64, 64), bool))


def test_a_network_that_is_not_there_or_none_is_refused_in_one_line(tmp_path):
    with pytest.raises(BonetrackError, match="there is no network for the first pose; give a first pose by hand"):
        FigureNetwork(tmp_path / "none.onnx")
    (tmp_path / "text.onnx").write_text("no network")
    with pytest.raises(BonetrackError, match="not a network for the first pose"):
        FigureNetwork(tmp_path / "text.onnx")
