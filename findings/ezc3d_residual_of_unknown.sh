#!/usr/bin/env bash
# ezc3d 1.7.2 writes a point of NaN as C3D wants an unknown one, with residual -1 and zeros, and reads it back as NaN; but the
# residual that it hands on of such a point is 0, which says that the point is known. Who looks for lost points by their residuals,
# as the format's manual says, finds none. The reader c3d 0.6.0 gives the -1 that stands in the file.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3.11 -m venv env && env/bin/pip install --quiet ezc3d==1.7.2 c3d==0.6.0 numpy==2.4.6
cat > run.py <<'PY'
import math
import warnings

import c3d
import ezc3d
import numpy as np

warnings.simplefilter("ignore")
file = ezc3d.c3d()
points = np.ones((4, 1, 3))
points[:3, 0, 1] = np.nan
parameters = file["parameters"]["POINT"]
parameters["RATE"]["value"], parameters["UNITS"]["value"], parameters["LABELS"]["value"] = [30.0], ["mm"], ["a"]
file["data"]["points"] = points
file.write("trial.c3d")

read = ezc3d.c3d("trial.c3d")["data"]
x, residuals = read["points"][0, 0].tolist(), read["meta_points"]["residuals"][0, 0].tolist()
print("ezc3d: x", x, "residuals", residuals)
with open("trial.c3d", "rb") as opened:
    others = [frame[0].tolist()[:4] for _, frame, _ in c3d.Reader(opened).read_frames(copy=True)]
print("c3d: x, y, z, residual", others)
assert math.isnan(x[1]) and residuals == [0.0, 0.0, 0.0]
assert others[1] == [0.0, 0.0, 0.0, -1.0]
PY
env/bin/python run.py
