"""How good weights are on held-out windows, while training: the same numbers each time, from one view alone."""

from __future__ import annotations

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from adapt.search.figure.decode import chances_of_cells, decode_joints
from adapt.search.figure.window import PIXEL_M, PIXELS
from adapt.template_builder.first_pose.batches import as_batch
from adapt.template_builder.first_pose.net import FigureNet
from adapt.template_builder.first_pose.windows import KINDS

_MOST = 768  # windows
_TOGETHER = 64
_WITHIN_MM = 150.0


def measure(weights: dict[str, Tensor], shards: list[NDArray[np.void]]) -> str:
    """Median joint error (mm) and share within 150 mm over persons' windows; pixels right, of persons and of crops."""
    net = FigureNet()
    net.load_state_dict(weights)
    net.eval()
    samples = [sample for shard in shards for sample in shard[:_MOST]][:_MOST]
    errors, pixels = [], {kind: np.zeros(2) for kind in KINDS}
    for start in range(0, len(samples), _TOGETHER):
        chosen = samples[start : start + _TOGETHER]
        batch = as_batch(chosen)
        with torch.no_grad():
            joints, parts = (out.numpy() for out in net(torch.from_numpy(batch.fed)))
        called = parts.argmax(axis=1)
        for k, sample in enumerate(chosen):
            kind = KINDS[sample["kind"]]
            body = batch.labels[k] > 0
            pixels[kind] += (called[k] == batch.labels[k])[body].sum(), body.sum()
            if kind == "person":
                errors.append(_errors_mm(joints[k], batch.places[k]))
    found = np.concatenate(errors)
    right = {kind: hit / max(count, 1.0) for kind, (hit, count) in pixels.items()}
    return (
        f"median {np.median(found):.0f} mm, within 150 mm {np.mean(found < _WITHIN_MM):.3f}, "
        f"pixels of persons {right['person']:.3f}, of crops {right['crop']:.3f}"
    )


def _errors_mm(joints: NDArray[np.float32], places: NDArray[np.float32]) -> NDArray[np.float64]:
    """Errors (J,) of the joints that are in the window."""
    found, _ = decode_joints(*chances_of_cells(joints))
    inside = ((places[:, :2] > 2.0) & (places[:, :2] < PIXELS - 2.0)).all(axis=1)
    return 1e3 * np.asarray(np.linalg.norm((found - places) * [PIXEL_M, PIXEL_M, 1.0], axis=1))[inside]
