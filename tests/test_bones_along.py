"""Bones along a curve: vertebrae and ribs ride on shares of the arc between two bones."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from adapt.anatomy import Anatomy, Floats, anatomy_arrays
from adapt.anatomy_file import anatomy_description, load_anatomy, read_anatomy, save_anatomy
from adapt.mirror import mirrored, mirrored_body
from adapt.model.body import Body, bone_transforms, make_body, posed_bones, rest_theta
from adapt.model.derivatives import constant_points
from adapt.model.joints import JOINT_TYPES
from adapt.model.joints.curve import Curve
from adapt.model.parts import refuse_wrong_parts
from adapt.model.pose_space import joint_index
from adapt.own_anatomy import content
from adapt.subject import Subject
from capture.errors import AnatomyError
from tests.test_deformer_types import arched_elbow
from tests.test_gltf import ReadBack
from tests.test_usd import posed_by_usd
from tests.toy_anatomy import toy_anatomy
from tests.toy_trunk import toy_trunk
from track.export.gltf import write_gltf
from track.export.osim import landmark_markers
from track.export.usd import write_usd
from track.motion import Motion, bones_and_centres, coordinate_names
from track.view.frames import pose_body

SHARES = np.linspace(0.0, 1.0, 8)


def anatomy(shares: Floats | None = SHARES) -> Anatomy:
    """The toy arm whose fore arm is a row of vertebrae from the upper arm's end on."""
    toy = arched_elbow(toy_anatomy())
    bones = tuple(replace(bone, along=shares) if bone.name == "fore" else bone for bone in toy.bones)
    return replace(toy, bones=bones)


def body() -> Body:
    template = make_body(anatomy())
    scales = np.linspace(0.9, 1.1, len(template.affine.groups))
    return make_body(template.anatomy, shape=template.affine.shape(scales, np.zeros((len(scales), 3))))


def some_theta(of: Body) -> Floats:
    return rest_theta(of) + np.random.default_rng(4).uniform(-0.6, 0.6, len(of.anatomy.coordinates))


def test_every_vertex_goes_with_its_share_of_the_curve() -> None:
    some = body()
    theta, joint = some_theta(some), some.anatomy.joint("elbow")
    curve, index = JOINT_TYPES[joint.type], joint_index(some.anatomy, joint)
    assert isinstance(curve, Curve)
    parent, p = bone_transforms(some, theta)["upper"], constant_points(some.p.value, len(theta))
    for share, rest, found in zip(SHARES, some.rest_bones["fore"], posed_bones(some, theta)["fore"], strict=True):
        moved = parent @ curve.along(some.anatomy, joint, theta[index], p, index, float(share)).matrix()
        np.testing.assert_allclose(found, moved[:3, :3] @ rest + moved[:3, 3], atol=1e-12)


def test_the_base_stays_with_the_parent_and_the_top_goes_with_the_bone() -> None:
    some = body()
    theta = some_theta(some)
    moved, posed, rest = bone_transforms(some, theta), posed_bones(some, theta)["fore"], some.rest_bones["fore"]
    for vertex, bone in ((0, "upper"), (-1, "fore")):
        expected = moved[bone][:3, :3] @ rest[vertex] + moved[bone][:3, 3]
        np.testing.assert_allclose(posed[vertex], expected, atol=1e-12)


def test_at_rest_it_is_where_it_is() -> None:
    some = body()
    np.testing.assert_allclose(posed_bones(some, rest_theta(some))["fore"], some.rest_bones["fore"], atol=1e-12)


def test_the_mirror_image_moves_as_the_mirror_image() -> None:
    right = body()
    left, theta = mirrored_body(right), some_theta(right)
    signs = np.ones(len(theta))
    for joint in right.anatomy.joints:
        signs[np.array(joint_index(right.anatomy, joint))[list(JOINT_TYPES[joint.type].turned_over)]] = -1.0
    flipped = posed_bones(left, signs * theta)["fore"] * [1.0, 1.0, -1.0]
    np.testing.assert_allclose(flipped, posed_bones(right, theta)["fore"], atol=1e-12)
    np.testing.assert_array_equal(mirrored(left.anatomy).bone("fore").along, SHARES)


def test_shares_survive_the_file_which_says_that_it_is_of_a_later_version(tmp_path: Path) -> None:
    for name, shares, version in (("with", SHARES, 3), ("without", None, 2)):
        save_anatomy(anatomy(shares), tmp_path / f"{name}.npz")
        with np.load(tmp_path / f"{name}.npz") as data:
            assert json.loads(str(data["description"]))["version"] == version
        again = read_anatomy(tmp_path / f"{name}.npz", where=tmp_path).bone("fore").along
        assert (again is None) == (shares is None)
        np.testing.assert_allclose([] if again is None else again, [] if shares is None else shares, atol=1e-7)


def test_a_limb_without_such_bones_is_told_as_before() -> None:
    """Subjects name a template by a digest of this: it must not change because something new may be said of bones."""
    limb = load_anatomy("upper-limb-right")
    assert anatomy_description(limb)["version"] == 2
    assert not [name for name in anatomy_arrays(limb) if name.endswith("along")]
    assert content(anatomy()) != content(anatomy(None))


def test_shares_of_a_bone_to_which_no_curve_leads_are_refused() -> None:
    some = anatomy()
    bones = tuple(replace(bone, along=SHARES) if bone.name == "palm" else bone for bone in some.bones)
    with pytest.raises(AnatomyError, match="bone palm: its vertices ride on shares of an arc, and no curve leads to"):
        refuse_wrong_parts(replace(some, bones=bones))


def trunk_motion() -> tuple[Subject, Motion]:
    """Three poses of the toy trunk, bent in the second; in the last one its chest does not show."""
    some = make_body(toy_trunk())
    thetas = np.tile(rest_theta(some), (3, 1))
    for name, value in {"trunk_bending": 0.3, "trunk_extension": -0.7, "trunk_twist": 0.4}.items():
        thetas[1, some.anatomy.coordinate_index(name)] = value
    none = np.zeros((len(thetas[0]) + len(some.shape),) * 2)
    subject = Subject(some, thetas[:1], np.zeros(1), none, {})
    shown = np.ones((3, len(some.anatomy.bones)), dtype=bool)
    transforms, centres = bones_and_centres(subject, thetas, shown)
    told = np.zeros(3)
    names = some.anatomy.name, coordinate_names(some.anatomy)
    parts = (np.arange(3) / 10.0, thetas, np.zeros(thetas.shape), ("", "", ""), told, told, told.astype(int), shown)
    return subject, Motion(*names, *parts, transforms, centres)


def test_gltf_bends_them_by_helper_joints_and_hides_them_where_they_do_not_show(tmp_path: Path) -> None:
    subject, motion = trunk_motion()
    chest = [bone.name for bone in subject.anatomy.bones].index("chest")
    shown = motion.shown.copy()
    shown[2, chest] = False
    write_gltf(replace(motion, shown=shown), subject, tmp_path / "motion.glb")
    read = ReadBack(tmp_path / "motion.glb")
    for key in (0, 1):
        expected = posed_bones(subject.body, motion.thetas[key])["chest"]
        found = read.hung("chest_surface", key)
        assert np.abs(found - expected).max() < (1e-6 if key == 0 else 5e-4)
    node = read.node("chest_surface")
    assert all(node not in (other.children or []) for other in read.gltf.nodes)
    assert node in read.gltf.scenes[0].nodes
    scales = {read.gltf.nodes[k].name: values[1][:, 0] for k, values in read.channels("scale").items()}
    hidden = [name for name, values in scales.items() if values.tolist() == [1.0, 1.0, 0.0]]
    assert hidden == [f"chest_{k}_of_8" for k in range(9)]
    assert np.ptp(read.hung("chest_surface", 2), axis=0)[[0, 2]].max() < 0.02  # a line along the curve


def test_usd_bends_them_by_helper_joints(tmp_path: Path) -> None:
    from pxr import Usd

    subject, motion = trunk_motion()
    write_usd(motion, subject, tmp_path / "motion.usdc")
    stage = Usd.Stage.Open(str(tmp_path / "motion.usdc"))
    for key in (0, 1):
        expected = posed_bones(subject.body, motion.thetas[key])["chest"]
        found = posed_by_usd(stage, "chest_surface", float(key))
        assert np.abs(found - expected).max() < (1e-6 if key == 0 else 5e-4)


def test_the_viewer_has_their_surfaces_posed() -> None:
    subject, motion = trunk_motion()
    posed = pose_body(subject.body, motion.thetas[1])
    assert posed is not None
    assert list(posed.along) == ["chest"]
    expected = posed_bones(subject.body, motion.thetas[1])["chest"]
    np.testing.assert_allclose(posed.along["chest"], expected, atol=1e-6)


def test_landmarks_on_them_are_no_markers_of_one_bone() -> None:
    markers = landmark_markers(make_body(toy_trunk()))
    assert "base" not in markers
    assert markers["nape"].bone == "chest"
