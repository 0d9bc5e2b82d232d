"""Two opinions on how bones differ between people, and the best that either can make of the other's bones.

By handles (paper, section 3.2) a bone's heads keep their shape and its shaft takes up the difference. By one affine map
per bone (Anatomy Transfer, Ali-Hamadi et al. 2013) all of a bone is stretched alike, its heads with it.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy.interpolate import RBFInterpolator

from adapt.anatomy import Anatomy, Floats
from adapt.model.body import Body, make_body
from adapt.model.handles import d_deform_d_shape, handle_positions
from adapt.model.shape.handle_space import affine_set
from track.evaluation.random_bodies import LENGTH_SPREAD, SCALE_SPREAD, random_body, soft_tissue

_SKIN_SAMPLES = 1200  # whose displacement is interpolated into the limb
_EVERY = 4  # of a bone's vertices, one in so many is fitted to


@dataclass(frozen=True, eq=False)
class Person:
    """Somebody's rest skin (V, 3) and bones (N, 3) by name, vertex by vertex those of the template. Metres."""

    skin: Floats = field(repr=False)
    bones: dict[str, Floats] = field(repr=False)


def person_by_handles(anatomy: Anatomy, seed: int) -> Person:
    """A random person as the model has it: ``track.evaluation.random_bodies.random_body``."""
    body = random_body(anatomy, seed)
    return Person(body.v_tilde.value, body.rest_bones)


def person_by_stretch(anatomy: Anatomy, seed: int) -> Person:
    """A random person whose bones are stretched along and across, each as a whole; the skin rides along.

    As much as by handles: lengths within 8 per cent, widths within 6, soft tissue. Bones between the same joints are
    stretched alike, and each starts where its parent has been stretched to, so that nothing dislocates.
    """
    rng = np.random.default_rng(seed)
    maps = _stretches(anatomy, rng)
    skin = _homogeneous(anatomy.skin_vertices + soft_tissue(anatomy, rng))
    riding = make_body(anatomy).skin_riding
    moved = sum(riding[:, [k]] * (skin @ maps[bone.name]) for k, bone in enumerate(anatomy.bones))
    bones = {bone.name: _homogeneous(bone.vertices) @ maps[bone.name] for bone in anatomy.bones}
    return Person(np.asarray(moved), bones)


def _stretches(anatomy: Anatomy, rng: np.random.Generator) -> dict[str, Floats]:
    """The affine map (4, 3) of every bone, for points in rows: [x 1] @ map."""
    factors: dict[tuple[str, ...], tuple[float, float]] = {}
    maps: dict[str, Floats] = {}
    for joint in anatomy.joints:
        own = [handle for handle in anatomy.handles if handle.bone == joint.child]
        start, end = np.array(own[0].position), np.array(own[-1].position)
        between = tuple(handle.joint for handle in own)
        if between not in factors:
            length, width = (1.0 + rng.uniform(-spread, spread) for spread in (LENGTH_SPREAD, SCALE_SPREAD))
            factors[between] = (length, width)
        length, width = factors[between]
        along = (end - start) / max(float(np.linalg.norm(end - start)), 1e-9)
        linear = width * np.eye(3) + (length - width) * np.outer(along, along)
        carried = start if joint.parent is None else (_homogeneous(start[None]) @ maps[joint.parent])[0]
        maps[joint.child] = np.vstack([linear, carried - start @ linear])
    return maps


def affine_bones(anatomy: Anatomy, goals: dict[str, Floats]) -> dict[str, Floats]:
    """The template's bones, each by the affine map that takes it nearest (least squares) to its goal (N, 3)."""
    return {
        bone.name: _homogeneous(bone.vertices) @ fit_affine(bone.vertices[::_EVERY], goals[bone.name][::_EVERY])
        for bone in anatomy.bones
    }


def fit_affine(points: Floats, goals: Floats) -> Floats:
    """argmin_M |[x 1] M - y|^2 over maps M (4, 3), for points x (N, 3) and goals y (N, 3)."""
    return np.asarray(np.linalg.lstsq(_homogeneous(points), goals, rcond=None)[0])


def warped_bones(anatomy: Anatomy, skins: list[Floats]) -> list[dict[str, Floats]]:
    """Where the template's bones go when skins (V, 3) carry what is inside them, smoothly and biharmonically.

    Anatomy Transfer interpolates the skin's displacement into the body before it fits the bones. Radial functions
    |x - x_i|, the biharmonic equation's fundamental solution in space, on vertices of the skin.
    """
    count = len(anatomy.skin_vertices)
    some = np.linspace(0, count - 1, min(_SKIN_SAMPLES, count)).round().astype(int)
    shifts = np.concatenate([skin[some] - anatomy.skin_vertices[some] for skin in skins], axis=1)
    field_ = RBFInterpolator(anatomy.skin_vertices[some], shifts, kernel="linear", degree=1)
    moved = {bone.name: field_(bone.vertices).reshape(len(bone.vertices), -1, 3) for bone in anatomy.bones}
    return [{bone.name: bone.vertices + moved[bone.name][:, k] for bone in anatomy.bones} for k, _ in enumerate(skins)]


def body_through_bones(anatomy: Anatomy, goals: dict[str, Floats]) -> Body:
    """The body whose bones come nearest (least squares over vertices) to goals (N, 3) by name."""
    points = np.concatenate([bone.vertices[::_EVERY] for bone in anatomy.bones])
    weights = np.concatenate([bone.handle_weights[::_EVERY] for bone in anatomy.bones])
    return _body_through(anatomy, points, weights, np.concatenate([goals[b.name][::_EVERY] for b in anatomy.bones]))


def body_through_skin(anatomy: Anatomy, skin: Floats) -> Body:
    """The body whose skin comes nearest (least squares over vertices) to a skin (V, 3), by its bones alone."""
    return _body_through(anatomy, anatomy.skin_vertices, anatomy.skin_handle_weights, skin)


def _body_through(anatomy: Anatomy, points: Floats, weights: Floats, goals: Floats) -> Body:
    """argmin over shapes of |deform(points) - goals|^2, a linear problem: the handles' identity moves no point."""
    affine = affine_set(anatomy)
    columns = d_deform_d_shape(points, weights, handle_positions(anatomy), affine.basis)
    rows = columns.reshape(-1, columns.shape[-1])
    change = np.linalg.lstsq(rows, (goals - points).ravel(), rcond=None)[0]
    return make_body(anatomy, shape=affine.identity + change)


def _homogeneous(points: Floats) -> Floats:
    return np.column_stack([points, np.ones(len(points))])
