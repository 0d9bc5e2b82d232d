"""How the time to pose skin grows with the number of deformers: as many vertices of one limb or of several.

The limbs hang together in one anatomy, as those of a whole person do, though each by a root of its own. With loops that
ask for every vertex whether each deformer has a share of it, and that fill all columns of derivatives, the time grows
with the number of limbs; it need not.
"""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np
from scipy.linalg import block_diag

from adapt.anatomy import Anatomy, Bone, Deformer, Floats, Frame, Joint
from adapt.model.body import make_body, rest_theta

LIMBS = (1, 2, 4, 8)
POSED, _TIMES = 2000, 40


def seconds_by_deformers(anatomy: Anatomy) -> tuple[tuple[int, ...], tuple[float, ...]]:
    """Numbers of deformers, and the processor's least seconds to pose ``POSED`` vertices with their derivatives."""
    counts, seconds = [], []
    for limbs in LIMBS:
        several = limbs_in_one(anatomy, limbs)
        body = make_body(several)
        theta, rows = rest_theta(body), np.linspace(0, len(body.v_hat) - 1, POSED).astype(int)
        body.prepared.posed(theta, rows)  # prepares, and compiles
        spent = []
        for _ in range(_TIMES):
            start = time.process_time()
            body.prepared.posed(theta, rows)
            spent.append(time.process_time() - start)
        counts.append(len(several.deformers))
        seconds.append(min(spent))
    return tuple(counts), tuple(seconds)


def limbs_in_one(anatomy: Anatomy, count: int) -> Anatomy:
    """An anatomy of so many limbs alike, all in one place; names get the limb's number.

    >>> from adapt.anatomy_file import load_anatomy
    >>> two = limbs_in_one(load_anatomy("upper-limb-right"), 2)
    >>> [bone.name for bone in two.bones], len(two.coordinates), two.deformer_weights.shape[1]
    (['humerus0', 'ulna0', 'radius0', 'hand0', 'humerus1', 'ulna1', 'radius1', 'hand1'], 20, 6)
    """

    def blocks(weights: Floats) -> Floats:
        return np.asarray(block_diag(*[weights] * count))

    ks, skin, handles = range(count), len(anatomy.skin_vertices), len(anatomy.handles)
    return Anatomy(
        name=f"{count} of {anatomy.name}",
        side=anatomy.side,
        bones=tuple(_bone(bone, k, k * handles, (count - 1 - k) * handles) for k in ks for bone in anatomy.bones),
        joints=tuple(_joint(joint, k) for k in ks for joint in anatomy.joints),
        coordinates=tuple(replace(c, name=f"{c.name}{k}") for k in ks for c in anatomy.coordinates),
        handles=tuple(
            replace(h, name=f"{h.name}{k}", bone=f"{h.bone}{k}", joint=f"{h.joint}{k}")
            for k in ks
            for h in anatomy.handles
        ),
        deformers=tuple(_deformer(deformer, k) for k in ks for deformer in anatomy.deformers),
        landmark_names=tuple(f"{name}{k}" for k in ks for name in anatomy.landmark_names),
        landmarks=np.tile(anatomy.landmarks, (count, 1)),
        landmark_handle_weights=blocks(anatomy.landmark_handle_weights),
        skin_vertices=np.tile(anatomy.skin_vertices, (count, 1)),
        skin_faces=np.concatenate([anatomy.skin_faces + k * skin for k in ks]),
        skin_handle_weights=blocks(anatomy.skin_handle_weights),
        deformer_weights=blocks(anatomy.deformer_weights),
        fit_weight=np.tile(anatomy.fit_weight, count),
        tetrahedra=anatomy.tetrahedra,
    )


def _names(names: tuple[str, ...], k: int) -> tuple[str, ...]:
    return tuple(f"{name}{k}" for name in names)


def _frame(frame: Frame, k: int) -> Frame:
    parts = (frame.origin, frame.y_from, frame.y_to, frame.z_from, frame.z_to)
    origin, y_from, y_to, z_from, z_to = (_names(names, k) for names in parts)
    return Frame(origin, y_from, y_to, z_from, z_to)


def _bone(bone: Bone, k: int, before: int, after: int) -> Bone:
    weights = np.pad(bone.handle_weights, ((0, 0), (before, after)))
    return replace(bone, name=f"{bone.name}{k}", frame=_frame(bone.frame, k), handle_weights=weights)


def _joint(joint: Joint, k: int) -> Joint:
    return replace(
        joint,
        name=f"{joint.name}{k}",
        parent=None if joint.parent is None else f"{joint.parent}{k}",
        child=f"{joint.child}{k}",
        other=None if joint.other is None else f"{joint.other}{k}",
        coordinates=_names(joint.coordinates, k),
        axes=tuple((f"{first}{k}", f"{second}{k}") for first, second in joint.axes),
        centre=_names(joint.centre, k),
        frames=tuple(_frame(frame, k) for frame in joint.frames),
    )


def _deformer(deformer: Deformer, k: int) -> Deformer:
    frames = tuple(_frame(frame, k) for frame in deformer.frames)
    return replace(deformer, name=f"{deformer.name}{k}", bones=_names(deformer.bones, k), frames=frames)


def main() -> None:
    """Print the curve of either limb, and how many times the time of one limb several take."""
    from adapt.anatomy_file import load_anatomy
    from capture.console import stdout

    for name in ("upper-limb-right", "lower-limb-right"):
        counts, seconds = seconds_by_deformers(load_anatomy(name))
        told = (f"{c} deformers {1e3 * s:.2f} ms ({s / seconds[0]:.2f})" for c, s in zip(counts, seconds, strict=True))
        stdout.print(f"{name}, {POSED} vertices with derivatives: {', '.join(told)}", highlight=False)


if __name__ == "__main__":
    main()
