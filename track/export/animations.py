"""A motion in one file, for other programs: what each is called, what it needs, and what it does not say exactly."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path

from adapt.anatomy import Floats
from adapt.subject import Subject
from capture.own import Mark, refuse_foreign
from capture.upright import AXES
from track.export import bvh, c3d, glb, usd
from track.export.bvh import Gaps, refuse_gaps, write_bvh
from track.export.c3d import write_c3d
from track.export.gltf import write_gltf
from track.export.linear_skin import SkinGap
from track.export.upright import told_up, up_in_words
from track.export.usd import write_usd
from track.motion import Motion, MotionError


@dataclass(frozen=True, eq=False)
class Asked:
    """What is asked of such files: the direction (3,) that points up, what becomes of gaps in BVH."""

    up: Floats | None = None
    gaps: Gaps | None = None


@dataclass(frozen=True)
class Written:
    """Files, and sentences about what they do not say exactly."""

    paths: list[Path]
    said: list[str]


@dataclass(frozen=True)
class Format:
    """A file's name and mark, the module that it needs, with the extra that brings it, and what writes it."""

    file: str
    mark: Mark
    needs: tuple[str, str] | None
    write: Callable[[Motion, Subject, Path, Asked], Written]


def refuse_formats(names: Collection[str], motion: Motion, out: Path, asked: Asked) -> None:
    """Refuse, before anything is written, what could not be.

    Raises:
        MotionError: a library is missing, no frame was tracked, or frames were lost and nothing is said of gaps.
        OutputError: something stands in a file's place that bonetrack did not write.
    """
    for name in names:
        needs = FORMATS[name].needs
        if needs is not None and find_spec(needs[0]) is None:
            raise MotionError(f"--{name} needs {needs[0]}", remedy=f"pip install 'bonetrack[{needs[1]}]'")
        refuse_foreign(out / FORMATS[name].file, FORMATS[name].mark)
    if "bvh" in names:
        refuse_gaps(motion, asked.gaps)


def write_formats(names: Collection[str], motion: Motion, subject: Subject, out: Path, asked: Asked) -> Written:
    """Write a motion in all formats of these names into a folder."""
    done = [FORMATS[name].write(motion, subject, out / FORMATS[name].file, asked) for name in names]
    said = [line for one in done for line in one.said]
    if set(names) - {"c3d"}:
        said.append(_up_in_words(motion, asked))
    return Written([path for one in done for path in one.paths], said)


def _up(motion: Motion, asked: Asked) -> Floats:
    known = asked.up if asked.up is not None else told_up(motion)
    return AXES["y"] if known is None else known


def _up_in_words(motion: Motion, asked: Asked) -> str:
    if asked.up is None and told_up(motion) is None:
        return "the motion does not know which way is up: its y is taken for it; --up states another axis"
    return f"up is {up_in_words(_up(motion, asked))} in the recording, and y in these files"


def _gltf(motion: Motion, subject: Subject, path: Path, asked: Asked) -> Written:
    report = write_gltf(motion, subject, path, up=_up(motion, asked))
    said = [f"{_off(path, report.skin)} (frame {report.worst_frame}), because it is blended linearly"]
    if report.lost_frames:
        said.append(f"{path.name}: {report.lost_frames} lost frame(s) have no keys; viewers pass over them evenly")
    if report.frames_with_hidden_bones:
        said.append(
            f"{path.name}: bones vanish where they do not show ({report.frames_with_hidden_bones} frame(s)); "
            "their skin stays, on guessed poses"
        )
    return Written([path], said)


def _usd(motion: Motion, subject: Subject, path: Path, asked: Asked) -> Written:
    gap = write_usd(motion, subject, path, up=_up(motion, asked))
    said = [f"{_off(path, gap)}, because it is blended linearly"]
    if lost := int((~motion.tracked).sum()):
        said.append(f"{path.name}: skin and bones are invisible in {lost} lost frame(s)")
    return Written([path], said)


def _bvh(motion: Motion, subject: Subject, path: Path, asked: Asked) -> Written:
    report = write_bvh(motion, subject, path, up=_up(motion, asked), gaps=asked.gaps)
    said = []
    if report.filled:
        how = "the pose before" if asked.gaps == "hold" else "even motion"
        said.append(f"{path.name}: {report.filled} lost frame(s) are {how}, which nobody saw")
    if report.left_out:
        said.append(f"{path.name}: {report.left_out} lost frame(s) are left out")
    hidden = int(((~motion.shown).any(axis=1) & motion.tracked).sum())
    if hidden:
        said.append(f"{path.name}: bones that do not show are guessed in {hidden} frame(s), and not told from others")
    return Written(report.paths, said)


def _c3d(motion: Motion, subject: Subject, path: Path, asked: Asked) -> Written:
    moved = write_c3d(motion, subject, path)
    uneven = f"{path.name}: {moved} of its even times fall between two frames, and so do the points"
    return Written([path], [uneven] if moved else [])


def _off(path: Path, gap: SkinGap) -> str:
    mean, largest = 1e3 * gap.mean_m, 1e3 * gap.largest_m
    return f"{path.name}: its skin is off the model's by {mean:.2f} mm in the mean, at most {largest:.1f} mm"


FORMATS = {
    "gltf": Format("motion.glb", glb.MARK, None, _gltf),
    "usd": Format("motion.usdc", usd.MARK, ("pxr", "usd"), _usd),
    "bvh": Format("motion.bvh", bvh.MARK, None, _bvh),
    "c3d": Format("motion.c3d", c3d.MARK, ("ezc3d", "c3d"), _c3d),
}
"""By the names of the command's options."""
