"""Docstrings show by example what a function does: of what ships, one public function in five. Read from the sources.

That every example runs and says what comes out is tested with the pages (test_docs).
"""

from __future__ import annotations

import ast
from pathlib import Path

from tests.sources import ROOT, modules
from tests.test_wheel import shipped_files

ONE_IN = 5


def shipped() -> dict[str, Path]:
    """The files of what ships, by module name."""
    files = {ROOT / path for path in shipped_files()}
    return {name: path for name, path in modules().items() if path in files}


def public_functions(path: Path) -> dict[str, bool]:
    """A module's own public functions, and whether their docstrings have an example."""
    functions = (node for node in ast.parse(path.read_text(encoding="utf-8")).body if isinstance(node, ast.FunctionDef))
    return {node.name: ">>> " in (ast.get_docstring(node) or "") for node in functions if not node.name.startswith("_")}


def test_one_public_function_in_five_has_an_example():
    has = [example for path in shipped().values() for example in public_functions(path).values()]
    assert ONE_IN * sum(has) >= len(has), f"{sum(has)} of {len(has)} public functions have an example"


def test_an_example_is_counted_by_its_function(tmp_path):
    source = tmp_path / "source.py"
    source.write_text(
        'def shown():\n    """One.\n\n    >>> 1\n    1\n    """\n\n\ndef plain():\n    """Two."""\n\n\n'
        'def bare():\n    pass\n\n\ndef _own():\n    """Three.\n\n    >>> 3\n    3\n    """\n',
        encoding="utf-8",
    )
    assert public_functions(source) == {"shown": True, "plain": False, "bare": False}
