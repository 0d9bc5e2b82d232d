"""What nimblephysics, which AddBiomechanics is built on, reads of our files; for tests, as JSON on standard output.

It needs numpy before 2, so a Python of its own runs this file, and nothing of the project is imported. Only the
compiled module is used: the package around it loads torch, which no reader of files needs.

    python nimble_reader.py trc FILE                 -> times, and a dictionary of points (m) for each
    python nimble_reader.py mot MODEL FILE           -> coordinates by name, each over time
    python nimble_reader.py osim MODEL POSES.json    -> for each pose, a dictionary of 4 x 4 transforms by body
"""

from __future__ import annotations

import json
import sys

import nimblephysics_libs._nimblephysics as nimble
import numpy as np

PARSER = nimble.biomechanics.OpenSimParser


def trc(path: str) -> dict:
    read = PARSER.loadTRC(path)
    points = [{name: at.tolist() for name, at in frame.items()} for frame in read.markerTimesteps]
    return {"times": list(read.timestamps), "points": points}


def mot(model: str, path: str) -> dict:
    skeleton = PARSER.parseOsim(model, ignoreGeometry=True).skeleton
    poses = PARSER.loadMot(skeleton, path).poses
    return {skeleton.getDofByIndex(i).getName(): poses[i].tolist() for i in range(skeleton.getNumDofs())}


def osim(model: str, poses: str) -> dict:
    read = PARSER.parseOsim(model)
    skeleton = read.skeleton
    names = [skeleton.getDofByIndex(i).getName() for i in range(skeleton.getNumDofs())]
    bodies = []
    with open(poses, encoding="utf-8") as file:
        for pose in json.load(file):
            skeleton.setPositions(np.array([pose[name] for name in names]))
            nodes = [skeleton.getBodyNode(k) for k in range(skeleton.getNumBodyNodes())]
            bodies.append({node.getName(): node.getWorldTransform().matrix().tolist() for node in nodes})
    return {"coordinates": names, "bodies": bodies, "markers": sorted(read.markersMap)}


sys.stdout.write(json.dumps({"trc": trc, "mot": mot, "osim": osim}[sys.argv[1]](*sys.argv[2:])) + "\n")
