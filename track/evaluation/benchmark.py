"""How long everything takes, stage by stage, on one thread, beside what it may take.

Stages that are compiled loops are shown beside the same work in plain NumPy.

    python -m track.evaluation.benchmark [RECORDING] [--subject FILE] [--repeat 5] [--adapt]

``threadpoolctl`` holds numpy to one thread where it is installed; elsewhere set ``OMP_NUM_THREADS=1``. A recording
that has its truth beside it needs no subject: the person who was simulated is taken.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path

import click
import cv2
import numpy as np
from rich.table import Table
from scipy.spatial import cKDTree

from adapt.anatomy import Anatomy, Floats
from adapt.fit.alternate import adapt_body
from adapt.fit.correspondences import Target, find_corres, pixel_of
from adapt.fit.follow import follow_pose
from adapt.fit.least_squares import data_term, levenberg_marquardt
from adapt.fit.nearest import PointGrid
from adapt.fit.pose import PoseEnergy, PoseFit, match_pose
from adapt.fit.recording import DEFAULT_POSES, adapt_recording
from adapt.fit.score import find_skin
from adapt.model.body import Body, make_body, pose_skin, pose_skin_varying
from adapt.model.deformers import carry
from adapt.model.kinematics import bone_motions
from adapt.model.surface import incidence, vertex_normals
from adapt.model.variation import Motion, Points, constant_points
from adapt.subject import Subject, load_subject
from capture.calibration.calibrate import calibrate_recording
from capture.cloud.fuse import fuse, region_of_interest
from capture.cloud.normals import radius_px
from capture.cloud.patches import fit_patches, fit_patches_by_arrays
from capture.cloud.preprocess import clean_depth
from capture.console import stderr, stdout
from capture.errors import BonetrackError, FitError
from capture.recording import Instant, Recording, instants, open_recording, read_depth
from capture.rigid import apply, exp_so3, inverse, log_so3
from track.ahead import one_ahead
from track.evaluation.errors import read_truth, world_from_common
from track.prediction import predict
from track.run import ready_target
from track.tracker import TrackedFrame, Tracker, TrackerState, make_tracker
from track.uncertainty import pose_covariance

FRAME_TARGET_S = 0.033
ADAPTATION_TARGET_S = 30.0  # of six poses, first poses given
AUTOMATIC_TARGET_S = 180.0
_LOOP_FRAMES = 30


@dataclass(frozen=True)
class Timing:
    """Seconds that each repetition of one stage took (R,), and the processor's part of them (R,).

    The two differ where other programs ran meanwhile. ``twin`` are the processor's seconds for the same
    work in plain NumPy.
    """

    stage: str
    seconds: Floats
    processor: Floats
    target_s: float | None = None
    twin: Floats | None = None


@dataclass(frozen=True)
class _Bench:
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
        target_s: float | None = None,
        twin: Callable[[], object] | None = None,
    ) -> Timing:
        work()  # fills caches
        timing = timed(stage, work, repeat=self.repeat, target_s=target_s)
        return timing if twin is None else replace(timing, twin=self.time(stage, twin).processor)


def timed(stage: str, work: Callable[[], object], *, repeat: int = 1, target_s: float | None = None) -> Timing:
    """Run ``work`` so many times and time each run."""
    seconds, processor = [], []
    for _ in range(repeat):
        start, used = time.perf_counter(), time.process_time()
        work()
        seconds.append(time.perf_counter() - start)
        processor.append(time.process_time() - used)
    return Timing(stage, np.array(seconds), np.array(processor), target_s)


def frame_timings(bench: _Bench) -> list[Timing]:
    """The stages of tracking one frame, and the whole of it."""
    body, sample, theta = bench.tracker.subject.body, bench.tracker.sample, bench.frame.theta
    skin = pose_skin(body, theta)
    normals = sample.normals(skin)
    matches = match_pose(body, bench.target, theta, sample, gate_m=0.02)
    chosen, weights = matches.vertex, sample.observations[matches.vertex]
    varying = pose_skin_varying(body, theta, vertices=chosen)
    fit = PoseFit(theta, matches, matches.distance)
    region = region_of_interest(bench.recording)
    expected = predict(body.anatomy, bench.state, bench.moment.time_s)

    def update() -> None:
        cost = PoseEnergy(body, matches, weights, None)
        moved = levenberg_marquardt(cost.quadratic, bench.state.theta, steps=1, energy=cost.value)
        match_pose(body, bench.target, moved, sample, gate_m=0.02)

    def whole() -> None:
        target = Target(fuse(bench.recording, bench.moment, region=region))
        bench.tracker.follow(target, bench.moment.time_s, bench.state)

    views, whole_skin, few = len(bench.moment.frames), len(skin), len(chosen)
    view, points = bench.target.cloud.views[0], bench.target.cloud.points
    radius, focal = radius_px(view.camera), view.camera.fx
    pixels = np.stack(pixel_of(view, points[bench.target.cloud.sensor == 0])[:2], axis=1)
    near, tree, grid = skin[chosen], cKDTree(points), PointGrid(points)
    corner = (body.anatomy.skin_faces, incidence(body.anatomy.skin_faces, len(skin))[sample.vertices])
    views, whole_skin, few = len(bench.moment.frames), len(skin), len(chosen)
    return [
        bench.time(f"read and clean {views} depth images", lambda: read_and_clean(bench.recording, bench.moment)),
        bench.time(
            f"patches at {len(pixels)} pixels of one image",
            lambda: fit_patches(view.depth, pixels, radius_px=radius, focal_px=focal),
            twin=lambda: fit_patches_by_arrays(view.depth, pixels, radius_px=radius, focal_px=focal),
        ),
        bench.time("fuse, reading included", lambda: fuse(bench.recording, bench.moment, region=region)),
        bench.time(
            f"pose_skin, {whole_skin} vertices",
            lambda: pose_skin(body, theta),
            twin=lambda: skin_of_blocks(body, theta, columns=0),
        ),
        bench.time(
            f"pose_skin_varying, theta, {whole_skin} vertices",
            lambda: pose_skin_varying(body, theta),
            twin=lambda: skin_of_blocks(body, theta, columns=len(theta)),
        ),
        bench.time(
            f"normals, {len(sample.vertices)} vertices",
            lambda: sample.normals(skin),
            twin=lambda: vertex_normals(skin, *corner),
        ),
        bench.time(
            f"nearest of {len(points)} points, {few} times", lambda: grid.query(near), twin=lambda: tree.query(near)
        ),
        bench.time(f"pose_skin_varying, theta, {few} matches", lambda: pose_skin_varying(body, theta, vertices=chosen)),
        bench.time(
            f"find_corres, {len(sample.vertices)} vertices",
            lambda: find_corres(bench.target, skin, normals, sample.vertices),
        ),
        bench.time(f"data_term of the pose, {few} matches", lambda: data_term(varying, matches, weights)),
        bench.time("one pose update (LM step, matches)", update),
        bench.time("follow: catch up, settle", lambda: follow_pose(body, bench.target, expected, sample)),
        bench.time("judge: find_skin", lambda: find_skin(body, bench.target, theta, sample)),
        bench.time("judge: pose_covariance", lambda: pose_covariance(bench.tracker.subject, fit, sample)),
        bench.time("whole frame: fuse, follow, judge", whole),
        replace(loop_timing(bench), target_s=FRAME_TARGET_S),
    ]


def skin_of_blocks(body: Body, theta: Floats, *, columns: int) -> Points:
    """The posed skin from the model's own blocks, with so many columns of derivatives: all by theta, or none."""
    anatomy = body.anatomy
    motions = bone_motions(anatomy, theta, constant_points(body.p.value, len(theta)))
    none = np.zeros((3, 0))
    still = {name: Motion(motion.rotation, motion.translation, none, none) for name, motion in motions.items()}
    value, d = np.zeros((len(body.v_hat), 3)), np.zeros((len(body.v_hat), 3, columns))
    for deformer, bound, share in zip(anatomy.deformers, body.bound_skin, anatomy.deformer_weights.T, strict=True):
        moved = carry(deformer, bound, motions if columns else still)
        value += share[:, None] * moved.value
        d += share[:, None, None] * moved.d
    return Points(value, d)


def loop_timing(bench: _Bench) -> Timing:
    """From depth images to judged poses, frame after frame, the next one fused ahead as ``track_recording`` does."""
    moments = instants(bench.recording)
    begin = min(range(len(moments)), key=lambda k: abs(moments[k].time_s - bench.moment.time_s))
    left, state = moments[begin : begin + _LOOP_FRAMES], bench.state
    seconds, processor = [time.perf_counter()], [time.process_time()]
    ready = partial(ready_target, bench.recording, region_of_interest(bench.recording))
    for moment, target in zip(left, one_ahead(ready, left), strict=True):
        if isinstance(target, Target):
            _, state = bench.tracker.follow(target, moment.time_s, state)
        seconds.append(time.perf_counter())
        processor.append(time.process_time())
    return Timing(f"loop of {len(left)} frames, fused one ahead", np.diff(seconds), np.diff(processor))


def read_and_clean(recording: Recording, moment: Instant) -> None:
    """Read one instant's depth images and drop their flying pixels."""
    for name, frame in moment.frames.items():
        sensor = recording.sensor(name)
        clean_depth(read_depth(sensor, frame), sensor.camera)


def adaptation_timing(recording: Recording, subject: Subject) -> Timing:
    """Algorithm 4, once: the template adapted from the subject's own example poses as given first poses."""
    moments = instants(recording)
    at = np.abs(np.array([moment.time_s for moment in moments])[:, None] - subject.times).argmin(axis=0)
    targets = [Target(fuse(recording, moments[k])) for k in at]
    return timed(
        f"adaptation, {len(targets)} poses, first poses given",
        lambda: adapt_body(make_body(subject.anatomy), targets, subject.thetas),
        target_s=ADAPTATION_TARGET_S,
    )


def automatic_timing(recording: Recording, subject: Subject) -> Timing:
    """From the recording to a subject without a hand on it, once."""
    return timed(
        f"adaptation, {DEFAULT_POSES} poses, fully automatic",
        lambda: adapt_recording(recording, subject.anatomy),
        target_s=AUTOMATIC_TARGET_S,
    )


def prepare(recording: Recording, subject: Subject, *, repeat: int) -> _Bench:
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
    return _Bench(recording, tracker, last, target, state, frame, repeat)


def simulated_subject(recording: Recording) -> Subject:
    """Who was simulated, with the true poses of a few frames as examples.

    Raises:
        MotionError: the recording has no truth beside it.
    """
    truth = read_truth(recording)
    common_from_world = inverse(world_from_common(recording, truth))
    few = np.linspace(0, len(truth.times) - 1, DEFAULT_POSES).round().astype(int)
    thetas = np.array([_moved(truth.body.anatomy, truth.thetas[k], common_from_world) for k in few])
    return Subject(truth.body, thetas, truth.times[few], 1e-6 * np.eye(len(truth.body.shape)), {})


def _moved(anatomy: Anatomy, theta: Floats, to_from: Floats) -> Floats:
    """The pose (n,) seen from another frame: its free joint carried there by ``to_from`` (4, 4)."""
    moved = theta.copy()
    free = next(joint for joint in anatomy.joints if joint.type == "free")
    index = np.array([anatomy.coordinate_index(name) for name in free.coordinates])
    moved[index[:3]] = log_so3(to_from[:3, :3] @ exp_so3(theta[index[:3]]))
    moved[index[3:]] = apply(to_from, theta[index[3:]])
    return moved


def timing_table(timings: list[Timing], title: str) -> Table:
    """Median and range of each stage, the processor's median, the twin's and its ratio, and the share of the target."""
    table = Table("stage", title=title)
    for name in ("median", "range", "processor", "NumPy twin", "of target"):
        table.add_column(name, justify="right", no_wrap=True)
    for timing in timings:
        scale, unit = (1e3, "ms") if np.median(timing.seconds) < 1.0 else (1.0, "s")
        median, used = (f"{scale * np.median(values):.1f} {unit}" for values in (timing.seconds, timing.processor))
        spread = f"{scale * timing.seconds.min():.1f}-{scale * timing.seconds.max():.1f}"
        share = ""
        if timing.target_s is not None:
            share = f"{np.median(timing.seconds) / timing.target_s:.2f} of {timing.target_s:g} s"
        twin = ""
        if timing.twin is not None:
            twin = (
                f"{1e3 * np.median(timing.twin):.1f} ms, {np.median(timing.twin) / np.median(timing.processor):.1f} x"
            )
        table.add_row(timing.stage, median, spread, used, twin, share)
    return table


def hold_to_one_thread() -> None:
    """One thread in OpenCV and, if ``threadpoolctl`` is there, in whatever numpy and scipy multiply with."""
    cv2.setNumThreads(1)
    if find_spec("threadpoolctl") is not None:
        import_module("threadpoolctl").threadpool_limits(limits=1)
    elif os.environ.get("OMP_NUM_THREADS") != "1":
        stderr.print("threadpoolctl is not installed: set OMP_NUM_THREADS=1 to measure one thread")


def _opened(path: Path) -> Recording:
    """The recording, calibrated in memory if nobody calibrated it."""
    recording = open_recording(path)
    if recording.calibration is None and len(recording.sensors) > 1:
        recording = replace(recording, calibration=calibrate_recording(recording))
    return recording


@click.command()
@click.argument("recording", type=click.Path(path_type=Path), default=Path("recordings/upper-limb-right-sample"))
@click.option("--subject", type=click.Path(path_type=Path), help="Who moves there; else who was simulated.")
@click.option("--repeat", default=5, show_default=True, type=click.IntRange(min=1), help="How often each stage runs.")
@click.option("--adapt", is_flag=True, help="Also time the whole automatic adaptation, once.")
def main(recording: Path, subject: Path | None, repeat: int, adapt: bool) -> None:
    """Time tracking and adaptation on RECORDING and print a table."""
    hold_to_one_thread()
    try:
        with stdout.status("timing") as status:
            opened = _opened(recording)
            who = simulated_subject(opened) if subject is None else load_subject(subject)
            timings = frame_timings(prepare(opened, who, repeat=repeat))
            status.update("timing the adaptation")
            timings.append(adaptation_timing(opened, who))
            if adapt:
                status.update("timing the automatic adaptation")
                timings.append(automatic_timing(opened, who))
    except BonetrackError as error:
        raise click.ClickException(str(error)) from error
    stdout.print(timing_table(timings, f"{recording.name}: one thread, median of {repeat} (adaptation: once)"))


if __name__ == "__main__":
    main()
