"""ISB's thoraco-humeral angles, in degrees; what else is reported of a pose see ``adapt.model.pose_space``."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from adapt.anatomy import Anatomy, Floats
from adapt.model.joints.euler import arm_angles
from adapt.model.known_rows import of_known_rows
from adapt.model.pose_space import root_joint
from capture.rigid import exp_so3
from track.motion import MotionError


def thoraco_humeral(world_from_thorax: Floats, thetas: Floats, rotation: list[int], *, side: str) -> dict[str, Floats]:
    """ISB angles (degrees) of the humerus in the thorax, Y-X'-Y'' (Wu et al. 2005), for poses (T, n).

    ``rotation`` are the indices of the humerus' rotation vector in theta; the thorax frame (4, 4) has X forward,
    Y up, Z right. Plane 0 is abduction, 90 forward flexion; elevation is counted positive. A left arm has the angles
    of its mirror image (adapt.mirror), so they mean the same on both sides.

    >>> abducted, flexed = [-np.pi / 3.0, 0.0, 0.0], [0.0, 0.0, np.pi / 3.0]
    >>> angles = thoraco_humeral(np.eye(4), np.array([abducted, flexed]), [0, 1, 2], side="right")
    >>> [(angles[f"thoracohumeral_{name}"].round(6) + 0.0).tolist() for name in ("plane_of_elevation", "elevation")]
    [[0.0, 90.0], [60.0, 60.0]]
    """
    to_thorax = world_from_thorax[:3, :3].T
    reflection = np.diag([1.0, 1.0, -1.0 if side == "left" else 1.0])

    def angles(vectors: Floats) -> Floats:
        return arm_angles(reflection @ to_thorax @ exp_so3(vectors) @ reflection)

    values = np.rad2deg(of_known_rows(thetas[:, rotation], angles))
    names = ("plane_of_elevation", "elevation", "axial_rotation")
    return {f"thoracohumeral_{name}": values[:, k] for k, name in enumerate(names)}


def refuse_without_humerus(anatomy: Anatomy) -> None:
    """Tell that there are no thoraco-humeral angles where another bone than the humerus is free in the recording.

    Raises:
        MotionError: it is another.

    >>> from adapt.anatomy_file import load_anatomy
    >>> refuse_without_humerus(load_anatomy("upper-limb-left"))
    >>> refuse_without_humerus(load_anatomy("lower-limb-left"))
    Traceback (most recent call last):
        ...
    track.motion.MotionError: no thoraco-humeral angles: the free bone of lower-limb-left is the pelvis, ...
    """
    root = root_joint(anatomy)
    if root.child != "humerus":
        problem = f"no thoraco-humeral angles: the free bone of {anatomy.name} is the {root.child}, not the humerus"
        raise MotionError(problem, remedy="leave out the thorax")


def read_thorax(path: Path) -> Floats:
    """The thorax frame (4, 4) in the recording's frame, from a JSON file: a list of four rows of four numbers.

    Raises:
        MotionError: not such a file, or not a rigid transform.

    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     path = Path(folder, "thorax.json")
    ...     _ = path.write_text(json.dumps(np.diag([-1.0, 1.0, 1.0, 1.0]).tolist()))
    ...     read_thorax(path)  # mirrored, which no thorax can be
    Traceback (most recent call last):
        ...
    track.motion.MotionError: ...thorax.json: is not a rigid 4 x 4 transform; X forward, Y up, Z right; metres
    """
    try:
        matrix = np.array(json.loads(path.read_text(encoding="utf-8")), dtype=np.float64)
    except OSError as error:
        raise MotionError("cannot be read", where=path, remedy="name a JSON file with the thorax frame") from error
    except (ValueError, TypeError) as error:
        raise MotionError("is not a JSON list of numbers", where=path, remedy="give four rows of four") from error
    rigid = matrix.shape == (4, 4) and np.allclose(matrix[:3, :3] @ matrix[:3, :3].T, np.eye(3), atol=1e-4)
    if not rigid or np.linalg.det(matrix[:3, :3]) < 0.0 or not np.allclose(matrix[3], [0, 0, 0, 1]):
        raise MotionError("is not a rigid 4 x 4 transform", where=path, remedy="X forward, Y up, Z right; metres")
    return matrix
