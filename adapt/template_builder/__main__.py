"""``python -m adapt.template_builder NAME``: build a template, check it, and write it where the package looks."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import click

from adapt.anatomy_file import load_anatomy, save_anatomy
from adapt.template_builder.assemble import build_anatomy, source_of
from adapt.template_builder.check import Check, require
from adapt.template_builder.checks import all_checks
from adapt.template_builder.lower_limb import LOWER_LIMB_RIGHT
from adapt.template_builder.plan import LimbPlan
from adapt.template_builder.provenance import write_provenance
from adapt.template_builder.upper_limb import UPPER_LIMB_RIGHT
from capture.errors import BonetrackError
from capture.files import replaced_when_complete

PLANS = {plan.name: plan for plan in (LOWER_LIMB_RIGHT, UPPER_LIMB_RIGHT)}
TEMPLATES = Path(__file__).resolve().parent.parent / "templates"
LARGEST_FILE = 6.0  # MB


@click.command()
@click.argument("name", type=click.Choice(sorted(PLANS)))
@click.option("--out", type=click.Path(path_type=Path), default=TEMPLATES, help="Folder to write to.")
def main(name: str, out: Path) -> None:
    """Build the anatomy template NAME, check it, and write it with its provenance."""
    try:
        _build(PLANS[name], out)
    except BonetrackError as error:
        click.echo(f"error: {error}", err=True)
        sys.exit(1)


def _build(plan: LimbPlan, out: Path) -> None:
    anatomy, pose = build_anatomy(plan, click.echo)
    out.mkdir(parents=True, exist_ok=True)
    path = out / f"{plan.name}.npz"
    with replaced_when_complete(path) as candidate:
        save_anatomy(anatomy, candidate)
        written = replace(load_anatomy(candidate), name=plan.name)
        checks = all_checks(written, plan, source_of(plan))
        checks.append(Check("file size", candidate.stat().st_size / 1e6, LARGEST_FILE, "MB"))
        for check in checks:
            click.echo(check.line())
        require(checks, plan.name)
    write_provenance(written, plan, pose, checks, out)


if __name__ == "__main__":
    main()
