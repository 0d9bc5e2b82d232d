"""How well our handles reach the femurs and tibias of real people, beside simpler ways to fit a bone to a person."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache, partial
from pathlib import Path

import igl
import numpy as np
from numpy.typing import NDArray

from adapt.anatomy import Anatomy, Bone
from adapt.anatomy_file import load_anatomy
from adapt.model.handles import d_deform_d_shape, deform, handle_positions
from adapt.model.surface import submesh
from adapt.template_builder.meshes import Mesh
from track.accuracy.mesh_distance import distance_to_mesh
from track.evaluation.experiments.experiment import Experiment, Result, markdown_table, summary
from track.evaluation.experiments.surface_fit import (
    Family,
    SurfaceFit,
    affine,
    fit_family,
    greatest_length,
    read_mesh,
    rigid,
    uniform_scale,
)
from track.view.render import BONE, Layer, framing_camera, look_at, render, save_png

NAME, TITLE = "real-bones", "Real femurs and tibias within reach of the handles"
ANATOMY, BONES = "lower-limb-right", ("femur", "tibia")
SUBJECTS = ("subject03", "subject16", "subject20", "subject22", "subject24")
DRAWN = ("random0", "random1", "random2", "random3", "random4")
_FOLDER = "msk_bone_shapes"
PICTURED = "subject24"
POINTS = 3000
BANDS = (
    (1.0, BONE),
    (2.0, (0.98, 0.85, 0.40)),
    (4.0, (0.95, 0.60, 0.20)),
    (8.0, (0.85, 0.25, 0.15)),
    (np.inf, (0.50, 0.15, 0.55)),
)  # mm, colour
CREDIT = "Real bones: shape model of the package musculoskeletal-models (Auckland Bioengineering Institute), MPL-2.0."


def handles(anatomy: Anatomy, name: str) -> tuple[Mesh, Family]:
    """A bone's largest part (of tibia and fibula the tibia), and what the bone's own handles make of it."""
    bone = anatomy.bone(name)
    kept = _largest_part(bone)
    mesh, weights = Mesh(*submesh(bone.vertices, bone.faces, kept)), bone.handle_weights[kept]
    positions = handle_positions(anatomy)
    own = np.repeat([handle.bone == name for handle in anatomy.handles], 4)
    nothing = np.zeros((len(positions), 4))
    basis = d_deform_d_shape(mesh.vertices, weights, positions, np.eye(len(own)))[:, :, own]
    start = np.tile([1.0, 0.0, 0.0, 0.0], own.sum() // 4)
    return mesh, Family(deform(mesh.vertices, weights, positions, nothing), basis, start)


def _largest_part(bone: Bone) -> NDArray[np.bool_]:
    _, label = igl.facet_components(bone.faces)
    kept = np.zeros(len(bone.vertices), dtype=np.bool_)
    kept[bone.faces[label == np.argmax(np.bincount(label))]] = True
    return kept


WAYS: dict[str, Callable[[Mesh], Family]] = {
    "as it is": rigid,
    "one uniform scale": uniform_scale,
    "one affine map": affine,
}


@lru_cache(maxsize=2)
def _template(name: str) -> tuple[Mesh, dict[str, Family]]:
    """The bone, and the families to fit: the ways above, and our handles."""
    mesh, ours = handles(load_anatomy(ANATOMY), name)
    return mesh, {**{way: family(mesh) for way, family in WAYS.items()}, "our handles": ours}


def _fits(data: Path, case: str, name: str) -> dict[str, SurfaceFit]:
    mesh, families = _template(name)
    target = _real(data, case, name)
    return {way: fit_family(mesh, family, target, points=POINTS) for way, family in families.items()}


def _real(data: Path, case: str, name: str) -> Mesh:
    return read_mesh(data / _FOLDER / case / f"{name}.ply")


def run(case: str, folder: Path, *, data: Path) -> Result:
    """Mean, 95 % and greatest distance (mm) of every way, bone by bone; a picture of one person."""
    fits = {name: _fits(data, case, name) for name in BONES}
    result: Result = {name: {way: _scored(fit) for way, fit in of_bone.items()} for name, of_bone in fits.items()}
    result["lengths_mm"] = {name: 1e3 * greatest_length(_real(data, case, name)) for name in BONES}
    if case == PICTURED:
        panels = [_panel(_template(name)[0], fit, data, case, name) for name in BONES for fit in fits[name].values()]
        result["picture"] = str(folder / "distances.png")
        save_png(np.concatenate(panels, axis=1), folder / "distances.png")
    return result


def _scored(fit: SurfaceFit) -> dict[str, float]:
    mean, p95, most = fit.distances.mean(), np.percentile(fit.distances, 95), fit.distances.max()
    return {"freedom": fit.freedom, "mean_mm": 1e3 * mean, "p95_mm": 1e3 * p95, "max_mm": 1e3 * most}


def _panel(mesh: Mesh, fit: SurfaceFit, data: Path, case: str, name: str) -> NDArray[np.uint8]:
    """The fitted bone from behind, each face coloured by its distance from the real one."""
    target = _real(data, case, name)
    off = 1e3 * distance_to_mesh(fit.vertices[mesh.faces].mean(axis=1), target.vertices, target.faces)
    band = np.searchsorted([limit for limit, _ in BANDS[:-1]], off)
    layers = [
        Layer(fit.vertices, mesh.faces[band == k], colour) for k, (_, colour) in enumerate(BANDS) if (band == k).any()
    ]
    along = np.linalg.eigh(np.cov(target.vertices.T))[1]
    eye = look_at(target.vertices, along[:, 0], along[:, 2], distance_m=3.0)
    return render(layers, eye, framing_camera(eye, target.vertices, width=110, height=440))


def describe(results: Mapping[str, Result], images: Path) -> str:
    """A table of the subjects, one by one, and one of the random shapes together."""
    rows = [["surface distance: mean / 95 % / maximum (mm)", *_ways(results)]]
    for name in BONES:
        rows += [[f"{name}, {case}", *_cells(results, [case], name)] for case in SUBJECTS if case in results]
        for title, cases in (("the subjects' mean", SUBJECTS), ("the random shapes' mean", DRAWN)):
            known = [case for case in cases if case in results]
            rows += [[f"**{name}, {title}** (n = {len(known)})", *_cells(results, known, name)]] if known else []
    count = {title: sum(case in results for case in cases) for title, cases in (("s", SUBJECTS), ("r", DRAWN))}
    return f"""{count["s"]} people's femurs and tibias from computed tomography, and {count["r"]} random members of the
shape model that was made of 26 people. Each is fitted by the template's bone alone, moved rigidly and changed in one
of four ways (in brackets: free numbers), by iterated closest points over both surfaces, {POINTS} points of each.
Distances are from both surfaces' points to the other surface. This is what the handles can reach at best: no skin, no
noise, no neighbour that shares a joint's handle. It is not a test of adaptation.

{markdown_table(rows)}

{_lengths(results)}

What our handles leave is the form of the heads, which they only scale, and the bow of the shaft. An affine map does no
better on the whole, and it would shear the joints' surfaces.
{_figure(results, images)}
"""


def _lengths(results: Mapping[str, Result]) -> str:
    """How long the bones are, the template's and the people's: handles start from the template's proportions."""
    ours = np.array([1e3 * greatest_length(_template(name)[0]) for name in BONES])
    real = np.array([[r["lengths_mm"][name] for name in BONES] for c, r in results.items() if c in SUBJECTS])
    if not len(real):
        return ""
    share = real[:, 1] / real[:, 0]
    return f"""Greatest lengths (mm): the people's femurs {summary(real[:, 0], digits=0)} and tibias
{summary(real[:, 1], digits=0)}; the template's {ours[0]:.0f} and {ours[1]:.0f}. Their tibias have {share.min():.2f} to
{share.max():.2f} of their femurs' length, the template's has {ours[1] / ours[0]:.2f}."""


def _ways(results: Mapping[str, Result]) -> list[str]:
    first = next(iter(results.values()))[BONES[0]]
    return [f"{way} ({first[way]['freedom']})" for way in first]


def _cells(results: Mapping[str, Result], cases: Sequence[str], name: str) -> list[str]:
    def mean(way: str, what: str) -> float:
        return float(np.mean([results[case][name][way][what] for case in cases]))

    keys = ("mean_mm", "p95_mm", "max_mm")
    return [" / ".join(f"{mean(way, key):.1f}" for key in keys) for way in results[cases[0]][name]]


def _figure(results: Mapping[str, Result], images: Path) -> str:
    drawn = [Path(result["picture"]) for result in results.values() if "picture" in result]
    if not drawn or not drawn[0].is_file():
        return ""
    images.mkdir(parents=True, exist_ok=True)
    shutil.copy(drawn[0], images / "real-bones.png")
    return f"""
![Fitted femur and tibia of one person, coloured by distance](images/real-bones.png)

{PICTURED}: femur, then tibia, each as it is, with one uniform scale, with one affine map, with our handles. Up to 1 mm
from the real bone: bone colour; up to 2: yellow; 4: orange; 8: red; more: violet.
{CREDIT}
"""


def experiment(data: Path) -> Experiment:
    """The experiment on the bones below ``data``."""
    return Experiment(NAME, TITLE, (*SUBJECTS, *DRAWN), partial(run, data=data), describe)
