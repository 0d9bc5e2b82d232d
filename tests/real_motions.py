"""Real people's motions as bonetrack would hand them on, from the tables of joint angles in ../shared/motions.

Tests that use them skip where the tables are not. The body is the template's: only the angles are a person's.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from adapt.anatomy import Anatomy, Floats
from adapt.anatomy_file import load_anatomy
from adapt.model.body import make_body, rest_theta
from adapt.model.pose_space import root_coordinates
from adapt.subject import Subject
from track.motion import Motion, bones_and_centres, coordinate_names

FOLDER = Path(__file__).parents[2] / "shared" / "motions"
_HIP_IN_PELVIS = np.array([-0.0563, -0.0785, 0.0773])  # m, right, of Rajagopal's model


def columns_of(name: str) -> dict[str, Floats]:
    """The columns (T,) of a table, in s, rad and m."""
    path = FOLDER / f"{name}.csv"
    if not path.is_file():
        pytest.skip(f"no ../shared/motions/{name}.csv here")
    lines = [line for line in path.read_text(encoding="utf-8").splitlines() if not line.startswith("#")]
    table = np.array([[float(cell) for cell in line.split(",")] for line in lines[1:]])
    return dict(zip(lines[0].split(","), table.T, strict=True))


def leg_motion(name: str, side: str = "right", *, deviation_deg: float = 1.0) -> Motion:
    """One leg of a real motion, its knee flexion counted positive."""
    columns, anatomy = columns_of(name), load_anatomy(f"lower-limb-{side}")
    end = side[0]
    knee = columns[f"knee_angle_{end}"]
    columns[f"knee_angle_{end}"] = -knee if np.median(knee) < 0.0 else knee
    turn = Rotation.from_euler("ZXY", np.column_stack([columns[f"pelvis_{n}"] for n in ("tilt", "list", "rotation")]))
    at = np.column_stack([columns[f"pelvis_t{c}"] for c in "xyz"])
    at = at + turn.apply(_HIP_IN_PELVIS * [1.0, 1.0, 1.0 if side == "right" else -1.0])
    thetas = poses(anatomy, columns, len(at))
    thetas[:, root_coordinates(anatomy)] = np.column_stack([turn.as_rotvec(), at])
    return motion_of(anatomy, columns["time"], thetas, deviation_deg=deviation_deg)


def poses(anatomy: Anatomy, columns: dict[str, Floats], count: int) -> Floats:
    """Poses (T, n) with the coordinates that there are columns of; the rest is at rest."""
    thetas = np.tile(rest_theta(make_body(anatomy)), (count, 1))
    for i, coordinate in enumerate(anatomy.coordinates):
        if coordinate.name in columns:
            thetas[:, i] = columns[coordinate.name]
    return thetas


def motion_of(
    anatomy: Anatomy, times: Floats, thetas: Floats, *, deviation_deg: float = 1.0, placed: bool = True
) -> Motion:
    """A motion of the template body; frames of unknown pose (NaN) are lost, bones unknown if not ``placed``."""
    body = make_body(anatomy)
    known = np.isfinite(thetas).all(axis=1)
    shown = np.tile(known[:, None], (1, len(anatomy.bones)))
    subject = Subject(body, thetas[:1], times[:1], 1e-6 * np.eye(len(body.shape)), {})
    transforms, centres = bones_and_centres(subject, thetas if placed else np.full(thetas.shape, np.nan), shown)
    return Motion(
        anatomy=anatomy.name,
        coordinates=coordinate_names(anatomy),
        times=times,
        thetas=thetas,
        deviations=np.where(known[:, None], np.deg2rad(deviation_deg), np.nan) * np.ones(thetas.shape[1]),
        lost=tuple("" if k else "left out by the test" for k in known),
        residuals=np.where(known, 0.001, np.nan),
        coverage=np.where(known, 0.95, 0.2),
        matches=np.where(known, 900, 0),
        shown=shown,
        transforms=transforms,
        centres=centres,
    )
