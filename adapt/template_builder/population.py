"""``python -m adapt.template_builder.population MEN.csv WOMEN.csv``: how people's limbs vary, from a survey of persons.

The survey is ANSUR II (US Army, 2012; 4,082 men, 1,986 women; public): one row a person, lengths in millimetres, mass
in tenths of a kilogram. What is kept is small: means and covariances of logarithms, for men and for women.
"""

from __future__ import annotations

import csv
import json
from collections.abc import Mapping, Sequence
from pathlib import Path

import click
import numpy as np

from adapt.anatomy import Floats
from adapt.model.shape.population import POPULATION
from capture.errors import AnatomyError
from capture.files import UNREADABLE, replaced_when_complete

COLUMNS: Mapping[str, Sequence[str]] = {  # what is kept, and the columns: the first, less the others
    "stature": ("stature",),
    "mass": ("weightkg",),
    "upper arm": ("acromionradialelength",),
    "forearm length": ("radialestylionlength",),
    "palm": ("palmlength",),
    "thigh": ("trochanterionheight", "tibialheight"),
    "shank": ("tibialheight", "lateralmalleolusheight"),
    "foot": ("footlength",),
    "pelvis breadth": ("bicristalbreadth",),
    "wrist girth": ("wristcircumference",),
    "hand breadth": ("handbreadth",),
    "ankle breadth": ("bimalleolarbreadth",),
    "foot breadth": ("footbreadthhorizontal",),
    "arm girth": ("bicepscircumferenceflexed",),
    "forearm girth": ("forearmcircumferenceflexed",),
    "thigh girth": ("thighcircumference",),
    "lower thigh girth": ("lowerthighcircumference",),
    "calf girth": ("calfcircumference",),
    "ankle girth": ("anklecircumference",),
}
_UNITS = {"mass": 0.1}  # kg; the file has tenths
_MM = 1e-3


@click.command()
@click.argument("men", type=click.Path(path_type=Path))
@click.argument("women", type=click.Path(path_type=Path))
@click.option("--out", type=click.Path(path_type=Path), default=POPULATION, help="File to write to.")
def main(men: Path, women: Path, out: Path) -> None:
    """Write how people's limbs vary, from the surveys' tables MEN and WOMEN."""
    sexes = {sex: _distribution(_logarithms(path)) for sex, path in (("male", men), ("female", women))}
    table = {"measures": list(COLUMNS), "unit": "log of m, of kg for mass", **sexes}
    with replaced_when_complete(out) as partial:
        partial.write_text(json.dumps(table, indent=1) + "\n", encoding="utf-8")
    click.echo(f"{out} written")


def _logarithms(path: Path) -> Floats:
    """Natural logarithms (N, K) of all measures, in metres and kilograms, of N persons."""
    try:
        with path.open(encoding="latin-1", newline="") as file:
            persons = list(csv.DictReader(file))
        columns = [[float(person[name]) for person in persons] for name in _columns()]
    except (*UNREADABLE, KeyError, ValueError) as error:
        raise AnatomyError("is not a table of ANSUR II", where=path, remedy="take its public CSV files") from error
    at = dict(zip(_columns(), np.array(columns), strict=True))
    values = [at[of[0]] - sum(at[less] for less in of[1:]) for of in COLUMNS.values()]
    units = [_UNITS.get(name, _MM) for name in COLUMNS]
    return np.log(np.array(values).T * units)


def _columns() -> list[str]:
    return [column for of in COLUMNS.values() for column in of]


def _distribution(logarithms: Floats) -> dict[str, object]:
    covariance = np.cov(logarithms, rowvar=False)
    return {
        "persons": len(logarithms),
        "mean": [round(float(value), 5) for value in logarithms.mean(axis=0)],
        "covariance": [[round(float(value), 7) for value in row] for row in covariance],
    }


if __name__ == "__main__":
    main()
