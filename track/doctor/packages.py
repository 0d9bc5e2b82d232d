"""The packages that the program needs, always and for single formats and features, by what its own metadata say."""

from __future__ import annotations

import importlib
import platform
from collections.abc import Mapping, Sequence
from functools import cache
from importlib import metadata
from typing import Literal

from packaging.requirements import Requirement

from capture._open3d import open3d
from track.doctor.finding import Finding

WHAT_FOR = {
    "azure-kinect": "importing Azure Kinect files (.mkv)",
    "realsense": "importing RealSense files (.bag)",
    "realsense-live": "recording RealSense cameras",
    "view": "`bonetrack view` and `bonetrack report`",
    "movie": "`bonetrack movie`",
    "c3d": "C3D (`bonetrack export --c3d`, `bonetrack import-markers`)",
    "usd": "USD (`bonetrack export --usd`)",
    "tables": "tables as Parquet",
    "pandas": "tables as pandas has them, in Python",
    "statistics": "`bonetrack compare --spm`",
    "batch": "`bonetrack batch`",
}
"""What people want the extras for; the others are for who works on the program."""

_REPAIR = "pip install --force-reinstall bonetrack"


def requirements() -> list[Requirement]:
    """What the installed program asks for; nothing where it runs from a checkout that nobody installed."""
    try:
        return [Requirement(line) for line in metadata.requires("bonetrack") or ()]
    except metadata.PackageNotFoundError:
        return []


def program() -> list[Finding]:
    """The program, Python, and the packages without which nothing runs."""
    here = f"Python {platform.python_version()}, {platform.system()} {platform.machine()}"
    try:
        found = [Finding("ok", f"bonetrack {metadata.version('bonetrack')}, {here}")]
    except metadata.PackageNotFoundError:
        told = f"bonetrack runs from a checkout, {here}; which packages it needs is not known"
        return [Finding("missing", told, "pip install . in the checkout")]
    always = [one for one in requirements() if one.marker is None or one.marker.evaluate({"extra": ""})]
    return found + [_finding(one, "bad", "nothing runs without it", _REPAIR) for one in always]


def extras(what_for: dict[str, str] = WHAT_FOR) -> list[Finding]:
    """The packages of the extras that users may want."""
    found = []
    for extra, purpose in what_for.items():
        remedy = f"pip install 'bonetrack[{extra}]'"
        for one in _of_extra(extra):
            if one.marker is not None and not one.marker.evaluate({"extra": extra}):
                told = f"{one.name}, for {purpose}, is not made for {platform.system()} {platform.machine()}"
                found.append(Finding("not here", told))
            else:
                found.append(_finding(one, "missing", f"for {purpose}", remedy))
    return found


def _of_extra(extra: str) -> Sequence[Requirement]:
    """What an extra asks for, on whatever machine."""
    named = f'extra == "{extra}"'
    return [one for one in requirements() if one.marker is not None and named in str(one.marker)]


def _finding(wanted: Requirement, otherwise: Literal["bad", "missing"], why: str, remedy: str) -> Finding:
    """How a package is: there, new enough, and ready to be imported, or else what its state is called."""
    try:
        version = metadata.version(wanted.name)
    except metadata.PackageNotFoundError:
        return Finding(otherwise, f"{wanted.name} is not installed, {why}", remedy)
    if not wanted.specifier.contains(version, prereleases=True):
        told = f"{wanted.name} is of version {version} and should be {wanted.specifier}, {why}"
        return Finding(otherwise, told, remedy)
    if problem := _import_problem(wanted.name):
        told = f"{wanted.name} {version} cannot be imported ({problem}), {why}"
        return Finding(otherwise, told, remedy)
    return Finding("ok", f"{wanted.name} {version}" + ("" if otherwise == "bad" else f", {why}"))


def _import_problem(distribution: str) -> str:
    """Why a distribution's modules cannot be imported; empty where they can."""
    try:
        if distribution == "open3d":
            open3d()  # with libusb, which few systems carry
            return ""
        for module in _modules(distribution):
            importlib.import_module(module)
    except Exception as error:
        return f"{type(error).__name__}: {error}".partition("\n")[0]
    return ""


@cache
def _provided() -> Mapping[str, Sequence[str]]:
    """Which distributions bring the top modules; asked once, because all of their files are looked through."""
    return metadata.packages_distributions()


def _modules(distribution: str) -> list[str]:
    """The top modules of a distribution that are named as one imports them."""
    wanted = distribution.lower().replace("_", "-")
    return sorted(
        module
        for module, owners in _provided().items()
        if module.isidentifier()
        and not module.startswith("_")
        and wanted in [owner.lower().replace("_", "-") for owner in owners]
    )[:1]
