"""A subject's performance as depth sensors would have recorded it, with the truth stored beside."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from adapt.model.body import pose_skin
from capture.recording import Recording
from capture.sensor import NoiseModel
from capture.simulate import SensorRig, default_rig, simulate_recording
from track.evaluation.performance import Performance
from track.motion import coordinate_names


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

    Raises:
        RecordingError: see ``capture.simulate.simulate_recording``.
    """
    body = performance.body
    if rig is None:
        some = performance.thetas[:: max(1, len(performance.thetas) // 60)]
        rig = default_rig(np.concatenate([pose_skin(body, theta) for theta in some]), seed=seed)
    truth = {
        "anatomy": np.array(body.anatomy.name),
        "coordinates": np.array(coordinate_names(body.anatomy)),
        "theta": performance.thetas,
        "shape": body.shape,
        "displacement": (body.v_hat - body.anatomy.skin_vertices).astype(np.float32),
    }
    return simulate_recording(
        out,
        (pose_skin(body, theta) for theta in performance.thetas),
        body.anatomy.skin_faces,
        performance.times.tolist(),
        rig=rig,
        noise=noise,
        seed=seed,
        truth=truth,
        overwrite=overwrite,
        progress=progress,
    )
