"""Tracking (paper, section 3.4): algorithm 1 on every frame, from the last pose, with a motion prior.

A frame is lost, and says why, when the skin in sight is not found where the pose says, or when no bone shows. Its
pose is never made up; the next frame starts from the last pose that was tracked, with a prior that has loosened
meanwhile. In a frame that is tracked, bones may be out of sight (``track.shown``): the prior keeps what only they tell,
and its standard deviation grows.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from adapt.anatomy import Anatomy, Floats
from adapt.fit.correspondences import Target
from adapt.fit.follow import follow_pose
from adapt.fit.pose import GaussianPose, PoseFit, fit_pose
from adapt.fit.sample import SkinSample, sample_skin
from adapt.fit.score import FoundSkin, find_skin, score_pose
from adapt.fit.start import locate
from adapt.fit.untold import towards_rest
from adapt.subject import Subject
from capture.errors import FitError
from capture.rigid import exp_so3, log_so3
from track.shown import Bools, bones_shown, coordinates_known, coordinates_seen, fits, shows
from track.uncertainty import pose_covariance

SAMPLED_VERTICES = 2000
ACCELERATION_RAD_S2 = 400.0  # motion prior: standard deviation of joint accelerations; fast people reach it
ACCELERATION_M_S2 = 20.0
_FLOOR_RAD, _FLOOR_M = np.deg2rad(0.5), 0.002  # the prior is never narrower than this
_MEMORY_S = 0.25  # a velocity older than this says nothing any more
LEAST_BONES = 2  # with skin, that must show in a frame without a past; one alone may be anything
MOST_ATTACHED = 0.4  # share of the outline beyond which the same surface goes on, in a frame without a past
LARGEST_RESIDUAL_M = 0.006
_FORGOTTEN_S = 0.5  # a limb lost for longer is searched for anew, once in this time
_BACK_S = 1.0  # time in which a joint that nothing tells of has gone most of the way back to rest
_LONGEST_WAIT_S = 8.0  # between searches for bones out of sight


@dataclass(frozen=True)
class TrackedFrame:
    """One frame: pose (n,), covariance (n, n), which bones show (B,), and quality; ``lost`` is the reason, or empty.

    Of a tracked frame the pose is whole, coordinates of bones that do not show are guessed.
    """

    time_s: float
    theta: Floats = field(repr=False)
    covariance: Floats = field(repr=False)
    shown: Bools = field(repr=False)
    residual_m: float
    coverage: float
    matches: int
    lost: str


@dataclass(frozen=True)
class TrackerState:
    """What the next frame needs: the last tracked pose, its time, its velocity, and what is not known of it.

    ``shown`` are the bones that showed then; ``known_s`` says when each coordinate was last known (-inf: never),
    ``searched_s`` when the limb was last searched, ``wait_s`` how long to wait before bones that are out of sight are
    searched again.
    """

    time_s: float
    theta: Floats
    velocity: Floats  # (n,) rad/s, m/s
    shown: Bools  # (B,)
    known_s: Floats  # (n,)
    searched_s: float = -np.inf
    wait_s: float = _FORGOTTEN_S


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
        attached = score_pose(body, target, fit, self.sample).attached
        if attached > MOST_ATTACHED:
            reason = f"{100 * attached:.0f} % of the limb's outline lies on other surface"
            return _lost(self.subject.anatomy, time_s, reason), None
        never = np.full(len(fit.theta), -np.inf)
        frame, known_s = self._judge(fit, target, time_s, never, least=LEAST_BONES)
        if frame.lost:
            return frame, None
        still = np.zeros_like(frame.theta)
        return frame, TrackerState(time_s, frame.theta, still, frame.shown, known_s, searched_s=time_s)

    def follow(self, target: Target, time_s: float, state: TrackerState) -> tuple[TrackedFrame, TrackerState]:
        """Track a frame from the last tracked one.

        When the frame is lost the state is unchanged, but for the time of the last search: a pose long gone says
        nothing of where the limb is now, so it is looked for anew, though not on every frame. So it is when bones have
        been out of sight for long: what is found then stands if more bones show.
        """
        if time_s - max(state.time_s, state.searched_s) > _FORGOTTEN_S:
            frame, found = self.first(target, time_s)
            return frame, found or replace(state, searched_s=time_s)
        frame, after = self._continue(target, time_s, state)
        if frame.lost or not _search_is_due(after):
            return frame, after
        anew, found = self.first(target, time_s)
        if found is not None and anew.shown.sum() > frame.shown.sum():
            return anew, found
        return frame, replace(after, searched_s=time_s, wait_s=min(2.0 * after.wait_s, _LONGEST_WAIT_S))

    def _continue(self, target: Target, time_s: float, state: TrackerState) -> tuple[TrackedFrame, TrackerState]:
        anatomy = self.subject.anatomy
        prior = predict(anatomy, state, time_s)
        kept = float(np.exp(-(time_s - state.time_s) / _BACK_S))  # a motion prior alone would let what is untold drift
        mean = towards_rest(self.subject.body, prior.mean, state.theta, state.shown, kept)
        try:
            fit = follow_pose(self.subject.body, target, replace(prior, mean=mean), self.sample)
        except FitError as error:
            return _lost(anatomy, time_s, error.problem), state
        frame, known_s = self._judge(fit, target, time_s, state.known_s, least=1)
        if frame.lost:
            return frame, state
        velocity = pose_difference(anatomy, frame.theta, state.theta) / (time_s - state.time_s)
        velocity[~(coordinates_seen(anatomy, frame.shown) & coordinates_seen(anatomy, state.shown))] = 0.0
        after = TrackerState(time_s, frame.theta, velocity, frame.shown, known_s)
        return frame, after if frame.shown.all() else replace(after, searched_s=state.searched_s, wait_s=state.wait_s)

    def missed(self, time_s: float, reason: str) -> TrackedFrame:
        """A frame that cannot even be looked at."""
        return _lost(self.subject.anatomy, time_s, reason)

    def _judge(
        self, fit: PoseFit, target: Target, time_s: float, known_s: Floats, *, least: int
    ) -> tuple[TrackedFrame, Floats]:
        """The frame that a fit makes, lost if fewer bones with skin show, and when each coordinate was last known."""
        anatomy = self.subject.anatomy
        found = find_skin(self.subject.body, target, fit.theta, self.sample)
        shown = bones_shown(anatomy, found.bones)
        lost = _why_lost(fit, found, sum(shows(part) for part in found.bones.values()) < min(least, len(found.bones)))
        if lost:
            shown[:] = False
        known_s = np.where(coordinates_known(anatomy, shown[None])[0], time_s, known_s)
        theta = np.full_like(fit.theta, np.nan) if lost else fit.theta
        covariance = unsure_where_unknown(anatomy, pose_covariance(self.subject, fit, self.sample), time_s - known_s)
        quality = (fit.residual_m, found.whole.coverage, len(fit.matches))
        return TrackedFrame(time_s, theta, covariance, shown, *quality, lost), known_s


def _why_lost(fit: PoseFit, found: FoundSkin, too_few: bool) -> str:
    if fit.residual_m > LARGEST_RESIDUAL_M:
        return f"skin and cloud are {1e3 * fit.residual_m:.1f} mm apart"
    if not fits(found.whole):
        share, apart = 100 * found.whole.coverage, 1e3 * found.whole.skin_m
        return f"{share:.0f} % of the skin in sight was found, {apart:.1f} mm from the cloud"
    return "too few bones show" if too_few else ""


def _search_is_due(state: TrackerState) -> bool:
    """Whether something has not been known for long, nor searched for."""
    unknown_s = state.time_s - float(state.known_s.min())
    return unknown_s > _FORGOTTEN_S and state.time_s - state.searched_s > state.wait_s


def make_tracker(subject: Subject) -> Tracker:
    """Prepare a subject for tracking."""
    return Tracker(subject, sample_skin(subject.anatomy, at_most=SAMPLED_VERTICES))


def predict(anatomy: Anatomy, state: TrackerState, time_s: float) -> GaussianPose:
    """The motion prior: constant velocity, with an uncertainty that grows by acceleration times dt^2 / 2."""
    dt = time_s - state.time_s
    memory = float(np.exp(-max(0.0, dt - 0.05) / _MEMORY_S))
    mean = advance(anatomy, state.theta, state.velocity * dt * memory)
    return GaussianPose(mean, np.diag(1.0 / _spread(anatomy, np.array(dt)) ** 2))


def _spread(anatomy: Anatomy, dt: Floats) -> Floats:
    """Standard deviation (n,) in rad or m of coordinates not seen for ``dt`` () or (n,) seconds."""
    rotational = np.array([coordinate.unit == "rad" for coordinate in anatomy.coordinates])
    spread = np.where(rotational, ACCELERATION_RAD_S2, ACCELERATION_M_S2) * dt**2 / 2.0
    return np.asarray(spread + np.where(rotational, _FLOOR_RAD, _FLOOR_M))


def unsure_where_unknown(anatomy: Anatomy, covariance: Floats, unknown_s: Floats) -> Floats:
    """The covariance (n, n) of a pose whose coordinates have not been known for so long (n,) s; 0 where they are.

    What is not known spreads as in ``predict``, up to the standard deviation of any place of its range being as likely.
    """
    anywhere = np.array([(c.high - c.low) / np.sqrt(12.0) for c in anatomy.coordinates])
    guess = np.minimum(_spread(anatomy, unknown_s), anywhere)
    unknown = unknown_s > 0.0
    told = covariance * ~(unknown[:, None] | unknown)
    return np.asarray(told + np.diag(np.where(unknown, guess, 0.0) ** 2))


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


def _free_rotations(anatomy: Anatomy) -> list[list[int]]:
    return [
        [anatomy.coordinate_index(name) for name in joint.coordinates[:3]]
        for joint in anatomy.joints
        if joint.type == "free"
    ]


def _lost(anatomy: Anatomy, time_s: float, reason: str) -> TrackedFrame:
    n, nowhere = len(anatomy.coordinates), np.zeros(len(anatomy.bones), dtype=bool)
    return TrackedFrame(time_s, np.full(n, np.nan), np.full((n, n), np.nan), nowhere, np.nan, 0.0, 0, reason)
