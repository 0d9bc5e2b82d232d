"""Exported USD files in two readers: usd-core, which poses them, and tinyusdz, which shares no code with it."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from adapt.model.body import pose_skin, posed_bones
from capture.errors import OutputError
from tests.holey_limb import KNOWN, UP, HoleyLimb, holey
from tests.test_export_readers import COUNT, HIDDEN, LOST, bone_of_last_marker
from track.export.usd import write_usd

__all__ = ["holey"]


@pytest.fixture(scope="module")
def written(holey: HoleyLimb, tmp_path_factory):
    pytest.importorskip("pxr", reason="USD needs usd-core: pip install bonetrack[usd]")
    path = tmp_path_factory.mktemp("usd") / "motion.usdc"
    return path, write_usd(holey.motion, holey.subject, path, up=UP)


def posed_by_usd(stage, name, code):
    """A mesh's vertices as UsdSkel poses them at a time code."""
    from pxr import Usd, UsdGeom, UsdSkel

    root = UsdSkel.Root(stage.GetDefaultPrim())
    cache = UsdSkel.Cache()
    cache.Populate(root, Usd.PrimDefaultPredicate)
    skeleton = cache.GetSkelQuery(UsdSkel.Skeleton.Get(stage, "/motion/skeleton"))
    mesh = UsdGeom.Mesh.Get(stage, f"/motion/{name}")
    moves = skeleton.ComputeSkinningTransforms(code)
    points = mesh.GetPointsAttr().Get()
    assert cache.GetSkinningQuery(mesh.GetPrim()).ComputeSkinnedPoints(moves, points, code)
    return np.array(points)


def test_the_format_s_own_library_poses_skin_and_bones_where_ours_are(written, holey):
    from pxr import Usd

    path, gap = written
    stage = Usd.Stage.Open(str(path))
    for t in KNOWN:
        theta = holey.motion.thetas[t]
        skin = holey.turned(pose_skin(holey.body, theta))
        off = np.linalg.norm(posed_by_usd(stage, "skin", float(t)) - skin, axis=1)
        assert off.max() < gap.largest_m + 1e-4  # scales are of half precision
        for name, surface in posed_bones(holey.body, theta).items():
            np.testing.assert_allclose(
                posed_by_usd(stage, f"{name}_surface", float(t)), holey.turned(surface), atol=1e-5
            )


def test_units_axes_and_rate_are_stated_and_the_format_s_own_checks_find_nothing(written):
    from pxr import Usd, UsdGeom, UsdValidation

    stage = Usd.Stage.Open(str(written[0]))
    assert UsdGeom.GetStageUpAxis(stage) == "Y"
    assert UsdGeom.GetStageMetersPerUnit(stage) == 1.0
    assert stage.GetTimeCodesPerSecond() == pytest.approx(30.0)
    assert (stage.GetStartTimeCode(), stage.GetEndTimeCode()) == (0.0, pytest.approx(COUNT - 1.0))
    validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
    errors = UsdValidation.ValidationContext(validators).Validate(stage)
    assert len(validators) > 10
    assert not [(error.GetName(), error.GetMessage()) for error in errors]


def test_skin_and_bones_are_invisible_where_they_are_not_known(written, holey):
    from pxr import Usd, UsdGeom

    stage = Usd.Stage.Open(str(written[0]))

    def invisible(name):
        visibility = UsdGeom.Mesh.Get(stage, f"/motion/{name}").GetVisibilityAttr()
        return [t for t in range(COUNT) if visibility.Get(float(t)) == "invisible"]

    hidden = bone_of_last_marker(holey.subject)
    assert invisible("skin") == list(LOST)
    assert invisible(f"{hidden}_surface") == sorted([*LOST, HIDDEN])


def test_weights_are_whole_and_a_joint_stands_after_its_parent(written):
    from pxr import Usd, UsdSkel

    stage = Usd.Stage.Open(str(written[0]))
    binding = UsdSkel.BindingAPI(stage.GetPrimAtPath("/motion/skin"))
    weights = np.array(binding.GetJointWeightsPrimvar().Get()).reshape(-1, 4)
    np.testing.assert_allclose(weights.sum(axis=1), 1.0, atol=2e-7 * 4)
    joints = UsdSkel.Skeleton.Get(stage, "/motion/skeleton").GetJointsAttr().Get()
    topology = UsdSkel.Topology(joints)
    assert topology.Validate()[0]


def test_another_reader_finds_the_same_keys_and_a_scale_with_each(written, holey):
    tinyusdz = pytest.importorskip("tinyusdz", reason="reads USD files in tests")
    from pxr import Usd, UsdSkel

    stage = tinyusdz.load(str(written[0]))
    assert (stage.get_metadata("upAxis"), stage.get_metadata("metersPerUnit")) == ("Y", 1.0)
    scene = tinyusdz.tydra.convert_to_render_scene(stage)
    (animation,) = scene.animations()
    samplers = animation.samplers()
    keys: dict[str, dict[int, np.ndarray]] = {"translation": {}, "rotation": {}, "scale": {}}
    for channel in animation.channels():
        sampler = samplers[channel["sampler"]]
        np.testing.assert_allclose(np.asarray(sampler.times), KNOWN, atol=1e-4)
        keys[channel["path"]][channel["joint_id"]] = np.asarray(sampler.values).reshape(len(KNOWN), -1)
    whole = Usd.Stage.Open(str(written[0]))
    ours = UsdSkel.Animation.Get(whole, "/motion/skeleton/animation")
    count = len(ours.GetJointsAttr().Get())
    assert {len(joints) for joints in keys.values()} == {count}
    for k, t in enumerate(KNOWN):
        turns = np.array([[*q.GetImaginary(), q.GetReal()] for q in ours.GetRotationsAttr().Get(float(t))])
        theirs = np.array([keys["rotation"][joint][k] for joint in range(count)])
        assert (Rotation.from_quat(turns) * Rotation.from_quat(theirs).inv()).magnitude().max() < 1e-3
        shifts = np.array([keys["translation"][joint][k] for joint in range(count)])
        np.testing.assert_allclose(shifts, np.array(ours.GetTranslationsAttr().Get(float(t))), atol=1e-6)
        scales = np.array([keys["scale"][joint][k] for joint in range(count)])
        np.testing.assert_allclose(scales, np.array(ours.GetScalesAttr().Get(float(t))), atol=1e-3)
    meshes = {mesh.name: np.asarray(mesh.points) for mesh in scene.meshes()}
    np.testing.assert_allclose(meshes["skin"], holey.body.v_tilde.value, atol=1e-6)


def test_a_file_of_other_programs_is_not_replaced_and_one_of_ours_is(written, holey, tmp_path):
    from pxr import Usd

    foreign = tmp_path / "motion.usdc"
    Usd.Stage.CreateNew(str(foreign)).Save()
    with pytest.raises(OutputError, match="not replaced"):
        write_usd(holey.motion, holey.subject, foreign)
    write_usd(holey.motion, holey.subject, written[0], up=UP)
