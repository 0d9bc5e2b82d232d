"""One file projects points, and one decides what the sensors see."""

from __future__ import annotations

import ast
import re
from collections.abc import Callable, Iterable
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PROJECTS, SEES = "capture/projection.py", "adapt/match/visibility.py"

# ``capture`` is not asked: it knows of no skin, only of how squarely a sensor looked at a surface that it measured.
SEE_SKIN = ("adapt", "track", "docs/figures")
_LINE_OF_SIGHT = re.compile(r"sight|towards?|forward|eyes?|rays?|sensors?|world_from_sensor|world_from_eye|direction")


def found(packages: Iterable[str], but: str, wrong: Callable[[ast.AST], bool]) -> dict[str, list[int]]:
    """Files of the packages, but for one, and the lines in them where something is wrong."""
    files = [path for package in packages for path in sorted((ROOT / package).rglob("*.py"))]
    assert len(files) > 100
    lines = {str(path.relative_to(ROOT)): lines_of(path.read_text(encoding="utf-8"), wrong) for path in files}
    return {path: where for path, where in lines.items() if where and path != but}


def lines_of(source: str, wrong: Callable[[ast.AST], bool]) -> list[int]:
    """The lines of a source where something is wrong."""
    return sorted({node.lineno for node in ast.walk(ast.parse(source)) if isinstance(node, ast.expr) and wrong(node)})


def names(node: ast.AST) -> set[str]:
    """All names and attributes in an expression."""
    inner = list(ast.walk(node))
    return {part.id for part in inner if isinstance(part, ast.Name)} | {
        part.attr for part in inner if isinstance(part, ast.Attribute)
    }


def projects(node: ast.AST) -> bool:
    """Whether an expression calls OpenCV's projection, adds a principal point to products, or multiplies a matrix."""
    if isinstance(node, ast.Attribute):
        return node.attr == "projectPoints"
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Add):
        return any({f"f{axis}", f"c{axis}"} <= names(node) for axis in "xy")
    is_product = isinstance(node, ast.BinOp) and isinstance(node.op, ast.MatMult)
    return is_product and isinstance(node.left, ast.Attribute) and node.left.attr == "matrix"


def compares_with_line_of_sight(node: ast.AST) -> bool:
    """Whether a comparison asks how a normal stands to a line of sight: by name, or by a frame's third column."""
    if not isinstance(node, ast.Compare):
        return False
    named = names(node)
    if named & {"facing", "toward", "towards"}:
        return True
    columns = {ast.unparse(part.slice) for part in ast.walk(node) if isinstance(part, ast.Subscript)}
    if {"(0, 2)", "(1, 2)", "(2, 2)"} <= columns:
        return True
    return any("normal" in name for name in named) and any(_LINE_OF_SIGHT.fullmatch(name) for name in named)


def test_one_file_projects_points() -> None:
    assert not found(("adapt", "capture", "track", "docs/figures"), PROJECTS, projects), f"ask {PROJECTS} instead"


def test_one_file_decides_what_the_sensors_see() -> None:
    assert not found(SEE_SKIN, SEES, compares_with_line_of_sight), f"ask {SEES} instead"


@pytest.mark.parametrize(
    "source",
    [
        "uv = cv2.projectPoints(rays, zero, zero, identity, distortion)",
        "uv = normalised * (camera.fx, camera.fy) + (camera.cx, camera.cy)",
        "u = fx * x / z + cx",
        "uv = camera.matrix @ points.T",
    ],
)
def test_a_projection_is_found(source: str) -> None:
    assert lines_of(source, projects) == [1]


@pytest.mark.parametrize(
    "source",
    [
        'visible = np.einsum("ij,ij->i", normals, sight) > 0.2 * np.linalg.norm(sight, axis=1)',
        "outline = np.abs(normals @ (-forward)) < OUTLINE",
        "counted = weights * (normals @ toward > 0.2)",
        "on_outline = abs(e * t[0, 2] + f * t[1, 2] + g * t[2, 2]) >= OUTLINE",
        "away = towards <= facing * np.sqrt(a * a + b * b + c * c)",
    ],
)
def test_a_comparison_with_the_line_of_sight_is_found(source: str) -> None:
    assert lines_of(source, compares_with_line_of_sight) == [1]


def test_what_is_no_projection_and_no_line_of_sight_is_not_found() -> None:
    assert not lines_of("slope = (u - camera.cx) / camera.fx", projects)
    assert not lines_of("same = normals @ other_normals > 0.8", compares_with_line_of_sight)
