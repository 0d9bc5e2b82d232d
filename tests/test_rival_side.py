"""The other side is always tried: a wrong one is refused, and what the data cannot tell is not claimed."""

from __future__ import annotations

from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pytest

from adapt.adapt_recording import adapt_recording
from adapt.match.correspondences import Target
from adapt.match.skin_sample import sample_skin
from adapt.mirror import mirrored, mirrored_body
from adapt.model.body import make_body, pose_skin
from adapt.model.size import resized
from adapt.options import AdaptOptions
from adapt.search.rival_side import (
    TOLD,
    SideEvidence,
    _pose_of_other,
    compare_sides,
    refuse_neither_side,
    refuse_the_other_side,
)
from adapt.subject import WIDENED, doubts
from capture.errors import FitError

FRAMES = [0, 3, 6, 9]


@pytest.fixture(scope="module")
def clouds(limb):
    return [limb.targets[k] for k in FRAMES]


@pytest.fixture(scope="module")
def poses_of_the_left(limb, clouds):
    """Left arms laid into a right arm's clouds, as a search with the wrong anatomy would lay them."""
    asked = make_body(limb.subject.anatomy)
    other = mirrored_body(asked)
    sample = sample_skin(other.anatomy, at_most=1000)
    pairs = zip(clouds, limb.thetas[FRAMES], strict=True)
    return np.array([_pose_of_other(asked, other, target, theta, sample) for target, theta in pairs])


def test_a_mirrored_body_poses_as_the_mirror_image(limb):
    body = limb.subject.body
    theta = limb.thetas[3].copy()
    other = theta.copy()
    theta[:6] = other[:6] = 0.0
    ours, theirs = pose_skin(body, theta), pose_skin(mirrored_body(body), other)
    np.testing.assert_allclose(theirs * [1.0, 1.0, -1.0], ours, atol=1e-9)


def test_the_right_side_is_told(limb, clouds):
    evidence = compare_sides(limb.subject.anatomy, clouds, limb.thetas[FRAMES], scale=1.0)
    assert evidence.told
    assert evidence.other_m > 2.0 * evidence.asked_m
    refuse_the_other_side(evidence, limb.subject.anatomy, where=Path("rec"))


def test_the_wrong_side_is_refused_with_both_remedies(limb, poses_of_the_left):
    left = mirrored(limb.subject.anatomy)
    given = dict(zip(FRAMES, poses_of_the_left, strict=True))
    with pytest.raises(FitError, match="nearer to upper-limb-right") as refused:
        adapt_recording(limb.recording, left, AdaptOptions(frames=FRAMES, first_poses=given))
    assert "--anatomy upper-limb-right" in refused.value.remedy
    assert "--mirrored" in refused.value.remedy


def test_what_the_data_cannot_tell_is_neither_claimed_nor_refused(limb):
    alike = SideEvidence(asked_m=0.0010, other_m=0.00101, patches=120, prior=0.5)
    assert not alike.told
    refuse_the_other_side(alike, limb.subject.anatomy, where=Path("rec"))
    likelier = SideEvidence(asked_m=0.0029, other_m=0.0028, patches=70, prior=-14.0)  # real shanks gave such figures
    refuse_the_other_side(likelier, limb.subject.anatomy, where=Path("rec"))


def test_what_no_side_explains_is_refused(limb, clouds):
    """A fit across the patient's arm and the therapist's: skin 4.4 mm off, and the mirror image is worse still."""
    anatomy = limb.subject.anatomy
    across = SideEvidence(asked_m=0.0044, other_m=0.0055, patches=140, prior=5.0)
    with pytest.raises(FitError, match=r"4\.4 mm off, patch by patch") as refused:
        refuse_neither_side(across, anatomy, clouds, where=Path("rec"))
    assert "--near" in refused.value.remedy
    refuse_neither_side(replace(across, asked_m=0.0007), anatomy, clouds, where=Path("rec"))
    refuse_neither_side(replace(across, other_m=0.0007), anatomy, clouds, where=Path("rec"))  # the other side's to say


def test_far_sensors_may_be_farther_off(limb, clouds):
    far = [Target(replace(t.cloud, views=tuple(moved_back(v, 3.0) for v in t.cloud.views))) for t in clouds]
    across = SideEvidence(asked_m=0.0044, other_m=0.0055, patches=140, prior=5.0)
    refuse_neither_side(across, limb.subject.anatomy, far, where=Path("rec"))


def moved_back(view, by_m):
    world_from_sensor = view.world_from_sensor.copy()
    world_from_sensor[:3, 3] -= by_m * world_from_sensor[:3, 2]
    return replace(view, world_from_sensor=world_from_sensor)


def test_an_upper_arm_alone_does_not_tell_its_side(limb, clouds):
    body = limb.subject.body

    def upper_arm(target, theta):
        skin, bones = pose_skin(body, theta), body.skin_riding.argmax(axis=1)
        names = [bone.name for bone in body.anatomy.bones]
        points = target.cloud.points
        nearest = ((points[:, None] - skin[None, ::8]) ** 2).sum(axis=2).argmin(axis=1)
        kept = bones[::8][nearest] == names.index("humerus")
        parts = {name: getattr(target.cloud, name)[kept] for name in ("points", "normals", "boundary", "sensor")}
        return Target(replace(target.cloud, **parts))

    cut = [upper_arm(target, theta) for target, theta in zip(clouds, limb.thetas[FRAMES], strict=True)]
    evidence = compare_sides(limb.subject.anatomy, cut, limb.thetas[FRAMES], scale=1.0)
    assert abs(evidence.support) < TOLD


def test_what_could_not_be_told_is_said_beside_every_result(limb):
    figures = {"poses": [{"median_distance_mm": 1.0}], WIDENED: 2.0}
    report = figures | {"side": asdict(SideEvidence(0.001, 0.00101, 120, 0.5)) | {"told": False}}
    assert "taken on trust" in doubts(replace(limb.subject, report=report))[0]
    assert doubts(replace(limb.subject, report=figures)) == []  # written before sides were told
    assert "limb that is not the subject's is told less surely" in doubts(replace(limb.subject, report={}))[0]
    assert "narrower than they would be now" in doubts(replace(limb.subject, report={"poses": figures["poses"]}))[0]


@pytest.mark.parametrize(("size", "by", "told"), [(0.8, 1, True), (0.8, 2, False), (1.0, 1, False), (1.3, 1, True)])
def test_an_unusual_size_that_one_camera_tells_is_said(limb, size, by, told):
    """A focal length that is wrong by a fifth makes a person a fifth larger or smaller, and nothing else jars."""
    report = limb.subject.report | {"settings": {"frames_used": [{"sensor": "one"}] * by}}
    sized = replace(limb.subject, body=resized(limb.subject.body, size), report=report)
    assert any("focal length" in line for line in doubts(sized)) == told
