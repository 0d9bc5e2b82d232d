"""A limb that moves faster than expected is caught up with."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from adapt.fit.follow import follow_pose
from adapt.fit.pose import GaussianPose
from adapt.match.correspondences import Target
from adapt.match.skin_sample import sample_skin
from capture.calibration.calibrate import calibrate_recording
from capture.cloud.fuse import fuse
from capture.recording import instants, open_recording
from capture.rigid import inverse
from track.accuracy.truth import read_truth, world_from_common
from track.evaluation.known import carried

SAMPLE = Path(__file__).parents[1] / "recordings" / "lower-limb-right-sample"


@pytest.fixture(scope="module")
def leg():
    """The sample recording of a leg, whose leg it is, and its true poses."""
    recording = open_recording(SAMPLE)
    recording = replace(recording, calibration=calibrate_recording(recording))
    truth = read_truth(recording)
    to_common = inverse(world_from_common(recording, truth))
    return recording, truth.body, carried(truth.body.anatomy, truth.thetas, to_common)


@pytest.mark.parametrize(("frame", "off_deg"), [(17, 60.0), (69, -50.0), (86, 50.0), (86, 0.0)])
def test_a_foot_that_has_turned_round_unexpectedly_is_found(leg, frame: int, off_deg: float) -> None:
    recording, body, thetas = leg
    target = Target(fuse(recording, instants(recording)[frame]))
    ankle, mean = body.anatomy.coordinate_index("ankle_angle_r"), thetas[frame].copy()
    mean[ankle] += np.deg2rad(off_deg)
    rotational = np.array([coordinate.unit == "rad" for coordinate in body.anatomy.coordinates])
    spread = np.where(rotational, np.deg2rad(13.0), 0.013)  # what the tracker expects at 30 frames a second
    sample = sample_skin(body.anatomy, at_most=2000)
    fit = follow_pose(body, target, GaussianPose(mean, np.diag(spread**-2.0)), sample)
    assert abs(np.rad2deg(fit.theta[ankle] - thetas[frame, ankle])) < 3.0
