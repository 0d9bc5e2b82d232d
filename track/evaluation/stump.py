"""A limb that ends early: the skin beyond a joint is gone, as after an amputation, and a cap closes what is left."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from adapt.anatomy import Floats, Ints
from adapt.model.body import Body, pose_skin


@dataclass(frozen=True, eq=False)
class Stump:
    """A body without the skin that rides mostly on one of ``gone``, its last bones, and how its surface is closed.

    ``faces`` (F, 3) are those of the skin that is left, then the cap's, which all meet in one more vertex, the last.
    """

    body: Body
    faces: Ints = field(repr=False)
    rim: Ints = field(repr=False)

    def at(self, theta: Floats) -> Floats:
        """The vertices (V + 1, 3) m in a pose: the whole skin's, of which some are in no face, and the cap's middle."""
        skin = pose_skin(self.body, theta)
        return np.vstack([skin, skin[self.rim].mean(axis=0)])


def stump(body: Body, gone: tuple[str, ...]) -> Stump:
    """Cut the skin where it comes to ride mostly on the bones that are ``gone``."""
    names = [bone.name for bone in body.anatomy.bones]
    left = body.skin_riding[:, [names.index(name) for name in gone]].sum(axis=1) < 0.5
    kept = body.anatomy.skin_faces[left[body.anatomy.skin_faces].all(axis=1)]
    edges = np.concatenate([kept[:, [0, 1]], kept[:, [1, 2]], kept[:, [2, 0]]])
    whole = {tuple(edge) for edge in edges[:, ::-1].tolist()}
    open_edges = np.array([edge for edge in edges.tolist() if tuple(edge) not in whole])
    tip = np.full((len(open_edges), 1), len(left))
    cap = np.hstack([open_edges[:, ::-1], tip])
    return Stump(body, np.concatenate([kept, cap]), np.unique(open_edges))
