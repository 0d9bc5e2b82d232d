"""What comes out of a marker trial beside a motion: its markers there, a table of distances, and a picture."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from adapt.anatomy import Floats
from adapt.subject import Subject
from capture.own import PNG, refuse_any_foreign, table_of
from capture.upright import AXES
from track.export.opensim_tables import TRC, write_trc
from track.export.tables import Table, write_csv
from track.export.upright import told_up
from track.markers.align import Alignment, at_times
from track.markers.read import MarkerTrial
from track.motion import Motion
from track.view.pictures import body_layers
from track.view.render import BONE, SKIN, Layer, framing_camera, look_at, render, save_png
from track.view.stills import captioned, key_of

LAB, OURS = (0.80, 0.10, 0.45), (0.10, 0.35, 0.75)
_RADIUS_M = 0.006
_WIDTH, _HEIGHT = 720, 720


def write_beside(
    trial: MarkerTrial, alignment: Alignment, motion: Motion, subject: Subject, ours: Mapping[str, Floats], out: Path
) -> list[Path]:
    """Write ``markers.trc`` (all markers in the motion's frame and clock), ``differences.csv`` and ``markers.png``.

    Raises:
        OutputError: something stands in a file's place that bonetrack did not write; nothing is written then.
    """
    carried, table = alignment.carried(trial), differences(motion, alignment)
    paths = [out / name for name in ("markers.trc", "differences.csv", "markers.png")]
    refuse_any_foreign(dict(zip(paths, (TRC, table_of(list(table)), PNG), strict=True)))
    out.mkdir(parents=True, exist_ok=True)
    write_trc(paths[0], carried.times, carried.points)
    write_csv(paths[1], table)
    _picture(carried, alignment, motion, subject, ours, paths[2])
    return paths


def differences(motion: Motion, alignment: Alignment) -> Table:
    """How far each marker is from the point it goes with (mm) at the motion's times; NaN where either is unknown."""
    apart = {f"{marker}_to_{point}_mm": 1e3 * far for (marker, point), far in alignment.apart.items()}
    return {"time_s": motion.times} | apart


def _picture(
    carried: MarkerTrial,
    alignment: Alignment,
    motion: Motion,
    subject: Subject,
    ours: Mapping[str, Floats],
    path: Path,
) -> None:
    """The frame in which most pairs are known: the body, its points, and the markers."""
    t = int(np.isfinite(np.array(list(alignment.apart.values()))).sum(axis=0).argmax())
    at = {name: at_times(carried.times, points, motion.times[t : t + 1])[0] for name, points in carried.points.items()}
    body, skin = subject.body, body_layers(subject.body, motion.thetas[t], shown=motion.shown[t])
    marks = [ball(place, LAB) for place in at.values() if np.isfinite(place).all()]
    mine = [ours[point][t] for _, point in alignment.apart]
    marks += [ball(place, OURS) for place in mine if np.isfinite(place).all()]
    known = told_up(motion)
    up = AXES["y"] if known is None else known
    points = np.concatenate([layer.vertices for layer in (*skin, *marks)])
    panels = []
    for direction in (np.cross(up, _across(up)), _across(up)):
        eye = look_at(points, direction + 0.2 * up, up)
        panels.append(render([*skin, *marks], eye, framing_camera(eye, points, width=_WIDTH // 2, height=_HEIGHT)))
    words = {SKIN: "skin", BONE: "bones", LAB: "laboratory's markers", OURS: "points they go with"}
    keys = [key_of(colour, text) for colour, text in words.items()]
    title = f"markers beside {body.anatomy.name}"
    save_png(captioned(np.concatenate(panels, axis=1), title, f"{motion.times[t]:.2f} s", keys), path)


def ball(place: Floats, colour: tuple[float, float, float]) -> Layer:
    """A small ball about a place (3,) m, to be seen from anywhere."""
    from capture._open3d import open3d

    mesh = open3d().geometry.TriangleMesh.create_sphere(_RADIUS_M, 8)
    return Layer(np.asarray(mesh.vertices) + place, np.asarray(mesh.triangles), colour)


def _across(up: Floats) -> Floats:
    """A level direction (3,)."""
    least = np.eye(3)[int(np.argmin(np.abs(up)))]
    level = np.cross(up, least)
    return np.asarray(level / np.linalg.norm(level))
