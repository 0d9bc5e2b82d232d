#!/usr/bin/env bash
# OpenSim 4.6 has two readers of .mot and .sto files. `TimeSeriesTable` reads `nan`; `Storage`, which reads a motion for the tools and
# the window, takes the first `nan` for the end of the file: later rows are missing without a word, and the row of the `nan` is kept
# with numbers that the file does not have, so that an unknown pose becomes a known one.
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
written = [(10.0, 1.0), (20.0, 2.0), (math.nan, math.nan), (40.0, 4.0), (50.0, 5.0)]
rows = "".join(f"{t / 10}\t{a}\t{b}\n" for t, (a, b) in enumerate(written))
head = "Coordinates\nversion=1\nnRows=5\nnColumns=3\ninDegrees=yes\n\nUnits are S.I.\nendheader\n"
open("motion.mot", "w").write(f"{head}time\tknee\tankle\n{rows}")

table = opensim.TimeSeriesTable("motion.mot")
knee = [float(x) for x in table.getDependentColumn("knee").to_numpy()]
print("TimeSeriesTable:", table.getNumRows(), "rows, knee", knee)
assert table.getNumRows() == 5 and math.isnan(knee[2]) and knee[4] == 50.0

storage = opensim.Storage("motion.mot")
column = opensim.ArrayDouble()
storage.getDataColumn("knee", column)
read = [column.get(k) for k in range(column.getSize())]
print("Storage:", storage.getSize(), "rows, knee", read)
assert storage.getSize() == 3 and read[:2] == [10.0, 20.0] and not math.isnan(read[2])
PY
osim/bin/python run.py
