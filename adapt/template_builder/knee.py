"""The knee and the kneecap: facts of the full-body model of Rajagopal et al. (2016), and where its guides lie.

Rajagopal, Dembia, DeMers, Delp, Hicks and Delp, "Full-body musculoskeletal model for muscle-driven simulation of human
gait", IEEE Transactions on Biomedical Engineering 63(10), 2016; joints `walker_knee_r` and `patellofemoral_r` of its
OpenSim model (MIT licence), the knee after Walker, Rovick and Robertson (1988). Frames of femur, tibia and patella
are OpenSim's: X forward, Y up, Z right. Flexion is positive, 0 is the straight knee. Metres, radians.
"""

from __future__ import annotations

from adapt.template_builder.coupled_joint import CoupledJoint, Curve, Guides

_X, _Y, _Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
_ORIENTATION = (-1.64157, 1.44618, 1.5708)
# fmt: off
_KNOTS = (
    0.0, 0.174533, 0.349066, 0.523599, 0.698132, 0.872665, 1.0472, 1.22173, 1.39626, 1.5708, 1.74533, 1.91986, 2.0944,
)

WALKER_KNEE = CoupledJoint(
    knots=_KNOTS,
    turns=(
        Curve(_X, _KNOTS),  # flexion is the coordinate itself
        Curve(_Z, (
            0.0, 0.0126809, 0.0226969, 0.0296054, 0.0332049, 0.0335354, 0.0308779, 0.0257548, 0.0189295, 0.011407,
            0.00443314, -0.00050475, -0.0016782,
        )),  # adduction
        Curve(_Y, (
            0.0, 0.059461, 0.109399, 0.150618, 0.18392, 0.210107, 0.229983, 0.24435, 0.254012, 0.25977, 0.262428,
            0.262788, 0.261654,
        )),  # internal rotation
    ),
    shifts=(
        Curve(_Y, (
            0.0, 0.000479, 0.000835, 0.001086, 0.001251, 0.001346, 0.001391, 0.001403, 0.0014, 0.0014, 0.001421,
            0.001481, 0.001599,
        )),
        Curve(_Z, (
            0.0, 0.000988, 0.001899, 0.002734, 0.003492, 0.004173, 0.004777, 0.005305, 0.005756, 0.00613, 0.006427,
            0.006648, 0.006792,
        )),
    ),
    location_in_parent=(-0.00809, -0.40796, -0.00275),
    orientation_in_parent=_ORIENTATION,
    location_in_child=(-0.0080895, -0.0035348, -0.0014847),
    orientation_in_child=_ORIENTATION,
)
"""The tibia in the femur, over `knee_angle_r`."""

PATELLOFEMORAL = CoupledJoint(
    knots=_KNOTS,
    turns=(
        Curve(_Z, (
            0.00113686, -0.00629212, -0.105582, -0.253683, -0.414245, -0.579047, -0.747244, -0.91799, -1.09044,
            -1.26379, -1.43763, -1.61186, -1.78634,
        )),
    ),
    shifts=(
        Curve(_X, (
            0.0524, 0.0488, 0.0437, 0.0371, 0.0296, 0.0216, 0.0136, 0.0057, -0.0019, -0.0088, -0.0148, -0.0196, -0.0227,
        )),
        Curve(_Y, (
            -0.0108, -0.019, -0.0263, -0.0322, -0.0367, -0.0395, -0.0408, -0.0404, -0.0384, -0.0349, -0.0301, -0.0245,
            -0.0187,
        )),
        Curve(_Z, (0.00275,) * len(_KNOTS)),
    ),
    location_in_parent=(-0.00809, -0.40796, -0.00275),
    orientation_in_parent=(0.0, 0.0, 0.0),
    location_in_child=(0.0, 0.0, 0.0),
    orientation_in_child=(0.0, 0.0, 0.0),
)
"""The patella in the femur, over `knee_angle_r_beta`, which the model sets equal to `knee_angle_r`."""
# fmt: on

# Where the table bends little, every other of its knots will do; the kneecap's bends most where it enters its groove.
KNEE_KNOTS = _KNOTS[::2]
PATELLA_KNOTS = (*_KNOTS[:2], *_KNOTS[2::2])

PLATEAU = Guides(medial=(-0.006, -0.024, -0.018), lateral=(-0.006, -0.024, 0.024), normal=(-0.006, 0.001, 0.003))
"""On the tibia: the middles of both plateaus, which glide over the condyles, and a point 25 mm above them."""

PATELLAR_FACETS = Guides(medial=(-0.008, 0.027, -0.012), lateral=(-0.008, 0.027, 0.012), normal=(-0.030, 0.027, 0.0))
"""On the patella: both facets of its back, which glide in the trochlea, and a point 22 mm behind them."""
