"""``python -m adapt.template_builder NAME``: build a template, check it, and write it where the package looks."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import click

from adapt.anatomy import Anatomy
from adapt.anatomy_file import load_anatomy, save_anatomy
from adapt.template_builder.assemble import build_anatomy, source_of
from adapt.template_builder.body import BODY
from adapt.template_builder.body_assemble import build_body
from adapt.template_builder.body_checks import body_checks
from adapt.template_builder.body_provenance import write_body_provenance
from adapt.template_builder.check import Check, require
from adapt.template_builder.checks import all_checks
from adapt.template_builder.lower_limb import LOWER_LIMB_RIGHT
from adapt.template_builder.plan import LimbPlan
from adapt.template_builder.provenance import write_provenance
from adapt.template_builder.stages import Stages
from adapt.template_builder.upper_limb import UPPER_LIMB_RIGHT
from capture.errors import BonetrackError
from capture.files import replaced_when_complete

PLANS = {plan.name: plan for plan in (LOWER_LIMB_RIGHT, UPPER_LIMB_RIGHT)}
TEMPLATES = Path(__file__).resolve().parent.parent / "templates"
LARGEST_FILE = 6.0  # MB


@click.command()
@click.argument("name", type=click.Choice(sorted([*PLANS, BODY.name])))
@click.option("--out", type=click.Path(path_type=Path), default=TEMPLATES, help="Folder to write to.")
@click.option(
    "--stages",
    type=click.Path(path_type=Path),
    help="Folder to keep the body's finished stages in: a build that was broken off goes on from there.",
)
def main(name: str, out: Path, stages: Path | None) -> None:
    """Build the anatomy template NAME, check it, and write it with its provenance."""
    try:
        if name == BODY.name:
            _build_body(out, Stages(stages))
        else:
            _build(PLANS[name], out)
    except BonetrackError as error:
        click.echo(f"error: {error}", err=True)
        sys.exit(1)


def _build(plan: LimbPlan, out: Path) -> None:
    anatomy, pose = build_anatomy(plan, click.echo)
    written, checks = _written(anatomy, out, lambda limb: all_checks(limb, plan, source_of(plan)))
    write_provenance(written, plan, pose, checks, out)


def _build_body(out: Path, stages: Stages) -> None:
    anatomy, posed = build_body(click.echo, stages)
    written, checks = _written(anatomy, out, body_checks)
    write_body_provenance(written, posed, checks, out)


def _written(anatomy: Anatomy, out: Path, checked: Callable[[Anatomy], list[Check]]) -> tuple[Anatomy, list[Check]]:
    """The anatomy as it is read from its file, which is there only if it passes its checks."""
    out.mkdir(parents=True, exist_ok=True)
    with replaced_when_complete(out / f"{anatomy.name}.npz") as candidate:
        save_anatomy(anatomy, candidate)
        written = replace(load_anatomy(candidate), name=anatomy.name)
        checks = checked(written)
        checks.append(Check("file size", candidate.stat().st_size / 1e6, LARGEST_FILE, "MB"))
        for check in checks:
            click.echo(check.line())
        require(checks, anatomy.name)
    return written, checks


if __name__ == "__main__":
    main()
