"""Tracking (paper, section 3.4): algorithm 1 on every frame, from the last pose, with a motion prior.

A frame is lost, and says why, when the skin in sight is not found where the pose says, or when no bone shows. Its pose
is never made up; the next frame starts from the last pose that was tracked, with a prior that has loosened meanwhile.
In a frame that is tracked, bones may be out of sight (``track.observed_bones``): the prior keeps what only they tell,
and its standard deviation grows.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, field, replace

import numpy as np

from adapt.anatomy import Floats
from adapt.fit.follow import follow_pose
from adapt.fit.judge import LEAST_IN_SIGHT, judge_fit, shows
from adapt.fit.never_seen import skin_of, without
from adapt.fit.pose import GaussianPose, PoseFit, fit_pose
from adapt.fit.posterior import inflate_unobserved, pose_covariance
from adapt.fit.unobserved import towards_rest
from adapt.match.correspondences import Target
from adapt.match.skin_sample import SkinSample, sample_skin
from adapt.model.body import Body
from adapt.model.pose_space import pose_difference, root_joint
from adapt.search.first_pose import CLEARLY_M, GOOD_M, locate, try_pose
from adapt.search.other_limb import on_its_side
from adapt.search.pose_score import score_pose
from adapt.subject import Subject, as_adapted
from capture.errors import FitError
from track.cloud_change import look_of, looks_changed
from track.observed_bones import bones_shown, coordinates_known, coordinates_seen
from track.out_of_step import lever_of_late
from track.prediction import guess_deviation, predict
from track.thresholds import USUAL, Thresholds
from track.tracked_frame import BY_HAND, FORGOTTEN_S, FOUND, TrackedFrame, TrackerState, lost_frame

_WORSE_THAN_ADAPTED = 3.0  # found anew on something else (a board), the skin fits worse than the person's by more
_USUAL_M = 0.001  # matched skin of an adapted subject from its clouds, where its file does not say
_CLEARLY_WORSE = 1.2  # from a likely start, skin that is farther from the cloud than as adapted by more is searched
_STILL_RAD, _MOST_FITS = np.deg2rad(0.5), 5  # a pose found anew is fitted until it stays


@dataclass(frozen=True)
class Tracker:
    """A subject prepared for tracking.

    ``usual_m`` is how far (m) matched skin of a pose found anew may be from the cloud, ``good_m`` how far all its skin
    may be in a pose that was fitted from one of the subject's own, if the limb is not to be searched.
    """

    subject: Subject
    sample: SkinSample = field(repr=False)
    usual_m: float
    good_m: float
    thresholds: Thresholds = USUAL

    def decided_by(self) -> dict[str, float]:
        """What decides whether a frame is tracked, a bone shows, and a limb is searched; m, s, rad, shares, counts."""
        return asdict(self.thresholds) | {
            "largest_residual_found_anew_m": self.usual_m,
            "largest_skin_to_cloud_unsearched_m": self.good_m,
            "least_skin_in_sight": LEAST_IN_SIGHT,
            "searched_after_s": FORGOTTEN_S,
        }

    def first(self, target: Target, time_s: float) -> tuple[TrackedFrame, TrackerState | None]:
        """Track a frame without a past: from the subject's example poses, else from many starts."""
        body = self.subject.body
        try:
            start = locate(body, target, self.sample, list(self.subject.thetas), good_m=self.good_m)
            start, _ = on_its_side(body, target, start, self.sample)
            fit = _settled(body, target, start.fit.theta, self.sample)
        except FitError as error:
            return lost_frame(self.subject.anatomy, time_s, error.problem), None
        merged = score_pose(body, target, fit, self.sample).merged_outline
        if merged > self.thresholds.most_outline_on_other_surface:
            reason = f"{100 * merged:.0f} % of the limb's outline lies on other surface"
            return lost_frame(self.subject.anatomy, time_s, reason), None
        never = np.full(len(fit.theta), -np.inf)
        frame, known_s = self._judge(fit, target, time_s, never, least=self.thresholds.least_bones_found_anew)
        frame = self._doubted(frame)
        if frame.lost:
            return frame, None
        still = np.zeros_like(frame.theta)
        found = TrackerState(time_s, frame.theta, still, frame.shown, known_s, searched_s=time_s)
        return replace(frame, how=FOUND), found

    def nothing_known(self) -> TrackerState:
        """The state before the first frame."""
        n, nowhere = len(self.subject.anatomy.coordinates), np.zeros(len(self.subject.anatomy.bones), dtype=bool)
        return TrackerState(-np.inf, np.full(n, np.nan), np.zeros(n), nowhere, np.full(n, -np.inf))

    def given(
        self, target: Target, time_s: float, theta: Floats, state: TrackerState
    ) -> tuple[TrackedFrame, TrackerState]:
        """Track a frame from a pose (n,) that a person set for it; the past counts only if that does not fit."""
        anatomy = self.subject.anatomy
        sd = {"rad": self.thresholds.sd_by_hand_rad, "m": self.thresholds.sd_by_hand_m}
        deviation = np.array([sd[coordinate.unit] for coordinate in anatomy.coordinates])
        prior = GaussianPose(theta, np.diag(1.0 / deviation**2))
        try:
            fit = fit_pose(self.subject.body, target, theta, self.sample, prior=prior)
        except FitError as error:
            return lost_frame(anatomy, time_s, f"from the pose set by hand {error.problem}"), state
        frame, known_s = self._judge(fit, target, time_s, np.full(len(theta), -np.inf), least=1)
        if frame.lost:
            return replace(frame, lost=f"from the pose set by hand {frame.lost}"), state
        still = np.zeros_like(frame.theta)
        return replace(frame, how=BY_HAND), TrackerState(time_s, frame.theta, still, frame.shown, known_s, time_s)

    def follow(
        self, target: Target, time_s: float, state: TrackerState, *, searching: bool = True
    ) -> tuple[TrackedFrame, TrackerState]:
        """Track a frame from the last tracked one.

        When the frame is lost the state is unchanged, but for what is said of the last search: a pose long gone says
        nothing of where the limb is now, so it is looked for anew, though not on every frame, and ever more seldom
        while the cloud stays as it was. So it is when bones have been out of sight for long: what is found then stands
        if more bones show. A limb that comes back is taken up when little of it shows, so a little later it is searched
        for, and what is found then stands if it explains the cloud clearly better. Without ``searching`` none is done.
        """
        lost_for_s = time_s - max(state.time_s, state.searched_s)
        if searching and lost_for_s > FORGOTTEN_S:
            look = look_of(target.cloud)
            if lost_for_s > state.wait_s or looks_changed(look, state.look):
                frame, found = self.first(target, time_s)
                return frame, found or replace(state, searched_s=time_s, wait_s=self._longer(state), look=look)
        if not np.isfinite(state.time_s):
            return self.missed(time_s, "not found yet"), state
        frame, after = self._continue(target, time_s, state)
        if frame.lost or not searching:
            return frame, after
        if time_s - after.taken_up_s > self.thresholds.compared_after_s:
            return self._compared(frame, replace(after, taken_up_s=np.inf), target)
        if not _search_is_due(after):
            return frame, after
        anew, found = self.first(target, time_s)
        if found is not None and anew.shown.sum() > frame.shown.sum():
            return anew, found
        return frame, replace(after, searched_s=time_s, wait_s=self._longer(after))

    def _longer(self, state: TrackerState) -> float:
        """How long (s) to wait until the next search, after one in vain."""
        return min(2.0 * state.wait_s, self.thresholds.longest_wait_for_search_s)

    def _compared(self, frame: TrackedFrame, state: TrackerState, target: Target) -> tuple[TrackedFrame, TrackerState]:
        """A tracked frame, or what a search finds in its stead where that explains the cloud clearly better."""
        anew, found = self.first(target, frame.time_s)
        state = replace(state, searched_s=frame.time_s)
        if found is None:
            return frame, state
        was, now = (try_pose(self.subject.body, target, self.sample, theta) for theta in (frame.theta, anew.theta))
        if now is None or (was is not None and was.cost_m < now.cost_m + CLEARLY_M):
            return frame, state
        return anew, found

    def _continue(self, target: Target, time_s: float, state: TrackerState) -> tuple[TrackedFrame, TrackerState]:
        anatomy = self.subject.anatomy
        prior = predict(anatomy, state, time_s)
        # A motion prior alone would let what is untold drift.
        kept = float(np.exp(-(time_s - state.time_s) / self.thresholds.back_to_rest_s))
        mean = towards_rest(self.subject.body, prior.mean, state.theta, state.shown, kept)
        try:
            fit = follow_pose(self.subject.body, target, replace(prior, mean=mean), self.sample)
        except FitError as error:
            return lost_frame(anatomy, time_s, error.problem), state
        frame, known_s = self._judge(fit, target, time_s, state.known_s, least=1)
        if time_s - state.time_s > self.thresholds.found_anew_after_s:
            frame = self._doubted(frame)
        if frame.lost:
            return frame, state
        velocity = pose_difference(anatomy, frame.theta, state.theta) / (time_s - state.time_s)
        velocity[~(coordinates_seen(anatomy, frame.shown) & coordinates_seen(anatomy, state.shown))] = 0.0
        taken_up_s = time_s if time_s - state.time_s > FORGOTTEN_S else state.taken_up_s
        after = TrackerState(time_s, frame.theta, velocity, frame.shown, known_s, taken_up_s=taken_up_s)
        return frame, after if frame.shown.all() else replace(after, searched_s=state.searched_s, wait_s=state.wait_s)

    def _doubted(self, frame: TrackedFrame) -> TrackedFrame:
        """A frame found anew, lost unless its skin fits about as well as it did when it was adapted.

        A forearm alone fits many places: where the root bone does not show, it must fit well.
        """
        anatomy = self.subject.anatomy
        root = next(k for k, bone in enumerate(anatomy.bones) if bone.name == root_joint(anatomy).child)
        most_m = self.usual_m if frame.shown[root] else self.thresholds.largest_residual_without_root_m
        if frame.lost or frame.residual_m <= most_m:
            return frame
        reason = f"skin and cloud are {1e3 * frame.residual_m:.1f} mm apart, too far for a pose found anew"
        return lost_frame(anatomy, frame.time_s, reason)

    def missed(self, time_s: float, reason: str) -> TrackedFrame:
        """A frame that cannot even be looked at."""
        return lost_frame(self.subject.anatomy, time_s, reason)

    def _judge(
        self, fit: PoseFit, target: Target, time_s: float, known_s: Floats, *, least: int
    ) -> tuple[TrackedFrame, Floats]:
        """The frame that a fit makes, lost if fewer bones with skin show, and when each coordinate was last known."""
        anatomy = self.subject.anatomy
        bounds = self.thresholds.followed
        judged = judge_fit(self.subject.body, target, fit, self.sample, bounds)
        found = judged.found
        unknown = np.isin([bone.name for bone in anatomy.bones], self.subject.never_seen)
        shown = bones_shown(anatomy, found.bones, bounds) & ~unknown
        too_few = sum(shows(part, bounds) for part in found.bones.values()) < min(least, len(found.bones))
        lost = judged.reason or ("too few bones show" if too_few else "")
        if lost:
            shown[:] = False
        known_s = np.where(coordinates_known(anatomy, shown[None])[0], time_s, known_s)
        theta = np.full_like(fit.theta, np.nan) if lost else fit.theta
        guessed = guess_deviation(anatomy, time_s - known_s)
        covariance = inflate_unobserved(pose_covariance(self.subject, fit, self.sample), guessed)
        quality = (fit.residual_m, found.whole.skin_m, found.whole.coverage, len(fit.matches))
        frame = TrackedFrame(time_s, theta, covariance, shown, *quality, lost)
        return frame if lost else replace(
            frame, late=lever_of_late(self.subject.body, target, fit, self.sample)
        ), known_s


def _search_is_due(state: TrackerState) -> bool:
    """Whether something has not been known for long, nor searched for."""
    unknown_s = state.time_s - float(state.known_s.min())
    return unknown_s > FORGOTTEN_S and state.time_s - state.searched_s > state.wait_s


def make_tracker(subject: Subject, thresholds: Thresholds = USUAL) -> Tracker:
    """Prepare a subject for tracking."""
    sample = sample_skin(subject.anatomy, at_most=thresholds.sampled_vertices)
    matched, skin = (as_adapted(subject, name) for name in ("median_distance_mm", "skin_to_cloud_mm"))
    return Tracker(
        subject,
        without(sample, skin_of(subject.body, subject.never_seen)),
        usual_m=max(
            _WORSE_THAN_ADAPTED * (_USUAL_M if matched is None else matched), thresholds.largest_residual_without_root_m
        ),
        good_m=GOOD_M if skin is None else min(_CLEARLY_WORSE * skin, GOOD_M),
        thresholds=thresholds,
    )


def _settled(body: Body, target: Target, theta: Floats, sample: SkinSample) -> PoseFit:
    """The fitted pose, fitted again until it stays: from afar a forearm turns slowly into its place.

    Raises:
        FitError: too little of the skin finds a target.
    """
    fit = fit_pose(body, target, theta, sample)
    for _ in range(_MOST_FITS - 1):
        before = fit.theta
        fit = fit_pose(body, target, before, sample)
        if np.abs(pose_difference(body.anatomy, fit.theta, before)).max() < _STILL_RAD:
            break
    return fit
