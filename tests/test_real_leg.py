"""A real leg that our model's joints move, and its bones beside ours."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from adapt.anatomy_file import load_anatomy
from adapt.model.body import Body, bone_transforms, make_body, pose_skin, posed_bones, rest_theta
from adapt.model.size import resized
from adapt.template_builder.meshes import Mesh
from capture.rigid import apply
from track.evaluation.experiments import real_leg_page
from track.evaluation.experiments.real_leg import bound, compared, depths
from track.evaluation.real_legs import LANDMARKS, RealLeg, laid_on, our_bones, parts_of


def leg_of(body: Body, theta: np.ndarray) -> RealLeg:
    """A leg of our own model as if it were somebody's."""
    moved, p = bone_transforms(body, theta), body.p.value
    places = {
        name: apply(moved[bone], p[[body.anatomy.landmark_index(name)]])[0] for name, (bone, _) in LANDMARKS.items()
    }
    skin = Mesh(pose_skin(body, theta), body.anatomy.skin_faces)
    return RealLeg(skin, our_bones(body, posed_bones(body, theta)), places, (-np.inf, np.inf))


@pytest.fixture(scope="module")
def smaller() -> tuple[Body, np.ndarray]:
    body = resized(make_body(load_anatomy("lower-limb-right")), 0.9)
    theta = rest_theta(body)
    theta[body.anatomy.coordinate_index("knee_angle_r")] += 0.1
    return body, theta


def test_a_body_is_laid_on_somebodys_landmarks_in_size_and_pose(smaller: tuple[Body, np.ndarray]) -> None:
    leg = leg_of(*smaller)
    for proportions in (False, True):
        body, theta = laid_on(smaller[0].anatomy, leg.landmarks, proportions=proportions)
        found = leg_of(body, theta)
        for name, place in leg.landmarks.items():
            np.testing.assert_allclose(found.landmarks[name], place, atol=2e-3, err_msg=name)


def test_skin_that_is_bound_to_our_joints_is_its_owners_in_the_pose_it_was_found_in_and_bends_as_ours(
    smaller: tuple[Body, np.ndarray],
) -> None:
    body, _ = smaller
    leg = leg_of(*smaller)
    swollen = Mesh(leg.skin.vertices + np.array([0.002, 0.0, 0.0]), leg.skin.faces)
    made, lying = bound(RealLeg(swollen, leg.bones, leg.landmarks, leg.span))
    np.testing.assert_allclose(pose_skin(made, lying), swollen.vertices, atol=1e-6)
    bent = lying.copy()
    bent[body.anatomy.coordinate_index("knee_angle_r")] += 0.8
    ours, _ = laid_on(body.anatomy, leg.landmarks, proportions=True)
    apart = np.linalg.norm(pose_skin(made, bent) - pose_skin(ours, bent), axis=1)
    assert np.median(apart) < 0.004


def test_bones_are_compared_where_there_is_skin_only(smaller: tuple[Body, np.ndarray]) -> None:
    tibia = leg_of(*smaller).bones["tibia"]
    low, high = tibia.vertices[:, 1].min(), tibia.vertices[:, 1].max()
    bulged = tibia.vertices.copy()
    bulged[bulged[:, 1] > (low + high) / 2.0] += [0.01, 0.0, 0.0]
    whole = compared(Mesh(bulged, tibia.faces), tibia, (-np.inf, np.inf))
    half = compared(Mesh(bulged, tibia.faces), tibia, (-np.inf, (low + high) / 2.0))
    assert half["as_it_lies_mm"] < 0.2 < whole["as_it_lies_mm"]
    assert whole["lengths_mm"][1] == pytest.approx(1e3 * (high - low), rel=0.1)


def test_a_bone_moved_towards_the_skin_lies_less_deep(smaller: tuple[Body, np.ndarray]) -> None:
    leg = leg_of(*smaller)
    forward = {b: Mesh(m.vertices + np.array([0.002, 0.0, 0.0]), m.faces) for b, m in leg.bones.items()}
    before, after = (depths(bones, leg.skin) for bones in (leg.bones, forward))
    assert before["patella"] - after["patella"] == pytest.approx(2.0, abs=0.7)
    assert after["tibia at the tuberosity"] < before["tibia at the tuberosity"]


def test_a_mesh_of_two_parts_comes_apart_the_larger_first() -> None:
    corners = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 1.0, 0.0]])
    faces = np.array([[0, 1, 2], [1, 4, 2], [5, 6, 7]])
    large, small = parts_of(Mesh(np.concatenate([corners, corners + 5.0]), faces))
    assert (len(large.faces), len(small.faces)) == (2, 1)


def test_the_page_marks_bones_that_miss_their_aims(tmp_path: Path) -> None:
    def bone(lies_mm: float, ours_mm: float) -> dict[str, object]:
        return {"as_it_lies_mm": lies_mm, "moved_mm": 1.0, "lengths_mm": [ours_mm, 100.0]}

    bones = {
        "tibia": bone(2.0, 101.0),
        "fibula": bone(4.0, 104.0),
        "patella": bone(1.0, 99.0),
        "femur": bone(4.5, 150.0),
    }
    at_rest = {"bones": bones, "depths_mm": {"ours": {"patella": 3.0}, "theirs": {"patella": 2.0}}, "skin_mm": 0.6}
    results = {"at rest, woman (CT)": at_rest, "in motion, woman (CT)": {"failed": "no box"}}
    text = real_leg_page.describe(results, tmp_path)
    assert "| surface of the tibia, as it lies (mm) | 3 | 2.0 ± 0.0 (2.0) |" in text
    assert "| surface of the fibula, as it lies (mm) | 3 | **4.0 ± 0.0 (4.0)** |" in text
    assert "| length of the fibula (%) | 2 | **+4.0** |" in text
    assert "| length of the femur (%) |  | +50.0 |" in text
    assert "| patella | 3.0, 2.0 |" in text
    assert real_leg_page.losses(results) == [
        "at rest, woman (CT): surface of the fibula 4.0 mm (aim 3), length of the fibula +4.0 % (aim 2)",
        "in motion, woman (CT): no box",
    ]
