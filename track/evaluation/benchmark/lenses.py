"""What a lens with distortion costs, beside a pinhole: in visibility, matching and the first search.

The same cloud and skin for all; only the depth images, in which the skin is looked up, are those of another lens.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np

from adapt.anatomy import Floats
from adapt.match.correspondences import Target, find_corres
from adapt.match.visibility import visible_vertices
from adapt.model.body import pose_skin
from adapt.search.coarse_cost import Scene, costs
from capture.camera import ray_slopes
from capture.cloud.fuse import Cloud, View
from capture.projection import project
from track.evaluation.benchmark.stages import PLACEMENTS, Bench, some_placements

LENS_TARGET = 1.3
LENS_ROUNDS = 31

_AZURE_KINECT = (0.5, -0.02, 2e-5, -7e-5, -0.003, 0.9, 0.08, -0.01)
_ALL = (*_AZURE_KINECT, 1e-3, 0.0, -1e-3, 0.0, 0.01, -0.01)
LENSES = {"pinhole": (), "8 coefficients": _AZURE_KINECT, "14 coefficients": _ALL}
"""The first is what the others are compared with."""

LENS_HEADER = ("work", *LENSES)
_LEAST_S = 0.004  # short work is repeated in each round until it takes this long


@dataclass(frozen=True)
class LensTiming:
    """Seconds of processor's time that one piece of work takes in each round (R, L) with each of the lenses."""

    stage: str
    seconds: Floats

    @property
    def ratios(self) -> Floats:
        """How many times as long as with the pinhole it takes with each lens (L,)."""
        return np.asarray(np.median(self.seconds / self.seconds[:, :1], axis=0))


def lens_row(timing: LensTiming) -> tuple[str, ...]:
    """The medians, and how many times as long as the pinhole's each is; thousandths of a millisecond are shown."""
    pinhole, *others = zip(np.median(timing.seconds, axis=0), timing.ratios, strict=True)
    told = [f"{1e3 * seconds:.3f} ms ({ratio:.2f} x)" for seconds, ratio in others]
    return (timing.stage, f"{1e3 * pinhole[0]:.3f} ms", *told)


def lens_timings(bench: Bench) -> list[LensTiming]:
    """Visibility, matching and the coarse search of a frame, through all lenses."""
    sample, placed = bench.tracker.sample, some_placements(bench)
    skin = pose_skin(bench.tracker.subject.body, bench.frame.theta)
    normals = sample.normals(skin)
    points, faces = skin[sample.vertices], normals[sample.vertices]
    clouds = [seen_through(bench.target.cloud, distortion) for distortion in LENSES.values()]
    targets, scenes = [Target(cloud) for cloud in clouds], [Scene(cloud) for cloud in clouds]

    def see(cloud: Cloud) -> Callable[[], object]:
        return lambda: [visible_vertices(view, points, faces) for view in cloud.views]

    def match(target: Target) -> Callable[[], object]:
        return lambda: find_corres(target, skin, normals, sample.vertices)

    def search(scene: Scene) -> Callable[[], object]:
        return lambda: costs(scene, placed)

    count, views = len(points), len(bench.target.cloud.views)
    return [
        _in_turn(f"visibility: {count} vertices, {views} sensors", [see(cloud) for cloud in clouds]),
        _in_turn(f"matching: find_corres, {count} vertices", [match(target) for target in targets]),
        _in_turn(f"search: {PLACEMENTS} placements of 100 vertices", [search(scene) for scene in scenes]),
    ]


def seen_through(cloud: Cloud, distortion: Sequence[float]) -> Cloud:
    """The cloud, its depth images as sensors with such a lens would have measured them."""
    return replace(cloud, views=tuple(_through(view, tuple(distortion)) for view in cloud.views))


def _through(view: View, distortion: tuple[float, ...]) -> View:
    """Each pixel shows what the pinhole's nearest pixel on its ray shows, or nothing beyond the pinhole's image."""
    camera = replace(view.camera, distortion=distortion)
    rays = np.concatenate([ray_slopes(camera), np.ones((camera.height, camera.width, 1), dtype=np.float32)], axis=2)
    at = project(view.camera, rays.reshape(-1, 3))[0].reshape(camera.height, camera.width, 2).astype(np.float32)
    depth = cv2.remap(view.depth, at[..., 0], at[..., 1], cv2.INTER_NEAREST, borderValue=0.0)
    return replace(view, camera=camera, depth=np.asarray(depth))


def _in_turn(stage: str, works: Sequence[Callable[[], object]]) -> LensTiming:
    """Time the same work with each lens, in turns, so that a busy machine slows down all of them alike."""
    for work in works:
        work()  # fills caches
    often = max(1, round(_LEAST_S / max(_taken(works[0], 1), 1e-9)))
    return LensTiming(stage, np.array([[_taken(work, often) for work in works] for _ in range(LENS_ROUNDS)]))


def _taken(work: Callable[[], object], often: int) -> float:
    start = time.process_time()
    for _ in range(often):
        work()
    return (time.process_time() - start) / often
