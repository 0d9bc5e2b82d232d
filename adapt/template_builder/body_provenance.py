"""The record that stands beside the body's template: what it was built from, how it was changed, what was measured."""

from __future__ import annotations

from datetime import date
from importlib.metadata import version
from pathlib import Path

import numpy as np

from adapt.anatomy import Anatomy
from adapt.template_builder.body import BODY
from adapt.template_builder.body_source import SKIN, PosedBody
from adapt.template_builder.check import Check
from adapt.template_builder.provenance import BASE_MESH, check_row
from adapt.template_builder.sources_makehuman import PACKAGE as SKIN_PACKAGE
from adapt.template_builder.sources_myosim import MODEL, PACKAGE
from capture.files import replaced_when_complete


def write_body_provenance(anatomy: Anatomy, posed: PosedBody, checks: list[Check], folder: Path) -> None:
    """Write ``body.md`` into ``folder``."""
    with replaced_when_complete(folder / f"{anatomy.name}.md") as partial:
        partial.write_text(_text(anatomy, posed, checks), encoding="utf-8")


def _text(anatomy: Anatomy, posed: PosedBody, checks: list[Check]) -> str:
    targets = ", ".join(f"`{name}` x {weight:.3g}" for name, weight in SKIN.targets.items())
    scales = {name: np.exp(value) for name, value in posed.pose.items() if name.startswith("log_")}
    rest = ", ".join(
        f"`{c.name}` {np.degrees(c.rest):.1f}" for c in anatomy.coordinates if c.rest and not c.name.endswith("_l")
    )
    upstream = "\n".join(f"| {what} | {where} | {licence} |" for what, where, licence in BODY.upstream)
    facts = "\n".join(f"| {what} | {where} | facts |" for what, where in BODY.facts)
    return f"""# {anatomy.name}

Built by `python -m adapt.template_builder {anatomy.name}` on {date.today().isoformat()}.

## Sources

| what | from | licence |
|---|---|---|
| bones | PyPI `{PACKAGE}` {version(PACKAGE)}, model `{MODEL}` | Apache-2.0, see `LICENSE-myo-sim.txt` |
{upstream}
| skin, its joint centres | MakeHuman base mesh hm08 and shape targets, as packed in PyPI `{SKIN_PACKAGE}` \
{version(SKIN_PACKAGE)} (whose code was not used) | CC0-1.0, see `LICENSE-makehuman.md` |
{facts}

Of the source's model only the bones' surfaces and where the bones stand at zero were taken for the trunk. The arm's
axes are Holzbaur, Murray & Delp's numbers as CompleteHumanModel has them, and so are the blade's ellipsoid and frame.

{BASE_MESH} Shape targets and their weights: {targets}; the body scaled to a stature of {SKIN.stature} m.

## What was changed

{_changes(anatomy)}
Rest pose (degrees; the left is alike): {rest}.

Scales: {", ".join(f"{name.removeprefix('log_')} {value:.3f}" for name, value in scales.items())}.

Vertices: skin {len(anatomy.skin_vertices)}, {", ".join(f"{bone.name} {len(bone.vertices)}" for bone in anatomy.bones)}.
Tetrahedra: {len(anatomy.tetrahedra["limb"][1])}.

## Checks at build time

| check | measured | limit | unit |
|---|---|---|---|
{chr(10).join(check_row(check) for check in checks)}
"""


def _changes(anatomy: Anatomy) -> str:
    return f"""\
- Skin: axes turned to X forward, Y up, Z right; metres; Catmull-Clark subdivision; mouth, throat and eye sockets
  filled (what a ball of 6 mm cannot reach from outside); {len(anatomy.skin_vertices)} vertices, finer at hands, feet
  and face; the left half is the mirror image of the right; moved along its normals until limb bones lie as deep as
  people's.
- Bones: arm and leg stand as in the limbs' templates. The pelvis turns about the thighs' heads until the sacrum has
  room; vertebrae bend as arcs; the relief on the source's breastbone is left out; the left side is the right one's
  mirror image.
- The spine's three curves are as bent at rest as their vertebrae stand in this skin. Vertebrae, ribs and breastbone
  ride on shares of them: a vertebra as a whole, ribs and breastbone vertex by vertex, as the skin before them does.
- A curve's extension is its whole turn backward: zero is straight, and its range is CompleteHumanModel's about the rest
  value.
- Weights and tetrahedra were computed by this program; weights below 0.001 are left out.
"""
