"""Every error about a user's files says what to do."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

import capture

MODULES = sorted(
    path
    for part in ("importers", "recording", "calibration", "cloud", "")
    for path in (Path(capture.__file__).parent / part).glob("*.py")
)


@pytest.mark.parametrize("module", MODULES, ids=lambda path: f"{path.parent.name}.{path.stem}")
def test_errors_have_a_remedy(module: Path) -> None:
    raised = [node.exc for node in ast.walk(ast.parse(module.read_text())) if isinstance(node, ast.Raise)]
    silent = [
        ast.unparse(error)
        for error in raised
        if isinstance(error, ast.Call)
        and getattr(error.func, "id", "") in {"RecordingError", "CalibrationError", "CloudError"}
        and "remedy" not in {keyword.arg for keyword in error.keywords}
    ]
    assert not silent
