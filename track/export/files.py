"""Subjects and motions as files that other tools read."""

from __future__ import annotations

from pathlib import Path

from adapt.anatomy import Floats, Ints
from adapt.model.body import Body, pose_skin, posed_bones
from adapt.model.surface import submesh
from adapt.subject import Subject
from capture._open3d import open3d
from capture.files import replaced_when_complete
from track.angles import reported_coordinates
from track.belonging import refuse_other_subject
from track.export.opensim_tables import write_mot, write_mot_in_radians, write_trc
from track.export.osim import landmark_markers, marker_paths, write_osim
from track.export.osim_motion import in_si_with_coupled, with_coupled, write_states
from track.export.tables import motion_tables, write_csv, write_parquet
from track.motion import Motion, MotionError
from track.shown import known_thetas, skin_shown


def export_subject(subject: Subject, out: Path) -> list[Path]:
    """Write the rest skin and every bone as PLY, and the OpenSim model with its meshes; returns the files."""
    out.mkdir(parents=True, exist_ok=True)
    written = [_ply(out / "skin.ply", subject.body.v_tilde.value, subject.anatomy.skin_faces)]
    for bone in subject.anatomy.bones:
        written.append(_ply(out / f"{bone.name}.ply", subject.body.rest_bones[bone.name], bone.faces))
    return written + write_osim(subject.body, out)


def export_motion(
    motion: Motion, subject: Subject, out: Path, *, frame: int | None = None, parquet: bool = False
) -> list[Path]:
    """Write angles (``.mot``, ``.sto``), centres and landmarks (``.trc``), tables (CSV), one frame's skin and bones.

    With ``parquet`` the tables (``track.export.tables``) are written in that format, too.

    Bones that do not show in the frame are left out, with the skin that rides on them.

    Raises:
        MotionError: the frame does not exist or was lost, it is one of another subject, or pyarrow is missing.
    """
    refuse_other_subject(motion, subject)
    if frame is not None:
        _check_frame(motion, frame)
    out.mkdir(parents=True, exist_ok=True)
    columns = reported_coordinates(subject.anatomy, known_thetas(subject.anatomy, motion.thetas, motion.shown))
    write_mot(out / "angles.mot", motion.times, with_coupled(subject.anatomy, columns))
    write_mot_in_radians(out / "angles_radians.mot", motion.times, in_si_with_coupled(subject.anatomy, columns))
    write_states(out / "coordinates.sto", motion.times, subject.anatomy, columns)
    write_trc(out / "centres.trc", motion.times, motion.centres)
    write_trc(out / "markers.trc", motion.times, marker_paths(landmark_markers(subject.body), motion.transforms))
    names = ("angles.mot", "angles_radians.mot", "coordinates.sto", "centres.trc", "markers.trc")
    written = [out / name for name in names]
    for name, table in motion_tables(motion, subject.anatomy).items():
        written.append(write_csv(out / f"{name}.csv", table))
        if parquet:
            written.append(write_parquet(out / f"{name}.parquet", table))
    if frame is not None:
        written += _posed(motion, subject.body, out, frame)
    return written


def _check_frame(motion: Motion, frame: int) -> None:
    if not 0 <= frame < len(motion.times):
        raise MotionError(f"no frame {frame}", remedy=f"frames run from 0 to {len(motion.times) - 1}")
    if motion.lost[frame]:
        raise MotionError(f"frame {frame} was lost: {motion.lost[frame]}", remedy="choose another frame")


def _posed(motion: Motion, body: Body, out: Path, frame: int) -> list[Path]:
    theta, hidden = motion.thetas[frame], motion.hidden(frame)
    skin = submesh(pose_skin(body, theta), body.anatomy.skin_faces, skin_shown(body, motion.shown[frame]))
    written = [_ply(out / f"skin_{frame:05d}.ply", *skin)]
    bones = posed_bones(body, theta)
    for bone in body.anatomy.bones:
        if bone.name not in hidden:
            written.append(_ply(out / f"{bone.name}_{frame:05d}.ply", bones[bone.name], bone.faces))
    return written


def _ply(path: Path, vertices: Floats, faces: Ints) -> Path:
    """Write a triangle mesh (m) as binary PLY.

    Raises:
        MotionError: the file could not be written.
    """
    geometry, utility = open3d().geometry, open3d().utility
    mesh = geometry.TriangleMesh(utility.Vector3dVector(vertices), utility.Vector3iVector(faces))
    with replaced_when_complete(path) as partial:
        if not open3d().io.write_triangle_mesh(str(partial), mesh, write_vertex_normals=False):
            raise MotionError("could not be written", where=path, remedy="check the disk")
    return path
