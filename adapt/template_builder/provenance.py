"""The record that stands beside a template: what it was built from, how it was changed, what was measured."""

from __future__ import annotations

from datetime import date
from importlib.metadata import version
from pathlib import Path

import numpy as np

from adapt.anatomy import Anatomy
from adapt.template_builder.check import Check
from adapt.template_builder.depth_checks import spot_depths
from adapt.template_builder.plan import LimbPlan
from adapt.template_builder.sources_makehuman import PACKAGE as SKIN_PACKAGE
from adapt.template_builder.sources_myosim import MODEL, PACKAGE
from adapt.template_builder.superficial import Spot
from capture.files import replaced_when_complete

BASE_MESH = """\
The base mesh is copyright 2020 Data Collection AB, Joel Palmius and Jonas Hauquier, and was released as CC0 in
September 2020."""

_COMPUTED = """\
- Joint axes, landmarks and handles moved with the bones. Weights and tetrahedra were computed by this program. The
  tetrahedra come out otherwise each time they are made (`findings/pytetwild_one_thread_not_repeatable.sh`), and
  the weights with them: from one build to the next a weight differs by up to 0.12, and with it what the checks of
  moving bones say."""


def write_provenance(
    anatomy: Anatomy, plan: LimbPlan, pose: dict[str, float], checks: list[Check], folder: Path
) -> None:
    """Write ``<name>.md`` into ``folder``."""
    with replaced_when_complete(folder / f"{plan.name}.md") as partial:
        partial.write_text(_text(anatomy, plan, pose, checks), encoding="utf-8")


def _text(anatomy: Anatomy, plan: LimbPlan, pose: dict[str, float], checks: list[Check]) -> str:
    targets = ", ".join(f"`{name}` x {weight:.3g}" for name, weight in plan.skin.targets.items())
    rest = ", ".join(f"`{c.name}` {np.degrees(c.rest):.1f}" for c in anatomy.coordinates if c.name in plan.rest_from)
    scales = {name: np.exp(value) for name, value in pose.items() if name.startswith("log_")}
    upstream = "\n".join(f"| {what} | {where} | {licence} |" for what, where, licence in plan.upstream)
    facts = "\n".join(f"| {what} | {where} | facts |" for what, where in plan.facts)
    return f"""# {plan.name}

Built by `python -m adapt.template_builder {plan.name}` on {date.today().isoformat()}.

## Sources

| what | from | licence |
|---|---|---|
| {"bones" if plan.stated else "bones, joint axes"} | PyPI `{PACKAGE}` {version(PACKAGE)}, model `{MODEL}` | Apache-2.0, see `LICENSE-myo-sim.txt` |
{upstream}
| skin, its joint centres | MakeHuman base mesh hm08 and shape targets, CC0, as packed in PyPI `{SKIN_PACKAGE}` \
{version(SKIN_PACKAGE)} (whose code was not used) | CC0-1.0, see `LICENSE-makehuman.md` |
{facts}

{BASE_MESH} Shape targets and their weights: {targets}; the body scaled to a stature of {plan.skin.stature} m.

## What was changed

- Skin: axes turned to X forward, Y up, Z right; metres; Catmull-Clark subdivision; cut off by {_planes(plan)}, closed
  with flat caps; resampled to {len(anatomy.skin_vertices)} evenly spread vertices; then moved along its normals,
  smoothly, by up to 14 mm (leg) and 8 mm (arm), until bones lie as deep as in the table below, and clear.
- Bones: holes closed and facets rounded by a level set where the source is open or coarse; simplified; posed into the
  skin by its joints and one scale per group of bones (across and along the shaft); some parts joined
  to one rigid bone; bodies moved in their parents (m, at the source's size): {plan.shifts or "none"}; meshes left
  out: {", ".join(plan.without) or "none"}.
{_COMPUTED}

{plan.notes}
Rest pose (degrees): {rest}.

Other angles in which the source's bodies stand at rest (degrees): {_askew(plan, pose) or "none"}.

Scales: {", ".join(f"{name.removeprefix('log_')} {value:.3f}" for name, value in scales.items())}.

Vertices: skin {len(anatomy.skin_vertices)}, {", ".join(f"{bone.name} {len(bone.vertices)}" for bone in anatomy.bones)}.
Tetrahedra: {", ".join(f"{name} {len(parts[1])}" for name, parts in anatomy.tetrahedra.items())}.

{_depths(anatomy, plan)}
## Checks at build time

| check | measured | limit | unit |
|---|---|---|---|
{chr(10).join(check_row(check) for check in checks)}
"""


def _planes(plan: LimbPlan) -> str:
    return "a plane" if len(plan.skin.cuts) == 1 else f"{len(plan.skin.cuts)} planes"


def _depths(anatomy: Anatomy, plan: LimbPlan) -> str:
    rows = "\n".join(_depth_row(spot, depth) for spot, depth in spot_depths(anatomy, plan))
    return f"""## Depths beneath the skin

The shallowest vertex of the bone there. Assumptions are marked as such.

| where | here, mm | in people, mm | known from |
|---|---|---|---|
{rows}
"""


def _askew(plan: LimbPlan, pose: dict[str, float]) -> str:
    """The hinges' angles (degrees) that are no coordinate's rest."""
    in_rest = {hinge for hinge, _ in plan.rest_from.values()}
    return ", ".join(
        f"{name} {np.degrees(value):.1f}"
        for name, value in pose.items()
        if name not in in_rest and not name.startswith(("log_", "root_"))
    )


def _depth_row(spot: Spot, depth: float) -> str:
    return f"| {spot.name} | {1e3 * depth:.1f} | {1e3 * spot.low:.1f} to {1e3 * spot.high:.1f} | {spot.source} |"


def check_row(check: Check) -> str:
    """A check as a row of the record's table."""
    sign = "at least" if check.least else "at most"
    return f"| {check.name} | {check.measured:.4g} | {sign} {check.limit:.4g} | {check.unit} |"
