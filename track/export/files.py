"""Subjects and motions as files that other tools read."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from adapt.anatomy import Floats, Ints
from adapt.model.body import Body, pose_skin, posed_bones
from adapt.model.pose_space import reported_coordinates
from adapt.model.surface import submesh
from adapt.subject import Subject
from capture._open3d import open3d
from capture.own import WRITTEN, Mark, refuse_any_foreign, replaced_if_own, table_of, words
from track.belonging import refuse_other_subject
from track.export.opensim_tables import MOT, TRC, write_mot, write_mot_in_radians, write_trc
from track.export.osim import landmark_markers, marker_paths, osim_files, write_osim
from track.export.osim_joints import follower_columns
from track.export.osim_motion import STATES, in_si_with_coupled, with_coupled, write_states
from track.export.tables import PARQUET, motion_tables, write_csv, write_parquet
from track.motion import Motion, MotionError
from track.observed_bones import known_thetas, skin_shown


def export_subject(subject: Subject, out: Path) -> list[Path]:
    """Write the rest skin and every bone as PLY, and the OpenSim model with its meshes; returns the files.

    Raises:
        OutputError: something stands in a file's place that bonetrack did not write; nothing is written then.
    """
    meshes = {out / "skin.ply": (subject.body.v_tilde.value, subject.anatomy.skin_faces)}
    for bone in subject.anatomy.bones:
        meshes[out / f"{bone.name}.ply"] = (subject.body.rest_bones[bone.name], bone.faces)
    refuse_any_foreign(dict.fromkeys(meshes, _PLY) | osim_files(subject.body, out))
    out.mkdir(parents=True, exist_ok=True)
    return [_ply(path, *mesh) for path, mesh in meshes.items()] + write_osim(subject.body, out)


def export_motion(
    motion: Motion, subject: Subject, out: Path, *, frame: int | None = None, parquet: bool = False
) -> list[Path]:
    """Write angles (``.mot``, ``.sto``), centres and landmarks (``.trc``), tables (CSV), one frame's skin and bones.

    With ``parquet`` the tables (``track.export.tables``) are written in that format, too.

    Bones that do not show in the frame are left out, with the skin that rides on them.

    Raises:
        MotionError: the frame does not exist or was lost, it is one of another subject, or pyarrow is missing.
        OutputError: something stands in a file's place that bonetrack did not write; nothing is written then.
    """
    refuse_other_subject(motion, subject)
    if frame is not None:
        _check_frame(motion, frame)
    pieces = _tracks(motion, subject, out) + _tables(motion, subject, out, parquet=parquet)
    if frame is not None:
        pieces += _posed(motion, subject.body, out, frame)
    refuse_any_foreign({piece.path: piece.mark for piece in pieces})
    out.mkdir(parents=True, exist_ok=True)
    for piece in pieces:
        piece.write(piece.path)
    return [piece.path for piece in pieces]


@dataclass(frozen=True)
class _Piece:
    """A file that is going to be written, how it is known again, and who writes it."""

    path: Path
    mark: Mark
    write: Callable[[Path], object]


def _tracks(motion: Motion, subject: Subject, out: Path) -> list[_Piece]:
    """The angles and points over time."""
    anatomy, times = subject.anatomy, motion.times
    columns = reported_coordinates(anatomy, known_thetas(anatomy, motion.thetas, motion.shown))
    columns |= follower_columns(subject.body, motion.transforms)
    degrees, radians = with_coupled(anatomy, columns), in_si_with_coupled(anatomy, columns)
    markers = marker_paths(landmark_markers(subject.body), motion.transforms)
    return [
        _Piece(out / "angles.mot", MOT, lambda path: write_mot(path, times, degrees)),
        _Piece(out / "angles_radians.mot", MOT, lambda path: write_mot_in_radians(path, times, radians)),
        _Piece(out / "coordinates.sto", STATES, lambda path: write_states(path, times, anatomy, columns)),
        _Piece(out / "centres.trc", TRC, lambda path: write_trc(path, times, motion.centres)),
        _Piece(out / "markers.trc", TRC, lambda path: write_trc(path, times, markers)),
    ]


def _tables(motion: Motion, subject: Subject, out: Path, *, parquet: bool) -> list[_Piece]:
    pieces = []
    for name, table in motion_tables(motion, subject.anatomy).items():
        pieces.append(_Piece(out / f"{name}.csv", table_of(list(table)), partial(write_csv, table=table)))
        if parquet:
            pieces.append(_Piece(out / f"{name}.parquet", PARQUET, partial(write_parquet, table=table)))
    return pieces


def _check_frame(motion: Motion, frame: int) -> None:
    if not 0 <= frame < len(motion.times):
        raise MotionError(f"no frame {frame}", remedy=f"frames run from 0 to {len(motion.times) - 1}")
    if motion.lost[frame]:
        raise MotionError(f"frame {frame} was lost: {motion.lost[frame]}", remedy="choose another frame")


def _posed(motion: Motion, body: Body, out: Path, frame: int) -> list[_Piece]:
    """The skin and the bones of one frame."""
    theta, hidden = motion.thetas[frame], motion.hidden(frame)
    bones = posed_bones(body, theta)
    meshes = {"skin": submesh(pose_skin(body, theta), body.anatomy.skin_faces, skin_shown(body, motion.shown[frame]))}
    meshes |= {bone.name: (bones[bone.name], bone.faces) for bone in body.anatomy.bones if bone.name not in hidden}
    return [
        _Piece(out / f"{name}_{frame:05d}.ply", _PLY, partial(_ply, vertices=vertices, faces=faces))
        for name, (vertices, faces) in meshes.items()
    ]


_PLY = words(WRITTEN)


def _ply(path: Path, vertices: Floats, faces: Ints) -> Path:
    """Write a triangle mesh (m) as binary PLY.

    Raises:
        MotionError: the file could not be written.
        OutputError: something stands there that bonetrack did not write.
    """
    geometry, utility = open3d().geometry, open3d().utility
    mesh = geometry.TriangleMesh(utility.Vector3dVector(vertices), utility.Vector3iVector(faces))
    with replaced_if_own(path, _PLY) as unfinished:
        if not open3d().io.write_triangle_mesh(str(unfinished), mesh, write_vertex_normals=False):
            raise MotionError("could not be written", where=path, remedy="check the disk")
        first, rest = unfinished.read_bytes().split(b"\nelement ", 1)
        unfinished.write_bytes(first + f"\ncomment {WRITTEN}\nelement ".encode() + rest)
    return path
