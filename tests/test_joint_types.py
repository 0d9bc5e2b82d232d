"""What must hold of every registered type of joint; a new type needs nothing here but an example."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

from adapt.anatomy import Anatomy, Coordinate, Floats, Frame, Joint
from adapt.anatomy_file import load_anatomy, read_anatomy, save_anatomy
from adapt.mirror import mirrored, mirrored_body
from adapt.model.body import Body, bone_frames, bone_transforms, make_body, rest_theta
from adapt.model.compiled.chain import move_bones
from adapt.model.compiled.prepared import prepare_chain
from adapt.model.derivatives import Motion, compose, constant_points, invert
from adapt.model.joints import JOINT_TYPES
from adapt.model.joints.opensim import OsimJoint, TransformAxis
from adapt.model.kinematics import bone_motions
from adapt.model.parts import refuse_wrong_parts
from adapt.model.pose_space import joint_index, reported_coordinates
from adapt.model.shape.handle_space import affine_set
from capture.errors import AnatomyError
from capture.rigid import exp_so3, inverse, transform
from tests.test_model import check_motion, seeded
from tests.toy_leg import place, toy_leg, with_joint
from track.evaluation import opensim_tools
from track.export.osim import write_osim
from track.export.osim_joints import body_frames, follower_columns, joints_of_coordinates, osim_joints
from track.export.osim_motion import in_si_with_coupled

REFLECTION = np.diag([1.0, 1.0, -1.0, 1.0])
ALONG, FORWARD, UPWARD = (("lateral", "medial"), ("back", "front"), ("low", "high"))
MIDDLE = np.array([-0.055, -0.805, 0.0025])  # of the toy's ankle: where the three lines meet
ENDS = {"medial": (0.01, -0.005, -0.03), "front": (0.04, 0.01, 0.004), "high": (0.006, 0.05, 0.002)}
OPPOSITE = {"medial": "lateral", "front": "back", "high": "low"}
RANGES = {"rad": (-0.8, 0.7, 0.15), "m": (-0.02, 0.03, 0.004)}

UPRIGHT = Frame(("low",), ("low",), ("high",), ("medial",), ("lateral",))

EXAMPLES: dict[str, str | dict[str, Any]] = {
    "free": "hip",  # the joint of that name in the toy, or the parts of one in its ankle's place
    "hinge": {"axes": (ALONG,)},
    "universal": {"axes": (ALONG, FORWARD)},
    "ball": {"axes": (ALONG, FORWARD, UPWARD)},
    "spline": "knee",
    "cylindrical": {"axes": (ALONG,)},
    "curve": {"frames": (UPRIGHT,)},
    "ellipsoid": {"frames": (UPRIGHT,), "axes": (FORWARD, UPWARD, ("medial", "lateral"))},
    "socket": {"frames": (UPRIGHT,)},
    "strut": {
        "parent": "thigh",
        "other": "shank",
        "axes": (("hip", "low"),),
        "frames": (Frame(("hip",), ("back",), ("front",), ("hip",), ("low",)),),
    },
}


def example(name: str) -> tuple[Anatomy, Joint]:
    """A toy leg with a joint of that type."""
    toy, given = toy_leg(), EXAMPLES[name]
    if isinstance(given, str):
        return toy, toy.joint(given)
    units = JOINT_TYPES[name].units
    own = tuple(Coordinate(f"q{k}", unit, *RANGES[unit]) for k, unit in enumerate(units))
    parts = {"parent": "shank", "axes": (), "centre": ("ankle_m", "ankle_l")} | given
    joint = Joint(name="ankle", type=name, child="foot", coordinates=tuple(c.name for c in own), **parts)
    spots = {end: MIDDLE + away for end, away in ENDS.items()} | {
        OPPOSITE[e]: MIDDLE - away for e, away in ENDS.items()
    }
    weights = np.tile(toy.landmark_handle_weights[toy.landmark_index("ankle_m")], (len(spots), 1))
    anatomy = replace(
        toy,
        joints=(*toy.joints[:-1], joint),
        coordinates=(*toy.coordinates[:-1], *own),
        landmark_names=(*toy.landmark_names, *spots),
        landmarks=np.vstack([toy.landmarks, place(np.array(list(spots.values())))]),
        landmark_handle_weights=np.vstack([toy.landmark_handle_weights, weights]),
    )
    return anatomy, joint


@pytest.fixture(params=JOINT_TYPES)
def case(request: pytest.FixtureRequest) -> tuple[Body, Joint]:
    """A body of some proportions with a joint of the type."""
    anatomy, joint = example(request.param)
    identity = affine_set(anatomy).identity
    shape = identity + np.random.default_rng(2).normal(0.0, 0.02, len(identity))
    return make_body(anatomy, shape=shape), joint


def thetas_of(body: Body, joint: Joint, count: int = 6) -> Floats:
    """Poses (T, n): the joint anywhere in its range, the others near rest."""
    rng = np.random.default_rng(5)
    thetas = rest_theta(body) + rng.uniform(-0.1, 0.1, (count, len(body.anatomy.coordinates)))
    if joint.coordinates and not JOINT_TYPES[joint.type].free:
        own = [body.anatomy.coordinates[i] for i in joint_index(body.anatomy, joint)]
        low, high = np.array([(c.low, c.high) for c in own]).T
        thetas[:, joint_index(body.anatomy, joint)] = rng.uniform(low, high, (count, len(own)))
    return thetas


def test_every_registered_type_has_an_example() -> None:
    assert set(EXAMPLES) == set(JOINT_TYPES)
    assert all(each.name == name for name, each in JOINT_TYPES.items())


def test_it_leaves_the_child_where_it_is_at_rest(case: tuple[Body, Joint]) -> None:
    body, _ = case
    for motion in bone_transforms(body, rest_theta(body)).values():
        np.testing.assert_allclose(motion, np.eye(4), atol=1e-12)


@pytest.mark.parametrize("at", [None, 0.0, 1e-4, 0.5, 2.0])  # rad or m; None: somewhere in the range
def test_it_varies_as_stated_with_theta_and_landmarks(case: tuple[Body, Joint], at: float | None) -> None:
    body, joint = case
    theta = thetas_of(body, joint)[0]
    if at is not None:
        theta[joint_index(body.anatomy, joint)] = at
    anatomy, n = body.anatomy, len(body.anatomy.coordinates)
    frame = anatomy.bone(joint.child).frame
    others = [each.landmarks() for each in anatomy.joints if each.child == joint.other]
    names = dict.fromkeys(
        [*joint.landmarks(), *frame.origin, *frame.y_from, *frame.y_to, *frame.z_from, *frame.z_to, *sum(others, ())]
    )
    used = np.array([anatomy.landmark_index(name) for name in names])
    columns = [*range(n), *(n + 3 * k + c for k in used for c in range(3))]

    def motion(q: Floats) -> Motion:
        landmarks = body.p.value.copy()
        landmarks[used] = q[n:].reshape(-1, 3)
        moved = bone_motions(anatomy, q[:n], seeded(landmarks, spare=n))
        full = moved[joint.child]
        if joint.parent is not None:
            full = compose(invert(moved[joint.parent]), full)
        return replace(full, d_rotation=full.d_rotation[:, columns], d_translation=full.d_translation[:, columns])

    check_motion(motion, np.r_[theta, body.p.value[used].ravel()])


@pytest.mark.parametrize("beyond", [0.0, 1.5])  # of the range
def test_the_compiled_chain_moves_as_the_model_does(case: tuple[Body, Joint], beyond: float) -> None:
    body, joint = case
    rng = np.random.default_rng(6)
    for theta in thetas_of(body, joint):
        there = theta + beyond * rng.uniform(-1.0, 1.0, len(theta))
        model = bone_motions(body.anatomy, there, constant_points(body.p.value, len(there)))
        fast = move_bones(body.prepared.chain, there)
        for b, bone in enumerate(body.anatomy.bones):
            for part in ("rotation", "translation", "d_rotation", "d_translation"):
                expected = getattr(model[bone.name], part)
                np.testing.assert_allclose(getattr(fast, part)[b], expected, atol=1e-12, err_msg=f"{bone.name} {part}")


@pytest.mark.parametrize("beyond", [0.0, 1.5])
def test_the_compiled_chain_varies_with_landmarks_as_the_model_does(case: tuple[Body, Joint], beyond: float) -> None:
    body, joint = case
    rng, n = np.random.default_rng(7), len(body.anatomy.coordinates)
    chain = prepare_chain(body.anatomy, seeded(body.p.value))
    for theta in thetas_of(body, joint):
        there = theta + beyond * rng.uniform(-1.0, 1.0, n)
        model = bone_motions(body.anatomy, there, seeded(body.p.value, spare=n))
        fast = move_bones(chain, there)
        for b, bone in enumerate(body.anatomy.bones):
            for part in ("rotation", "translation", "d_rotation", "d_translation"):
                expected = getattr(model[bone.name], part)
                np.testing.assert_allclose(getattr(fast, part)[b], expected, atol=1e-11, err_msg=f"{bone.name} {part}")


def test_the_mirror_image_moves_as_the_mirror_image(case: tuple[Body, Joint]) -> None:
    right, joint = case
    left = mirrored_body(right)
    signs = np.ones(len(right.anatomy.coordinates))
    for each in right.anatomy.joints:
        index, turned = joint_index(right.anatomy, each), JOINT_TYPES[each.type].turned_over
        signs[[index[k] for k in turned]] = -1.0
    np.testing.assert_allclose(rest_theta(left), signs * rest_theta(right), atol=1e-12)
    for theta in thetas_of(right, joint):
        others = bone_transforms(left, signs * theta)
        for name, motion in bone_transforms(right, theta).items():
            np.testing.assert_allclose(others[name], REFLECTION @ motion @ REFLECTION, atol=1e-12, err_msg=name)
    for c, other, sign in zip(right.anatomy.coordinates, left.anatomy.coordinates, signs, strict=True):
        assert (other.low, other.high) == tuple(sorted((sign * c.low, sign * c.high)))
    assert repr(mirrored(left.anatomy)) == repr(right.anatomy)


def test_it_survives_its_file(case: tuple[Body, Joint], tmp_path: Path) -> None:
    anatomy = case[0].anatomy
    save_anatomy(anatomy, tmp_path / "leg.npz")
    again = read_anatomy(tmp_path / "leg.npz", where=tmp_path)
    assert again.joints == anatomy.joints
    assert again.coordinates == anatomy.coordinates


def test_an_unknown_type_is_refused_in_one_line_with_the_known_ones(case: tuple[Body, Joint], tmp_path: Path) -> None:
    body, joint = case
    save_anatomy(body.anatomy, tmp_path / "leg.npz")
    with np.load(tmp_path / "leg.npz") as data:
        arrays = dict(data)
    description = json.loads(str(arrays["description"]))
    description["joints"][body.anatomy.joints.index(joint)]["type"] = "rubber"
    np.savez(tmp_path / "leg.npz", **(arrays | {"description": np.array(json.dumps(description))}))
    with pytest.raises(AnatomyError) as caught:
        load_anatomy(tmp_path / "leg.npz")
    message = str(caught.value)
    assert f"joint {joint.name}: no type 'rubber': the types are {', '.join(JOINT_TYPES)}" in message
    assert "\n" not in message


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"coordinates": ("point",) * 5}, "coordinate"),
        ({"axes": (ALONG,) * 4}, "axes"),
        ({"knots": (0.0,)}, "knot"),
        ({"parent": "another"}, "parent"),
    ],
    ids=["five coordinates", "four axes", "a knot", "a parent where there is none"],
)
def test_parts_that_make_none_are_refused(case: tuple[Body, Joint], wrong: dict[str, object], message: str) -> None:
    body, joint = case
    if "parent" in wrong and joint.parent is not None:
        wrong = {"parent": None}
    with pytest.raises(AnatomyError, match=f"joint {joint.name}: .*{message}"):
        refuse_wrong_parts(with_joint(body.anatomy, joint, **wrong))


def test_coordinates_of_another_unit_are_refused(case: tuple[Body, Joint]) -> None:
    anatomy, joint = case[0].anatomy, case[1]
    for name in joint.coordinates:
        i = anatomy.coordinate_index(name)
        unit = anatomy.coordinates[i].unit
        other = replace(anatomy.coordinates[i], unit="m" if unit == "rad" else "rad")
        with pytest.raises(AnatomyError, match=f"joint {joint.name}: its coordinate {name} must be in {unit}"):
            refuse_wrong_parts(
                replace(anatomy, coordinates=(*anatomy.coordinates[:i], other, *anatomy.coordinates[i + 1 :]))
            )


# ---- in OpenSim


def of_axis(axis: TransformAxis, values: dict[str, float]) -> float:
    """The value of a function of coordinates."""
    if axis.coordinate is None:
        return 0.0
    at = values[axis.coordinate]
    return at if axis.x is None or axis.y is None else float(CubicSpline(axis.x, axis.y)(at))


def placed_by(joint: OsimJoint, values: dict[str, float]) -> Floats:
    """P X(q) C^-1 (4, 4), as OpenSim's documentation and source of its joints say."""
    x, own = np.eye(4), [values[c.name] for c in joint.coordinates if not c.locked]
    if joint.kind == "PinJoint":
        x[:3, :3] = exp_so3(np.array([0.0, 0.0, own[0]]))
    elif joint.kind == "ConstantCurvatureJoint":
        x = constant_curvature(np.array(own), *joint.own["length"])
    elif joint.kind == "ScapulothoracicJoint":
        x = on_ellipsoid(np.array(own), np.array(joint.own["thoracic_ellipsoid_radii_x_y_z"]))
    else:
        assert joint.kind == "CustomJoint"
        for axis in joint.axes[:3]:
            x[:3, :3] = x[:3, :3] @ exp_so3(of_axis(axis, values) * axis.axis)
        x[:3, 3] = sum(of_axis(axis, values) * axis.axis for axis in joint.axes[3:])
    return joint.in_parent @ x @ inverse(joint.in_child)


def constant_curvature(q: Floats, length: float) -> Floats:
    """X (4, 4) of an arc of that length (m) along y that is bent by q[:2], which are not zero, and twisted by q[2]."""
    turn = Rotation.from_euler("XZY", q).as_matrix()
    across = np.hypot(turn[0, 1], turn[2, 1])
    angle = np.arctan2(across, turn[1, 1])
    x, z = (1.0 - np.cos(angle)) / across * turn[[0, 2], 1]
    return transform(turn, length / angle * np.array([x, np.sin(angle), z]))


def on_ellipsoid(q: Floats, radii: Floats) -> Floats:
    """X (4, 4) of a blade that is abducted, raised and turned upward on an ellipsoid of those radii (m)."""
    turn = Rotation.from_euler("YXZ", q * [1.0, -1.0, 1.0]).as_matrix()
    return transform(turn, radii * turn[:, 2])


def values_in_opensim(body: Body, thetas: Floats) -> list[dict[str, float]]:
    """What the model's coordinates are, pose by pose."""
    placed = [bone_transforms(body, theta) for theta in thetas]
    transforms = {bone.name: np.array([each[bone.name] for each in placed]) for bone in body.anatomy.bones}
    reported = reported_coordinates(body.anatomy, thetas) | follower_columns(body, transforms)
    columns = in_si_with_coupled(body.anatomy, reported)
    return [{name: float(values[t]) for name, values in columns.items()} for t in range(len(thetas))]


def test_its_form_in_opensim_places_the_bones_where_ours_are(case: tuple[Body, Joint]) -> None:
    body, joint = case
    joints, thetas = osim_joints(body), thetas_of(body, joint)
    owners = {c.name: each.name for each in joints for c in each.coordinates if not c.locked}
    assert joints_of_coordinates(body.anatomy) == owners
    parts = set(JOINT_TYPES[joint.type].opensim_owners(joint).values())
    own = [axis for each in joints if each.name in parts for axis in each.axes]
    close = 1e-9 if all(axis.x is None for axis in own) else 5e-4  # samples do not tell all
    for theta, values in zip(thetas, values_in_opensim(body, thetas), strict=True):
        placed: dict[str | None, Floats] = {None: np.eye(4)}
        for each in joints:
            placed[each.child] = placed[each.parent] @ placed_by(each, values)
        frames = {None: np.eye(4), **bone_frames(body, theta)}
        found = inverse(placed[joint.parent]) @ placed[joint.child]
        np.testing.assert_allclose(found, inverse(frames[joint.parent]) @ frames[joint.child], atol=close)
    for each in joints:
        for coordinate in each.coordinates:
            assert coordinate.low < coordinate.high


def test_opensim_itself_places_them_there(case: tuple[Body, Joint], tmp_path: Path) -> None:
    pytest.importorskip("opensim", reason="OpenSim is not installed: pip install bonetrack[opensim]")
    module = opensim_tools.opensim()
    body, joint = case
    write_osim(body, tmp_path)
    model = module.Model(str(tmp_path / f"{body.anatomy.name}.osim"))
    state, thetas = model.initSystem(), thetas_of(body, joint)
    for theta, values in zip(thetas, values_in_opensim(body, thetas), strict=True):
        for coordinate in model.getCoordinateSet():
            if not coordinate.get_locked():
                coordinate.setValue(state, values[coordinate.getName()], False)
        model.realizePosition(state)
        for name, frame in bone_frames(body, theta).items():
            there = model.getBodySet().get(name).getTransformInGround(state)
            turn = np.array([[there.R().get(i, j) for j in range(3)] for i in range(3)])
            found = transform(turn, np.array([there.p().get(i) for i in range(3)]))
            np.testing.assert_allclose(found, frame, atol=5e-4, err_msg=name)
    assert set(body_frames(body)) <= {each.getName() for each in model.getBodySet()}
