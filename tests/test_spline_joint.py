"""The spline joint: a knee and a kneecap that follow published tables through landmarks."""

from __future__ import annotations

import json
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pytest

from adapt.anatomy import Anatomy, Floats, Frame, Joint
from adapt.anatomy_file import load_anatomy, read_anatomy, save_anatomy
from adapt.model.body import bone_frames, bone_transforms, joint_centres, make_body, pose_skin_varying, rest_theta
from adapt.model.derivatives import Motion, constant_points
from adapt.model.joints import joint_motion
from adapt.model.parts import refuse_wrong_parts
from adapt.model.pose_space import reported_coordinates
from adapt.model.shape.handle_space import affine_set
from adapt.search.first_pose import variations
from adapt.template_builder.checks import motions
from adapt.template_builder.coupled_joint import CoupledJoint, Guides, child_in_parent, simm_spline, spline_joint
from adapt.template_builder.joint_accuracy import compare_with_table
from adapt.template_builder.knee import KNEE_KNOTS, PATELLAR_FACETS, PATELLOFEMORAL, PLATEAU, WALKER_KNEE
from capture.errors import AnatomyError
from capture.rigid import apply, inverse, rotation_angle, transform
from tests.finite_differences import check_jacobian
from tests.test_model import check_motion, seeded
from tests.toy_leg import REST, REST_FROM_FEMUR, place, toy_leg, with_joint

FLEXIONS = np.deg2rad(np.linspace(0.0, 120.0, 49))
NUMERIC_CHECK = Path(__file__).parents[2] / "shared" / "kinematics" / "facts.json"


@pytest.fixture(scope="module")
def leg() -> Anatomy:
    return toy_leg()


def motion_at(anatomy: Anatomy, name: str, angle: float, landmarks: Floats | None = None) -> Motion:
    """H of a joint with its coordinate at ``angle`` (rad), with the anatomy's landmarks or others."""
    joint = anatomy.joint(name)
    theta = np.zeros(len(anatomy.coordinates))
    theta[anatomy.coordinate_index(joint.coordinates[0])] = angle
    p = constant_points(anatomy.landmarks if landmarks is None else landmarks, len(theta))
    return joint_motion(anatomy, joint, theta, p, 0)


def table_motion(table: CoupledJoint, angle: float) -> Floats:
    """What the table says H is in the toy's rest space (4, 4): the child carried from the pose of rest."""
    return _in_rest_space(child_in_parent(table, angle) @ inverse(child_in_parent(table, REST)))


def _in_rest_space(motion: Floats) -> Floats:
    turn = REST_FROM_FEMUR[:3, :3]
    similar = transform(turn @ motion[:3, :3] @ turn.T, np.zeros(3))
    similar[:3, 3] = place(motion[:3, 3][None])[0] - similar[:3, :3] @ REST_FROM_FEMUR[:3, 3]
    return similar


def differences(anatomy: Anatomy, joint: str, table: CoupledJoint, guides: Guides, angle: float) -> tuple[float, float]:
    """Metres by which the child's origin and guides, and radians by which its axes, are off the table."""
    points = np.array([(0.0, 0.0, 0.0), guides.medial, guides.lateral, guides.normal])
    at_rest = place(apply(child_in_parent(table, REST), points))
    ours, theirs = motion_at(anatomy, joint, angle).matrix(), table_motion(table, angle)
    apart = np.linalg.norm(apply(ours, at_rest) - apply(theirs, at_rest), axis=1)
    return float(apart.max()), rotation_angle(ours[:3, :3] @ theirs[:3, :3].T)


@pytest.mark.parametrize(
    ("joint", "table", "guides"),
    [("knee", WALKER_KNEE, PLATEAU), ("cap", PATELLOFEMORAL, PATELLAR_FACETS)],
    ids=["knee", "kneecap"],
)
def test_the_calibrated_joint_follows_the_table_over_its_range(
    leg: Anatomy, joint: str, table: CoupledJoint, guides: Guides
) -> None:
    off = np.array([differences(leg, joint, table, guides, angle) for angle in FLEXIONS])
    assert off[:, 0].max() < 0.0005
    assert np.rad2deg(off[:, 1].max()) < 0.5


def test_the_comparison_with_the_table_finds_what_is_off_in_either_limb(leg: Anatomy) -> None:
    knee, mirror = leg.joint("knee"), np.array([1.0, 1.0, -1.0])
    outward = tuple(replace(frame, z_from=frame.z_to, z_to=frame.z_from) for frame in knee.frames)
    mirrored = replace(leg, landmarks=leg.landmarks * mirror)
    for anatomy, joint in ((leg, knee), (mirrored, knee), (mirrored, replace(knee, frames=outward))):
        found = compare_with_table(anatomy, joint, WALKER_KNEE, PLATEAU, FLEXIONS)
        expected = np.array([differences(leg, "knee", WALKER_KNEE, PLATEAU, angle) for angle in FLEXIONS])
        np.testing.assert_allclose(found.turn, expected[:, 1], atol=1e-7)
        assert (found.distance <= expected[:, 0] + 1e-9).all()
    shifted = leg.landmarks.copy()
    shifted[leg.landmark_index("knee_normal_03")] += 0.002
    off = compare_with_table(replace(leg, landmarks=shifted), knee, WALKER_KNEE, PLATEAU, FLEXIONS)
    assert np.rad2deg(off.turn.max()) > 1.0


def test_from_knot_to_knot_the_joint_follows_the_table_exactly(leg: Anatomy) -> None:
    for name, table in (("knee", WALKER_KNEE), ("cap", PATELLOFEMORAL)):
        knots = leg.joint(name).knots
        for knot in knots:
            ours = motion_at(leg, name, knot).matrix() @ inverse(motion_at(leg, name, knots[0]).matrix())
            theirs = table_motion(table, knot) @ inverse(table_motion(table, knots[0]))
            np.testing.assert_allclose(ours, theirs, atol=1e-12)


@pytest.mark.skipif(not NUMERIC_CHECK.is_file(), reason="OpenSim's own numbers are not on this machine")
def test_the_table_puts_the_tibia_where_opensim_does() -> None:
    rows = json.loads(NUMERIC_CHECK.read_text(encoding="utf-8"))["knee_numeric_check_right"]["rajagopal2016"]
    for flexion, *origin_mm, turn_deg in rows:
        tibia = child_in_parent(WALKER_KNEE, np.deg2rad(flexion))
        np.testing.assert_allclose(1e3 * tibia[:3, 3], origin_mm, atol=0.006)
        assert np.rad2deg(rotation_angle(tibia[:3, :3])) == pytest.approx(turn_deg, abs=0.006)


def test_the_tables_spline_passes_its_points_and_reproduces_cubics() -> None:
    x = (0.0, 0.3, 0.5, 1.1, 1.4)
    cubic = np.polynomial.Polynomial([0.2, -1.0, 3.0, 0.7])
    at = np.linspace(0.0, 1.4, 20)
    np.testing.assert_allclose(simm_spline(x, tuple(cubic(np.array(x))), at), cubic(at), atol=1e-12)
    np.testing.assert_allclose(simm_spline(x, (1.0, 5.0, -2.0, 0.0, 1.0), np.array(x)), (1, 5, -2, 0, 1), atol=1e-12)


@pytest.mark.parametrize("angle", [-0.1, 0.0, REST, 0.9, 2.0944, 2.2], ids=lambda angle: f"{angle:.2f}")
@pytest.mark.parametrize("name", ["knee", "cap"])
def test_it_varies_as_stated_with_theta_and_landmarks_beyond_its_knots_too(
    leg: Anatomy, name: str, angle: float
) -> None:
    joint, n = leg.joint(name), len(leg.coordinates)
    landmarks = leg.landmarks.copy()
    used = np.array([leg.landmark_index(landmark) for landmark in joint.landmarks()])
    theta = np.zeros(n)
    column = leg.coordinate_index("bend")

    def motion(q: Floats) -> Motion:
        landmarks[used] = q[1:].reshape(-1, 3)
        p = seeded(landmarks, spare=n)
        theta[column] = q[0]
        columns = [column, *(n + 3 * k + c for k in used for c in range(3))]
        full = joint_motion(leg, joint, theta, p, 0)
        return replace(full, d_rotation=full.d_rotation[:, columns], d_translation=full.d_translation[:, columns])

    moved = leg.landmarks[used] + np.random.default_rng(3).normal(0.0, 1e-3, (len(used), 3))
    check_motion(motion, np.r_[angle, moved.ravel()])


def test_landmarks_that_stand_still_give_the_same_motion_as_those_that_vary(leg: Anatomy) -> None:
    n, column = len(leg.coordinates), leg.coordinate_index("bend")
    for landmarks in (leg.landmarks, 1.1 * leg.landmarks):
        for angle in (0.4, 1.2):
            theta = np.full(n, angle)
            still = joint_motion(leg, leg.joint("knee"), theta, constant_points(landmarks, n), 0)
            varying = joint_motion(leg, leg.joint("knee"), theta, seeded(landmarks, spare=n), 0)
            np.testing.assert_allclose(still.matrix(), varying.matrix(), atol=1e-14)
            for part, other in ((still.d_rotation, varying.d_rotation), (still.d_translation, varying.d_translation)):
                np.testing.assert_allclose(part[:, column], other[:, column], atol=1e-14)
                assert not np.delete(part, column, axis=1).any()


def test_the_skin_over_a_knee_varies_as_stated_with_pose_and_shape(leg: Anatomy) -> None:
    identity = affine_set(leg).identity
    shape = identity + np.random.default_rng(1).normal(0.0, 0.02, len(identity))
    theta = rest_theta(make_body(leg)) + 0.3
    at = np.r_[theta, shape]

    def skin(q: Floats) -> Floats:
        body = make_body(leg, shape=q[len(theta) :])
        return pose_skin_varying(body, q[: len(theta)]).value

    jacobian = pose_skin_varying(make_body(leg, shape=shape), theta, with_shape=True).d
    check_jacobian(skin, jacobian, at)


def test_at_rest_it_leaves_the_child_where_it_is(leg: Anatomy) -> None:
    for name in ("knee", "cap"):
        np.testing.assert_allclose(motion_at(leg, name, REST).matrix(), np.eye(4), atol=1e-12)
    body = make_body(leg)
    for transform_ in bone_transforms(body, rest_theta(body)).values():
        np.testing.assert_allclose(transform_, np.eye(4), atol=1e-12)


def test_a_body_of_another_size_has_the_same_angles_and_shifts_in_proportion(leg: Anatomy) -> None:
    for name in ("knee", "cap"):
        plain, large = motion_at(leg, name, 1.3), motion_at(leg, name, 1.3, 1.25 * leg.landmarks)
        np.testing.assert_allclose(large.rotation, plain.rotation, atol=1e-12)
        np.testing.assert_allclose(large.translation, 1.25 * plain.translation, atol=1e-12)


def test_scaling_the_knees_handles_scales_its_gliding(leg: Anatomy) -> None:
    affine = affine_set(leg)
    shape = affine.identity.reshape(-1, 4).copy()
    knee = affine.groups.index("knee")
    shape[knee, 0] = 1.2
    template, thicker = make_body(leg), make_body(leg, shape=shape.ravel())
    bent = rest_theta(template).copy()
    bent[leg.coordinate_index("bend")] = 1.6
    point = place(np.array([(0.0, -0.42, 0.0)]))[0]
    centre = affine.centres[knee]
    for bone in ("shank", "kneecap"):
        plain, scaled = (
            inverse(bone_transforms(body, theta)["thigh"]) @ bone_transforms(body, theta)[bone]
            for body, theta in ((template, bent), (thicker, np.r_[rest_theta(thicker)[:6], bent[6:]]))
        )
        np.testing.assert_allclose(scaled[:3, :3], plain[:3, :3], atol=1e-9)
        expected = 1.2 * (apply(plain, point[None])[0] - centre) + centre
        np.testing.assert_allclose(apply(scaled, (1.2 * (point - centre) + centre)[None])[0], expected, atol=1e-9)


def test_the_mirror_image_of_a_knee_moves_as_the_mirror_image(leg: Anatomy) -> None:
    mirror = np.diag([1.0, 1.0, -1.0])
    for name in ("knee", "cap"):
        right, left = motion_at(leg, name, 1.1), motion_at(leg, name, 1.1, leg.landmarks @ mirror)
        np.testing.assert_allclose(left.rotation, mirror @ right.rotation @ mirror, atol=1e-12)
        np.testing.assert_allclose(left.translation, mirror @ right.translation, atol=1e-12)


def test_beyond_its_knots_the_joint_goes_on_smoothly(leg: Anatomy) -> None:
    for end, outward in ((0.0, -1.0), (KNEE_KNOTS[-1], 1.0)):
        before, at, after = (motion_at(leg, "knee", end + outward * step).translation for step in (-1e-5, 0.0, 1e-5))
        np.testing.assert_allclose(after - at, at - before, atol=1e-9)
        far = motion_at(leg, "knee", end + outward * 0.3).matrix()
        assert np.isfinite(far).all()
        assert rotation_angle(far[:3, :3]) > 0.0


def test_first_poses_are_sought_over_each_bending_once(leg: Anatomy) -> None:
    theta = rest_theta(make_body(leg))
    changed = [np.flatnonzero(other != theta).tolist() for other in variations(leg, theta)]
    bend, point = leg.coordinate_index("bend"), leg.coordinate_index("point")
    assert changed == [[], [bend], [bend], [point], [point]]


def test_checks_over_the_range_of_motion_go_through_a_shared_coordinate_once(leg: Anatomy) -> None:
    body = make_body(leg)
    poses = np.array(list(motions(body)))
    bends = (poses[:, leg.coordinate_index("bend")] != rest_theta(body)[leg.coordinate_index("bend")]).sum()
    points = (poses[:, leg.coordinate_index("point")] != rest_theta(body)[leg.coordinate_index("point")]).sum()
    assert bends == points > 0


def test_joints_that_share_a_coordinate_report_it_once(leg: Anatomy) -> None:
    body = make_body(leg)
    thetas = np.tile(rest_theta(body), (3, 1))
    thetas[:, leg.coordinate_index("bend")] = np.deg2rad([10.0, 20.0, 30.0])
    columns = reported_coordinates(leg, thetas)
    np.testing.assert_allclose(columns["bend"], [10.0, 20.0, 30.0])
    assert sorted(columns) == sorted(["hip_euler_x", "hip_euler_y", "hip_euler_z", "tx", "ty", "tz", "bend", "point"])
    assert set(joint_centres(body, thetas[0])) == {"hip", "knee", "cap", "ankle"}
    assert set(bone_frames(body, thetas[0])) == {"thigh", "shank", "kneecap", "foot"}


def test_a_file_with_spline_joints_says_what_it_said(leg: Anatomy, tmp_path: Path) -> None:
    save_anatomy(leg, tmp_path / "leg.npz")
    again = read_anatomy(tmp_path / "leg.npz", where=tmp_path)
    assert again.joints == leg.joints
    assert isinstance(again.joint("knee").frames[0], Frame)
    np.testing.assert_allclose(motion_at(again, "knee", 1.4).matrix(), motion_at(leg, "knee", 1.4).matrix(), atol=1e-5)


def test_a_file_of_the_first_version_has_joints_without_splines(leg: Anatomy, tmp_path: Path) -> None:
    hinged = replace(leg, joints=tuple(joint for joint in leg.joints if joint.type != "spline"))
    save_anatomy(hinged, tmp_path / "leg.npz")
    with np.load(tmp_path / "leg.npz") as data:
        arrays = dict(data)
    description = json.loads(str(arrays["description"]))
    description["version"] = 1
    for joint in description["joints"]:
        del joint["knots"], joint["frames"]
    np.savez(tmp_path / "old.npz", **(arrays | {"description": np.array(json.dumps(description))}))
    assert read_anatomy(tmp_path / "old.npz", where=tmp_path).joints == hinged.joints


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"type": "screw"}, "joint knee: no type 'screw': the types are free, hinge, universal, ball, spline"),
        ({"knots": (0.0, 1.0)}, "one frame a knot"),
        ({"knots": (), "frames": ()}, "one frame a knot"),
        ({"knots": tuple(reversed(KNEE_KNOTS))}, "two knots or more that increase"),
        ({"coordinates": ("bend", "point")}, r"spline has 1 coordinate\(s\) and 0 axes"),
        ({"axes": (("hip", "toe"),)}, r"spline has 1 coordinate\(s\) and 0 axes"),
        ({"parent": None}, "a free joint has no parent"),
    ],
)
def test_parts_that_make_no_joint_are_refused(leg: Anatomy, wrong: dict[str, object], message: str) -> None:
    with pytest.raises(AnatomyError, match=message):
        refuse_wrong_parts(with_joint(leg, leg.joint("knee"), **wrong))


def test_a_wrong_joint_in_a_file_is_told(leg: Anatomy, tmp_path: Path) -> None:
    save_anatomy(leg, tmp_path / "leg.npz")
    with np.load(tmp_path / "leg.npz") as data:
        arrays = dict(data)
    description = json.loads(str(arrays["description"]))
    description["joints"][1]["knots"][1] = -1.0
    np.savez(tmp_path / "leg.npz", **(arrays | {"description": np.array(json.dumps(description))}))
    with pytest.raises(AnatomyError, match="joint knee: a spline joint needs two knots or more that increase"):
        load_anatomy(tmp_path / "leg.npz")


def test_frames_that_are_none_or_turn_too_far_are_told(leg: Anatomy) -> None:
    knee = leg.joint("knee")
    first = knee.frames[0]
    flat = replace(knee, frames=(replace(first, y_to=first.z_to, y_from=first.z_from), *knee.frames[1:]))
    with pytest.raises(AnatomyError, match="lie on a line"):
        motion_of(leg, flat)
    upside_down = replace(first, y_from=first.y_to, y_to=first.y_from)
    with pytest.raises(AnatomyError, match="half a turn"):
        motion_of(leg, replace(knee, frames=(*knee.frames[:3], upside_down, *knee.frames[4:])))
    unknown = replace(first, origin=("navel",))
    with pytest.raises(AnatomyError, match="no landmark 'navel'"):
        motion_of(leg, replace(knee, frames=(unknown, *knee.frames[1:])))


def motion_of(anatomy: Anatomy, joint: Joint) -> Motion:
    n = len(anatomy.coordinates)
    return joint_motion(anatomy, joint, np.zeros(n), constant_points(anatomy.landmarks, n), 0)


def test_guides_whose_normal_leans_are_refused() -> None:
    leaning = replace(PLATEAU, normal=(0.0, 0.0, 0.02))
    with pytest.raises(AnatomyError, match="not perpendicular"):
        spline_joint(
            WALKER_KNEE,
            leaning,
            place,
            knots=KNEE_KNOTS,
            name="knee",
            parent="thigh",
            child="shank",
            coordinate="bend",
            centre=("hip",),
        )


def test_a_joint_names_every_landmark_it_depends_on_once(leg: Anatomy) -> None:
    names = leg.joint("knee").landmarks()
    assert len(names) == len(set(names)) == 3 * len(KNEE_KNOTS) + 2
    assert leg.joint("ankle").landmarks() == ("ankle_m", "ankle_l")
    assert asdict(leg.joint("knee"))["frames"][0]["origin"] == ("knee_medial_00", "knee_lateral_00")
