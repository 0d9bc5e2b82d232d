"""Performances to simulate: who moves (random bodies) and how (motion tables, and three made-up motions).

The random bodies are the project's own accuracy protocol: bone lengths within 8 %, scales within 6 %, and soft
tissue that the handles cannot express.
"""

from __future__ import annotations

import csv
import json
from collections.abc import Sequence
from dataclasses import dataclass, field
from importlib import resources
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from adapt.anatomy import Anatomy, Floats
from adapt.coordinate_columns import coordinate_column, refuse_outside_range, says_degrees
from adapt.mirror import mirrored_coordinate, mirrored_name
from adapt.model.body import Body, make_body, rest_theta
from adapt.model.pose_space import free_coordinates, joint_index
from adapt.model.shape.handle_space import affine_set
from adapt.model.surface import incidence, vertex_normals
from adapt.tissue import tissue_deviation
from capture.errors import BonetrackError

FPS = 30.0
LENGTH_SPREAD = 0.08
SCALE_SPREAD = 0.06
_SOFT_REACH_M = 0.04
_SOFT_BUMPS = 200
_TRANSITIONS_PER_S = 3.0  # neighbouring motions are joined by a transition of a third of a second
_SWAY_DEG, _SWAY_M = 25.0, 0.02  # enough to show the back of a joint now and then


class PerformanceError(BonetrackError):
    """A motion table cannot be performed."""


@dataclass(frozen=True, eq=False)
class Performance:
    """A body and its poses (T, n) over time (T,) s."""

    body: Body
    times: Floats = field(repr=False)
    thetas: Floats = field(repr=False)


def random_body(anatomy: Anatomy, seed: int) -> Body:
    """A body of other proportions: bone lengths, scales at the joints, and smooth bumps of soft tissue."""
    rng = np.random.default_rng(seed)
    affine = affine_set(anatomy)
    scales = 1.0 + rng.uniform(-SCALE_SPREAD, SCALE_SPREAD, len(affine.groups))
    stretch = 1.0 + rng.uniform(-LENGTH_SPREAD, LENGTH_SPREAD, len(affine.groups) - 1)
    spans = stretch[:, None] * np.diff(affine.centres, axis=0)
    heads = affine.centres[0] + np.vstack([np.zeros(3), np.cumsum(spans, axis=0)])
    return make_body(
        anatomy,
        shape=affine.shape(scales, heads - affine.centres),
        v_hat=anatomy.skin_vertices + soft_tissue(anatomy, rng),
    )


def soft_tissue(anatomy: Anatomy, rng: np.random.Generator) -> Floats:
    """A smooth random displacement (V, 3) m along the skin's normals, as much as the tissue's depth allows.

    Its standard deviation at a vertex is that of ``adapt.tissue``: millimetres on muscle, little over bone.
    """
    skin, faces = anatomy.skin_vertices, anatomy.skin_faces
    centres = skin[rng.choice(len(skin), _SOFT_BUMPS, replace=False)]
    bumps = np.exp(-0.5 * ((skin[:, None] - centres) ** 2).sum(axis=2) / _SOFT_REACH_M**2)
    bumps /= np.linalg.norm(bumps, axis=1, keepdims=True)  # unit variance everywhere
    along_normal = tissue_deviation(anatomy) * (bumps @ rng.normal(size=_SOFT_BUMPS))
    return np.asarray(along_normal[:, None] * vertex_normals(skin, faces, incidence(faces, len(skin))))


def motion_names(anatomy: Anatomy) -> tuple[str, ...]:
    """The made-up motions for an anatomy (``track/motions/NAME.json``): both sides of the body move alike."""
    return tuple(_motions(anatomy))


def _motions(anatomy: Anatomy) -> dict[str, dict[str, dict[str, float]]]:
    folder = Path(str(resources.files("track") / "motions"))
    paths = [folder / f"{name}.json" for name in (anatomy.name, mirrored_name(anatomy.name))]
    path = next((path for path in paths if path.is_file()), None)
    if path is None:
        raise PerformanceError(f"no motions for {anatomy.name}", where=folder, remedy="perform a motion table instead")
    motions: dict[str, dict[str, dict[str, float]]] = json.loads(path.read_text(encoding="utf-8"))
    named = mirrored_coordinate if path == paths[1] else str
    return {motion: {named(name): wave for name, wave in waves.items()} for motion, waves in motions.items()}


def _wave(phase: Floats, *, middle_deg: float, swing_deg: float, cycles: float, phase_deg: float) -> Floats:
    """An angle (T,) in radians that swings about its middle while ``phase`` (T,) runs from 0 to 1."""
    turn = 2.0 * np.pi * cycles * phase + np.deg2rad(phase_deg)
    return np.asarray(np.deg2rad(middle_deg + swing_deg * np.sin(turn)))


def perform(
    body: Body, motions: tuple[str, ...], *, seconds_each: float, fps: float = FPS, seed: int = 0
) -> Performance:
    """Motions one after the other, with the swaying of a limb that nobody holds still.

    Neighbouring motions are joined by a smooth transition of a third of a second.
    """
    count = round(seconds_each * fps)
    phase = np.arange(count) / count
    known = _motions(body.anatomy)
    waves = [{name: _wave(phase, **wave) for name, wave in known[motion].items()} for motion in motions]
    parts = [_theta(body, columns, count) for columns in waves]
    thetas = _sway(body, joined(parts, round(fps / _TRANSITIONS_PER_S)), fps, np.random.default_rng(seed))
    return Performance(body, np.arange(len(thetas)) / fps, thetas)


def perform_tables(
    body: Body, tables: Sequence[Path], *, seconds_each: float, fps: float = FPS, seed: int = 0
) -> Performance:
    """Recorded joint angles one table after the other, joined and swaying as in ``perform``.

    Of each table (see ``read_motion_table``) the liveliest ``seconds_each`` are taken, or all of a shorter one.

    Raises:
        PerformanceError: a table cannot be read.
    """
    parts = [_liveliest(_resampled(read_motion_table(path, body), fps), round(seconds_each * fps)) for path in tables]
    thetas = _sway(body, joined(parts, round(fps / _TRANSITIONS_PER_S)), fps, np.random.default_rng(seed))
    return Performance(body, np.arange(len(thetas)) / fps, thetas)


def _resampled(performance: Performance, fps: float) -> Floats:
    """Poses (T, n) at a steady rate."""
    start, end = performance.times[[0, -1]]
    times = start + np.arange(round((end - start) * fps) + 1) / fps
    return np.column_stack([np.interp(times, performance.times, column) for column in performance.thetas.T])


def _liveliest(thetas: Floats, count: int) -> Floats:
    """The ``count`` successive poses in which the angles change most."""
    if len(thetas) <= count:
        return thetas
    change = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(thetas, axis=0)).sum(axis=1))])
    start = int(np.argmax(change[count - 1 :] - change[: len(change) - count + 1]))
    return thetas[start : start + count]


def read_motion_table(path: Path, body: Body) -> Performance:
    """A performance from a CSV file: ``time`` (s) and coordinates (rad, m) by name; the rest stays at rest.

    Lines that begin with ``#`` are comments; columns that are no coordinates of the anatomy are passed over. Names that
    end in ``_deg`` are in degrees (``adapt.coordinate_columns``).

    Raises:
        PerformanceError: missing file, no time, no known coordinate, not numbers, times that do not increase, or values
            far outside a joint's range.
    """
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:  # spreadsheets begin with a byte order mark
            lines = [line for line in file if line.strip()]
            rows = list(csv.reader(line for line in lines if not line.startswith("#")))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise PerformanceError("cannot be read as a table", where=path, remedy="give a CSV file") from error
    header = [name.strip() for name in rows[0]] if rows else []
    degrees = says_degrees(line for line in lines if line.startswith("#"))
    found = [(k, coordinate_column(body.anatomy, name, degrees=degrees)) for k, name in enumerate(header)]
    columns = {k: column for k, column in found if column is not None}
    if "time" not in header or not columns:
        valid = ", ".join(coordinate.name for coordinate in body.anatomy.coordinates)
        raise PerformanceError(
            "no column `time`, or none that is a coordinate", where=path, remedy=f"name columns {valid}"
        )
    try:
        table = np.array([[float(cell) for _, cell in zip(header, row, strict=True)] for row in rows[1:]])
    except ValueError as error:
        raise PerformanceError(
            "a row is not all numbers, too short or too long", where=path, remedy="give one number per column"
        ) from error
    if not len(table):
        raise PerformanceError("has no rows", where=path, remedy="give one row per frame")
    times = table[:, header.index("time")]
    if not np.isfinite(table).all() or (np.diff(times) <= 0.0).any():
        raise PerformanceError("values must be finite and times increase", where=path, remedy="mend the table")
    values = {column.index: column.factor * table[:, k] for k, column in columns.items()}
    for column in columns.values():
        refuse_outside_range(
            body.anatomy,
            column,
            values[column.index],
            error=PerformanceError,
            where=path,
            row=lambda k: f"at {times[k]:g} s",
        )
    names = {column.index: body.anatomy.coordinates[column.index].name for column in columns.values()}
    return Performance(body, times, _theta(body, {names[i]: value for i, value in values.items()}, len(table)))


def _theta(body: Body, columns: dict[str, Floats], count: int) -> Floats:
    thetas = np.tile(rest_theta(body), (count, 1))
    for joint in body.anatomy.joints:
        if len(joint.axes) == 2:  # held straight, not as at rest: a wrist
            thetas[:, joint_index(body.anatomy, joint)] = 0.0
    for name, values in columns.items():
        thetas[:, body.anatomy.coordinate_index(name)] = values
    return thetas


def motion_spans(motions: Sequence[str], *, seconds_each: float, fps: float = FPS) -> dict[str, slice]:
    """The frames of each motion in what ``perform`` makes of them, without the transitions."""
    count, between = round(seconds_each * fps), round(fps / _TRANSITIONS_PER_S)
    starts = [k * (count + between) for k in range(len(motions))]
    return {name: slice(start, start + count) for name, start in zip(motions, starts, strict=True)}


def joined(parts: list[Floats], transition: int) -> Floats:
    """Pieces of motion (T_i, n) one after the other, with a smooth ``transition`` of so many frames between them."""
    pieces = [parts[0]]
    for part in parts[1:]:
        share = (1.0 - np.cos(np.pi * np.linspace(0.0, 1.0, transition + 2)[1:-1, None])) / 2.0
        pieces += [(1.0 - share) * pieces[-1][-1] + share * part[0], part]
    return np.concatenate(pieces)


def _sway(body: Body, thetas: Floats, fps: float, rng: np.random.Generator) -> Floats:
    """Slow turns and shifts of the free joint."""
    time = np.arange(len(thetas)) / fps
    swayed = thetas.copy()
    for index in free_coordinates(body.anatomy):
        rate, phase = rng.uniform(0.15, 0.45, 6), rng.uniform(0.0, 2.0 * np.pi, 6)
        waves = np.sin(2.0 * np.pi * rate * time[:, None] + phase)
        turn = Rotation.from_rotvec(np.deg2rad(_SWAY_DEG) * waves[:, :3])
        swayed[:, index[:3]] = (turn * Rotation.from_rotvec(thetas[:, index[:3]])).as_rotvec()
        swayed[:, index[3:]] += _SWAY_M * waves[:, 3:]
    return swayed
