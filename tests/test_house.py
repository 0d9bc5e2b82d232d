"""The shape of the code: no circle of imports, no module over 300 lines, no function over 50. Read from the sources."""

from __future__ import annotations

import ast
from functools import cache
from pathlib import Path

from tests.sources import ROOT, circles, modules

MODULE_LINES, FUNCTION_LINES = 300, 50


def sources() -> list[Path]:
    """All Python files but the tests."""
    return [*modules().values(), *sorted((ROOT / "docs").rglob("*.py"))]


@cache
def lengths() -> dict[str, int]:
    """How many lines every file has."""
    return {str(path.relative_to(ROOT)): len(path.read_text(encoding="utf-8").splitlines()) for path in sources()}


@cache
def function_lengths() -> dict[str, int]:
    """How many lines every function and method has from ``def`` on, by file and name; of two of a name, the longer."""
    found: dict[str, int] = {}
    for path in sources():
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
                name = f"{path.relative_to(ROOT)} {node.name}"
                found[name] = max(found.get(name, 0), (node.end_lineno or node.lineno) - node.lineno + 1)
    return found


def over(sizes: dict[str, int], limit: int) -> dict[str, int]:
    """What is larger than the limit."""
    return {name: size for name, size in sizes.items() if size > limit}


def test_no_modules_import_each_other_in_a_circle():
    assert [sorted(circle) for circle in circles()] == []


def test_a_circle_is_found_through_functions_and_through_types(tmp_path):
    for name, text in {
        "a": "def late():\n    from capture.b import two\n",
        "b": "from typing import TYPE_CHECKING\n\nif TYPE_CHECKING:\n    from capture import c\n",
        "c": "import capture.a\n",
        "d": "from capture.a import late\n",
    }.items():
        (tmp_path / "capture").mkdir(exist_ok=True)
        (tmp_path / "capture" / f"{name}.py").write_text(text)
    assert circles(tmp_path) == [frozenset({"capture.a", "capture.b", "capture.c"})]


def test_no_module_is_longer_than_300_lines():
    assert over(lengths(), MODULE_LINES) == {}


def test_no_function_is_longer_than_50_lines():
    assert over(function_lengths(), FUNCTION_LINES) == {}
