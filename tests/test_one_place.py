"""One file projects points, one says what sensors see, one assembles normal equations, one holds uncertainty."""

from __future__ import annotations

import ast
import re
from collections.abc import Callable, Iterable
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PROJECTS, SEES = "capture/projection.py", "adapt/match/visibility.py"
ASSEMBLES, SOLVES, DOUBTS = "adapt/fit/problem.py", "adapt/fit/least_squares.py", "adapt/fit/posterior.py"

# ``capture`` is not asked: it knows of no skin, only of how squarely a sensor looked at a surface that it measured.
SEE_SKIN = ("adapt", "track", "docs/figures")
# Planes, sensors' places (``capture``) and bones registered to bones (``evaluation``) are least squares of their own.
FIT_LIMBS = ("adapt", "track")
# What is known of people before anything is seen (``shape``) is no posterior.
OTHER_PROBLEMS = ("track/evaluation/", "adapt/template_builder/", "adapt/model/shape/")
# A search ranks poses by all their skin: it weighs no matches.
COUNTS, MATCHES, RANKS_POSES = "adapt/match/skin_sample.py", "adapt/match/correspondences.py", "adapt/search/"
DERIVATIVES = {"jacobian", "residual", "flat", "far", "d"}
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


def assembles(node: ast.AST) -> bool:
    """Whether an expression multiplies derivatives with each other or with what they are derivatives of."""
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.MatMult):
        turned = {part.attr for part in ast.walk(node.left) if isinstance(part, ast.Attribute)}
        return bool(turned & {"T", "swapaxes", "transpose"} and names(node.left) & DERIVATIVES)
    if not isinstance(node, ast.Call) or not isinstance(node.func, ast.Attribute):
        return False
    derived = [bool(names(argument) & DERIVATIVES) for argument in node.args]
    return node.func.attr in ("einsum", "matmul", "dot", "vdot") and sum(derived) > 1


def reads_normal_matrix(node: ast.AST) -> bool:
    """Whether an expression takes the normal matrix out of a sum of squares."""
    return isinstance(node, ast.Attribute) and node.attr == "hessian"


def reckons_with_covariance(node: ast.AST) -> bool:
    """Whether an expression calculates with a covariance: adds, multiplies, takes its diagonal, a root of it."""
    if isinstance(node, ast.BinOp):
        return is_covariance(node.left) or is_covariance(node.right)
    if not isinstance(node, ast.Call) or not isinstance(node.func, ast.Attribute):
        return False
    return names(node.func) >= {"np"} and node.func.attr != "array" and any(is_covariance(a) for a in node.args)


def is_covariance(node: ast.AST) -> bool:
    """Whether an expression is a covariance, part of one, or its transpose."""
    if isinstance(node, ast.Subscript) or (isinstance(node, ast.Attribute) and node.attr == "T"):
        return is_covariance(node.value)
    name = node.attr if isinstance(node, ast.Attribute) else node.id if isinstance(node, ast.Name) else ""
    return name.startswith("covariance") or name.endswith("covariance")


def found_in_fits(but: str, wrong: Callable[[ast.AST], bool]) -> dict[str, list[int]]:
    """What is found in the files that fit limbs."""
    return {path: lines for path, lines in found(FIT_LIMBS, but, wrong).items() if not path.startswith(OTHER_PROBLEMS)}


def test_one_file_projects_points() -> None:
    assert not found(("adapt", "capture", "track", "docs/figures"), PROJECTS, projects), f"ask {PROJECTS} instead"


def test_one_file_decides_what_the_sensors_see() -> None:
    assert not found(SEE_SKIN, SEES, compares_with_line_of_sight), f"ask {SEES} instead"


def test_one_file_assembles_normal_equations() -> None:
    assert not found_in_fits(ASSEMBLES, assembles), f"ask {ASSEMBLES} instead"


def test_normal_matrices_are_read_only_where_they_are_solved_and_where_uncertainty_is() -> None:
    assert found_in_fits(ASSEMBLES, reads_normal_matrix).keys() == {SOLVES, DOUBTS}, f"ask {ASSEMBLES} instead"


def test_one_file_holds_uncertainty() -> None:
    assert not found_in_fits(DOUBTS, reckons_with_covariance), f"ask {DOUBTS} instead"


def weighs_for_itself(node: ast.AST) -> bool:
    """Whether an expression takes the observations of some skin for their weights, whatever its pose."""
    return (
        isinstance(node, ast.Subscript) and isinstance(node.value, ast.Attribute) and node.value.attr == "observations"
    )


def test_whoever_weighs_matches_asks_how_far_they_are_trusted() -> None:
    elsewhere = found_in_fits(COUNTS, weighs_for_itself)
    assert elsewhere
    assert all(path.startswith(RANKS_POSES) for path in elsewhere), f"ask {COUNTS} for counts instead"


def test_matches_are_found_in_one_place_that_says_how_far_they_are_trusted() -> None:
    assert found_in_fits(MATCHES, calls("find_corres")).keys() == {"adapt/fit/pose.py"}


def calls(name: str) -> Callable[[ast.AST], bool]:
    """Whether an expression calls a function of that name."""
    return lambda node: isinstance(node, ast.Call) and ast.unparse(node.func) == name


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


@pytest.mark.parametrize(
    "source",
    [
        "hessian = flat.T @ flat",
        "matrix = jacobian.T @ (weight[:, None] * jacobian)",
        "blocks = np.matmul(np.swapaxes(skin.d, 1, 2), skin.d)",
        'matrix = np.einsum("nik,nil->kl", jacobian, jacobian)',
    ],
)
def test_an_assembly_is_found(source: str) -> None:
    assert lines_of(source, assembles) == [1]


@pytest.mark.parametrize(
    "source",
    [
        "wider = frame.covariance + left @ left.T",
        "told = covariance * ~unknown",
        "sure = np.sqrt(np.diag(adaptation.covariance))",
        "spread = gradient @ subject.covariance[:m, :m] @ gradient",
    ],
)
def test_reckoning_with_a_covariance_is_found(source: str) -> None:
    assert lines_of(source, reckons_with_covariance) == [1]


def test_what_only_looks_like_any_of_these_is_not_found() -> None:
    assert not lines_of("turn = left.rotation.T @ right.rotation", assembles)
    assert not lines_of("frame = replace(frame, covariance=np.array(entry['covariance']))", reckons_with_covariance)
    assert not lines_of("slope = (u - camera.cx) / camera.fx", projects)
    assert not lines_of("same = normals @ other_normals > 0.8", compares_with_line_of_sight)
