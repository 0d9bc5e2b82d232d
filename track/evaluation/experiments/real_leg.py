"""A real woman's leg and a real man's: bones from the skin alone, at rest; and hers in motion, by our model's joints.

At rest: four exact sensors around the skin, our template laid on the landmarks in one size, then adapted to that one
cloud; skin of the pelvis and the foot, where there is none of hers, and within 3 cm of where hers ends takes no part.

In motion: her skin is bound to our deformers about her own bones. The shape and pose of our model whose landmarks are
nearest to hers gives the knee's and the ankle's axes; each of her vertices takes the weights of the nearest place on
that body's skin; and its place at rest is solved for, so that the bound skin is exactly hers in the pose in which she
lay. Her bones ride on ours. So the truth of the motion is ours; the shape of bones and skin, and the flesh between, are
hers.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from pathlib import Path

import igl
import numpy as np

from adapt.adapt_recording import adapt_recording
from adapt.anatomy import Anatomy, Floats
from adapt.anatomy_file import load_anatomy
from adapt.fit.alternate import adapt_body
from adapt.fit.never_seen import Bools, skin_of
from adapt.match.correspondences import Target
from adapt.model.body import Body, bone_transforms, make_body, pose_skin, pose_skin_by_v_hat, posed_bones
from adapt.options import AdaptOptions
from adapt.subject import Subject
from adapt.template_builder.meshes import Mesh
from capture.calibration.calibrate import write_calibration
from capture.cloud.fuse import Cloud, fuse, region_of_interest
from capture.errors import BonetrackError
from capture.recording import Recording, instants, open_recording
from capture.recording.types import Calibration, SensorCalibration
from capture.rigid import apply, inverse
from capture.simulation.rig import default_rig
from capture.simulation.sensor import NoiseModel
from capture.simulation.simulate import simulate_recording
from track.accuracy.mesh_distance import distance_to_mesh
from track.evaluation.experiments.experiment import Experiment, Result
from track.evaluation.experiments.real_leg_page import describe, losses
from track.evaluation.experiments.surface_fit import fit_family, greatest_length, rigid
from track.evaluation.known import carried, record_meshes
from track.evaluation.made_up_motions import FPS
from track.evaluation.real_legs import BONES, MAN, WOMAN, RealLeg, laid_on, our_bones, read_leg
from track.evaluation.swing import Swing, times_and_phase
from track.track_recording import track_recording

NAME, TITLE = "real-leg", "A real woman's leg, and a man's: bones from the skin"
ANATOMY = "lower-limb-right"
CASES = (f"at rest, {WOMAN}", f"at rest, {MAN}", f"in motion, {WOMAN}")
LEVELS = {"at the tuberosity": 0.12, "at 25 %": 0.25, "at 50 %": 0.50, "at 75 %": 0.75, "at the malleolus": 0.97}
_BAND_M = 0.006
_ENDS_M = 0.03  # skin so near to where hers ends takes no part, nor do bones beyond
_SECONDS, _SEED = 2.0, 1
_SWINGS = {"knee_angle_r": Swing(32.0, 30.0, 1.0, -0.25), "ankle_angle_r": Swing(0.0, 10.0, 2.0)}
_SWAY = {"hip_ry": Swing(0.0, 12.0, 1.0, 0.1), "hip_rz": Swing(0.0, 8.0, 1.5)}
_FRAMES = 8  # in which bones are compared
_OFF_DEG, _OFF_M = 6.0, 0.015  # of first poses that are given
_RIDES = {"tibia": "tibia", "fibula": "tibia", "patella": "patella", "femur": "femur"}


def run(case: str, folder: Path, *, data: Path) -> Result:
    """One of CASES; what stops it is the result, too."""
    how, who = case.split(", ")
    leg = read_leg(who, data)
    try:
        return _at_rest(leg, folder) if how == "at rest" else _in_motion(leg, folder)
    except BonetrackError as error:
        return {"failed": error.problem}


def _at_rest(leg: RealLeg, folder: Path) -> Result:
    target = Target(_all_round(leg, folder))
    body, theta = laid_on(load_anatomy(ANATOMY), leg.landmarks, proportions=False)
    adapted = adapt_body(body, [target], theta[None], gone=_gone(body, theta, leg))
    ours = our_bones(adapted.body, posed_bones(adapted.body, adapted.thetas[0]))
    skin = pose_skin(adapted.body, adapted.thetas[0])
    kept = ~_gone(adapted.body, adapted.thetas[0], leg) & (adapted.body.anatomy.fit_weight > 0.5)
    there = leg.open_skin
    return {
        "bones": {bone: compared(ours[bone], leg.bones[bone], leg.span) for bone in BONES},
        "depths_mm": {"ours": depths(ours, there), "theirs": depths(leg.bones, there)},
        "skin_mm": 1e3 * float(distance_to_mesh(skin[kept], there.vertices, there.faces).mean()),
    }


def _all_round(leg: RealLeg, folder: Path) -> Cloud:
    """The cloud that four exact sensors around the skin see together, in the skin's own axes."""
    there = leg.open_skin
    rig = default_rig(there.vertices, spread_deg=270.0, elevations_deg=(0.0,) * 4)
    recording = simulate_recording(
        folder / "recording", [there.vertices], there.faces, [0.0], rig=rig, noise=NoiseModel(), overwrite=True
    )
    stand = {s.name: SensorCalibration(s.world_from_sensor, residual_mm=0.0) for s in rig.sensors}
    write_calibration(recording, Calibration(stand))
    recording = open_recording(recording.path)
    return fuse(recording, instants(recording)[0], region=region_of_interest(recording))


def _gone(body: Body, theta: Floats, leg: RealLeg) -> Bools:
    """The template's skin (V,) that has none of hers to be matched to."""
    low, high = leg.span
    if not np.isfinite(low):
        return np.zeros(len(body.v_hat), dtype=bool)
    y = pose_skin(body, theta)[:, 1]
    return np.asarray(skin_of(body, ("pelvis", "foot")) | (y < low + _ENDS_M) | (y > high - _ENDS_M))


def compared(ours: Mesh, theirs: Mesh, span: tuple[float, float]) -> Result:
    """Mean surface distances (mm) both ways, as they lie and moved rigidly, where there is skin, and lengths (mm)."""
    low, high = span[0], span[1] - _ENDS_M
    pairs = ((ours, theirs), (theirs, ours))
    kept = [a.vertices[(a.vertices[:, 1] > low) & (a.vertices[:, 1] < high)] for a, _ in pairs]
    apart = [distance_to_mesh(points, b.vertices, b.faces) for points, (_, b) in zip(kept, pairs, strict=True)]
    return {
        "as_it_lies_mm": 1e3 * float(np.concatenate(apart).mean()),
        "moved_mm": 1e3 * float(fit_family(ours, rigid(ours), theirs).distances.mean()),
        "lengths_mm": [1e3 * greatest_length(mesh) for mesh in (ours, theirs)],
    }


def depths(bones: dict[str, Mesh], skin: Mesh) -> dict[str, float]:
    """The least depth (mm) under a skin of the tibia at LEVELS of its length, and of the kneecap."""
    tibia = bones["tibia"].vertices
    top, bottom = tibia[:, 1].max(), tibia[:, 1].min()
    found = {}
    for level, share in LEVELS.items():
        band = tibia[np.abs(tibia[:, 1] - (top + share * (bottom - top))) < _BAND_M]
        found[f"tibia {level}"] = 1e3 * float(distance_to_mesh(band, skin.vertices, skin.faces).min())
    found["patella"] = 1e3 * float(distance_to_mesh(bones["patella"].vertices, skin.vertices, skin.faces).min())
    return found


def bound(leg: RealLeg) -> tuple[Body, Floats]:
    """Our model with somebody's skin, and the pose (n,) in which that skin is theirs (see the module)."""
    anatomy = load_anatomy(ANATOMY)
    body, theta = laid_on(anatomy, leg.landmarks, proportions=True)
    there = pose_skin(body, theta)
    _, face, place = igl.point_mesh_squared_distance(leg.skin.vertices, there, anatomy.skin_faces)
    corners = anatomy.skin_faces[face]
    share = igl.barycentric_coordinates(place, *(there[corners[:, k]] for k in range(3)))

    def taken(values: Floats) -> Floats:
        return np.asarray(np.einsum("nk,nk...->n...", share, values[corners]))

    own = replace(
        anatomy,
        skin_vertices=taken(anatomy.skin_vertices),
        skin_faces=leg.skin.faces,
        skin_handle_weights=taken(anatomy.skin_handle_weights),
        deformer_weights=taken(anatomy.deformer_weights),
        fit_weight=taken(anatomy.fit_weight),
    )
    made = make_body(own, shape=body.shape)
    for _ in range(6):
        posed = pose_skin_by_v_hat(made, theta)
        step = np.linalg.solve(posed.d, (leg.skin.vertices - posed.value)[:, :, None])[:, :, 0]
        made = make_body(own, shape=body.shape, v_hat=made.v_hat + step)
    return made, theta


def _poses(body: Body, theta: Floats) -> Floats:
    """Poses (T, n): from where she lay, with knee and ankle bending and the whole leg swaying."""
    _, u = times_and_phase(_SECONDS, FPS)
    thetas = np.tile(theta, (len(u), 1))
    for name, swing in (_SWINGS | _SWAY).items():
        column = body.anatomy.coordinate_index(name)
        thetas[:, column] = np.deg2rad(swing.degrees(u)) + (theta[column] if name in _SWAY else 0.0)
    return thetas


def _in_motion(leg: RealLeg, folder: Path) -> Result:
    hers, lying = bound(leg)
    thetas = _poses(hers, lying)
    skins = [pose_skin(hers, theta) for theta in thetas]
    times = times_and_phase(_SECONDS, FPS)[0].tolist()
    points = np.concatenate(skins[::6])
    recording, world = record_meshes(skins, leg.skin.faces, times, folder / "recording", points=points, seed=_SEED)
    anatomy = load_anatomy(ANATOMY)
    true = carried(anatomy, thetas, inverse(world))
    subject, start = _subject(recording, anatomy, true, folder)
    motion = track_recording(recording, subject, folder / "motion")
    good = np.flatnonzero(motion.tracked)
    some = good[:: max(1, len(good) // _FRAMES)]
    knee = motion.coordinates.index("knee_angle_r")
    return {
        "start": start,
        "never_seen": list(subject.never_seen),
        "frames": len(motion.tracked),
        "lost": int((~motion.tracked).sum()),
        "knee_deg": np.rad2deg(motion.thetas[good, knee] - true[good, knee]).tolist(),
        "knee_stated_deg": np.rad2deg(motion.deviations[good, knee]).tolist(),
        "bones": [_frame(leg, hers, lying, thetas[t], subject, motion.thetas[t], world) for t in some],
    }


def _subject(recording: Recording, anatomy: Anatomy, true: Floats, folder: Path) -> tuple[Subject, str]:
    """The subject, automatic; if that is refused, from first poses as a hand would give them; and which of the two."""
    try:
        return adapt_recording(recording, anatomy), "found"
    except BonetrackError as error:
        refused = error.problem
    rng = np.random.default_rng(_SEED)
    scale = [_OFF_M if c.unit == "m" else np.deg2rad(_OFF_DEG) for c in anatomy.coordinates]
    frames = np.linspace(0, len(true) - 1, 8).astype(int)[:-1].tolist()
    first = {frame: true[frame] + rng.uniform(-1.0, 1.0, len(scale)) * scale for frame in frames}
    return adapt_recording(recording, anatomy, AdaptOptions(first_poses=first)), f"given, for by itself: {refused}"


def _frame(
    leg: RealLeg, hers: Body, lying: Floats, pose: Floats, subject: Subject, theta: Floats, world: Floats
) -> Result:
    """Our bones beside hers in one frame, each carried back to where hers lay."""
    now, then = bone_transforms(hers, pose), bone_transforms(hers, lying)
    ours = our_bones(subject.body, posed_bones(subject.body, theta))
    found: Result = {}
    for bone, ride in _RIDES.items():
        back = then[ride] @ inverse(now[ride]) @ world
        found[bone] = compared(Mesh(apply(back, ours[bone].vertices), ours[bone].faces), leg.bones[bone], leg.span)
    return found


def experiment(data: Path) -> Experiment:
    """The experiment on the legs below ``data``."""
    return Experiment(NAME, TITLE, CASES, partial(run, data=data), describe, losses)
