"""Figures 10 and 11: what four ways of moving a forearm's skin do to it while the forearm turns."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from adapt.anatomy import Deformer, Floats, Ints
from adapt.anatomy_file import load_anatomy
from adapt.model.body import Body, make_body, pose_skin, posed_bones, rest_theta
from capture._open3d import open3d
from track.evaluation.bones import depth_inside
from track.evaluation.elastic import make_elastic
from track.evaluation.experiments.drawing import new_figure, save_figure
from track.evaluation.experiments.experiment import Experiment, Result, markdown_table
from track.evaluation.sections import Sections, sections
from track.evaluation.skinning import bone_weights, bound_to, dual_quaternions, forearm_line, linear_blending
from track.view.render import SKIN, Layer, framing_camera, look_at, render

LEVELS = np.linspace(0.10, 0.95, 69)  # shares of the way from the elbow's to the wrist's middle
_ANATOMY, _ANGLES = "upper-limb-right", (-90.0, -60.0, -30.0, 0.0, 30.0, 60.0, 90.0)
_STEP_DEG = 10.0  # elasticity is turned by so much at a time
_WRIST = 1.05  # of the way from elbow to wrist: where the forearm's triangles end

Method = Callable[[Body, Floats, Floats], Floats]
"""Skin (V, 3) of a body in a pose, bound in another: ``method(body, theta, bound)``."""


def ours(body: Body, theta: Floats, bound: Floats) -> Floats:
    """The model itself; it needs no skin to be bound to."""
    return pose_skin(body, theta)


def blended(how: Callable[[Floats, Floats, Floats], Floats]) -> Method:
    """Skin posed by blending bones, from the model's skin in the pose ``bound``."""

    def method(body: Body, theta: Floats, bound: Floats) -> Floats:
        return how(pose_skin(body, bound), bone_weights(body), bound_to(body, bound, theta))

    return method


def elastic(body: Body, theta: Floats, bound: Floats) -> Floats:
    """The limb as a solid that is as rigid as possible around its bones, turned from ``bound`` in small steps."""
    flesh = make_elastic(body.anatomy)
    steps = max(1, int(np.ceil(np.rad2deg(np.abs(theta - bound).max()) / _STEP_DEG)))
    for share in np.linspace(0.0, 1.0, steps + 1)[1:]:
        flesh.move(body, bound + share * (theta - bound))
    return flesh.skin()


METHODS: dict[str, Method] = {
    "forearm deformer": ours,
    "linear blending": blended(linear_blending),
    "dual quaternions": blended(dual_quaternions),
}
_ALL: dict[str, Method] = METHODS | {"elasticity": elastic}


@dataclass(frozen=True, eq=False)
class Twist:
    """One method at one angle: posed skin (V, 3) and its sections, relative to the rest skin's."""

    method: str
    angle: float  # degrees
    skin: Floats = field(repr=False)
    sections: Sections = field(repr=False)
    area: Floats = field(repr=False)  # (L,) relative to rest
    volume: float  # relative to rest


def measure(body: Body, method: str, angle: float, bound: Floats) -> Twist:
    """Pose the rest body with pro_sup at ``angle`` (degrees) and slice its forearm."""
    theta = with_twist(body, angle)
    skin = _ALL[method](body, theta, bound)
    rest, posed = forearm_sections(body, body.v_tilde.value, rest_theta(body)), forearm_sections(body, skin, theta)
    return Twist(method, angle, skin, posed, posed.areas / rest.areas, posed.volume() / rest.volume())


def with_twist(body: Body, angle: float) -> Floats:
    """The rest pose with pro_sup at ``angle`` (degrees)."""
    theta = rest_theta(body)
    theta[body.anatomy.coordinate_index("pro_sup")] = np.deg2rad(angle)
    return theta


def forearm_sections(body: Body, skin: Floats, theta: Floats) -> Sections:
    """Slices from the middle of the elbow to the middle of the wrist, where the bones have carried them."""
    return sections(skin, body.anatomy.skin_faces, *forearm_line(body, theta), LEVELS)


def run(case: str, folder: Path) -> Result:
    """One method over the whole range of rotation."""
    body = make_body(load_anatomy(_ANATOMY))
    bound = rest_theta(body)
    twists = [measure(body, case, angle, bound) for angle in _ANGLES]
    rest_deg = float(np.rad2deg(bound[body.anatomy.coordinate_index("pro_sup")]))
    farthest = max(twists, key=lambda twist: abs(twist.angle - rest_deg))
    return {
        "rest_deg": rest_deg,
        "rest_bow_mm": 1e3 * float(forearm_sections(body, body.v_tilde.value, bound).bow().max()),
        "rest_crossing": crossing_triangles(body.v_tilde.value, _forearm_faces(body)),
        "twists": [_measured(body, twist) for twist in twists],
        "farthest": {
            "angle": farthest.angle,
            "area": farthest.area.round(4).tolist(),
            "bow_mm": (1e3 * farthest.sections.bow()).round(3).tolist(),
            "skin_mm": (1e3 * farthest.skin).round(1).tolist(),
        },
    }


def _measured(body: Body, twist: Twist) -> Result:
    bones = posed_bones(body, with_twist(body, twist.angle))
    inner = np.concatenate([bones[name] for name in _forearm(body).bones])
    return {
        "angle": twist.angle,
        "least": float(twist.area.min()),
        "most": float(twist.area.max()),
        "volume": twist.volume,
        "bow_mm": 1e3 * float(twist.sections.bow().max()),
        "crossing": crossing_triangles(twist.skin, _forearm_faces(body)),
        "cover_mm": 1e3 * float(depth_inside(inner, twist.skin, body.anatomy.skin_faces).min()),
    }


def _forearm_faces(body: Body) -> Ints:
    """The triangles (K, 3) of the skin between elbow and wrist."""
    start, end = forearm_line(body, rest_theta(body))
    along = (body.v_tilde.value - start) @ (end - start) / ((end - start) @ (end - start))
    moved = body.anatomy.deformer_weights[:, body.anatomy.deformers.index(_forearm(body))] > 0.5
    return np.asarray(
        body.anatomy.skin_faces[(moved & (along > 0.0) & (along < _WRIST))[body.anatomy.skin_faces].all(1)]
    )


def _forearm(body: Body) -> Deformer:
    return next(deformer for deformer in body.anatomy.deformers if deformer.type == "forearm")


def crossing_triangles(vertices: Floats, faces: Ints) -> int:
    """How many triangles of a surface (V, 3), (F, 3) cut another one."""
    geometry, utility = open3d().geometry, open3d().utility
    mesh = geometry.TriangleMesh(utility.Vector3dVector(vertices), utility.Vector3iVector(faces.astype(np.int32)))
    return len(np.unique(np.asarray(mesh.get_self_intersecting_triangles())))


def describe(results: Mapping[str, Result], images: Path) -> str:
    """The methods at both ends of the range, and where they are worst."""
    first = next(iter(results.values()))
    titles = ["pro_sup (deg)", "least section (%)", "most (%)", "volume (%)", "bow (mm)", "crossing", "cover (mm)"]
    rows = [["method", *titles]]
    for name, result in results.items():
        for twist in result["twists"]:
            if twist["angle"] in (_ANGLES[0], 0.0, _ANGLES[-1]):
                shares = [f"{100 * twist[key]:.1f}" for key in ("least", "most", "volume")]
                rest = [f"{twist['bow_mm']:.1f}", str(twist["crossing"]), f"{twist['cover_mm']:.1f}"]
                rows.append([name, f"{twist['angle']:+.0f}", *shares, *rest])
    name = "figure-10-forearm.png"
    _draw(results, images / name)
    return f"""The template's forearm, bound at rest ({first["rest_deg"]:.0f} degrees of pro_sup, which counts pronation
as positive) and turned from -90 to 90 degrees: nothing random, so no seeds. Linear blending and dual quaternions have
the deformer's own ramp along the forearm as weights. Elasticity is libigl's as-rigid-as-possible energy on the limb's
tetrahedra: corotated elasticity without resistance to a change of volume. Points inside a bone move with it; the rest,
skin included, is free; it is turned {_STEP_DEG:g} degrees at a time. Flesh sticks to bone in it, as it does not in a
real forearm, so it shows what this energy does and not what tissue does.

Sections are perpendicular to the line from elbow to wrist, from 10 to 95 per cent of the way, in per cent of the area
at rest. Bow is how far the line of their centroids leaves its chord; at rest it is {first["rest_bow_mm"]:.1f} mm.
Crossing counts the triangles of the forearm's skin that cut another ({first["rest_crossing"]} at rest). Cover is the
least depth of ulna and radius below the skin; negative where a bone comes through.

{markdown_table(rows)}

Bound at rest, dual quaternions keep the sections as well as the deformer does, and their centre line is straighter over
the middle of the range; it leaves its chord farther at full supination, where the carrying angle shows. Linear blending
is the straightest there because it has lost the forearm that could bow. So the deformer's advantage over dual
quaternions is a small one on this limb; over the other two it is large. From the whole
twist at once dual quaternions do worse: see [model.md](model.md) and `docs/figures/forearm_twist.py` for that with the
first three methods. We have no numbers of the paper's to set beside these.

![Forearms turned farthest from rest, section areas and least section over the range](images/{name})
"""


def _draw(results: Mapping[str, Result], path: Path) -> None:
    """Rendered forearms above; below, section areas there, and least section and bow over the range."""
    body = make_body(load_anatomy(_ANATOMY))
    figure = new_figure(2.9 * max(len(results), 3), 6.6)
    above, below = figure.subfigures(2, 1)
    panels = above.subplots(1, len(results), squeeze=False)[0]
    area, least, bow = below.subplots(1, 3)
    for axes, (name, result) in zip(panels, results.items(), strict=True):
        farthest = result["farthest"]
        axes.imshow(_rendered(body, 1e-3 * np.array(farthest["skin_mm"]), with_twist(body, farthest["angle"])))
        axes.set_title(f"{name}, {farthest['angle']:+.0f} deg", fontsize="medium")
        axes.axis("off")
        angles = [twist["angle"] for twist in result["twists"]]
        area.plot(100 * LEVELS, 100 * np.array(farthest["area"]), label=name)
        least.plot(angles, [100 * twist["least"] for twist in result["twists"]], ".-")
        bow.plot(angles, [twist["bow_mm"] for twist in result["twists"]], ".-")
    area.set(xlabel="elbow to wrist (%)", ylabel="section area (% of rest)")
    least.set(xlabel="pro_sup (deg)", ylabel="least section (% of rest)")
    bow.set(xlabel="pro_sup (deg)", ylabel="bow of the centre line (mm)")
    area.legend(fontsize="small")
    for axes in (area, least, bow):
        axes.grid(alpha=0.3)
        axes.set_ylim(0.0, None)
    save_figure(figure, path)


def _rendered(body: Body, skin: Floats, theta: Floats) -> NDArray[np.uint8]:
    """The forearm from the side."""
    start, end = forearm_line(body, theta)
    t = (skin - start) @ (end - start) / ((end - start) @ (end - start))
    around, up = skin[(t > -0.15) & (t < 1.5)], np.array([0.0, 1.0, 0.0])
    eye = look_at(around, np.cross(end - start, up), up)
    camera = framing_camera(eye, around, width=420, height=420)
    return render([Layer(skin, body.anatomy.skin_faces, SKIN)], eye, camera)


EXPERIMENT = Experiment("figure-10-forearm", "Figures 10 and 11: ways to turn a forearm", tuple(_ALL), run, describe)
