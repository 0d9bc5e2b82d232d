"""Nothing tests a type's name but the type itself: a new joint or deformer is one file and its line in the registry."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

from adapt.model.deformers import DEFORMER_TYPES
from adapt.model.joints import JOINT_TYPES

ROOT = Path(__file__).parents[1]
OWN = ("adapt/model/joints", "adapt/model/deformers", "adapt/template_builder", "track/evaluation")
"""The types, the templates that are made of them, and research programs that ask for one limb's forearm or bend."""


def product_files() -> list[Path]:
    """All Python files of the packages but those that may name types."""
    files = [path for package in ("capture", "adapt", "track") for path in sorted((ROOT / package).rglob("*.py"))]
    return [path for path in files if not any(path.is_relative_to(ROOT / own) for own in OWN)]


def types_named(source: str) -> list[tuple[int, str]]:
    """Line and name of every string in a source that is a type's name."""
    constants = (node for node in ast.walk(ast.parse(source)) if isinstance(node, ast.Constant))
    return [
        (node.lineno, node.value)
        for node in constants
        if isinstance(node.value, str) and (node.value in JOINT_TYPES or node.value in DEFORMER_TYPES)
    ]


def test_no_other_file_names_a_type() -> None:
    files = product_files()
    assert len(files) > 150
    named = {str(path.relative_to(ROOT)): types_named(path.read_text(encoding="utf-8")) for path in files}
    assert not {path: found for path, found in named.items() if found}, (
        "ask the type itself, or adapt.model.pose_space, instead"
    )


@pytest.mark.parametrize(
    "source",
    [
        'if joint.type == "free": pass',
        'x = joint.type in ("hinge", "other")',
        'match joint.type:\n    case "spline":\n        pass',
        '_PARTS = {"ball": (3, 3)}',
        'match deformer.type:\n    case "forearm":\n        pass',
    ],
)
def test_a_named_type_is_found(source: str) -> None:
    assert len(types_named(source)) == 1


def test_words_that_only_hold_a_types_name_are_none() -> None:
    assert not types_named('"""A free joint."""\nfree = "ball in the hand"')
