"""Measures of a subject that people can check with a tape: lengths of bones and girths of the limb, at rest."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import connected_components
from scipy.spatial import ConvexHull, QhullError

from adapt.anatomy import Bone, Floats, Ints
from adapt.fit.posterior import deviation_along
from adapt.model.body import make_body
from adapt.model.frames import landmark_mean
from adapt.plain_words import landmark_words
from adapt.subject import Subject

PLACES = (0.25, 0.5, 0.75)
"""Where along a bone girths are taken: shares of the way from the first to the last landmark of its long axis."""
_APART_M = 0.1


@dataclass(frozen=True)
class Length:
    """A bone's length (m) along its long axis, with one standard deviation, and the template's."""

    bone: str
    ends: str  # the landmarks it is measured between
    length_m: float
    sd_m: float
    template_m: float


@dataclass(frozen=True)
class Girth:
    """What a tape around the skin would read (m), square to a bone's long axis at ``share`` of its length."""

    bone: str
    start: str  # the landmarks that the share is counted from
    share: float
    girth_m: float
    template_m: float


def lengths(subject: Subject) -> list[Length]:
    """Length of every bone between the landmarks that make its ISB long axis; the SD comes from the shape's covariance.

    Adapted bones keep their template's proportions but for the handles' scales: what is not seen is not measured.

    >>> from adapt.anatomy_file import load_anatomy
    >>> arm = make_body(load_anatomy("upper-limb-right"))
    >>> subject = Subject(arm, np.zeros((0, 10)), np.zeros(0), 1e-4 * np.eye(16), {})
    >>> first = lengths(subject)[0]
    >>> first.bone, round(first.length_m, 3), first.length_m == first.template_m
    ('humerus', 0.277, True)
    >>> first.ends
    'middle of medial epicondyle of the humerus and lateral epicondyle of the humerus to centre of the humeral head'
    """
    template = _template(subject)
    rows = []
    for bone in subject.anatomy.bones:
        length, gradient = _length(subject, bone)
        spread = deviation_along(subject.covariance, gradient)
        ends = f"{_names(bone.frame.y_from)} to {_names(bone.frame.y_to)}"
        rows.append(Length(bone.name, ends, length, spread, _length(template, bone)[0]))
    return rows


def girths(subject: Subject) -> list[Girth]:
    """Girths of the rest skin at ``PLACES`` of every bone that runs from one joint to another.

    >>> from adapt.anatomy_file import load_anatomy
    >>> arm = make_body(load_anatomy("upper-limb-right"))
    >>> subject = Subject(arm, np.zeros((0, 10)), np.zeros(0), np.eye(16), {})
    >>> [(girth.bone, girth.share, round(girth.girth_m, 2)) for girth in girths(subject)[:3]]
    [('humerus', 0.25, 0.28), ('humerus', 0.5, 0.3), ('humerus', 0.75, 0.36)]
    """
    template = _template(subject)
    rows = []
    for bone in subject.anatomy.bones:
        if not _runs_between_joints(subject, bone):
            continue
        for share in PLACES:
            girth, known = _girth(subject, bone, share), _girth(template, bone, share)
            if girth is not None and known is not None:
                rows.append(Girth(bone.name, _names(bone.frame.y_from), share, girth, known))
    return rows


def _template(subject: Subject) -> Subject:
    """The same person with the template's body."""
    return replace(subject, body=make_body(subject.anatomy))


def _runs_between_joints(subject: Subject, bone: Bone) -> bool:
    """Whether the bone's own joint and one that it carries are apart; a hand or a pelvis has no such length."""
    anatomy, p = subject.anatomy, subject.body.p
    own = [landmark_mean(anatomy, p, joint.centre)[0] for joint in anatomy.joints if joint.child == bone.name]
    carried = [landmark_mean(anatomy, p, joint.centre)[0] for joint in anatomy.joints if joint.parent == bone.name]
    return any(float(np.sqrt((a - b) @ (a - b))) > _APART_M for a in own for b in carried)


def _length(subject: Subject, bone: Bone) -> tuple[float, Floats]:
    """Length (m) and its gradient by the shape (4J,)."""
    start, d_start = landmark_mean(subject.anatomy, subject.body.p, bone.frame.y_from)
    end, d_end = landmark_mean(subject.anatomy, subject.body.p, bone.frame.y_to)
    length = float(np.linalg.norm(end - start))
    return length, (end - start) / length @ (d_end - d_start)


def _girth(subject: Subject, bone: Bone, share: float) -> float | None:
    """Girth (m); None where the plane meets no closed limb around the bone."""
    start, _ = landmark_mean(subject.anatomy, subject.body.p, bone.frame.y_from)
    end, _ = landmark_mean(subject.anatomy, subject.body.p, bone.frame.y_to)
    place = start + share * (end - start)
    return tape(
        subject.body.v_tilde.value, subject.anatomy.skin_faces, place, (end - start) / np.linalg.norm(end - start)
    )


def tape(vertices: Floats, faces: Ints, place: Floats, axis: Floats) -> float | None:
    """Length (m) of a tape around a mesh (V, 3), (F, 3) in the plane through ``place`` (3,) square to ``axis`` (3,).

    A tape bridges hollows: it is as long as the convex hull's border. Of several loops in the plane the one around
    ``place`` counts; None where there is none.
    """
    height = (vertices - place) @ axis
    crossing = faces[(height[faces].min(axis=1) < 0.0) & (height[faces].max(axis=1) >= 0.0)]
    if not len(crossing):
        return None
    edges = np.sort(crossing[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    edges = edges[(height[edges[:, 0]] < 0.0) != (height[edges[:, 1]] < 0.0)].reshape(-1, 2, 2)  # two of each face
    unique, index = np.unique(edges.reshape(-1, 2), axis=0, return_inverse=True)
    index = index.reshape(-1, 2)
    joined = sparse.coo_matrix((np.ones(len(index)), index.T), shape=(len(unique), len(unique)))
    _, loop = connected_components(joined, directed=False)
    low, high = unique.T
    share = height[low] / (height[low] - height[high])
    points = vertices[low] + share[:, None] * (vertices[high] - vertices[low]) - place
    flat = points @ _square_to(axis)
    for number in range(loop.max() + 1):
        try:
            hull = ConvexHull(flat[loop == number])
        except QhullError:
            continue
        if (hull.equations[:, -1] <= 0.0).all():  # the place itself is inside
            return float(hull.area)
    return None


def _square_to(axis: Floats) -> Floats:
    """Two directions (3, 2) square to an axis (3,) and to each other."""
    other = np.eye(3)[np.abs(axis).argmin()]
    first = np.cross(axis, other)
    first /= np.linalg.norm(first)
    return np.column_stack([first, np.cross(axis, first)])


def _names(landmarks: tuple[str, ...]) -> str:
    told = [landmark_words(name) for name in landmarks]
    return told[0] if len(told) == 1 else f"middle of {' and '.join(told)}"
