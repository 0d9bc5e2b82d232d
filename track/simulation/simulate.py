"""A subject's performance as depth sensors would have recorded it, with the truth stored beside."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adapt.model.body import pose_skin
from adapt.own_anatomy import kept_anatomy
from capture.recording import Recording
from capture.simulation.rig import SensorRig, default_rig
from capture.simulation.sensor import NoiseModel
from capture.simulation.simulate import simulate_recording
from track.motion import coordinate_names
from track.simulation.performance import Performance


def simulate_performance(
    performance: Performance,
    out: Path,
    *,
    noise: NoiseModel | None = None,
    rig: SensorRig | None = None,
    seed: int = 0,
    overwrite: bool = False,
    progress: Callable[[int], None] | None = None,
) -> Recording:
    """Record a performance; ``truth.npz`` then also holds the body and its poses.

    Without a ``rig``, the sensors are placed as ``performance_rig`` does.

    Raises:
        RecordingError: see ``capture.simulation.simulate.simulate_recording``.
    """
    body = performance.body
    return simulate_recording(
        out,
        (pose_skin(body, theta) for theta in performance.thetas),
        body.anatomy.skin_faces,
        performance.times.tolist(),
        rig=performance_rig(performance, seed=seed) if rig is None else rig,
        noise=noise,
        seed=seed,
        truth=truth_of(performance),
        overwrite=overwrite,
        progress=progress,
    )


def truth_of(performance: Performance) -> dict[str, NDArray[Any]]:
    """What ``truth.npz`` holds of a performance, by name: ``track.accuracy.truth`` reads it.

    >>> from adapt.anatomy_file import load_anatomy
    >>> from adapt.model.body import make_body
    >>> arm = make_body(load_anatomy("upper-limb-right"))
    >>> truth = truth_of(Performance(arm, np.zeros(1), np.zeros((1, 10))))
    >>> sorted(truth), truth["displacement"].any().item()  # a template that ships is known by its name
    (['anatomy', 'anatomy_content', 'coordinates', 'displacement', 'shape', 'theta'], False)
    """
    body = performance.body
    return {
        "anatomy": np.array(body.anatomy.name),
        "coordinates": np.array(coordinate_names(body.anatomy)),
        "theta": performance.thetas,
        "shape": body.shape,
        "displacement": (body.v_hat - body.anatomy.skin_vertices).astype(np.float32),
        **kept_anatomy(body.anatomy),
    }


def performance_rig(
    performance: Performance,
    *,
    distance_m: float = 1.2,
    spread_deg: float = 80.0,
    elevations_deg: Sequence[float] = (24.0, 12.0),
    seed: int = 0,
) -> SensorRig:
    """Sensors around a performance: ``default_rig`` around the skin in some of its poses."""
    some = performance.thetas[:: max(1, len(performance.thetas) // 60)]
    points = np.concatenate([pose_skin(performance.body, theta) for theta in some])
    return default_rig(points, distance_m=distance_m, spread_deg=spread_deg, elevations_deg=elevations_deg, seed=seed)
