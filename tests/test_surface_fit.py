"""Fitting one surface to another: what the family can express is found, wherever the other surface lies."""

from __future__ import annotations

import numpy as np
import pytest

from adapt.anatomy import Floats
from adapt.anatomy_file import load_anatomy
from adapt.model.handles import deform, handle_positions
from adapt.template_builder.meshes import Mesh
from capture.rigid import exp_so3
from track.evaluation.experiments.real_bones import handles
from track.evaluation.experiments.surface_fit import affine, fit_family, rigid, sample_surface, uniform_scale

TURN, SHIFT = exp_so3(np.array([0.9, -1.6, 0.5])), np.array([0.4, -0.2, 0.7])


@pytest.fixture(scope="module")
def femur() -> Mesh:
    return handles(load_anatomy("lower-limb-right"), "femur")[0]


def elsewhere(vertices: Floats, mesh: Mesh) -> Mesh:
    """The mesh with these vertices, turned and moved away."""
    return Mesh(vertices @ TURN.T + SHIFT, mesh.faces)


def test_a_bone_made_by_the_handles_is_reached_by_the_handles_and_not_by_one_scale() -> None:
    anatomy = load_anatomy("lower-limb-right")
    mesh, family = handles(anatomy, "femur")
    np.testing.assert_allclose(family.shape(family.start), mesh.vertices, atol=1e-6)
    a = np.tile([1.0, 0.0, 0.0, 0.0], (len(anatomy.handles), 1))
    a[[h.name == "femur_distal" for h in anatomy.handles]] = [0.9, 0.0, -0.04, 0.0]
    bone = anatomy.bone("femur")
    there = elsewhere(deform(bone.vertices, bone.handle_weights, handle_positions(anatomy), a), mesh)
    ours, scaled = (fit_family(mesh, f, there, points=150) for f in (family, uniform_scale(mesh)))
    assert ours.distances.max() < 1e-4
    assert scaled.distances.mean() > 1e-3
    np.testing.assert_allclose(ours.vertices, there.vertices, atol=1e-3)


def test_each_family_has_the_freedom_that_its_name_says(femur: Mesh) -> None:
    sheared = femur.vertices @ np.array([[1.1, 0.1, 0.0], [0.0, 0.95, 0.0], [0.05, 0.0, 1.0]])
    there = elsewhere(sheared, femur)
    fits = [fit_family(femur, family(femur), there, points=120) for family in (rigid, uniform_scale, affine)]
    assert [fit.freedom for fit in fits] == [6, 7, 12]
    assert fits[2].distances.max() < 1e-4 < fits[1].distances.mean()


def test_a_sample_lies_on_the_surface_and_covers_it_evenly(femur: Mesh) -> None:
    points = sample_surface(femur, 4000, np.random.default_rng(0)).of(femur.vertices, femur.faces)
    corners = femur.vertices[femur.faces]
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    middle = (corners.mean(axis=1) * areas[:, None]).sum(axis=0) / areas.sum()
    np.testing.assert_allclose(points.mean(axis=0), middle, atol=0.01)
