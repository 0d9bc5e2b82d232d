"""Only the shape space knows in which order the numbers of a body's shape stand."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from adapt.anatomy import Anatomy, Handle
from adapt.anatomy_file import anatomy_names, load_anatomy
from adapt.model.shape.handle_space import AffineSet, affine_set
from adapt.model.shape.prior import bones_between_groups, shape_prior
from tests.toy_anatomy import toy_anatomy

ROOT = Path(__file__).parents[1]
OWN = "adapt/model/shape"
LAYOUT = re.compile(r"::4\]|shape\.reshape\(|identity\.reshape\(|4 \* (?:group|j|k|first|second)\b")


def test_no_other_file_knows_the_layout_of_a_shape() -> None:
    files = [path for package in ("capture", "adapt", "track", "docs") for path in (ROOT / package).rglob("*.py")]
    assert len(files) > 200
    own = [path for path in files if path.is_relative_to(ROOT / OWN)]
    assert own
    found = {
        f"{path.relative_to(ROOT)}:{number}": line.strip()
        for path in files
        if path not in own
        for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), start=1)
        if LAYOUT.search(line) and not _of_something_else(line)
    }
    assert not found, "ask adapt.model.shape instead"


def _of_something_else(line: str) -> bool:
    """Every fourth frame, vertex or match is no shape."""
    return bool(re.search(r"(thetas|times|vertices|\[name\])\[::4\]|getattr\(", line))


@pytest.mark.parametrize(
    "line", ["scales = body.shape[::4]", "shape[3::4] *= -1.0", "x = shape.reshape(-1, 4)", "rows.append({4 * j: 1.0})"]
)
def test_a_line_that_knows_the_layout_is_found(line: str) -> None:
    assert LAYOUT.search(line)
    assert not _of_something_else(line)


@pytest.fixture(scope="module", params=anatomy_names())
def anatomy(request: pytest.FixtureRequest) -> Anatomy:
    return load_anatomy(request.param)


def random_shape(affine: AffineSet) -> np.ndarray:
    rng = np.random.default_rng(3)
    return affine.shape(rng.uniform(0.8, 1.2, len(affine.groups)), rng.normal(0.0, 0.02, (len(affine.groups), 3)))


def test_a_shape_says_what_it_was_made_of(anatomy: Anatomy) -> None:
    affine = affine_set(anatomy)
    shape = random_shape(affine)
    np.testing.assert_array_equal(affine.shape(affine.scales(shape), affine.shifts(shape)), shape)
    np.testing.assert_array_equal(affine.mirrored(affine.mirrored(shape)), shape)
    np.testing.assert_array_equal(np.sort(np.r_[affine.scale_columns, affine.shift_columns.ravel()]), range(len(shape)))


def test_a_group_of_handles_stands_where_its_handles_do(anatomy: Anatomy) -> None:
    affine = affine_set(anatomy)
    shape = random_shape(affine)
    a = affine.handle_parameters(shape)
    for j, group in enumerate(affine.groups):
        mine = [i for i, handle in enumerate(anatomy.handles) if handle.joint == group]
        moved = np.array([anatomy.handles[i].position for i in mine]) + a[mine, 1:]
        np.testing.assert_allclose(moved.mean(axis=0), affine.heads(shape)[j], atol=1e-12)
        np.testing.assert_allclose(a[mine, 0], affine.scales(shape)[j])


def test_a_resized_shape_is_larger_all_over(anatomy: Anatomy) -> None:
    affine = affine_set(anatomy)
    shape = random_shape(affine)
    larger = affine.resized(shape, 1.3)
    np.testing.assert_allclose(affine.scales(larger), 1.3 * affine.scales(shape))
    spans = [np.diff(affine.heads(one), axis=0) for one in (shape, larger)]
    np.testing.assert_allclose(spans[1], 1.3 * spans[0])


def test_a_shape_outside_the_model_is_led_back_to_it(anatomy: Anatomy) -> None:
    affine = affine_set(anatomy)
    scales, shifts = np.ones(len(affine.groups)), np.zeros((len(affine.groups), 3))
    scales[0] = -0.5
    shape = affine.shape(scales, shifts)
    assert not affine.is_possible(shape)
    assert affine.is_possible(affine.nearest_possible(shape))
    np.testing.assert_array_equal(affine.nearest_possible(affine.identity), affine.identity)


def test_of_a_bone_with_three_heads_all_pairs_are_held_together() -> None:
    toy = toy_anatomy()
    toy = replace(toy, handles=(*toy.handles, Handle("thumb", "palm", "thumb", (0.2, -0.45, 0.08))))
    affine = affine_set(toy)
    heads = [affine.groups.index(name) for name in ("wrist", "tips", "thumb")]
    pairs = [tuple(sorted(pair)) for pair, bone in bones_between_groups(toy, affine).items() if bone == "palm"]
    assert sorted(pairs) == sorted((i, j) for i in heads for j in heads if i < j)
    assert np.linalg.eigvalsh(shape_prior(toy, affine).precision).min() > 1.0
