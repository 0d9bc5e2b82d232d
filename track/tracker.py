"""Tracking (paper, section 3.4): algorithm 1 on every frame, from the last pose, with a motion prior.

A frame is lost, and says why, when too little of the skin that should show has a target or when what matches
does so badly. Its pose is never made up; the next frame starts from the last pose that was tracked, with a prior
that has loosened meanwhile.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from adapt.anatomy import Anatomy, Floats
from adapt.fit.correspondences import Target
from adapt.fit.least_squares import SIGMA_M, data_term
from adapt.fit.pose import GaussianPose, PoseFit, fit_pose
from adapt.fit.sample import SkinSample, sample_skin
from adapt.fit.score import FoundSkin, find_skin, score_pose
from adapt.fit.start import locate
from adapt.model.body import pose_skin_varying
from adapt.subject import Subject
from capture.errors import FitError
from capture.rigid import exp_so3, log_so3

SAMPLED_VERTICES = 2000
ACCELERATION_RAD_S2 = 400.0  # motion prior: standard deviation of joint accelerations; fast people reach it
ACCELERATION_M_S2 = 20.0
_FLOOR_RAD, _FLOOR_M = np.deg2rad(0.5), 0.002  # the prior is never narrower than this
_MEMORY_S = 0.25  # a velocity older than this says nothing any more
LEAST_COVERAGE = 0.75
LARGEST_SKIN_M = 0.013  # mean distance of the skin that should show to the cloud
MOST_ATTACHED = 0.4  # share of the outline beyond which the same surface goes on, in a frame without a past
LARGEST_RESIDUAL_M = 0.006
_GATE_M = 0.03
_UPDATES, _STEPS = 8, 1
_FORGOTTEN_S = 0.5  # a limb lost for longer is searched for anew, once in this time


@dataclass(frozen=True)
class TrackedFrame:
    """One frame: pose (n,), covariance (n, n), and quality; ``lost`` is the reason, or empty."""

    time_s: float
    theta: Floats = field(repr=False)
    covariance: Floats = field(repr=False)
    residual_m: float
    coverage: float
    matches: int
    lost: str


@dataclass(frozen=True)
class TrackerState:
    """What the next frame needs: the last tracked pose, its time, its velocity, and when the limb was searched."""

    time_s: float
    theta: Floats
    velocity: Floats  # (n,) rad/s, m/s
    searched_s: float = -np.inf


@dataclass(frozen=True)
class Tracker:
    """A subject prepared for tracking."""

    subject: Subject
    sample: SkinSample = field(repr=False)

    def first(self, target: Target, time_s: float) -> tuple[TrackedFrame, TrackerState | None]:
        """Track a frame without a past: from the subject's example poses, else from many starts."""
        body = self.subject.body
        try:
            start = locate(body, target, self.sample, list(self.subject.thetas))
            fit = fit_pose(body, target, start.fit.theta, self.sample)
        except FitError as error:
            return _lost(self.subject.anatomy, time_s, error.problem), None
        pose = score_pose(body, target, fit, self.sample)
        if pose.attached > MOST_ATTACHED:
            reason = f"{100 * pose.attached:.0f} % of the limb's outline lies on other surface"
            return _lost(self.subject.anatomy, time_s, reason), None
        frame = self._judge(fit, FoundSkin(pose.skin_m, pose.coverage), time_s)
        return frame, None if frame.lost else TrackerState(time_s, frame.theta, np.zeros_like(frame.theta))

    def follow(self, target: Target, time_s: float, state: TrackerState) -> tuple[TrackedFrame, TrackerState]:
        """Track a frame from the last tracked one.

        When the frame is lost the state is unchanged, but for the time of the last search: a pose long gone says
        nothing of where the limb is now, so it is looked for anew, though not on every frame.
        """
        if time_s - max(state.time_s, state.searched_s) > _FORGOTTEN_S:
            frame, found = self.first(target, time_s)
            return frame, found or replace(state, searched_s=time_s)
        prior = predict(self.subject.anatomy, state, time_s)
        try:
            fit = fit_pose(
                self.subject.body,
                target,
                prior.mean,
                self.sample,
                updates=_UPDATES,
                steps=_STEPS,
                gate_m=_GATE_M,
                prior=prior,
            )
        except FitError as error:
            return _lost(self.subject.anatomy, time_s, error.problem), state
        frame = self._judge(fit, find_skin(self.subject.body, target, fit.theta, self.sample), time_s)
        if frame.lost:
            return frame, state
        elapsed = time_s - state.time_s
        velocity = pose_difference(self.subject.anatomy, frame.theta, state.theta) / elapsed
        return frame, TrackerState(time_s, frame.theta, velocity)

    def missed(self, time_s: float, reason: str) -> TrackedFrame:
        """A frame that cannot even be looked at."""
        return _lost(self.subject.anatomy, time_s, reason)

    def _judge(self, fit: PoseFit, found: FoundSkin, time_s: float) -> TrackedFrame:
        lost = ""
        if found.coverage < LEAST_COVERAGE:
            lost = f"only {100 * found.coverage:.0f} % of the skin that should show was found"
        elif fit.residual_m > LARGEST_RESIDUAL_M:
            lost = f"skin and cloud are {1e3 * fit.residual_m:.1f} mm apart"
        elif found.skin_m > LARGEST_SKIN_M:
            lost = f"the skin that should show is {1e3 * found.skin_m:.1f} mm from the cloud"
        theta = np.full_like(fit.theta, np.nan) if lost else fit.theta
        covariance = pose_covariance(self.subject, fit, self.sample)
        return TrackedFrame(time_s, theta, covariance, fit.residual_m, found.coverage, len(fit.matches), lost)


def make_tracker(subject: Subject) -> Tracker:
    """Prepare a subject for tracking."""
    return Tracker(subject, sample_skin(subject.anatomy, at_most=SAMPLED_VERTICES))


def predict(anatomy: Anatomy, state: TrackerState, time_s: float) -> GaussianPose:
    """The motion prior: constant velocity, with an uncertainty that grows by acceleration times dt^2 / 2."""
    dt = time_s - state.time_s
    memory = float(np.exp(-max(0.0, dt - 0.05) / _MEMORY_S))
    mean = advance(anatomy, state.theta, state.velocity * dt * memory)
    rotational = np.array([coordinate.unit == "rad" for coordinate in anatomy.coordinates])
    spread = np.where(rotational, ACCELERATION_RAD_S2, ACCELERATION_M_S2) * dt**2 / 2.0
    spread += np.where(rotational, _FLOOR_RAD, _FLOOR_M)
    return GaussianPose(mean, np.diag(1.0 / spread**2))


def pose_difference(anatomy: Anatomy, theta: Floats, earlier: Floats) -> Floats:
    """theta - earlier (n,), with a free joint's turn as the rotation vector that leads from one to the other."""
    difference = theta - earlier
    for index in _free_rotations(anatomy):
        difference[index] = log_so3(exp_so3(theta[index]) @ exp_so3(earlier[index]).T)
    return difference


def advance(anatomy: Anatomy, theta: Floats, step: Floats) -> Floats:
    """The pose reached from ``theta`` by a ``pose_difference``; rotation vectors stay no longer than pi."""
    moved = theta + step
    for index in _free_rotations(anatomy):
        moved[index] = log_so3(exp_so3(step[index]) @ exp_so3(theta[index]))
    return moved


def pose_covariance(subject: Subject, fit: PoseFit, sample: SkinSample) -> Floats:
    """Covariance (n, n) of a fitted pose: from the data's noise, and from what is not known of the shape.

    Noise: the inverse normal matrix, scaled by how well the skin fits. Shape: an error ds of the shape makes the
    best pose err by -H_tt^-1 H_ts ds.
    """
    n = len(fit.theta)
    index = fit.matches.vertex
    weights = sample.observations[index]
    skin = pose_skin_varying(subject.body, fit.theta, with_shape=True, vertices=index)
    hessian = data_term(skin, fit.matches, weights).hessian
    noise = np.linalg.inv(hessian[:n, :n] + 1e-6 * np.eye(n))
    misfit = float(np.average(fit.distances**2, weights=weights)) / SIGMA_M**2
    lever = noise @ hessian[:n, n:]
    return np.asarray(max(misfit, 0.05) * noise + lever @ subject.covariance @ lever.T)


def _free_rotations(anatomy: Anatomy) -> list[list[int]]:
    return [
        [anatomy.coordinate_index(name) for name in joint.coordinates[:3]]
        for joint in anatomy.joints
        if joint.type == "free"
    ]


def _lost(anatomy: Anatomy, time_s: float, reason: str) -> TrackedFrame:
    n = len(anatomy.coordinates)
    nothing = np.full(n, np.nan)
    return TrackedFrame(time_s, nothing, np.full((n, n), np.nan), np.nan, 0.0, 0, reason)
