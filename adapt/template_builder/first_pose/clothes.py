"""Clothes and hair, as skin that stands off the body by a smooth random field, region by region."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from adapt.model.surface import incidence, vertex_normals
from adapt.search.figure.names import PARTS
from adapt.template_builder.first_pose.people import Person, Rig

Floats = NDArray[np.float64]

_LOOSEST = 0.028  # m
_THICKEST_HAIR = 0.05  # m
_WAVES = 5
_UNDRESSED = 0.15  # of all people


class Wardrobe:
    """Dresses people of one rig."""

    def __init__(self, rig: Rig) -> None:
        self._rig = rig
        self._faces = rig.faces.astype(np.int64)
        self._onto = incidence(self._faces, len(rig.used))
        self._regions = {
            name: np.isin(rig.vertex_parts, [PARTS.index(f"{part}_{side}") for part in parts for side in "lr"])
            for name, parts in {
                "upper arms": ("upper_arm",),
                "forearms": ("lower_arm",),
                "thighs": ("thigh",),
                "shanks": ("shank",),
                "feet": ("foot",),
            }.items()
        }
        self._regions["trunk"] = rig.vertex_parts == PARTS.index("trunk")

    def dress(self, rng: np.random.Generator, person: Person) -> Floats:
        """The outer surface (V, 3) m at rest: skin, clothes, hair."""
        outward = vertex_normals(person.skin, self._faces, self._onto)
        off = self._hair(rng, person)
        if rng.random() > _UNDRESSED:
            off += self._looseness(rng) * _field(rng, person.skin)
            off += self._regions["feet"] * rng.uniform(0.0, 0.014)  # shoes
        return np.asarray(person.skin + outward * off[:, None])

    def _looseness(self, rng: np.random.Generator) -> Floats:
        """How far clothes stand off at most (V,) m: a top with or without sleeves, short or long trousers."""
        top, trousers = rng.uniform(0.0, _LOOSEST, 2)
        sizes = {
            "trunk": top * rng.uniform(0.5, 1.0),
            "upper arms": top * (rng.random() < 0.8),
            "forearms": top * 0.7 * (rng.random() < 0.4),
            "thighs": trousers,
            "shanks": trousers * (rng.random() < 0.7),
        }
        loose = np.zeros(len(self._rig.used))
        for name, size in sizes.items():
            loose += self._regions[name] * size
        return loose

    def _hair(self, rng: np.random.Generator, person: Person) -> Floats:
        centre = person.cubes["head-2"]
        x, y = person.skin[:, 0] - centre[0], person.skin[:, 1] - centre[1]
        hairy = (self._rig.vertex_parts == PARTS.index("head")) & ((y > 0.04) | (x < -0.02)) & (x < 0.06)
        return np.asarray(hairy * rng.uniform(0.0, _THICKEST_HAIR) * (rng.random() < 0.7))


def _field(rng: np.random.Generator, points: Floats) -> Floats:
    """A smooth random field (V,) over points (V, 3) m, 0 to 1: a sum of waves of 0.25 to 1.5 m."""
    total = np.zeros(len(points))
    for _ in range(_WAVES):
        wave = rng.normal(0.0, 1.0, 3) * rng.uniform(4.0, 25.0)
        total += np.sin(points @ wave + rng.uniform(0.0, 2.0 * np.pi))
    return np.asarray(np.clip(total / _WAVES + 0.6, 0.0, 1.4) / 1.4)
