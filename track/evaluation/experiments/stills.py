"""A few frames of a subject who moves, with starts of a stated error: where the experiments on adaptation begin."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from adapt.anatomy import Anatomy, Floats
from adapt.anatomy_file import load_anatomy
from track.evaluation.known import CARMINE, KnownRecording, record_known
from track.evaluation.made_up_motions import FPS, perform
from track.evaluation.random_bodies import random_body
from track.simulation.performance import Performance

_STEP = 10  # frames of the motion between one still and the next


def record_stills(anatomy: str, motions: tuple[str, ...], count: int, folder: Path, *, seed: int) -> KnownRecording:
    """A random body in ``count`` poses of its motions, seen by two Carmine sensors."""
    body = random_body(load_anatomy(anatomy), seed)
    seconds = count * _STEP / FPS / len(motions)
    moving = perform(body, motions, seconds_each=seconds, seed=seed)
    chosen = np.linspace(0, len(moving.thetas) - 1, count).round().astype(int)
    stills = Performance(body, np.arange(count) / FPS, moving.thetas[chosen])
    return record_known(stills, folder, noise=CARMINE, seed=seed)


def disturbed(anatomy: Anatomy, thetas: Floats, seed: int, *, degrees: float, metres: float) -> Floats:
    """Poses (K, n) with every coordinate off by at most so much, evenly distributed."""
    scale = [metres if c.unit == "m" else np.deg2rad(degrees) for c in anatomy.coordinates]
    return np.asarray(thetas + np.random.default_rng(seed).uniform(-1.0, 1.0, thetas.shape) * scale)
