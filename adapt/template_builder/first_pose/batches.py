"""Batches of training windows, drawn by seed and step: mirrored, moved in depth and partly hidden by lot."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import cast

import numpy as np
from numpy.typing import NDArray

from adapt.search.figure.names import MIRRORED_JOINTS, MIRRORED_PARTS
from adapt.search.figure.window import PIXELS, REACH_M, features
from adapt.template_builder.first_pose.windows import KINDS, NO_DEPTH, SAMPLE

Floats32 = NDArray[np.float32]

_DEPTH_M = 0.03
_HIDDEN = 0.2  # of windows have a rectangle without depth


@dataclass(frozen=True)
class Batch:
    """What the network is fed (N, 4, 128, 128), joints' places (N, 19, 3), labels (N, 64, 64), -1 without depth."""

    fed: Floats32 = field(repr=False)
    places: Floats32 = field(repr=False)
    labels: NDArray[np.int64] = field(repr=False)
    somebody: Floats32 = field(repr=False)  # (N,) 1 or 0


def draw_batch(rng: np.random.Generator, shards: list[NDArray[np.void]], size: int) -> Batch:
    """Windows drawn from all shards with equal chances."""
    ends = np.cumsum([len(shard) for shard in shards])
    samples = []
    for k in rng.integers(0, ends[-1], size):
        shard = int(np.searchsorted(ends, k, side="right"))
        samples.append(_varied(rng, shards[shard][k - (ends[shard - 1] if shard else 0)]))
    return as_batch(samples)


def as_batch(samples: list[np.void]) -> Batch:
    """Samples as the network is fed them and what is asked of it."""
    beyond = [beyond_of(sample) for sample in samples]
    valid = np.array([np.isfinite(b[1::2, 1::2]) for b in beyond])
    labels = np.where(valid, np.array([sample["parts"] for sample in samples], np.int64), -1)
    somebody = np.array([sample["kind"] != KINDS.index("nobody") for sample in samples], np.float32)
    places = np.array([sample["joints"] for sample in samples], np.float32)
    return Batch(np.array([features(b) for b in beyond]), places, labels, somebody)


def beyond_of(sample: np.void) -> Floats32:
    """A sample's depth (128, 128) m beyond its window's, NaN where there is none."""
    depth = sample["depth"]
    return np.where(depth == NO_DEPTH, np.float32(np.nan), depth.astype(np.float32) * np.float32(1e-3))


def _varied(rng: np.random.Generator, sample: np.void) -> np.void:
    """A sample as it might have been as well."""
    varied = np.zeros((), SAMPLE)
    varied[...] = sample
    depth = varied["depth"]
    if rng.random() < 0.5:
        depth = depth[:, ::-1]
        varied["parts"] = np.array(MIRRORED_PARTS, np.uint8)[varied["parts"]][:, ::-1]
        # Labels are those of every second pixel, 1, 3, 5 ..: mirrored they are those of 126, 124 .., half a cell off.
        joints = varied["joints"][list(MIRRORED_JOINTS)]
        joints[:, 0] = PIXELS - joints[:, 0]
        varied["joints"] = joints
    off = np.int16(round(1e3 * rng.normal(0.0, _DEPTH_M)))
    kept = (depth != NO_DEPTH) & (np.abs(depth.astype(np.int32) + off) < 1e3 * REACH_M)
    if rng.random() < _HIDDEN:
        top, left = rng.integers(0, PIXELS - 8, 2)
        kept[top : top + rng.integers(6, 50), left : left + rng.integers(6, 50)] = False
    varied["depth"] = np.where(kept, depth + off, NO_DEPTH)
    varied["joints"][:, 2] += off * 1e-3
    return cast(np.void, varied[()])
