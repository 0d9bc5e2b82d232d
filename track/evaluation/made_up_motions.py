"""How random bodies move: three made-up motions, or recorded joint angles, joined and swaying."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from adapt.anatomy import Anatomy, Floats
from adapt.mirror import mirrored_coordinate, mirrored_name
from adapt.model.body import Body
from adapt.model.pose_space import free_coordinates
from track.simulation.motion_table import read_motion_table
from track.simulation.performance import Performance, PerformanceError, poses_with

FPS = 30.0
_TRANSITIONS_PER_S = 3.0  # neighbouring motions are joined by a transition of a third of a second
_SWAY_DEG, _SWAY_M = 25.0, 0.02  # enough to show the back of a joint now and then


def motion_names(anatomy: Anatomy) -> tuple[str, ...]:
    """The made-up motions for an anatomy (``motions/NAME.json`` beside this file): both sides of a body move alike."""
    return tuple(_motions(anatomy))


def _motions(anatomy: Anatomy) -> dict[str, dict[str, dict[str, float]]]:
    folder = Path(__file__).parent / "motions"
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
    parts = [poses_with(body, columns, count) for columns in waves]
    thetas = _sway(body, joined(parts, round(fps / _TRANSITIONS_PER_S)), fps, np.random.default_rng(seed))
    return Performance(body, np.arange(len(thetas)) / fps, thetas)


def perform_tables(
    body: Body, tables: Sequence[Path], *, seconds_each: float, fps: float = FPS, seed: int = 0
) -> Performance:
    """Recorded joint angles one table after the other, joined and swaying as in ``perform``.

    Of each table (see ``track.simulation.motion_table``) the liveliest ``seconds_each`` are taken, or all of a
    shorter one.

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
