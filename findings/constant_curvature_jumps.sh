#!/usr/bin/env bash
# OpenSim 4.6's ConstantCurvatureJoint, a spine's bend at constant curvature, is not continuous inside the range that it supports.
# Where the sine of the bend is below 0.001 or above 0.999 it takes the curve for a straight line along the tangent at its end. Near
# zero the end is twice as far to the side as a moment before. At 87.4 degrees, before it warns of anything, the end jumps by 0.7 of
# the length: a lumbar spine of 0.1 m by 7 cm. Beyond 89.4 degrees it warns and holds the angle, but stays at the wrong place.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3.11 -m venv osim && osim/bin/pip install --quiet opensim==4.6
cat > run.py <<'PY'
import math

import opensim

opensim.Logger.setLevelString("off")
print("OpenSim", opensim.GetVersion())
model = opensim.Model()
child = opensim.Body("child", 1.0, opensim.Vec3(0.0), opensim.Inertia(1.0))
model.addBody(child)
joint = opensim.ConstantCurvatureJoint("curve", model.getGround(), child, opensim.Vec3(0.0), 1.0)  # 1 m long
model.addJoint(joint)
state = model.initSystem()


def end(bend):
    """Where the end of the curve is when it is bent about z, and by how much it is turned."""
    model.getCoordinateSet().get(1).setValue(state, bend, False)
    model.realizePosition(state)
    there = child.getTransformInGround(state)
    return there.p().get(0), there.p().get(1), math.atan2(there.R().get(1, 0), there.R().get(0, 0))


def close(found, expected):
    assert all(abs(a - b) < 1e-6 for a, b in zip(found, expected)), (found, expected)


def arc(a):
    return -(1.0 - math.cos(a)) / a, math.sin(a) / a, a


def line(a):
    return -math.sin(a), math.cos(a), a


for bend, expected in (
    (0.0010, line),
    (0.0011, arc),
    (0.5000, arc),
    (1.5260, arc),
    (1.5262, line),
    (1.5600, line),
):
    found = end(bend)
    print(f"bend {bend:.4f} rad: x {found[0]:.6f}, y {found[1]:.6f}, turned {found[2]:.4f}; arc {arc(bend)[0]:.6f}, {arc(bend)[1]:.6f}")
    close(found, expected(bend))
print(f"jump at 87.4 degrees: {math.dist(end(1.5260)[:2], end(1.5262)[:2]):.2f} of the length")
close(end(2.0), line(math.pi / 2.0 - 0.01))
PY
osim/bin/python run.py
