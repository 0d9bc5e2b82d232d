"""A motion of the known limb as tracking would hand it on: lost frames, a hidden bone, stated deviations."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from adapt.subject import Subject
from tests.known_limb import KnownLimb
from track.motion import Motion, bones_and_centres, coordinate_names

LOST = (4, 5)
HIDDEN = 8
BONES = ("humerus", "ulna", "radius", "hand")
WHY = "only 31 % of the skin that should show was found"
DEVIATION = np.deg2rad(1.5)


def known_motion(limb: KnownLimb) -> Motion:
    """The truth itself, with one SD of 1.5 degrees (26 mm) each; two frames are lost, in one the hand is hidden."""
    thetas = limb.thetas.copy()
    thetas[list(LOST)] = np.nan
    known = np.isfinite(thetas[:, 0])
    shown = np.tile(known[:, None], (1, len(limb.subject.anatomy.bones)))
    shown[HIDDEN, BONES.index("hand")] = False
    transforms, centres = bones_and_centres(limb.subject, thetas, shown)
    return Motion(
        anatomy=limb.subject.anatomy.name,
        coordinates=coordinate_names(limb.subject.anatomy),
        times=limb.times,
        thetas=thetas,
        deviations=np.where(known[:, None], DEVIATION, np.full(thetas.shape, np.nan)),
        lost=tuple(WHY if t in LOST else "" for t in range(len(thetas))),
        residuals=np.where(known, 0.0012, np.nan),
        coverage=np.where(known, 0.97, 0.31),
        matches=np.where(known, 900, 0),
        shown=shown,
        transforms=transforms,
        centres=centres,
    )


def reported_subject(limb: KnownLimb) -> Subject:
    """The known subject with a report like an adaptation's."""
    pose = {"time_s": 0.1, "matches": 812, "median_distance_mm": 0.71, "skin_to_cloud_mm": 3.2, "coverage": 0.99}
    report = {
        "poses": [pose],
        "noise_mm": 0.8,
        "scales": {"elbow": {"scale": 0.98, "sd": 0.011}},
        "landmarks_shown": {"EL": 1, "olecranon": 0},
        "landmarks_never_shown": ["olecranon"],
    }
    return replace(limb.subject, report=report)
