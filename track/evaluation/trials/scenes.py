"""What stands around the limb: a furnished room, a second arm that holds the wrist, a second person."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from adapt.anatomy import Floats
from adapt.anatomy_file import load_anatomy
from adapt.mirror import mirrored_name
from adapt.model.body import joint_centres, pose_skin
from capture.rigid import exp_so3
from capture.simulation.rig import Ints, box_mesh, default_rig
from track.evaluation.experiments.faulty_recordings import person
from track.evaluation.trials.people import ARM, LEG
from track.evaluation.trials.recorded import Around, Made, performance_of, record, still
from track.simulation.performance import Performance

_FURNITURE = {  # middle relative to the limb's (m; +x towards the sensors, +y up), sides (m)
    "floor": ((0.0, -0.95, 0.0), (6.0, 0.02, 6.0)),
    "wall": ((-1.3, 0.3, 0.0), (0.02, 2.6, 6.0)),
    "side wall": ((0.0, 0.3, -1.8), (6.0, 2.6, 0.02)),
    "table": ((-0.75, -0.25, 0.9), (0.7, 0.03, 1.0)),
    "chair's seat": ((-0.55, -0.50, -0.9), (0.45, 0.04, 0.45)),
    "chair's back": ((-0.76, -0.05, -0.9), (0.04, 0.9, 0.45)),
}


def in_a_room(seed: int, folder: Path, *, anatomy: str = ARM) -> Made:
    """An arm or leg with floor, walls, table and chair in view."""
    performance = performance_of(anatomy, seed)
    room = still(*furniture(_middle(performance)))
    return Made(folder, anatomy, record(performance, folder, seed=seed, around=[room]))


def furniture(middle: Floats) -> tuple[Floats, Ints]:
    """Vertices (V, 3) m and triangles (F, 3) of a room around a place (3,)."""
    boxes = [(box_mesh(sides), np.array(place)) for place, sides in _FURNITURE.values()]
    vertices = [mesh[0] + middle + place for mesh, place in boxes]
    return np.concatenate(vertices), np.concatenate([8 * k + mesh[1] for k, (mesh, _) in enumerate(boxes)])


def held_at_the_wrist(seed: int, folder: Path) -> Made:
    """A therapist's right hand holds the wrist of a right arm and goes along with it."""
    patient = performance_of(ARM, seed)
    return Made(folder, ARM, record(patient, folder, seed=seed, around=[_therapist(patient, seed)]))


def _therapist(patient: Performance, seed: int) -> Around:
    """Another body's arm that comes from the other side, its hand about the patient's wrist."""
    anatomy = load_anatomy(ARM)
    other = performance_of(ARM, seed + 1000)
    arm = pose_skin(other.body, other.thetas[0])
    hand = arm[anatomy.skin_handle_weights[:, [h.bone == "hand" for h in anatomy.handles]].sum(axis=1) > 0.5]
    turn = exp_so3(np.array([np.pi, 0.0, 0.0]))  # from below
    grip = hand.mean(axis=0) @ turn.T

    def at(instant: int) -> Floats:
        wrist = joint_centres(patient.body, patient.thetas[instant])["wrist"]
        return np.asarray(arm @ turn.T - grip + wrist)

    return Around(at, anatomy.skin_faces)


def beside(anatomy: str, *, apart_m: float = 0.45) -> Callable[[int, Path], Made]:
    """A right arm, and a second arm beside it that moves in its own way."""

    def make(seed: int, folder: Path) -> Made:
        performance, other = performance_of(ARM, seed), performance_of(anatomy, seed + 1000)
        shift = _middle(performance) - _middle(other) + [0.0, 0.0, -apart_m]
        faces = other.body.anatomy.skin_faces
        second = Around(lambda t: np.asarray(pose_skin(other.body, other.thetas[t]) + shift), faces)
        rig = default_rig(np.concatenate([_swept(performance), _swept(other) + shift]), seed=seed)
        return Made(folder, ARM, record(performance, folder, seed=seed, rig=rig, around=[second]))

    return make


def _swept(performance: Performance) -> Floats:
    return np.concatenate([pose_skin(performance.body, theta) for theta in performance.thetas])


def somebody_behind(seed: int, folder: Path) -> Made:
    """Somebody made of ellipsoids stands half a metre behind the limb."""
    performance = performance_of(ARM, seed)
    vertices, faces = person()
    around = still(vertices + _middle(performance) - [0.6, 0.2, 0.0], faces)
    return Made(folder, ARM, record(performance, folder, seed=seed, around=[around]))


def _middle(performance: Performance) -> Floats:
    skin = pose_skin(performance.body, performance.thetas[0])
    return np.asarray((skin.min(axis=0) + skin.max(axis=0)) / 2.0)


MAKERS: dict[str, Callable[[int, Path], Made]] = {
    "furnished room": in_a_room,
    "furnished room, leg": lambda seed, folder: in_a_room(seed, folder, anatomy=LEG),
    "therapist holds the wrist": held_at_the_wrist,
    "two arms of one person": beside(mirrored_name(ARM)),
    "two right arms": beside(ARM),
    "two right arms far apart": beside(ARM, apart_m=1.2),
    "somebody stands behind": somebody_behind,
}
