"""Where the upper limb's joints lie and about what they turn, stated here and not taken from the source skeleton.

The source's arm goes back to a model of which the joints' definition was released for non-commercial use. The numbers
below are those of openly licensed models, in the frames of OpenSim's bones, which the source's bodies have, too:
elbow, forearm and wrist of the CompleteHumanModel (nimblephysics, BSD-2-Clause; after Rajagopal et al. 2016 and Seth et
al. 2019), ranges of Holzbaur, Murray & Delp (2005). The source's bones confirm them: the elbow's axis runs through the
middle of the trochlea's groove, the forearm's through the middles of the radius's head and of the ulna's.

Turns are right-handed for OpenSim's positive coordinates: flexion, pronation, ulnar deviation, palmar flexion.
"""

from __future__ import annotations

from math import radians

import numpy as np

from adapt.template_builder.plan import AxisPlan
from adapt.template_builder.sources_myosim import SourceHinge, StatedJoint

_ELBOW_AXIS = (0.0494, 0.0366, 0.9981082)  # in the humerus
_FOREARM_AXIS = (-0.017161, 0.9926656, -0.119668)  # in the ulna
_DEVIATION_AXIS = (0.0, 0.0, -1.0)  # in the radius
_FLEXION_AXIS = (1.0, 0.0, 0.0)  # in the lunate


def _hinge(name: str, axis: tuple[float, float, float], low: float, high: float) -> SourceHinge:
    return SourceHinge(name, np.array(axis) / np.linalg.norm(axis), radians(low), radians(high))


STATED = {
    "ulna_r": StatedJoint((0.0061, -0.2904, -0.0123), (_hinge("elbow_flexion_r", _ELBOW_AXIS, 0.0, 130.0),)),
    "radius_r": StatedJoint((0.0004, -0.011503, 0.019999), (_hinge("pro_sup_r", _FOREARM_AXIS, -90.0, 90.0),)),
    "lunate_r": StatedJoint(
        (0.018, -0.242, 0.025),
        (
            _hinge("deviation_r", _DEVIATION_AXIS, -10.0, 25.0),
            _hinge("flexion_r", _FLEXION_AXIS, -70.0, 70.0),
        ),
    ),
}

REST_FROM = {
    "elbow_flexion": ("elbow_flexion_r", 1.0),
    "pro_sup": ("pro_sup_r", 1.0),
    "deviation": ("deviation_r", 1.0),
    "flexion": ("flexion_r", 1.0),
}

# A positive turn is right-handed about first -> second.
AXES = (
    AxisPlan(("elbow_axis_medial", "elbow_axis_lateral"), "ulna_r", "humerus_r", _ELBOW_AXIS, (-0.022, 0.022)),
    AxisPlan(("ulnar_head", "radial_head"), "radius_r", "ulna_r", _FOREARM_AXIS, (-0.232, -0.008)),
    AxisPlan(
        ("wrist_deviation_axis_dorsal", "wrist_deviation_axis_palmar"),
        "lunate_r",
        "radius_r",
        _DEVIATION_AXIS,
        (-0.012, 0.012),
    ),
    AxisPlan(
        ("wrist_flexion_axis_ulnar", "wrist_flexion_axis_radial"),
        "lunate_r",
        "lunate_r",
        _FLEXION_AXIS,
        (-0.018, 0.018),
    ),
)
