"""Virtual markers: what a motion capture laboratory would see of a body, stuck on the skin at the usual places.

A marker is a skin vertex, so it moves with the skin over the bone. ``marker_sets/NAME.json`` says where: the skin
that a ray comes to first, from a place among the landmarks ("at", with weights) in a direction of the bone's frame
("toward"; X forward, Y up, Z right); the bone that a model carries the marker on; its weights in a static trial and in
motion; and pairs of markers whose distances scale a bone along its axes.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from adapt.anatomy import Anatomy, Floats, Ints
from adapt.mirror import mirrored_name
from adapt.model.body import Body, make_body, pose_skin
from adapt.model.frames import frame_from_landmarks
from track.export.osim import Marker
from track.simulation.performance import PerformanceError

_BEHIND_M = 0.005  # a bony landmark may lie this far outside the skin's vertices
_FORWARD = 0.3  # what a metre along the ray counts beside a metre off it
_COUNTED = 0.5  # of fit_weight: a marker does not sit on the cut where the limb ends


@dataclass(frozen=True)
class VirtualMarker:
    """A skin vertex, the bone that a model carries it on, and its weights in inverse kinematics."""

    name: str
    bone: str
    vertex: int
    static_weight: float
    motion_weight: float


@dataclass(frozen=True)
class MarkerSet:
    """Markers, and by bone and axes ("X Z") the pairs of markers whose distances give the scale."""

    markers: tuple[VirtualMarker, ...]
    measurements: dict[str, dict[str, list[list[str]]]]

    @property
    def vertices(self) -> Ints:
        """The skin vertices (M,)."""
        return np.array([marker.vertex for marker in self.markers])


def marker_set(anatomy: Anatomy) -> MarkerSet:
    """The marker set of an anatomy, or of its mirror image.

    Raises:
        PerformanceError: there is none.
    """
    folder = Path(__file__).parent / "marker_sets"
    paths = [folder / f"{name}.json" for name in (anatomy.name, mirrored_name(anatomy.name))]
    path = next((path for path in paths if path.is_file()), None)
    if path is None:
        raise PerformanceError(f"no markers for {anatomy.name}", where=folder, remedy="write a marker set")
    description = json.loads(path.read_text(encoding="utf-8"))
    across = 1.0 if path == paths[0] else -1.0  # z points to the body's right on both sides
    template = make_body(anatomy)
    markers = (_marker(template, name, parts, across) for name, parts in description["markers"].items())
    return MarkerSet(tuple(markers), description["measurements"])


def _marker(template: Body, name: str, parts: dict[str, Any], across: float) -> VirtualMarker:
    anatomy = template.anatomy
    place = sum(share * anatomy.landmarks[anatomy.landmark_index(landmark)] for landmark, share in parts["at"].items())
    frame = frame_from_landmarks(anatomy, anatomy.bone(parts["bone"]).frame, template.p)
    direction = frame.rotation @ (np.array(parts["toward"]) * [1.0, 1.0, across])
    away = anatomy.skin_vertices - place
    forward = away @ (direction / np.linalg.norm(direction))
    aside = np.sqrt(np.maximum((away**2).sum(axis=1) - forward**2, 0.0))
    off = np.where((forward > -_BEHIND_M) & (anatomy.fit_weight > _COUNTED), aside + _FORWARD * forward, np.inf)
    vertex = int(np.argmin(off))
    return VirtualMarker(name, parts["bone"], vertex, *parts["weights"])


def misplaced(markers: MarkerSet, anatomy: Anatomy, *, deviation_m: float, rng: np.random.Generator) -> MarkerSet:
    """Markers as a hand sticks them: on the skin vertex nearest to the right place plus an isotropic normal error."""
    skin = anatomy.skin_vertices
    meant = skin[markers.vertices] + deviation_m * rng.normal(size=(len(markers.markers), 3))
    stuck = cKDTree(skin).query(meant)[1]
    moved = (replace(marker, vertex=int(v)) for marker, v in zip(markers.markers, stuck, strict=True))
    return replace(markers, markers=tuple(moved))


def markers_at_rest(body: Body, markers: MarkerSet) -> dict[str, Marker]:
    """Where the body's skin carries the markers at rest: a model's markers."""
    skin = body.v_tilde.value
    return {marker.name: Marker(marker.bone, skin[marker.vertex]) for marker in markers.markers}


def marker_trial(
    body: Body, thetas: Floats, markers: MarkerSet, *, noise_m: float, rng: np.random.Generator
) -> dict[str, Floats]:
    """Trajectories (T, 3) in metres by name, of a moving body's markers, measured with isotropic noise."""
    index = markers.vertices
    seen = np.array([pose_skin(body, theta, vertices=index) for theta in thetas])
    seen += noise_m * rng.normal(size=seen.shape)
    return {marker.name: seen[:, k] for k, marker in enumerate(markers.markers)}
