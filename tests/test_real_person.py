"""A real limb beside ours: what is measured on its surfaces does not depend on where it lies."""

from __future__ import annotations

import numpy as np
import pytest

from adapt.template_builder.meshes import Mesh
from capture.rigid import apply, exp_so3, transform
from capture.simulation.rig import box_mesh
from track.evaluation.experiments.real_limbs import RealLimb
from track.evaluation.experiments.real_motion import depths_mm
from track.evaluation.experiments.real_person import Posed, compared, shaft_axis
from track.evaluation.experiments.surface_fit import greatest_length
from track.evaluation.holes import closed

MOVE = transform(exp_so3(np.array([0.3, -0.8, 0.2])), np.array([0.5, 0.1, -0.3]))


def bone(*, length: float = 0.4) -> Mesh:
    return Mesh(*box_mesh((0.02, length, 0.03)))


def moved(mesh: Mesh, rigid: np.ndarray) -> Mesh:
    return Mesh(apply(rigid, mesh.vertices), mesh.faces)


def test_the_longest_side_of_a_bone_tells_its_axis_and_its_length() -> None:
    there = moved(_finer(bone()), MOVE)
    assert greatest_length(there) == pytest.approx(np.sqrt(0.02**2 + 0.4**2 + 0.03**2))
    assert abs(shaft_axis(there) @ MOVE[:3, 1]) == pytest.approx(1.0)


def test_a_mesh_with_two_holes_is_closed() -> None:
    vertices, faces = box_mesh((0.1, 0.4, 0.1))
    ends = [np.ptp(vertices[face, 1]) < 1e-9 for face in faces]
    tube = Mesh(vertices, faces[~np.array(ends)])
    assert not tube.is_closed()
    whole = closed(tube)
    assert whole.is_closed()
    assert whole.volume() == pytest.approx(0.1 * 0.4 * 0.1)


def test_a_limb_beside_itself_has_no_error_and_a_shorter_one_has_that_of_its_length() -> None:
    centres = {"hip": np.array([0.0, 0.2, 0.0]), "knee": np.array([0.0, -0.2, 0.0])}
    skin, femur = bone(), _finer(bone())
    every = np.ones(len(skin.vertices), dtype=np.bool_)
    him = RealLimb(skin, {"femur": femur}, centres, {})
    same = compared(Posed(skin, {"femur": femur}, centres, every), him)
    assert same["centres_mm"] == {"hip": [0.0, 0.0, 0.0], "knee": [0.0, 0.0, 0.0]}
    assert same["surfaces"]["femur"]["as it lies"] == pytest.approx([0.0, 0.0, 0.0], abs=1e-9)
    lower = centres | {"knee": np.array([0.0, -0.16, 0.0])}
    shorter = compared(Posed(skin, {"femur": _finer(bone(length=0.36))}, lower, every), him)
    assert shorter["distances_m"]["hip to knee"] == pytest.approx([0.36, 0.40])
    assert shorter["axes_deg"]["femur"] == pytest.approx(0.0, abs=0.05)
    assert shorter["surfaces"]["femur"]["as it lies"][2] == pytest.approx(20.0)


def _finer(mesh: Mesh) -> Mesh:
    """Each triangle in sixteen, so that the middle of the bone has faces of its own."""
    import igl

    vertices, faces = igl.upsample(mesh.vertices, mesh.faces, 3)
    return Mesh(np.asarray(vertices), np.asarray(faces, dtype=np.int64))


def test_a_joint_lies_so_deep_below_the_nearest_skin() -> None:
    skin = Mesh(*box_mesh((0.2, 0.4, 0.3)))
    limb = RealLimb(skin, {}, {"middle": np.zeros(3), "near": np.array([0.0, 0.17, 0.0])}, {})
    assert depths_mm(limb) == {"middle": pytest.approx(100.0), "near": pytest.approx(30.0)}
