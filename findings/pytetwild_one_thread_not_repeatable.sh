#!/usr/bin/env bash
# pytetwild 0.4.2 gives another tetrahedral mesh each time it is asked for the same surface with the same settings, with one thread,
# too, and with the C library's random numbers seeded before every call: other corners, and other counts of tetrahedra by one to
# several per cent. What is solved on such a mesh (bounded biharmonic weights, say) is not repeatable to better than the mesh is fine.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3.11 -m venv tets && tets/bin/pip install --quiet pytetwild==0.4.2 pyvista==0.49.1 numpy==2.3.5
cat > run.py <<'PY'
import ctypes
import hashlib

import numpy as np
import pytetwild
import pyvista as pv

ball = pv.Sphere(radius=0.05, theta_resolution=60, phi_resolution=60).triangulate()
vertices = np.asarray(ball.points, dtype=np.float64)
faces = ball.faces.reshape(-1, 4)[:, 1:].astype(np.int32)
found = set()
for _ in range(4):
    ctypes.CDLL(None).srand(0)
    points, tets = pytetwild.tetrahedralize(vertices, faces, edge_length_fac=0.08, num_threads=1)
    found.add((len(points), len(tets), hashlib.sha256(np.ascontiguousarray(points).tobytes()).hexdigest()[:8]))
    print(f"{len(points)} corners, {len(tets)} tetrahedra")
assert len(found) > 1, "the meshes are equal"
PY
tets/bin/python run.py
