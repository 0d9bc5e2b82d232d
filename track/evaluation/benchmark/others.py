"""Other programs on the same data in the same run: OpenSim's inverse kinematics, and a non-rigid ICP.

They answer other questions, so times alone do not say which to use. OpenSim is told what every marker is called and
gives joint angles; ``trimesh.registration.nricp_amberg`` bends any surface to any other and knows of no bones.
"""

from __future__ import annotations

from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from scipy.spatial import cKDTree

from adapt.anatomy import Floats
from adapt.fit.alternate import adapt_body
from adapt.match.correspondences import Target
from adapt.model.body import Body, make_body, pose_skin
from adapt.model.surface import incidence, vertex_normals
from adapt.subject import Subject
from capture.cloud.fuse import fuse
from capture.recording import Recording, instants
from track.accuracy.truth import read_truth
from track.evaluation.benchmark.timing import Timing, timed
from track.evaluation.markers import marker_set, marker_trial, markers_at_rest
from track.evaluation.opensim_tools import solve_kinematics
from track.export.osim import write_osim

_ACCURACY = 1e-5  # OpenSim's default
_MARKER_NOISE_M = 0.0005
_COUNTED = 0.5  # of fit_weight: skin of which errors are told


@dataclass(frozen=True)
class Comparison:
    """What another program took for the same work, and ours; errors (mm) by name, where both can be scored."""

    what: str
    theirs_s: float
    ours_s: float
    errors_mm: dict[str, tuple[float, float]]  # theirs, ours


def beside_opensim(recording: Recording, loop: Timing) -> Comparison | None:
    """Inverse kinematics of the true body's own model on markers of the same motion, per frame; None without OpenSim.

    Raises:
        OpenSimError: OpenSim failed.
        MotionError: the recording has no truth.
    """
    if find_spec("opensim") is None:
        return None
    truth, rng = read_truth(recording), np.random.default_rng(0)
    markers = marker_set(truth.body.anatomy)
    trial = marker_trial(truth.body, truth.thetas, markers, noise_m=_MARKER_NOISE_M, rng=rng)
    with TemporaryDirectory() as folder:
        model = write_osim(truth.body, Path(folder) / "model", markers=markers_at_rest(truth.body, markers))[0]
        solved = solve_kinematics(model, trial, truth.times, markers, _ACCURACY, Path(folder) / "ik")
    what = f"one frame: OpenSim's inverse kinematics on {len(markers.markers)} named markers"
    return Comparison(what, solved.wall_s / len(truth.times), float(loop.seconds.mean()), {})


def beside_nonrigid_icp(recording: Recording, subject: Subject) -> Comparison | None:
    """The template fitted to one cloud, from the same given pose, by both; None without trimesh.

    Ours is algorithm 4, which also gives bones, proportions and how sure they are.
    """
    if find_spec("trimesh") is None:
        return None
    import trimesh
    from trimesh.registration import nricp_amberg

    theta, moments = subject.thetas[0], instants(recording)
    target = Target(fuse(recording, min(moments, key=lambda moment: abs(moment.time_s - subject.times[0]))))
    template, ours, theirs = make_body(subject.anatomy), [], []
    start = trimesh.Trimesh(pose_skin(template, theta), subject.anatomy.skin_faces, process=False)
    work = timed("ours", lambda: ours.append(adapt_body(template, [target], theta[None])))
    other = timed("theirs", lambda: theirs.append(nricp_amberg(start, target.cloud.points, use_faces=False)))
    said = pose_skin(ours[0].body, ours[0].thetas[0])
    errors = [skin_errors(subject.body, theta, skin) for skin in (np.asarray(theirs[0]), said)]
    return Comparison(
        f"one static fit of {len(said)} vertices to {len(target.cloud.points)} points: `nricp_amberg`, its defaults",
        other.median_s,
        work.median_s,
        {name: (errors[0][name], errors[1][name]) for name in errors[0]},
    )


def skin_errors(body: Body, theta: Floats, said: Floats) -> dict[str, float]:
    """Mean errors (mm) of a skin (V, 3) against a body's in its pose: between same vertices, and across the surface."""
    anatomy, true = body.anatomy, pose_skin(body, theta)
    counted = anatomy.fit_weight > _COUNTED
    normals = vertex_normals(true, anatomy.skin_faces, incidence(anatomy.skin_faces, len(true)))
    nearest = cKDTree(true).query(said[counted])[1]
    across = np.einsum("ij,ij->i", said[counted] - true[nearest], normals[nearest])
    apart = np.linalg.norm(said - true, axis=1)[counted]
    return {"vertex": 1e3 * float(apart.mean()), "surface": 1e3 * float(np.abs(across).mean())}
