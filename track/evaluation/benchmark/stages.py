"""The stages of tracking one frame, on one thread, on a recording.

Stages that are compiled loops are shown beside the same work in plain NumPy, and what the first version of this program
took, on the machine of ``FIRST``, beside what is measured now.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from scipy.spatial import cKDTree

from adapt.fit.follow import follow_pose
from adapt.fit.least_squares import levenberg_marquardt
from adapt.fit.pose import PoseEnergy, PoseFit, match_pose
from adapt.fit.posterior import pose_covariance
from adapt.fit.problem import data_term
from adapt.match.correspondences import Target, find_corres
from adapt.match.point_grid import PointGrid
from adapt.match.skin_sample import sample_skin
from adapt.match.visibility import pixel_of
from adapt.model.body import pose_skin, pose_skin_varying
from adapt.model.pose_space import moved_rigidly
from adapt.model.surface import incidence, vertex_normals
from adapt.options import AS_USUAL
from adapt.search.coarse_cost import Placements, Scene, costs, costs_by_arrays
from adapt.search.pose_score import find_skin
from adapt.subject import Subject
from capture.calibration.calibrate import calibrate_recording
from capture.cloud.fuse import Region, fuse, region_of_interest
from capture.cloud.normals import radius_px
from capture.cloud.patches import fit_patches, fit_patches_by_arrays
from capture.cloud.preprocess import clean_depth
from capture.errors import FitError
from capture.recording import Instant, Recording, instants, open_recording, read_depth
from capture.rigid import exp_so3, inverse
from track.accuracy.truth import read_truth, world_from_common
from track.evaluation.benchmark.timing import Timing, timed
from track.evaluation.skin_of_blocks import skin_of_blocks
from track.prediction import predict
from track.track_recording import track_recording
from track.tracked_frame import TrackedFrame, TrackerState
from track.tracker import Tracker, make_tracker

FRAME_TARGET_S = 0.033

PLACEMENTS = 200
_GATE_M = 0.02

FIRST = "the first version (November 2026, an idle two-core machine, one thread)"
FIRST_FUSE_S, FIRST_FRAME_S, FIRST_DEMO_S = 0.027, 0.067, 65.0


@dataclass(frozen=True)
class Bench:
    """What the stages work on: a frame in the middle of the recording, and the tracker's state just before it."""

    recording: Recording
    tracker: Tracker
    moment: Instant
    target: Target
    state: TrackerState
    frame: TrackedFrame
    repeat: int

    def time(
        self,
        stage: str,
        work: Callable[[], object],
        *,
        first_s: float | None = None,
        twin: Callable[[], object] | None = None,
    ) -> Timing:
        """Time a stage, and its twin; ``first_s`` is what it took the first version."""
        work()  # fills caches
        timing = timed(stage, work, repeat=self.repeat, first_s=first_s)
        return timing if twin is None else replace(timing, twin=self.time(stage, twin).processor)


def frame_timings(bench: Bench) -> list[Timing]:
    """The stages of tracking one frame, and the whole of it."""
    region = region_of_interest(bench.recording)

    def whole() -> None:
        target = Target(fuse(bench.recording, bench.moment, region=region))
        bench.tracker.follow(target, bench.moment.time_s, bench.state)

    timings = [*_cloud_timings(bench, region), *_skin_timings(bench), *_pose_timings(bench)]
    return [*timings, bench.time("whole frame, one thread: fuse, follow, judge", whole, first_s=FIRST_FRAME_S)]


def _cloud_timings(bench: Bench, region: Region) -> list[Timing]:
    """From files to a cloud."""
    view, points = bench.target.cloud.views[0], bench.target.cloud.points
    radius, focal = radius_px(view.camera), view.camera.fx
    pixels = np.stack(pixel_of(view, points[bench.target.cloud.sensor == 0])[:2], axis=1)
    views = len(bench.moment.frames)
    return [
        bench.time(f"read: {views} depth images", lambda: read(bench.recording, bench.moment)),
        bench.time(f"read and clean: {views} depth images", lambda: read_and_clean(bench.recording, bench.moment)),
        bench.time(
            f"patches at {len(pixels)} pixels of one image",
            lambda: fit_patches(view.depth, pixels, radius_px=radius, focal_px=focal),
            twin=lambda: fit_patches_by_arrays(view.depth, pixels, radius_px=radius, focal_px=focal),
        ),
        bench.time(
            "fuse, reading included",
            lambda: fuse(bench.recording, bench.moment, region=region),
            first_s=FIRST_FUSE_S,
        ),
    ]


def _skin_timings(bench: Bench) -> list[Timing]:
    """The posed skin, its normals and the points nearest to it."""
    body, sample, theta = bench.tracker.subject.body, bench.tracker.sample, bench.frame.theta
    skin, points = pose_skin(body, theta), bench.target.cloud.points
    chosen = match_pose(body, bench.target, theta, sample, gate_m=_GATE_M).vertex
    near, tree, grid = skin[chosen], cKDTree(points), PointGrid(points)
    corner = (body.anatomy.skin_faces, incidence(body.anatomy.skin_faces, len(skin))[sample.vertices])
    return [
        bench.time(
            f"pose_skin, {len(skin)} vertices",
            lambda: pose_skin(body, theta),
            twin=lambda: skin_of_blocks(body, theta, columns=0),
        ),
        bench.time(
            f"pose_skin_varying, theta, {len(skin)} vertices",
            lambda: pose_skin_varying(body, theta),
            twin=lambda: skin_of_blocks(body, theta, columns=len(theta)),
        ),
        bench.time(
            f"normals, {len(sample.vertices)} vertices",
            lambda: sample.normals(skin),
            twin=lambda: vertex_normals(skin, *corner),
        ),
        bench.time(
            f"nearest of {len(points)} points, {len(chosen)} times",
            lambda: grid.query(near),
            twin=lambda: tree.query(near),
        ),
    ]


def _pose_timings(bench: Bench) -> list[Timing]:
    """Matches, steps of the pose, and how it is judged."""
    body, sample, theta = bench.tracker.subject.body, bench.tracker.sample, bench.frame.theta
    skin = pose_skin(body, theta)
    normals, matches = sample.normals(skin), match_pose(body, bench.target, theta, sample, gate_m=_GATE_M)
    chosen, weights = matches.vertex, sample.counts(matches)
    varying = pose_skin_varying(body, theta, vertices=chosen)
    fit, few = PoseFit(theta, matches, matches.distance), len(chosen)
    expected = predict(body.anatomy, bench.state, bench.moment.time_s)

    def update() -> None:
        cost = PoseEnergy(body, matches, weights, None)
        moved = levenberg_marquardt(cost.quadratic, bench.state.theta, steps=1, energy=cost.value)
        match_pose(body, bench.target, moved, sample, gate_m=_GATE_M)

    return [
        bench.time(f"pose_skin_varying, theta, {few} matches", lambda: pose_skin_varying(body, theta, vertices=chosen)),
        bench.time(
            f"find_corres, {len(sample.vertices)} vertices",
            lambda: find_corres(bench.target, skin, normals, sample.vertices),
        ),
        bench.time(f"data_term of the pose, {few} matches", lambda: data_term(varying, matches, weights)),
        bench.time("one pose update (LM step, matches)", update),
        bench.time("follow: catch up, settle", lambda: follow_pose(body, bench.target, expected, sample)),
        placements_timing(bench),
        bench.time("judge: find_skin", lambda: find_skin(body, bench.target, theta, sample)),
        bench.time("judge: pose_covariance", lambda: pose_covariance(bench.tracker.subject, fit, sample)),
    ]


def some_placements(bench: Bench) -> Placements:
    """What the first search tries: the skin in this pose, turned in some ways about where it stands."""
    tracker, rng = bench.tracker, np.random.default_rng(0)
    sample = sample_skin(tracker.subject.anatomy, at_most=100)
    skin = pose_skin(tracker.subject.body, bench.frame.theta)
    points, middle = skin[sample.vertices], skin[sample.vertices].mean(axis=0)
    turned = np.array([exp_so3(vector).T for vector in rng.normal(0.0, 1.0, (PLACEMENTS, 3))])
    weights = sample.observations[sample.vertices]
    normals = sample.normals(skin)[sample.vertices] @ turned
    facing = np.tile(weights, (PLACEMENTS, 1))
    return Placements((points - middle) @ turned + middle, normals, facing, weights)


def placements_timing(bench: Bench) -> Timing:
    """The coarse half of the first search."""
    placed, scene = some_placements(bench), Scene(bench.target.cloud)
    return bench.time(
        f"the search's {PLACEMENTS} placements of 100 vertices",
        lambda: costs(scene, placed),
        twin=lambda: costs_by_arrays(scene, placed),
    )


def loop_timing(recording: Recording, subject: Subject) -> Timing:
    """What ``track_recording`` takes from one finished frame to the next: images, pose, judgement, journal."""
    seconds, processor = [time.perf_counter()], [time.process_time()]

    def finished(done: int, total: int) -> None:
        seconds.append(time.perf_counter())
        processor.append(time.process_time())

    with TemporaryDirectory() as folder:
        track_recording(recording, subject, Path(folder) / "motion", progress=finished)
    steps, used = np.diff(seconds)[1:], np.diff(processor)[1:]  # but for the first frame, which is searched
    stage = f"the loop of `bonetrack track`, {len(steps)} frames, the next one fused meanwhile"
    return Timing(stage, steps, used, FRAME_TARGET_S, first_s=FIRST_FRAME_S)


def read(recording: Recording, moment: Instant) -> None:
    """Read one instant's depth images."""
    for name, frame in moment.frames.items():
        read_depth(recording.sensor(name), frame)


def read_and_clean(recording: Recording, moment: Instant) -> None:
    """Read one instant's depth images and drop their flying pixels."""
    for name, frame in moment.frames.items():
        sensor = recording.sensor(name)
        clean_depth(read_depth(sensor, frame), sensor.camera)


def prepare(recording: Recording, subject: Subject, *, repeat: int) -> Bench:
    """Follow the limb for two frames in the middle of the recording.

    Raises:
        FitError: the limb is not found there.
    """
    tracker, moments = make_tracker(subject), instants(recording)
    before = moments[max(0, len(moments) // 2 - 2)]
    moment, last = moments[len(moments) // 2 - 1], moments[len(moments) // 2]
    first, state = tracker.first(Target(fuse(recording, before)), before.time_s)
    if state is not None:
        first, state = tracker.follow(Target(fuse(recording, moment)), moment.time_s, state)
    target = Target(fuse(recording, last))
    frame = first if state is None else tracker.follow(target, last.time_s, state)[0]
    if state is None or frame.lost:
        raise FitError(
            f"the limb is lost at {last.time_s:.2f} s: {frame.lost}",
            where=recording.path,
            remedy="give the subject who moves in this recording",
        )
    return Bench(recording, tracker, last, target, state, frame, repeat)


def simulated_subject(recording: Recording) -> Subject:
    """Who was simulated, with the true poses of a few frames as examples.

    Raises:
        MotionError: the recording has no truth beside it.
    """
    truth = read_truth(recording)
    common_from_world = inverse(world_from_common(recording, truth))
    few = np.linspace(0, len(truth.times) - 1, AS_USUAL.poses).round().astype(int)
    thetas = np.array([moved_rigidly(truth.body.anatomy, truth.thetas[k], common_from_world) for k in few])
    return Subject(truth.body, thetas, truth.times[few], 1e-6 * np.eye(len(truth.body.shape)), {})


def opened(path: Path) -> Recording:
    """The recording, calibrated in memory if nobody calibrated it."""
    recording = open_recording(path)
    if recording.calibration is None and len(recording.sensors) > 1:
        recording = replace(recording, calibration=calibrate_recording(recording))
    return recording
