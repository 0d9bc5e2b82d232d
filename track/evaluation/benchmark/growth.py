"""How the time of a frame grows with the number of frames, of sensors, of skin vertices and of deformers."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TypeVar

import numpy as np
from scipy import sparse

from adapt.anatomy import Anatomy, Floats, Ints
from adapt.match.correspondences import Target
from adapt.match.skin_sample import sample_skin
from adapt.model.body import make_body
from adapt.subject import Subject
from capture.cloud.fuse import fuse, region_of_interest
from capture.recording import Calibration, Recording, SensorCalibration, instants
from track.accuracy.truth import read_truth
from track.evaluation.benchmark.deformers import POSED, seconds_by_deformers
from track.evaluation.benchmark.timing import Timing
from track.evaluation.made_up_motions import motion_names, perform
from track.simulation.simulate import performance_rig, simulate_performance
from track.tracker import Tracker, make_tracker

SENSORS = (1, 2, 4)
SAMPLES = (500, 1000, 2000, 4000)
_FPS, _SECONDS = 20.0, 0.6
_FRAMES = 20
_PARTS = 4

_T = TypeVar("_T")


@dataclass(frozen=True)
class Curve:
    """Median seconds of a frame (K,) by a quantity that grows (K,); the processor's, which others disturb less."""

    what: str
    quantity: tuple[int, ...]
    seconds: tuple[float, ...]


def by_frames(loop: Timing) -> Curve:
    """The processor's mean seconds a frame up to a quarter, half, three quarters and all of the frames of a loop."""
    ends = [len(loop.seconds) * part // _PARTS for part in range(1, _PARTS + 1)]
    return Curve(
        "frames of the recording, mean of a frame", tuple(ends), tuple(loop.processor[:end].mean() for end in ends)
    )


def by_sensors(subject: Subject) -> Curve:
    """The same motion seen by more sensors: fusing and following."""
    performance = perform(subject.body, motion_names(subject.anatomy)[:1], seconds_each=_SECONDS, fps=_FPS)
    subject = replace(subject, thetas=performance.thetas[:1], times=performance.times[:1])
    seconds = []
    for count in SENSORS:
        rig = performance_rig(performance, elevations_deg=tuple(np.linspace(24.0, 12.0, count)))
        with TemporaryDirectory() as folder:
            recording = simulate_performance(performance, Path(folder) / "recording", rig=rig)
            recording = replace(recording, calibration=_true_calibration(recording))
            seconds.append(_frame_seconds(make_tracker(subject), recording))
    return Curve("sensors, fuse and follow", SENSORS, tuple(seconds))


def by_sampled_vertices(recording: Recording, subject: Subject) -> Curve:
    """More of the same skin looked at in each frame: following alone."""
    tracker = make_tracker(subject)
    counts = (*SAMPLES, len(sample_skin(subject.anatomy).vertices))
    trackers = [replace(tracker, sample=sample_skin(subject.anatomy, at_most=count)) for count in counts]
    return Curve("skin vertices looked at, follow", counts, _follow_seconds(trackers, recording))


def by_skin_vertices(recording: Recording, subject: Subject) -> Curve:
    """A finer skin, as many of its vertices looked at: following alone."""
    fine = with_finer_skin(subject)
    trackers = [make_tracker(one) for one in (subject, fine)]
    counts = tuple(len(one.body.v_hat) for one in (subject, fine))
    return Curve("skin vertices in all, 2000 of them looked at, follow", counts, _follow_seconds(trackers, recording))


def by_deformers(subject: Subject) -> Curve:
    """More limbs in one anatomy, as much of their skin posed with its derivatives."""
    return Curve(f"deformers, pose {POSED} vertices", *seconds_by_deformers(subject.anatomy))


def with_finer_skin(subject: Subject) -> Subject:
    """The same subject, each triangle of the skin cut into four: what belongs to a vertex is the mean of its edge's."""
    anatomy, body = subject.anatomy, subject.body
    halves, faces = _midpoints(anatomy.skin_faces, len(body.v_hat))
    fine: Anatomy = replace(
        anatomy,
        skin_faces=faces,
        skin_vertices=np.vstack([anatomy.skin_vertices, halves @ anatomy.skin_vertices]),
        skin_handle_weights=np.vstack([anatomy.skin_handle_weights, halves @ anatomy.skin_handle_weights]),
        deformer_weights=np.vstack([anatomy.deformer_weights, halves @ anatomy.deformer_weights]),
        fit_weight=np.concatenate([anatomy.fit_weight, halves @ anatomy.fit_weight]),
    )
    v_hat = np.vstack([body.v_hat, halves @ body.v_hat])
    few = len(body.shape)  # the soft tissue's modes are others on another mesh
    return replace(
        subject, body=make_body(fine, shape=body.shape, v_hat=v_hat), covariance=subject.covariance[:few, :few]
    )


def _midpoints(faces: Ints, count: int) -> tuple[sparse.csr_matrix, Ints]:
    """Means over the edges' ends (E, V), and the faces (4 F, 3) of the mesh with the edges' middles as vertices."""
    ends = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    edges, which = np.unique(ends, axis=0, return_inverse=True)
    a, b, c = faces.T
    ab, bc, ca = count + which.reshape(-1, 3).T
    rows = np.repeat(np.arange(len(edges)), 2)
    halves = sparse.csr_matrix((np.full(2 * len(edges), 0.5), (rows, edges.ravel())), shape=(len(edges), count))
    quarters = [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
    return halves, np.concatenate([np.stack(quarter, axis=1) for quarter in quarters])


def _true_calibration(recording: Recording) -> Calibration:
    known = read_truth(recording).world_from_sensor
    return Calibration({name: SensorCalibration(stands, 0.0, {}) for name, stands in known.items()})


def _frame_seconds(tracker: Tracker, recording: Recording) -> float:
    """The processor's median seconds to fuse and follow a frame, all but the first."""
    region, state, seconds = region_of_interest(recording), tracker.nothing_known(), []
    for moment in instants(recording):
        cloud, fusing = _spent(partial(fuse, recording, moment, region=region))
        (_, state), following = _spent(partial(tracker.follow, Target(cloud), moment.time_s, state))
        seconds.append(fusing + following)
    return float(np.median(seconds[1:]))


def _follow_seconds(trackers: Sequence[Tracker], recording: Recording) -> tuple[float, ...]:
    """The processor's median seconds of each tracker to follow a frame, in turns, all but the first."""
    region = region_of_interest(recording)
    states = [tracker.nothing_known() for tracker in trackers]
    seconds: list[list[float]] = [[] for _ in trackers]
    for moment in instants(recording)[:_FRAMES]:
        cloud = fuse(recording, moment, region=region)
        for k, tracker in enumerate(trackers):
            (_, states[k]), following = _spent(partial(tracker.follow, Target(cloud), moment.time_s, states[k]))
            seconds[k].append(following)
    return tuple(float(np.median(of[1:])) for of in seconds)


def _spent(work: Callable[[], _T]) -> tuple[_T, float]:
    """What some work gives, and the processor's seconds it took."""
    start = time.process_time()
    result = work()
    return result, time.process_time() - start


def growth(recording: Recording, subject: Subject, loop: Timing) -> list[Curve]:
    """All curves."""
    return [
        by_frames(loop),
        by_sensors(subject),
        by_sampled_vertices(recording, subject),
        by_skin_vertices(recording, subject),
        by_deformers(subject),
    ]


def slope(curve: Curve) -> float:
    """The exponent k of time = c * quantity^k between a curve's ends: 1 is linear growth, 0 none."""
    seconds: Floats = np.array(curve.seconds)
    return float(np.log(seconds[-1] / seconds[0]) / np.log(curve.quantity[-1] / curve.quantity[0]))
