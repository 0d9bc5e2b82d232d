"""A motion as an animated glTF file: skin, bones and skeleton, for Blender, game engines and viewers in the browser.

What is not known: glTF has no key that says "unknown". A lost frame has no key, so a viewer moves evenly from the
frame before to the frame after; a bone's surface shrinks to nothing in frames in which the bone does not show (all of
them do in lost frames). The skin is one mesh and stays, there on guessed poses.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

from adapt.anatomy import Floats, Ints
from adapt.model.surface import incidence, vertex_normals
from adapt.subject import Subject
from capture.rigid import apply, inverse
from capture.upright import AXES
from track.export.glb import Glb
from track.export.joint_keys import joint_keys, posed_joints
from track.export.linear_skin import LinearSkin, SkinGap, linear_skin, skin_gap
from track.export.upright import y_up
from track.motion import Motion, MotionError

_MATERIALS: list[dict[str, Any]] = [
    {
        "name": "skin",
        "doubleSided": True,
        "alphaMode": "BLEND",
        "pbrMetallicRoughness": {"baseColorFactor": [0.85, 0.62, 0.52, 0.4], "metallicFactor": 0.0},
    },
    {
        "name": "bone",
        "pbrMetallicRoughness": {"baseColorFactor": [0.92, 0.88, 0.78, 1.0], "metallicFactor": 0.0},
    },
]
_SKIN, _BONE = range(2)


@dataclass(frozen=True)
class GltfReport:
    """What a written file does not say exactly: how far its skin is off, and frames without keys."""

    skin: SkinGap
    worst_frame: int
    lost_frames: int
    frames_with_hidden_bones: int


def write_gltf(motion: Motion, subject: Subject, path: Path, *, up: Floats = AXES["y"]) -> GltfReport:
    """Write a motion of the subject as ``.glb``: metres, y up, time 0 at the first frame.

    ``up`` (3,) is the direction of the recording's frame that points up (``capture.upright``); where it is y, positions
    are those of the recording's frame.

    Raises:
        MotionError: no frame was tracked.
    """
    if not motion.tracked.any():
        raise MotionError("no frame was tracked", remedy="a motion without a pose cannot be animated")
    thetas = motion.thetas[motion.tracked]
    skin, glb = linear_skin(subject.body, thetas), Glb()
    nodes = _joint_nodes(skin)
    meshes = [_skin_mesh(glb, skin), *_bone_meshes(glb, skin)]
    bone_nodes, unattached = _attach_bones(skin, nodes)
    nodes.append({"name": "skin", "mesh": 0, "skin": 0})
    roots = [k for k, parent in enumerate(skin.parents) if parent is None]
    times = motion.times[motion.tracked] - motion.times[0]
    channels = _joint_channels(glb, skin, times, thetas, y_up(up)) + _bone_channels(glb, motion, bone_nodes)
    document = {
        "extras": {"anatomy": motion.anatomy, "lost_frames": np.flatnonzero(~motion.tracked).tolist()},
        "scene": 0,
        "scenes": [{"nodes": [*roots, *unattached, len(nodes) - 1]}],
        "nodes": nodes,
        "meshes": meshes,
        "materials": _MATERIALS,
        "skins": [
            {
                "joints": list(range(len(skin.names))),
                "inverseBindMatrices": glb.add(np.array([inverse(frame) for frame in skin.rest])),
            }
        ],
        "animations": [
            {
                "name": "motion",
                "samplers": [sampler for sampler, _ in channels],
                "channels": [{"sampler": k, "target": target} for k, (_, target) in enumerate(channels)],
            }
        ],
    }
    glb.write(path, document)
    hidden = (~motion.shown).any(axis=1) & motion.tracked
    error = skin_gap(skin, thetas)
    worst = int(np.flatnonzero(motion.tracked)[error.worst_pose])
    return GltfReport(error, worst, int((~motion.tracked).sum()), int(hidden.sum()))


def _joint_nodes(skin: LinearSkin) -> list[dict[str, Any]]:
    """A node for every joint, at rest, with its children."""
    nodes: list[dict[str, Any]] = []
    rest = joint_keys(skin, skin.rest[None])
    for k, name in enumerate(skin.names):
        node = {
            "name": name,
            "translation": rest.translations[0, k].tolist(),
            "rotation": rest.rotations[0, k].tolist(),
        }
        children = [child for child, parent in enumerate(skin.parents) if parent == k]
        nodes.append(node | ({"children": children} if children else {}))
    return nodes


def _attach_bones(skin: LinearSkin, nodes: list[dict[str, Any]]) -> tuple[dict[str, list[int]], list[int]]:
    """Add a node with the bone's surface to every bone's joint; returns the nodes that scale it, by the bone's name.

    And the nodes of bones along a curve, which hang on joints as the skin does, and are scaled by these.
    """
    scaled, unattached, along = {}, [], {bone.name: bone for bone in skin.along}
    for k, bone in enumerate(skin.body.anatomy.bones):
        node: dict[str, Any] = {"name": f"{bone.name}_surface", "mesh": 1 + k}
        if bone.name in along:
            first = skin.first_helper(along[bone.name])
            scaled[bone.name] = list(range(first, first + len(along[bone.name].helpers)))
            unattached.append(len(nodes))
            node["skin"] = 0
        else:
            scaled[bone.name] = [len(nodes)]
            nodes[k].setdefault("children", []).append(len(nodes))
        nodes.append(node)
    return scaled, unattached


def _skin_mesh(glb: Glb, skin: LinearSkin) -> dict[str, Any]:
    mesh = _mesh(glb, "skin", skin.body.v_tilde.value, skin.body.anatomy.skin_faces, _SKIN)
    return _hung(glb, mesh, skin, skin.joints, skin.weights)


def _hung(glb: Glb, mesh: dict[str, Any], skin: LinearSkin, joints: Ints, weights: Floats) -> dict[str, Any]:
    """A mesh whose vertices hang on ``joints`` (N, 4) by ``weights`` (N, 4)."""
    single = weights.astype(np.float32)
    single[:, 0] = 1.0 - single[:, 1:].sum(axis=1)  # in single precision, too, they sum up to 1
    index: Literal["<u1", "<u2"] = "<u1" if len(skin.names) <= 256 else "<u2"  # a byte holds no more
    mesh["primitives"][0]["attributes"] |= {
        "JOINTS_0": glb.add(np.where(single > 0.0, joints, 0), index, use="vertices"),
        "WEIGHTS_0": glb.add(single, use="vertices"),
    }
    return mesh


def _bone_meshes(glb: Glb, skin: LinearSkin) -> list[dict[str, Any]]:
    """Every bone's surface in its joint's frame; of a bone along a curve at rest, hung on its joints."""
    along, meshes = {bone.name for bone in skin.along}, []
    for bone, frame in zip(skin.body.anatomy.bones, skin.rest, strict=False):
        rest = skin.body.rest_bones[bone.name]
        if bone.name in along:
            mesh = _mesh(glb, bone.name, rest, bone.faces, _BONE)
            meshes.append(_hung(glb, mesh, skin, *skin.bone_hung(bone.name)))
        else:
            meshes.append(_mesh(glb, bone.name, apply(inverse(frame), rest), bone.faces, _BONE))
    return meshes


def _mesh(glb: Glb, name: str, vertices: Floats, faces: Ints, material: int) -> dict[str, Any]:
    normals = vertex_normals(vertices, faces, incidence(faces, len(vertices)))
    attributes = {
        "POSITION": glb.add(vertices, use="vertices", bounds=True),
        "NORMAL": glb.add(normals, use="vertices"),
    }
    indices = glb.add(faces.reshape(-1), "<u4", use="faces")
    return {"name": name, "primitives": [{"attributes": attributes, "indices": indices, "material": material}]}


def _joint_channels(
    glb: Glb, skin: LinearSkin, times: Floats, thetas: Floats, turned: Floats
) -> list[tuple[dict[str, Any], dict[str, Any]]]:
    """Keys of every joint at times (T,) s with poses (T, n), all ``turned``: pairs of a sampler and its target."""
    keys, at = glb.add(times, bounds=True), joint_keys(skin, posed_joints(skin, thetas, turned))
    channels = []
    for k in range(len(skin.names)):
        parts = {"translation": at.translations[:, k], "rotation": at.rotations[:, k]}
        if not np.allclose(at.scales[:, k], 1.0, atol=1e-6):
            parts["scale"] = at.scales[:, k]
        for part, values in parts.items():
            sampler = {"input": keys, "interpolation": "LINEAR", "output": glb.add(values)}
            channels.append((sampler, {"node": k, "path": part}))
    return channels


def _bone_channels(
    glb: Glb, motion: Motion, nodes: dict[str, list[int]]
) -> list[tuple[dict[str, Any], dict[str, Any]]]:
    """Keys that shrink the surfaces of bones to nothing from a frame in which they do not show to one where they do."""
    shown = motion.shown & motion.tracked[:, None]
    if shown.all():
        return []
    times = glb.add(motion.times - motion.times[0], bounds=True)
    channels = []
    for name, shows in zip(motion.transforms, shown.T, strict=True):
        if not shows.all():
            scale = glb.add(np.repeat(shows[:, None], 3, axis=1))
            sampler = {"input": times, "interpolation": "STEP", "output": scale}
            channels += [(sampler, {"node": node, "path": "scale"}) for node in nodes[name]]
    return channels
