"""A subject: one person's adapted anatomy, as a file."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adapt.anatomy import Anatomy, Floats
from adapt.anatomy_file import is_path, load_anatomy
from adapt.model.body import Body, make_body
from adapt.model.shape.population import MEN_M
from adapt.model.shape.prior import overall_size
from adapt.own_anatomy import DIGEST, KEY, MOST_BYTES, anatomy_kept, content, kept_anatomy
from adapt.tissue import MODES
from capture.errors import AnatomyError
from capture.files import UNREADABLE, read_arrays, unreadable
from capture.own import arrays_of, replaced_if_own

FORMAT = "bonetrack-subject"
MARK = arrays_of(FORMAT)
_USUAL = (0.88, 1.12)  # size against the template; grown-ups from about 1.55 to 1.97 m
WIDENED = "body_deviations_times"  # in a report: how many times as wide as by the noise alone the body's deviations are
_CONTRADICTED = 0.12  # a size that differs by more from the stated one is neither the person's nor the prior's
# 1: the covariance is that of the shape alone; 3: holds the anatomy itself, if that is a user's own; 4: or a digest.
VERSION = 4
_MOST_BYTES = 16 << 20  # of one array, a hundred times the largest of the shipped anatomies'
_KNOWN = dict.fromkeys(("description", "shape", "displacement", "thetas", "times", "covariance"), _MOST_BYTES)
_KNOWN[KEY] = _KNOWN[DIGEST] = MOST_BYTES


@dataclass(frozen=True, eq=False)
class Subject:
    """A body, the poses it was adapted in, and what the fit said of itself.

    ``thetas`` (K, n) are the example poses and ``times`` (K,) their instants (s) in the recording;
    ``covariance`` (m + q, m + q) is that of the shape and of the coefficients of the soft tissue (``adapt.tissue``),
    or (m, m) where nothing is known of the tissue's; ``report`` is plain JSON. The ``path`` is that of the file that it
    was read from or written to.
    """

    body: Body
    thetas: Floats = field(repr=False)
    times: Floats = field(repr=False)
    covariance: Floats = field(repr=False)
    report: dict[str, Any] = field(repr=False)
    path: Path | None = field(default=None, repr=False)

    @property
    def never_seen(self) -> tuple[str, ...]:
        """Names of the bones that no pose showed when the subject was adapted: of these nothing is claimed."""
        return tuple(self.report.get("bones_never_seen", ()))

    @property
    def anatomy(self) -> Anatomy:
        """The anatomy the subject is made of."""
        return self.body.anatomy


def doubts(subject: Subject) -> list[str]:
    """What a result made with a subject should say beside it, in words: what its adaptation could not tell."""
    told = []
    side = subject.report.get("side")
    has_one = "side" in subject.report and subject.anatomy.side != "both"  # an older file says nothing of its side
    if has_one and not (side is not None and side["told"]):
        told.append(f"the data do not tell that it is a {subject.anatomy.side} limb: the asked side is taken on trust")
    size = overall_size(subject.body)
    if _by_one_camera(subject) and not _USUAL[0] < size < _USUAL[1]:
        told.append(
            f"the person came out {size:.2f} times as large as the template, {MEN_M * size:.2f} m tall if all of "
            "the body is so, and one camera alone says it: check whether that is so, for a wrong focal length or unit "
            "does that, too"
        )
    height_m = (subject.report.get("person") or {}).get("height_m")
    if height_m is not None and abs(size * MEN_M / height_m - 1.0) > _CONTRADICTED:
        told.append(
            f"the limb came out as that of somebody {MEN_M * size:.2f} m tall, and {height_m:.2f} m is stated: check "
            "the height, the unit of depth and the focal length"
        )
    if as_adapted(subject, "median_distance_mm") is None:
        told.append(
            "its file does not say how near its skin came to the clouds it was adapted to, so a limb that is not the "
            "subject's is told less surely: look at it in `bonetrack view`"
        )
    if WIDENED not in subject.report:
        told.append(
            "its file was written when a body was taken to be less far off than other people's are: deviations stated "
            "with it are narrower than they would be now, some by more than half; adapt it again"
        )
    return told


def as_adapted(subject: Subject, name: str) -> float | None:
    """The median (m) of what the subject's report says (mm) of its example poses; None where it does not.

    >>> arm = make_body(load_anatomy("upper-limb-right"))
    >>> report = {"poses": [{"median_distance_mm": 2.0}, {"median_distance_mm": 3.0}]}
    >>> subject = Subject(arm, np.zeros((2, 10)), np.zeros(2), np.eye(16), report)
    >>> as_adapted(subject, "median_distance_mm"), as_adapted(subject, "no such figure")
    (0.0025, None)
    """
    told = [pose[name] / 1e3 for pose in subject.report.get("poses", ()) if name in pose]
    return float(np.median(told)) if told else None


def _by_one_camera(subject: Subject) -> bool:
    """Whether one sensor saw it all; with more, the box or their clouds have told what is wrong with their cameras."""
    settings = subject.report.get("settings")
    return isinstance(settings, dict) and len(settings.get("frames_used", ())) == 1


def save_subject(subject: Subject, path: Path) -> None:
    """Write a subject as one ``.npz`` file; an anatomy that does not ship with the package is kept in it.

    Raises:
        OutputError: something stands there that is no subject.
        AnatomyError: the anatomy is too large for that.
    """
    kept = kept_anatomy(subject.anatomy)
    description = {
        "format": FORMAT,
        "version": VERSION,
        "anatomy": subject.anatomy.name,
        "skin_vertices": len(subject.body.v_hat),
        "report": subject.report,
    }
    path.parent.mkdir(parents=True, exist_ok=True)
    # An open file, because numpy adds a suffix to a name without one.
    with replaced_if_own(path, MARK) as partial, partial.open("wb") as file:
        np.savez_compressed(
            file,
            allow_pickle=False,
            description=np.array(json.dumps(description)),
            shape=subject.body.shape,
            displacement=(subject.body.v_hat - subject.anatomy.skin_vertices).astype(np.float32),
            thetas=subject.thetas,
            times=subject.times,
            covariance=subject.covariance,
            **kept,
        )


def load_subject(path: Path, *, anatomy: str | None = None) -> Subject:
    """Read a subject.

    The ``anatomy`` asked for is the name of one that ships, or the path of a file: then its content is compared with
    what the subject was adapted from, whatever the file is called.

    Raises:
        AnatomyError: missing, not a subject, a newer version, or not of the ``anatomy`` asked for.
    """
    if not path.is_file():
        raise AnatomyError("no such subject file", where=path, remedy="make one with `bonetrack adapt`")
    try:
        read = read_arrays(path, _KNOWN)
        description = json.loads(str(read.pop("description")))
        kept = {key: read.pop(key) for key in (KEY, DIGEST) if key in read}
        arrays = {key: value.astype(np.float64) for key, value in read.items()}
        subject = _from_parts(path, description, arrays, kept)
    except UNREADABLE as error:
        problem = unreadable("a subject file", error)
        raise AnatomyError(problem, where=path, remedy="make one with `bonetrack adapt`") from error
    if anatomy is not None:
        _refuse_other_anatomy(subject.anatomy, anatomy, path, own=KEY in kept)
    return subject


def _refuse_other_anatomy(anatomy: Anatomy, asked: str, path: Path, *, own: bool) -> None:
    """Raise AnatomyError if a subject's anatomy is not the one asked for; ``own``: it is a user's, kept in the file."""
    if is_path(asked):
        if content(anatomy) != content(load_anatomy(asked)):
            raise AnatomyError(
                f"was adapted from {anatomy.name}.npz with another content than {asked} has now",
                where=path,
                remedy="adapt the subject again, or give no --anatomy: the subject holds the one it was adapted from",
            )
    elif own or anatomy.name != asked:
        told = f"{anatomy.name}.npz" if own else anatomy.name
        problem = f"a subject of anatomy {told!r}, not {asked!r}"
        raise AnatomyError(problem, where=path, remedy=f"adapt one with --anatomy {asked}")


def _from_parts(path: Path, description: Any, arrays: dict[str, Floats], kept: dict[str, NDArray[Any]]) -> Subject:
    if not isinstance(description, dict) or description.get("format") != FORMAT:
        raise AnatomyError("not a subject file", where=path, remedy="make one with `bonetrack adapt`")
    if description["version"] > VERSION:
        raise AnatomyError(
            f"format version {description['version']} is newer than {VERSION}", where=path, remedy="update bonetrack"
        )
    name, report = description["anatomy"], description["report"]
    if not isinstance(name, str) or not isinstance(report, dict):
        raise ValueError("an anatomy's name and a report are expected")
    template = anatomy_kept(name, kept, where=path)
    if len(template.skin_vertices) != description["skin_vertices"]:
        raise AnatomyError(
            f"made with another template of {template.name}", where=path, remedy="adapt the subject again"
        )
    unseen = report.get("bones_never_seen", [])
    if not isinstance(unseen, list) or not set(map(str, unseen)) <= {bone.name for bone in template.bones}:
        raise ValueError("bones of the anatomy are expected to have never been seen")
    try:
        body = make_body(template, shape=arrays["shape"], v_hat=template.skin_vertices + arrays["displacement"])
    except AnatomyError as error:
        raise AnatomyError(error.problem, where=path, remedy="adapt the subject again") from error
    covariance = arrays["covariance"]
    if covariance.shape not in [(k, k) for k in (len(body.shape), len(body.shape) + MODES)]:
        raise AnatomyError(
            f"has a covariance of shape {covariance.shape}", where=path, remedy="adapt the subject again"
        )
    thetas, times = arrays["thetas"], arrays["times"]
    if times.ndim != 1 or thetas.shape != (len(times), len(template.coordinates)):
        raise ValueError(f"poses of shape {thetas.shape} at times of shape {times.shape}")
    return Subject(body, thetas, times, covariance, report, path)
