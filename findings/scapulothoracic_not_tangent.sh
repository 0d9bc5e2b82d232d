#!/usr/bin/env bash
# OpenSim 4.6's own description of ScapulothoracicJoint calls the plane of the shoulder blade tangent to the thoracic surface. It is
# tangent to a sphere: the radii stretch where the blade is, but not how it lies. On the ellipsoid of CompleteHumanModel (83, 200 and
# 83 mm) a blade that is raised by half a radian stands 16 degrees off the surface.
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
joint = opensim.ScapulothoracicJoint()
said = joint.getPropertyByName("scapula_winging_axis_origin").getComment()
print("said:", said)
assert "tangent to the thoracic surface" in said
radii = 0.083, 0.2, 0.083
model = opensim.Model()
blade = opensim.Body("blade", 1.0, opensim.Vec3(0.0), opensim.Inertia(1.0))
model.addBody(blade)
model.addJoint(
    opensim.ScapulothoracicJoint("glide", model.getGround(), blade, opensim.Vec3(*radii), opensim.Vec2(0.0), 0.0)
)
state = model.initSystem()
for raised, expected in ((0.0, 0.0), (0.25, 8.275), (0.5, 15.88)):
    model.getCoordinateSet().get(1).setValue(state, raised, False)
    model.realizePosition(state)
    there = blade.getTransformInGround(state)
    place = [there.p().get(k) for k in range(3)]
    upright = [there.R().get(k, 2) for k in range(3)]  # square to the plane of the blade
    assert abs(sum((x / r) ** 2 for x, r in zip(place, radii)) - 1.0) < 1e-12  # it is on the surface
    normal = [x / r**2 for x, r in zip(place, radii)]
    cosine = sum(a * b for a, b in zip(normal, upright)) / math.hypot(*normal)
    off = math.degrees(math.acos(min(1.0, cosine)))
    print(f"raised by {raised} rad: {off:.2f} degrees off the surface")
    assert abs(off - expected) < 0.01, off
PY
osim/bin/python run.py
