"""Skin bound to the frames that stand between two others."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from adapt.anatomy import Floats, Ints
from adapt.model.blended_frames import BlendedFrames, blended_frames
from adapt.model.derivatives import Motion, Points, compose, mere_points, still_points
from capture.rigid import hat


@dataclass(frozen=True)
class BoundBetween:
    """Skin at rest in its blended frames, and the two frames at rest.

    ``t`` (N,) says how far on the way between the two each point is; ``dt`` (N, n) is its derivative, or (1, 1) where
    it does not vary; ``local`` are the points' coordinates in the blended frames.
    """

    proximal: Motion
    distal: Motion
    t: Floats
    dt: Floats
    local: Points

    def at(self, index: Ints | slice) -> BoundBetween:
        """Some of the points."""
        dt = self.dt if len(self.dt) == 1 else self.dt[index]
        return BoundBetween(self.proximal, self.distal, self.t[index], dt, self.local.at(index))


def bind_between(
    proximal: Motion, distal: Motion, t: Floats, dt: Floats, skin: Points, *, varying: bool
) -> BoundBetween:
    """Skin points at rest in the frames between the two at ``t``; unless ``varying``, nothing varies at rest."""
    frame = blended_frames(proximal, distal, t, dt)
    if not varying:
        return BoundBetween(proximal, distal, t, np.zeros((1, 1)), still_points(into_frames(frame, skin.value)))
    return BoundBetween(proximal, distal, t, dt, into_frames_varying(frame, skin))


def carry_between(bound: BoundBetween, motions: tuple[Motion, ...]) -> Points:
    """The bound points where the frames carry them whose two ends ride on two bones, with derivatives."""
    proximal, distal = compose(motions[0], bound.proximal), compose(motions[1], bound.distal)
    return out_of_frames(blended_frames(proximal, distal, bound.t, bound.dt), bound.local)


def into_frames(frames: BlendedFrames, points: Floats) -> Floats:
    """Points (N, 3), each as its own frame sees it."""
    return np.asarray(np.einsum("nji,nj->ni", frames.rotation, points - frames.origin))


def into_frames_varying(frames: BlendedFrames, points: Points) -> Points:
    """The same with derivatives."""
    moved = points.d - frames.d_origin + np.matmul(hat(points.value - frames.origin), frames.d_rotation)
    return Points(into_frames(frames, points.value), np.matmul(np.swapaxes(frames.rotation, 1, 2), moved))


def out_of_frames(frames: BlendedFrames, local: Points) -> Points:
    """Points (N, 3) that each frame carries where it sees them, with derivatives."""
    arm = np.einsum("nij,nj->ni", frames.rotation, local.value)
    if not frames.d_origin.shape[2]:
        return mere_points(arm + frames.origin)
    d = np.matmul(hat(-arm), frames.d_rotation)
    d += frames.d_origin
    if not local.still:
        d += np.matmul(frames.rotation, local.d)
    return Points(arm + frames.origin, d)
