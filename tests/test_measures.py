from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from adapt.anatomy import Anatomy
from adapt.model.body import make_body
from adapt.model.shape.handle_space import affine_set
from adapt.tissue import MODES
from tests.finite_differences import check_jacobian
from tests.known_limb import known_subject
from track.view.measures import _length, girths, lengths, tape

SIDES = 180


def _tube(outline: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A wall of two rings, at z = -1 and z = 1."""
    count = len(outline)
    vertices = np.vstack([np.column_stack([outline, np.full(count, z)]) for z in (-1.0, 1.0)])
    a = np.arange(count)
    b = (a + 1) % count
    return vertices, np.vstack([np.column_stack([a, b, a + count]), np.column_stack([b, b + count, a + count])])


def _circle(radius: float = 0.05, centre: tuple[float, float] = (0.0, 0.0)) -> np.ndarray:
    angle = 2.0 * np.pi * np.arange(SIDES) / SIDES
    return radius * np.column_stack([np.cos(angle), np.sin(angle)]) + centre


def test_a_tape_around_a_tube_reads_its_circumference() -> None:
    vertices, faces = _tube(_circle())
    axis = np.array([0.0, 0.0, 1.0])
    assert tape(vertices, faces, np.array([0.0, 0.0, 0.3]), axis) == pytest.approx(2.0 * np.pi * 0.05, rel=1e-3)
    slanting = np.array([0.6, 0.0, 0.8])  # an ellipse of half axes r and r / 0.8
    h = ((1.0 - 0.8) / (1.0 + 0.8)) ** 2
    ellipse = np.pi * 0.05 * (1.0 + 1.0 / 0.8) * (1.0 + 3.0 * h / (10.0 + np.sqrt(4.0 - 3.0 * h)))
    assert tape(vertices, faces, np.zeros(3), slanting) == pytest.approx(ellipse, rel=1e-3)


def test_a_tape_bridges_a_hollow() -> None:
    round_one = _circle()
    dented = np.where(round_one[:, :1] > 0.03, round_one * [0.2, 1.0], round_one)
    bridged = tape(*_tube(dented), np.zeros(3), np.array([0.0, 0.0, 1.0]))
    along = np.vstack([dented, dented[:1]])
    assert bridged is not None
    assert bridged < 0.95 * np.linalg.norm(np.diff(along, axis=0), axis=1).sum()


def test_of_two_limbs_in_the_plane_the_one_around_the_place_counts() -> None:
    (thin, faces), (thick, _) = _tube(_circle(0.03)), _tube(_circle(0.06, (0.3, 0.0)))
    both, all_faces = np.vstack([thin, thick]), np.vstack([faces, faces + len(thin)])
    axis = np.array([0.0, 0.0, 1.0])
    assert tape(both, all_faces, np.zeros(3), axis) == pytest.approx(2.0 * np.pi * 0.03, rel=1e-3)
    assert tape(both, all_faces, np.array([0.3, 0.0, 0.0]), axis) == pytest.approx(2.0 * np.pi * 0.06, rel=1e-3)
    assert tape(both, all_faces, np.array([0.15, 0.0, 0.0]), axis) is None
    assert tape(both, all_faces, np.array([0.0, 0.0, 2.0]), axis) is None


def test_the_template_is_as_long_as_its_landmarks_say(arm: Anatomy) -> None:
    subject = known_subject(make_body(arm), np.zeros((0, len(arm.coordinates))), np.zeros(0))
    rows = {row.bone: row for row in lengths(subject)}
    at = {name: arm.landmarks[arm.landmark_index(name)] for name in ("EM", "EL", "GH")}
    expected = float(np.linalg.norm((at["EM"] + at["EL"]) / 2.0 - at["GH"]))
    assert rows["humerus"].length_m == pytest.approx(expected, abs=1e-4)
    epicondyles = "medial epicondyle of the humerus and lateral epicondyle of the humerus"
    assert rows["humerus"].ends == f"middle of {epicondyles} to centre of the humeral head"
    assert all(row.length_m == pytest.approx(row.template_m) for row in rows.values())


def test_only_bones_between_two_joints_have_girths_and_those_are_a_persons(arm: Anatomy) -> None:
    subject = known_subject(make_body(arm), np.zeros((0, len(arm.coordinates))), np.zeros(0))
    rows = girths(subject)
    assert {row.bone for row in rows} == {"humerus", "radius"}
    assert all(0.15 < row.girth_m < 0.45 for row in rows)
    assert all(row.girth_m == pytest.approx(row.template_m) for row in rows)


def test_a_body_that_is_thicker_at_every_joint_measures_more_around(arm: Anatomy) -> None:
    shape = affine_set(arm).identity.copy()
    shape[::4] = 1.1
    thicker = known_subject(make_body(arm, shape=shape), np.zeros((0, len(arm.coordinates))), np.zeros(0))
    assert all(1.02 < row.girth_m / row.template_m < 1.12 for row in girths(thicker))


def test_the_deviation_of_a_length_is_that_of_the_shape_carried_over(arm: Anatomy) -> None:
    shape = affine_set(arm).identity
    subject = known_subject(make_body(arm), np.zeros((0, len(arm.coordinates))), np.zeros(0))
    bone = arm.bone("humerus")

    def length(at: np.ndarray) -> np.ndarray:
        return np.array(_length(replace(subject, body=make_body(arm, shape=at)), bone)[0])

    gradient = _length(subject, bone)[1]
    check_jacobian(length, gradient, shape)
    row = next(row for row in lengths(subject) if row.bone == "humerus")
    assert row.sd_m == pytest.approx(1e-3 * np.linalg.norm(gradient))  # the covariance is 1e-6 times the identity
    # What is not known of the soft tissue says nothing of bones.
    with_tissue = np.eye(len(shape) + MODES)
    with_tissue[: len(shape), : len(shape)] = subject.covariance
    assert next(iter(lengths(replace(subject, covariance=with_tissue)))).sd_m == pytest.approx(row.sd_m)
