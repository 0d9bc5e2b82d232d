#!/usr/bin/env bash
# An unknown marker in a .trc is commonly written as empty cells. OpenSim 4.6 refuses such a file where the unknown marker is
# the last of its row; nimblephysics 0.10.52.1 (AddBiomechanics' reader) passes over empty cells, so that the markers behind
# stand under their neighbours' names, without a word. `nan` in each cell is read right by both.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3.11 -m venv osim && osim/bin/pip install --quiet opensim==4.6
python3.11 -m venv nimble && nimble/bin/pip install --quiet --no-deps nimblephysics==0.10.52.1 numpy==1.26.4

cat > write.py <<'PY'
"""Three markers A, B, C at x = 100, 200, 300 mm in two frames; in the second, one is unknown."""
import sys


def write(path, unknown, word):
    at = {"A": 100, "B": 200, "C": 300}
    head = [
        f"PathFileType\t4\t(X/Y/Z)\t{path}",
        "DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\tOrigDataStartFrame\tOrigNumFrames",
        "30\t30\t2\t3\tmm\t30\t1\t2",
        "Frame#\tTime\tA\t\t\tB\t\t\tC\t\t",
        "\t\tX1\tY1\tZ1\tX2\tY2\tZ2\tX3\tY3\tZ3",
        "",
    ]
    rows = []
    for t in range(2):
        cells = [word if t == 1 and name == unknown else f"{x + k}.0" for name, x in at.items() for k in range(3)]
        rows.append("\t".join([str(t + 1), f"{t / 30:.6f}", *cells]))
    open(path, "w").write("\n".join([*head, *rows]) + "\n")


for word, kind in (("", "empty"), ("nan", "nan")):
    write(f"middle_{kind}.trc", "B", word)
    write(f"last_{kind}.trc", "C", word)
PY
python3.11 write.py

cat > in_opensim.py <<'PY'
import math
import opensim

opensim.Logger.setLevelString("off")
print("OpenSim", opensim.GetVersion())


def x_of_second_frame(path):
    try:
        table = opensim.TimeSeriesTableVec3(path)
    except Exception as error:
        return str(error).strip().splitlines()[0]
    return [table.getRowAtIndex(1)[k].get(0) for k in range(3)]


read = {name: x_of_second_frame(f"{name}.trc") for name in ("middle_empty", "last_empty", "middle_nan", "last_nan")}
for name, value in read.items():
    print(name, value)
assert math.isnan(read["middle_empty"][1])
assert "Unexpected number of columns" in read["last_empty"]
assert read["middle_nan"][::2] == [100.0, 300.0] and math.isnan(read["middle_nan"][1])
assert read["last_nan"][:2] == [100.0, 200.0] and math.isnan(read["last_nan"][2])
PY
osim/bin/python in_opensim.py

cat > in_nimble.py <<'PY'
import os
from importlib.metadata import version
from nimblephysics_libs._nimblephysics.biomechanics import OpenSimParser

print("nimblephysics", version("nimblephysics"))
read = {}
for name in ("middle_empty", "last_empty", "middle_nan", "last_nan"):
    frame = OpenSimParser.loadTRC(os.path.abspath(f"{name}.trc")).markerTimesteps[1]
    read[name] = {marker: round(1e3 * at[0]) for marker, at in frame.items()}
    print(name, read[name])
assert read["middle_empty"] == {"A": 100, "B": 300}, "C's place, under B's name"
assert read["middle_nan"] == {"A": 100, "C": 300}
assert read["last_empty"] == read["last_nan"] == {"A": 100, "B": 200}
PY
nimble/bin/python in_nimble.py
