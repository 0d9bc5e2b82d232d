"""A motion as USD: a skeleton with skin and bones (UsdSkel) for Blender, Houdini, Unreal and Omniverse, with usd-core.

Metres, y up, time codes at the recording's rate from its first frame on. A lost frame has no key, so that readers move
evenly over it; the skin is invisible there, and each bone wherever it does not show. Scales are written of every joint
and key though most are 1: readers pass over an animation without a word that has turns and no scales.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np

from adapt.anatomy import Floats, Ints
from adapt.model.surface import incidence, vertex_normals
from adapt.subject import Subject
from capture.own import WRITTEN, Mark, replaced_if_own
from capture.upright import AXES
from track.export.even_times import even_times
from track.export.joint_keys import joint_keys, local_frames, posed_joints
from track.export.linear_skin import LinearSkin, SkinGap, linear_skin, skin_gap
from track.export.upright import y_up
from track.motion import Motion, MotionError
from track.observed_bones import Bools

_SKIN, _BONE = (0.85, 0.62, 0.52), (0.92, 0.88, 0.78)
_SKIN_OPACITY = 0.4
_ROOT = "/motion"


def _documentation(path: Path) -> bytes:
    """What a file says of itself, which stands compressed in it."""
    from pxr import Sdf

    layer = Sdf.Layer.OpenAsAnonymous(str(path), metadataOnly=True)  # its errors are RuntimeErrors
    return b"" if layer is None else str(layer.documentation).encode()


MARK = Mark(re.compile(re.escape(WRITTEN.encode())), _documentation)


def write_usd(motion: Motion, subject: Subject, path: Path, *, up: Floats = AXES["y"]) -> SkinGap:
    """Write a motion of the subject as ``.usdc``; returns how far its linearly blended skin is off the model's.

    ``up`` (3,) is the direction of the recording's frame that points up.

    Raises:
        MotionError: usd-core is not installed, or no frame was tracked.
        OutputError: something stands there that bonetrack did not write.
    """
    try:
        from pxr import UsdSkel
    except ImportError as error:
        raise MotionError("USD needs usd-core", remedy="pip install 'bonetrack[usd]'") from error
    if not motion.tracked.any():
        raise MotionError("no frame was tracked", remedy="a motion without a pose cannot be animated")
    thetas, rate = motion.thetas[motion.tracked], even_times(motion.times).rate_hz
    codes = (motion.times - motion.times[0]) * rate
    skin = linear_skin(subject.body, thetas)
    frames = posed_joints(skin, thetas, y_up(up))
    stage = _stage(rate, float(codes[-1]))
    root = UsdSkel.Root.Define(stage, _ROOT)
    stage.SetDefaultPrim(root.GetPrim())
    root.CreateExtentAttr(_bounds(_around(skin, frames)))
    skeleton = _Skeleton(stage, skin)
    skeleton.move(codes[motion.tracked], frames)
    anatomy = skin.body.anatomy
    mesh = skeleton.add("skin", skin.body.v_tilde.value, anatomy.skin_faces, skin.joints, skin.weights, _SKIN)
    mesh.CreateDisplayOpacityAttr([_SKIN_OPACITY])
    _show(mesh, codes, motion.tracked)
    for bone in anatomy.bones:
        rest, hung = skin.body.rest_bones[bone.name], skin.bone_hung(bone.name)
        mesh = skeleton.add(f"{bone.name}_surface", rest, bone.faces, *hung, _BONE)
        _show(mesh, codes, motion.shown[:, list(motion.transforms).index(bone.name)] & motion.tracked)
    with replaced_if_own(path, MARK) as partial:
        if not stage.GetRootLayer().Export(str(partial)):
            raise MotionError("could not be written", where=path, remedy="check the disk")
    return skin_gap(skin, thetas)


def _stage(rate: float, last_code: float) -> Any:
    from pxr import Usd, UsdGeom

    stage = Usd.Stage.CreateInMemory()
    stage.GetRootLayer().documentation = f"{WRITTEN}; metres, y up, time code 0 at the first frame"
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y)
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    stage.SetTimeCodesPerSecond(rate)
    stage.SetFramesPerSecond(rate)
    stage.SetStartTimeCode(0.0)
    stage.SetEndTimeCode(last_code)
    return stage


class _Skeleton:
    """The skin's joints as a skeleton on a stage, each after its parent, as the format wants them."""

    def __init__(self, stage: Any, skin: LinearSkin) -> None:
        from pxr import UsdSkel, Vt

        self.stage, self.skin = stage, skin
        paths = [_joint_path(skin, k) for k in range(len(skin.names))]
        self.order = sorted(range(len(paths)), key=lambda k: paths[k].count("/"))
        self.place = np.argsort(self.order)  # of each of the skin's joints in that order
        self.joints = Vt.TokenArray([paths[k] for k in self.order])
        self.skeleton = UsdSkel.Skeleton.Define(stage, f"{_ROOT}/skeleton")
        self.skeleton.CreateJointsAttr(self.joints)
        self.skeleton.CreateBindTransformsAttr(_matrices(skin.rest[self.order]))
        self.skeleton.CreateRestTransformsAttr(_matrices(local_frames(skin, skin.rest[None])[0, self.order]))

    def move(self, codes: Floats, frames: Floats) -> None:
        """Put the joints at frames (T, J, 4, 4) at time codes (T,)."""
        from pxr import UsdSkel, Vt

        animation = UsdSkel.Animation.Define(self.stage, f"{_ROOT}/skeleton/animation")
        animation.CreateJointsAttr(self.joints)
        UsdSkel.BindingAPI.Apply(self.skeleton.GetPrim()).CreateAnimationSourceRel().SetTargets([animation.GetPath()])
        keys = joint_keys(self.skin, frames)
        parts = (
            (animation.CreateTranslationsAttr(), Vt.Vec3fArray, keys.translations.astype(np.float32)),
            (animation.CreateRotationsAttr(), Vt.QuatfArray, keys.rotations.astype(np.float32)),
            (animation.CreateScalesAttr(), Vt.Vec3hArray, keys.scales.astype(np.float16)),
        )
        for attribute, kind, values in parts:
            for code, value in zip(codes, values, strict=True):
                attribute.Set(kind.FromNumpy(np.ascontiguousarray(value[self.order])), float(code))

    def add(self, name: str, vertices: Floats, faces: Ints, joints: Ints, weights: Floats, colour: Any) -> Any:
        """A mesh at rest, whose vertices (V, 3) hang on ``joints`` (V, I) of the skin by ``weights`` (V, I)."""
        from pxr import UsdGeom, UsdSkel, Vt

        mesh = UsdGeom.Mesh.Define(self.stage, f"{_ROOT}/{_identifier(name)}")
        mesh.CreatePointsAttr(_points(vertices))
        mesh.CreateNormalsAttr(_points(vertex_normals(vertices, faces, incidence(faces, len(vertices)))))
        mesh.SetNormalsInterpolation(UsdGeom.Tokens.vertex)
        mesh.CreateFaceVertexCountsAttr(Vt.IntArray(len(faces), 3))
        mesh.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(faces.reshape(-1).astype(np.int32)))
        mesh.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
        mesh.CreateExtentAttr(_bounds(vertices))
        mesh.CreateDisplayColorAttr([colour])
        binding = UsdSkel.BindingAPI.Apply(mesh.GetPrim())
        binding.CreateSkeletonRel().SetTargets([self.skeleton.GetPath()])
        binding.CreateGeomBindTransformAttr(_matrices(np.eye(4)[None])[0])
        count, exact = weights.shape[1], weights.astype(np.float32)
        exact[:, 0] = 1.0 - exact[:, 1:].sum(axis=1)  # in single precision, too, they sum up to 1
        index = np.where(exact > 0.0, self.place[joints], 0).astype(np.int32)
        binding.CreateJointIndicesPrimvar(False, count).Set(Vt.IntArray.FromNumpy(index.reshape(-1)))
        binding.CreateJointWeightsPrimvar(False, count).Set(Vt.FloatArray.FromNumpy(exact.reshape(-1)))
        return mesh


def _joint_path(skin: LinearSkin, joint: int) -> str:
    """A joint's name behind those of all that it hangs on."""
    parent, name = skin.parents[joint], _identifier(skin.names[joint])
    return name if parent is None else f"{_joint_path(skin, parent)}/{name}"


def _identifier(name: str) -> str:
    from pxr import Tf

    return str(Tf.MakeValidIdentifier(name))


def _show(mesh: Any, codes: Floats, shown: Bools) -> None:
    """Make a mesh invisible from each time code (T,) on at which it is not shown (T,) to the next at which it is."""
    from pxr import UsdGeom

    if shown.all():
        return
    visibility = mesh.CreateVisibilityAttr()
    for t in np.flatnonzero(np.r_[True, shown[1:] != shown[:-1]]):
        visibility.Set(UsdGeom.Tokens.inherited if shown[t] else UsdGeom.Tokens.invisible, float(codes[t]))


def _around(skin: LinearSkin, frames: Floats) -> Floats:
    """Two corners (2, 3) of a box that holds the skin wherever its joints stand in frames (T, J, 4, 4)."""
    rest = skin.rest[skin.joints[:, 0], :3, 3]
    reach = 1.1 * np.linalg.norm(skin.body.v_tilde.value - rest, axis=1).max()  # joints' scales are next to 1
    at = frames[..., :3, 3].reshape(-1, 3)
    return np.array([at.min(axis=0) - reach, at.max(axis=0) + reach])


def _points(points: Floats) -> Any:
    from pxr import Vt

    return Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(points, dtype=np.float32))


def _bounds(points: Floats) -> Any:
    return _points(np.array([points.min(axis=0), points.max(axis=0)]))


def _matrices(transforms: Floats) -> Any:
    """Transforms (N, 4, 4), which act on columns here and on rows there."""
    from pxr import Vt

    return Vt.Matrix4dArray.FromNumpy(np.ascontiguousarray(transforms.swapaxes(1, 2)))
