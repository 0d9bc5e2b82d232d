"""What the project's sources say of themselves, read and not run: which modules there are and what they import."""

from __future__ import annotations

import ast
from collections.abc import Iterable, Mapping
from functools import cache
from pathlib import Path

ROOT = Path(__file__).parents[1]
PACKAGES = ("capture", "adapt", "track")


@cache
def modules(root: Path = ROOT) -> dict[str, Path]:
    """The files of the three packages by module name; a package goes by its own name."""
    files = (path for package in PACKAGES for path in sorted((root / package).rglob("*.py")))
    return {".".join(path.relative_to(root).with_suffix("").parts).removesuffix(".__init__"): path for path in files}


@cache
def imports(root: Path = ROOT) -> dict[str, frozenset[str]]:
    """What every module imports of the three packages, at the top, in functions and for types alike."""
    known = modules(root)
    return {name: frozenset(_imported(path, known)) for name, path in known.items()}


def _imported(path: Path, known: Mapping[str, Path]) -> Iterable[str]:
    """The names of modules; ``from package import name`` is the module ``package.name`` where there is one.

    A name of the three packages that is no module comes as it is written, so that a reader can ask for it in vain.
    """
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names if alias.name.split(".")[0] in PACKAGES)
        elif isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] in PACKAGES:
            for alias in node.names:
                inner = f"{node.module}.{alias.name}"
                yield inner if inner in known else str(node.module)


def reached(start: Iterable[str], root: Path = ROOT) -> set[str]:
    """The modules that are imported when those of ``start`` run to their ends: they, theirs, and packages around."""
    graph, found, waiting = imports(root), set[str](), list(start)
    while waiting:
        name = waiting.pop()
        if name not in found:
            found.add(name)
            waiting += [*graph.get(name, ()), *filter(None, [name.rpartition(".")[0]])]
    return found


def circles(root: Path = ROOT) -> list[frozenset[str]]:
    """Modules that import each other, however far around: every set in which each reaches every other."""
    graph = imports(root)
    beyond = {name: _beyond(name, graph) for name in graph}
    found = {frozenset(b for b in beyond[a] if a in beyond[b]) for a in graph if a in beyond[a]}
    return sorted(found, key=sorted)


def _beyond(start: str, graph: Mapping[str, frozenset[str]]) -> set[str]:
    found, waiting = set[str](), list(graph[start])
    while waiting:
        name = waiting.pop()
        if name not in found:
            found.add(name)
            waiting += graph.get(name, ())
    return found
