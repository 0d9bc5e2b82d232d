#!/usr/bin/env bash
# A motion file with `inDegrees=yes` means two things. OpenSim 4.6 leaves a coupled coordinate (here: one that turns by a spline,
# as a kneecap's knee_angle_beta) as it stands, in radians; nimblephysics 0.10.52.1 converts it like the others, so the file that
# is right in one is wrong by a factor of 57.3 in the other. With `inDegrees=no` both take all columns as they stand.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3.11 -m venv osim && osim/bin/pip install --quiet opensim==4.6
python3.11 -m venv nimble && nimble/bin/pip install --quiet --no-deps nimblephysics==0.10.52.1 numpy==1.26.4

cat > write.py <<'PY'
def coordinate(name):
    return (
        f'<coordinates><Coordinate name="{name}"><default_value>0</default_value><range>-3 3</range>'
        "<clamped>true</clamped></Coordinate></coordinates>"
    )


def frames(parent, child):
    frame = (
        '<PhysicalOffsetFrame name="{}"><socket_parent>{}</socket_parent><translation>0 0 0</translation>'
        "<orientation>0 0 0</orientation></PhysicalOffsetFrame>"
    )
    return "<frames>" + frame.format("p", parent) + frame.format("c", child) + "</frames>"


SOCKETS = "<socket_parent_frame>p</socket_parent_frame><socket_child_frame>c</socket_child_frame>"
BODY = '<Body name="{}"><mass>1</mass><mass_center>0 0 0</mass_center><inertia>1 1 1 0 0 0</inertia></Body>'
UNIT = ("1 0 0", "0 1 0", "0 0 1")
ZERO = '<Constant name="function"><value>0</value></Constant>'
SPLINE = '<SimmSpline name="function"><x>-3 -1 0 1 3</x><y>-3.3 -1.1 0 1.1 3.3</y></SimmSpline>'
axes = "".join(
    f'<TransformAxis name="{kind}{k + 1}"><coordinates>{"beta" if SPLINE in text else ""}</coordinates>'
    f"<axis>{UNIT[k]}</axis>{text}</TransformAxis>"
    for kind, functions in (("rotation", (SPLINE, ZERO, ZERO)), ("translation", (ZERO,) * 3))
    for k, text in enumerate(functions)
)
open("model.osim", "w").write(
    '<?xml version="1.0"?><OpenSimDocument Version="40000"><Model name="m"><Ground name="ground"/>'
    f"<BodySet><objects>{BODY.format('thigh')}{BODY.format('patella')}</objects></BodySet><JointSet><objects>"
    f'<PinJoint name="hip">{SOCKETS}{coordinate("angle")}{frames("/ground", "/bodyset/thigh")}</PinJoint>'
    f'<CustomJoint name="slide">{SOCKETS}{coordinate("beta")}{frames("/bodyset/thigh", "/bodyset/patella")}'
    f"<SpatialTransform>{axes}</SpatialTransform></CustomJoint>"
    "</objects></JointSet></Model></OpenSimDocument>"
)
for word, angle in (("yes", "10.0"), ("no", "0.17453293")):
    rows = "".join(f"{t / 10}\t{angle}\t0.17453293\n" for t in range(3))
    head = f"Coordinates\nversion=1\nnRows=3\nnColumns=3\ninDegrees={word}\n\nUnits are S.I.\nendheader\n"
    open(f"{word}.mot", "w").write(f"{head}time\tangle\tbeta\n{rows}")
PY
python3.11 write.py

cat > in_opensim.py <<'PY'
import opensim

opensim.Logger.setLevelString("off")
print("OpenSim", opensim.GetVersion())
model = opensim.Model("model.osim")
model.initSystem()
types = {c.getName(): c.getMotionType() for c in model.getCoordinateSet()}
print("motion types (1 rotational, 2 translational, 3 coupled)", types)
assert types == {"angle": 1, "beta": 3}
for word in ("yes", "no"):
    table = opensim.TimeSeriesTable(f"{word}.mot")
    if table.getTableMetaDataString("inDegrees") == "yes":
        model.getSimbodyEngine().convertDegreesToRadians(table)
    read = {name: round(float(table.getDependentColumn(name)[0]), 5) for name in table.getColumnLabels()}
    print("inDegrees =", word, read)
    assert read == {"angle": 0.17453, "beta": 0.17453}
PY
osim/bin/python in_opensim.py

cat > in_nimble.py <<'PY'
import os
from importlib.metadata import version
from nimblephysics_libs._nimblephysics.biomechanics import OpenSimParser

print("nimblephysics", version("nimblephysics"))
skeleton = OpenSimParser.parseOsim(os.path.abspath("model.osim"), ignoreGeometry=True).skeleton
names = [skeleton.getDofByIndex(k).getName() for k in range(skeleton.getNumDofs())]
for word, beta in (("yes", 0.00305), ("no", 0.17453)):
    poses = OpenSimParser.loadMot(skeleton, os.path.abspath(f"{word}.mot")).poses
    read = {name: round(float(poses[k, 0]), 5) for k, name in enumerate(names)}
    print("inDegrees =", word, read)
    assert read == {"angle": 0.17453, "beta": beta}
PY
nimble/bin/python in_nimble.py
