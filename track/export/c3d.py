"""Joint centres and landmarks as C3D, the file of motion capture laboratories, with ezc3d.

C3D knows a rate and no times, so points stand at even times. One that is not known has residual -1 and zeros, as
c3d.org's notes for programmers want it; one that is known has residual 0, which says that it was reckoned.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from adapt.anatomy import Floats
from adapt.subject import Subject
from capture.own import Mark, replaced_if_own
from track.export.even_times import even_times
from track.export.osim import landmark_markers, marker_paths
from track.motion import Motion, MotionError

MOST_FRAMES = 65535
"""What a C3D file's header counts to; readers do not agree on longer files."""


def _parameters(path: Path) -> bytes:
    with path.open("rb") as file:
        return file.read(1 << 20)  # labels come first


MARK = Mark(re.compile(rb"SOFTWARE.{2,8}bonetrack", re.DOTALL), _parameters)


def c3d_points(motion: Motion, subject: Subject) -> dict[str, Floats]:
    """What the file holds: joint centres (T, 3) m by the joints' names, then landmarks by their own."""
    return motion.centres | marker_paths(landmark_markers(subject.body), motion.transforms)


def write_c3d(motion: Motion, subject: Subject, path: Path) -> int:
    """Write joint centres and landmarks in mm, in the recording's frame; returns how many times fall between frames.

    Raises:
        MotionError: ezc3d is not installed, or the motion is longer than such files can be.
        OutputError: something stands there that bonetrack did not write.
    """
    try:
        import ezc3d
    except ImportError as error:
        raise MotionError("C3D needs ezc3d", remedy="pip install 'bonetrack[c3d]'") from error
    points, even = c3d_points(motion, subject), even_times(motion.times)
    if len(even.times) > MOST_FRAMES:
        problem = f"{len(even.times)} frames are more than a C3D file holds, which is {MOST_FRAMES}"
        raise MotionError(problem, remedy="use centres.trc and markers.trc, which may be longer")
    file = ezc3d.c3d()
    file["data"]["points"] = _homogeneous({name: even.at(at) for name, at in points.items()})
    known = file["parameters"]["POINT"]
    known["RATE"]["value"], known["UNITS"]["value"] = [even.rate_hz], ["mm"]
    known["LABELS"]["value"] = list(points)
    known["DESCRIPTIONS"]["value"] = ["joint centre" if name in motion.centres else "landmark" for name in points]
    file.add_parameter("MANUFACTURER", "SOFTWARE", ["bonetrack"])
    with replaced_if_own(path, MARK) as partial:
        file.write(str(partial))
    return even.moved


def _homogeneous(points: Mapping[str, Floats]) -> Any:
    """Points (4, P, N) in mm; NaN, which ezc3d writes as C3D's unknown point, where any part of one is not known."""
    at = 1e3 * np.stack(list(points.values()))  # (P, N, 3)
    at[~np.isfinite(at).all(axis=2)] = np.nan
    return np.concatenate([at.transpose(2, 0, 1), np.ones((1, *at.shape[:2]))])
