"""Figure 17: what optimising the template's skin adds to the bones' proportions."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from adapt.anatomy import Floats
from adapt.anatomy_file import load_anatomy
from adapt.fit.alternate import adapt_body
from adapt.fit.pose import fit_pose, match_pose
from adapt.match.skin_sample import sample_skin
from adapt.model.body import Body, make_body, pose_skin, posed_bones
from track.accuracy.mesh_distance import distance_to_mesh
from track.evaluation.experiments.drawing import colour_bar, coloured_layers, new_figure, save_figure
from track.evaluation.experiments.experiment import Experiment, Result, markdown_table, summary
from track.evaluation.experiments.stills import disturbed, record_stills
from track.evaluation.known import KnownRecording, centre_errors
from track.observed_bones import Bools
from track.view.render import framing_camera, look_at, render

LIMBS = {"arm": ("upper-limb-right", ("bend-and-twist",)), "leg": ("lower-limb-right", ("walk",))}
_POSES = 12
_ADAPTED = list(range(0, _POSES, 2))  # the others are only posed
_SEEN_M = 0.012
_START_DEG, _START_M = 6.0, 0.015
_LIMIT_MM = 10.0  # of the colours
_POINTS = 600  # of each bone's surface, and of the skin, that are measured
_BARE, _COARSE, _FINE = "proportions alone", "with coarse soft tissue", "with the skin optimised"


def run(case: str, folder: Path) -> Result:
    """Adapt once without and once with algorithm 3, pose all frames, and measure skin and bones by the truth."""
    limb, _, seed = case.partition(" seed ")
    anatomy_name, motions = LIMBS[limb]
    known = record_stills(anatomy_name, motions, _POSES, folder / "recording", seed=int(seed))
    seen = _seen(known)
    return {name: _scored(known, body, seen) for name, body in _stages(known, int(seed)).items()}


def _stages(known: KnownRecording, seed: int) -> dict[str, Body]:
    """The bodies to compare; the first two have the same proportions."""
    anatomy, targets = known.body.anatomy, known.targets(_ADAPTED)
    starts = disturbed(anatomy, known.thetas[_ADAPTED], seed, degrees=_START_DEG, metres=_START_M)
    coarse = adapt_body(make_body(anatomy), targets, starts, optimise_skin=False).body
    fine = adapt_body(make_body(anatomy), targets, starts).body
    return {_BARE: make_body(anatomy, shape=coarse.shape), _COARSE: coarse, _FINE: fine}


def _seen(known: KnownRecording) -> Bools:
    """Which skin vertices (V,) of the true body, truly posed, find a point of a cloud that is adapted to."""
    seen = np.zeros(len(known.body.v_hat), dtype=bool)
    for target, theta in zip(known.targets(_ADAPTED), known.thetas[_ADAPTED], strict=True):
        seen[match_pose(known.body, target, theta, sample_skin(known.body.anatomy), gate_m=_SEEN_M).vertex] = True
    return seen


def _scored(known: KnownRecording, body: Body, seen: Bools) -> Result:
    """Pose the body in every frame, from the true pose, and measure."""
    sample = sample_skin(body.anatomy)
    pairs = zip(known.targets(list(range(_POSES))), known.thetas, strict=True)
    thetas = np.array([fit_pose(body, target, true, sample).theta for target, true in pairs])
    skin = np.array([_skin_mm(body, a, known.body, b) for a, b in zip(thetas, known.thetas, strict=True)])
    bones = [_bones_mm(body, a, known.body, b) for a, b in zip(thetas, known.thetas, strict=True)]
    counted = body.anatomy.fit_weight > 0.5
    centres = centre_errors(body, thetas, known.body, known.thetas)
    return {
        "skin, poses adapted to": skin[::2, counted].mean(axis=1).tolist(),
        "skin, other poses": skin[1::2, counted].mean(axis=1).tolist(),
        "skin that was seen, all poses": skin[:, counted & seen].mean(axis=1).tolist(),
        "skin never seen, all poses": skin[:, counted & ~seen].mean(axis=1).tolist(),
        **{f"surface {name}": [bone[name] for bone in bones] for name in bones[0]},
        **{f"centre {name}": (1e3 * values).tolist() for name, values in centres.items()},
        "by vertex": skin.mean(axis=0).round(2).tolist(),
    }


def _skin_mm(body: Body, theta: Floats, true_body: Body, true_theta: Floats) -> Floats:
    """Distance (V,) of every skin vertex to the true skin."""
    return 1e3 * distance_to_mesh(pose_skin(body, theta), pose_skin(true_body, true_theta), body.anatomy.skin_faces)


def _bones_mm(body: Body, theta: Floats, true_body: Body, true_theta: Floats) -> dict[str, float]:
    """Mean distance of some points of every bone to the true bone's surface."""
    bones, true = posed_bones(body, theta), posed_bones(true_body, true_theta)
    some = {name: points[:: max(1, len(points) // _POINTS)] for name, points in bones.items()}
    return {
        bone.name: 1e3 * float(distance_to_mesh(some[bone.name], true[bone.name], bone.faces).mean())
        for bone in body.anatomy.bones
    }


def describe(results: Mapping[str, Result], images: Path) -> str:
    """A table and a picture for each limb."""
    parts = [_limb(limb, {c: r for c, r in results.items() if c.startswith(f"{limb} ")}, images) for limb in LIMBS]
    return f"""Random subjects in {_POSES} poses, two Carmine sensors; bodies are adapted to every second pose, from
first poses off by up to {_START_DEG:g} degrees and {100 * _START_M:g} cm, and then posed in all of them, from the true
pose. "{_BARE}" has the second column's bones and the template's skin. Our step for the proportions already moves soft
tissue in 150 smooth modes, which the paper's does not: the second column is therefore not the paper's "before", and the
first is kinder than the paper's, because its bones did not have to explain the flesh. Errors in mm, mean ± SD (maximum)
over poses; skin and bone surfaces are distances of points to the nearest place of the true surface, centres are of
joints. Skin counts as seen where the true body finds a point of a cloud that is adapted to. The simulated tissue is
smooth over 4 cm and as thick as our prior expects, so the smooth modes can nearly express it, which flatters the second
column: real flesh may leave more to the last step. We have no numbers of the paper's to set beside these.

{"".join(parts).strip()}
"""


def _limb(limb: str, results: Mapping[str, Result], images: Path) -> str:
    if not results:
        return ""
    stages = list(next(iter(results.values())))
    kinds = [kind for kind in next(iter(results.values()))[stages[0]] if kind != "by vertex"]
    rows = [[f"{limb} ({len(results)} subjects)", *stages]]
    for kind in kinds:
        rows.append([kind, *(summary(np.concatenate([r[stage][kind] for r in results.values()])) for stage in stages)])
    name = f"figure-17-skin-{limb}.png"
    _draw(limb, next(iter(results.values())), images / name)
    caption = f"Distance of the {limb}'s skin to the true skin, mean over poses, on the template"
    return f"{markdown_table(rows)}\n\n![{caption}](images/{name})\n\n"


def _draw(limb: str, result: Result, path: Path) -> None:
    """The template's skin from both sides, coloured by how far each vertex lies from the true skin."""
    anatomy = load_anatomy(LIMBS[limb][0])
    skin, up = anatomy.skin_vertices, np.array([0.0, 1.0, 0.0])
    figure = new_figure(9.0, 6.5)
    panels = figure.subplots(2, len(result))
    for row, side in zip(panels, (1.0, -1.0), strict=True):
        eye = look_at(skin, np.array([side, 0.1, 0.3]), up)
        camera = framing_camera(eye, skin, width=360, height=420)
        for axes, (stage, errors) in zip(row, result.items(), strict=True):
            values = np.array(errors["by vertex"])
            axes.imshow(render(coloured_layers(skin, anatomy.skin_faces, values, limit=_LIMIT_MM), eye, camera))
            axes.set_title(stage, fontsize="medium")
            axes.axis("off")
    colour_bar(figure, panels, limit=_LIMIT_MM, label="distance to the true skin (mm)")
    save_figure(figure, path)


EXPERIMENT = Experiment(
    "figure-17-skin",
    "Figure 17: before and after the skin is optimised",
    ("arm seed 1", "leg seed 1", "arm seed 2", "leg seed 2", "arm seed 3", "leg seed 3"),
    run,
    describe,
)
