"""The kinds of facts a limb's data module states; the build programs read nothing else about a limb."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

from adapt.anatomy import Coordinate, Deformer, Floats, Frame, Joint
from adapt.template_builder.coupled_joint import CoupledJoint, Guides, spline_joint
from adapt.template_builder.meshes import Mesh
from adapt.template_builder.pose_bones import Placement
from adapt.template_builder.skin import Cut
from adapt.template_builder.sources_makehuman import SourceSkin
from adapt.template_builder.sources_myosim import Follow, Piece, SourceSkeleton, StatedJoint
from adapt.template_builder.superficial import Spot

Vector = tuple[float, float, float]


@dataclass(frozen=True)
class SkinPlan:
    """Which skin: shape targets with weights, stature (m), where the limb is cut off and any point of it.

    The first cut parts the limb from the body's middle or top; further ones go through what it leaves.
    """

    targets: dict[str, float]
    stature: float
    cuts: tuple[Cut, ...]
    tip: str  # a joint centre's name
    count: int  # vertices, about
    tet_edge: float  # m, of the tetrahedra that fill it


@dataclass(frozen=True)
class BonePlan:
    """One bone of the anatomy: the source bodies it is made of, and how finely.

    ``spacing`` and ``blur`` (m) are those of the level set that closes and smooths the source's surface;
    ``envelope`` (m) is how far a bone of several parts is grown to become one piece for its tetrahedra (0: it is
    one piece already).
    """

    name: str
    bodies: tuple[str, ...]
    count: int
    spacing: float
    blur: float
    envelope: float
    tet_edge: float
    frame: Frame


@dataclass(frozen=True)
class PointPlan:
    """A landmark on a source body.

    how: 'at' the point ``value`` (m) in the body's frame; 'extreme' the vertex farthest along ``value``, among those
    inside ``within``; 'middle' the mean of the vertices inside ``within``; 'sphere' the centre of the sphere that
    fits those vertices. ``within`` is (axis, low, high) in m, in the body's frame.
    """

    name: str
    body: str
    how: Literal["at", "extreme", "middle", "sphere"]
    value: Vector = (0.0, 0.0, 0.0)
    within: tuple[int, float, float] = (0, -9.0, 9.0)


@dataclass(frozen=True)
class AxisPlan:
    """Two landmarks on the axis of a source hinge, at ``distances`` (m) from the hinge's origin along ``axis``.

    The hinge belongs to ``body``, whose origin lies on the axis; ``carrier`` is the body in whose frame ``axis``
    stands: ``body`` itself or its parent, after the hinges ``after`` of ``body`` have turned it.
    """

    names: tuple[str, str]
    body: str
    carrier: str
    axis: Vector
    distances: tuple[float, float]  # m, at the source's size
    after: tuple[str, ...] = ()


@dataclass(frozen=True)
class SplinePlan:
    """A spline joint calibrated from a table: ``parent`` and ``child`` are bones, ``carrier`` is the parent's body."""

    name: str
    table: CoupledJoint
    guides: Guides
    knots: tuple[float, ...]
    parent: str
    child: str
    carrier: str
    coordinate: str
    centre: tuple[str, ...]

    def joint(self, place: Callable[[Floats], Floats]) -> tuple[Joint, dict[str, Floats]]:
        """The joint and its landmarks (3,) m, where ``place`` carries points (N, 3) of the carrier's frame."""
        return spline_joint(
            self.table,
            self.guides,
            place,
            knots=self.knots,
            name=self.name,
            parent=self.parent,
            child=self.child,
            coordinate=self.coordinate,
            centre=self.centre,
        )


@dataclass(frozen=True)
class HandlePlan:
    """A point handle: at the middle of the bone's vertices inside ``within`` of one source body.

    Where a head is made of several bones, ``also`` are further points at which the handle has all the weight.
    """

    name: str
    bone: str
    joint: str
    point: PointPlan
    also: tuple[PointPlan, ...] = ()


@dataclass(frozen=True)
class RampPlan:
    """How much skin counts in fitting along the line from one landmark to another: piecewise linear.

    ``at`` are distances (m) from ``start`` towards ``end``; before the first and beyond the last, ``values`` go on.
    """

    start: str
    end: str
    at: tuple[float, ...]
    values: tuple[float, ...]


@dataclass(frozen=True)
class HeldPart:
    """The part of a bone that holds tissue for a deformer: beyond ``beyond`` (m) from ``start`` towards ``end``.

    It holds what lies inside it and, unless that lies inside another bone, what lies within ``around`` (m) of it: of
    bones that are small beside the tetrahedra there may be no corner inside.

    Between two bones of many small ones (a wrist, an ankle) the skin moves gradually, over more than the joint line.
    Where two deformers share a bone, each holds its own end.
    """

    deformer: str
    bone: str
    start: str
    end: str
    beyond: float
    around: float = 0.0


@dataclass(frozen=True)
class Cushion:
    """Tissue within ``radius`` (m) of a landmark goes with the bone: what covers a bony point stays on it."""

    bone: str
    landmark: str
    radius: float


@dataclass(frozen=True, kw_only=True)
class AnatomyPlan:
    """What every anatomy's plan states.

    For the record: ``upstream``, what the source's bones go back to, and ``facts``, as rows of a table (what, from
    where, under which licence; facts have none), and ``notes``, a paragraph of choices.
    """

    name: str
    side: Literal["right", "left", "both"]
    upstream: tuple[tuple[str, str, str], ...]
    facts: tuple[tuple[str, str], ...]
    notes: str
    bones: tuple[BonePlan, ...]
    points: tuple[PointPlan, ...]
    axes: tuple[AxisPlan, ...]
    splines: tuple[SplinePlan, ...]
    handles: tuple[HandlePlan, ...]
    joints: tuple[Joint, ...]
    coordinates: tuple[Coordinate, ...]
    rest_from: dict[str, tuple[str, float]]  # coordinate: (source hinge, sign)
    deformers: tuple[Deformer, ...]
    held: tuple[HeldPart, ...]
    cushions: tuple[Cushion, ...]  # bones that are not named hold along their whole length
    fit_ramps: tuple[RampPlan, ...]
    spots: tuple[Spot, ...]  # where bones lie just under the skin
    clearance: dict[str, float]  # how near (m) to the skin any vertex of a bone, by name, may come


@dataclass(frozen=True, kw_only=True)
class LimbPlan(AnatomyPlan):
    """All of a limb, which is cut off the source's skin and of which one source skeleton is posed at once."""

    side: Literal["right", "left"]
    skin: SkinPlan
    bodies: tuple[str, ...]
    without: tuple[str, ...]  # meshes of those bodies that are left out
    pieces: tuple[Piece, ...]  # bodies that are taken apart
    follows: dict[str, Follow]  # bodies that follow a table instead of their hinges
    stated: dict[str, StatedJoint]  # bodies whose joints are not the source's
    shifts: dict[str, Vector]  # bodies moved (m) in their parents before posing, to keep joint spaces open
    fit_near_cut: tuple[tuple[float, ...], tuple[float, ...]]  # distance from the cut (m), weight
    pose: Callable[[SourceSkeleton, SourceSkin, Mesh], tuple[dict[str, float], dict[str, Placement]]]
