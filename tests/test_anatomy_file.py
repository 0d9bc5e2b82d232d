"""An anatomy and its model know nothing of files; what reads files knows them."""

from __future__ import annotations

import ast
from pathlib import Path

ADAPT = Path(__file__).parents[1] / "adapt"
BELOW = ("anatomy.py", "anatomy_check.py", "mirror.py", "tissue.py")


def imported(path: Path) -> set[str]:
    """The modules of adapt that a source imports, at its top or inside a function."""
    nodes = ast.walk(ast.parse(path.read_text(encoding="utf-8")))
    names = {node.module or "" for node in nodes if isinstance(node, ast.ImportFrom)}
    return {name for name in names if name.split(".")[0] == "adapt"}


def test_an_anatomy_is_data_and_needs_nothing_of_the_model():
    assert imported(ADAPT / "anatomy.py") == set()


def test_nothing_that_reading_a_file_needs_reads_files():
    below = [*(ADAPT / name for name in BELOW), *sorted((ADAPT / "model").rglob("*.py"))]
    assert len(below) > 30
    assert [path.name for path in below if "adapt.anatomy_file" in imported(path)] == []
