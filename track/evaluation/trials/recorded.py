"""Short simulated recordings of a limb, with whatever else stands around, and the truth beside them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from adapt.anatomy import Floats, Ints
from adapt.anatomy_file import load_anatomy
from adapt.model.body import Body, pose_skin
from adapt.model.size import resized
from capture.recording import open_recording
from capture.simulation.rig import SensorRig
from capture.simulation.simulate import simulate_recording
from track.accuracy.truth import Truth, read_truth
from track.evaluation.made_up_motions import perform
from track.evaluation.random_bodies import random_body
from track.motion import coordinate_names
from track.simulation.performance import Performance
from track.simulation.simulate import performance_rig

INSTANTS = 20
_SPEEDS = {1: 40, 2: 20}  # instants of a whole motion; at the first, a forearm turns by at most 19 degrees between two
_FPS = 10.0
_ARM, _LEG = "bend-and-twist", "walk"

Skin = Callable[[Floats], Floats]
"""What sensors see of a posed skin (V, 3): itself, or a part of it."""


@dataclass(frozen=True, eq=False)
class Made:
    """A recording's folder, the anatomy to ask for, and the truth."""

    recording: Path
    anatomy: str
    truth: Truth


@dataclass(frozen=True, eq=False)
class Around:
    """Something besides the limb: its vertices (N, 3) m at an instant, and its triangles (F, 3)."""

    at: Callable[[int], Floats] = field(repr=False)
    faces: Ints = field(repr=False)


def still(vertices: Floats, faces: Ints) -> Around:
    """Something that does not move."""
    return Around(lambda _: vertices, faces)


def performance_of(
    anatomy: str, seed: int, *, factor: float = 1.0, speed: int = 1, change: Callable[[Body], Body] = lambda b: b
) -> Performance:
    """A random body that makes the first 20 instants of a made-up motion, calmly or at twice the ``speed``."""
    template = load_anatomy(anatomy)
    body = change(resized(random_body(template, seed), factor))
    motion = _ARM if anatomy.startswith("upper") else _LEG
    whole = perform(body, (motion,), seconds_each=_SPEEDS[speed] / _FPS, fps=_FPS, seed=seed)
    return Performance(body, whole.times[:INSTANTS], whole.thetas[:INSTANTS])


def record(
    performance: Performance,
    folder: Path,
    *,
    seed: int,
    rig: SensorRig | None = None,
    around: Sequence[Around] = (),
    skin: Skin = lambda vertices: vertices,
    faces: Ints | None = None,
) -> Truth:
    """Record a performance into ``folder``; ``skin`` and ``faces`` say what of it there is to see.

    Returns:
        The truth, in the world of the simulation.
    """
    body = performance.body
    parts = [body.anatomy.skin_faces if faces is None else faces, *(thing.faces for thing in around)]

    def vertices(instant: int) -> list[Floats]:
        seen = skin(pose_skin(body, performance.thetas[instant]))
        return [seen, *(thing.at(instant) for thing in around)]

    starts = np.cumsum([0, *(len(part) for part in vertices(0)[:-1])])
    simulate_recording(
        folder,
        (np.concatenate(vertices(t)) for t in range(len(performance.times))),
        np.concatenate([start + part for start, part in zip(starts, parts, strict=True)]),
        performance.times.tolist(),
        rig=performance_rig(performance, seed=seed) if rig is None else rig,
        seed=seed,
        truth={
            "anatomy": np.array(body.anatomy.name),
            "coordinates": np.array(coordinate_names(body.anatomy)),
            "theta": performance.thetas,
            "shape": body.shape,
            "displacement": (body.v_hat - body.anatomy.skin_vertices).astype(np.float32),
        },
        overwrite=True,
    )
    return read_truth(open_recording(folder))
