"""A forearm twisted by 180 degrees: the forearm deformer, linear blending and dual quaternions side by side.

    python docs/figures/forearm_twist.py --out docs/images

Prints the smallest cross-section, the volume and the bow of the forearm's centre line, and writes
``forearm-twist.png``. Two twists are shown: from the template's rest pose to both ends of the range, and the whole
180 degrees at once, with all three methods bound to the skin of full pronation.
"""

from __future__ import annotations

from pathlib import Path

import click
import numpy as np
from rich.table import Table

from adapt.anatomy import Floats
from adapt.anatomy_file import load_anatomy
from adapt.model.body import Body, make_body, rest_theta
from capture.camera import Camera
from capture.console import stdout
from capture.files import replaced_when_complete
from track.evaluation.experiments.forearm import LEVELS, METHODS, Twist, forearm_sections, measure, with_twist
from track.evaluation.sections import Sections
from track.view.render import SKIN, Layer, framing_camera, look_at, render

ANGLES = (-90.0, -45.0, 0.0, 45.0, 90.0)
BOUND = 90.0  # degrees: full pronation, where the whole twist starts


def table(title: str, rest: Sections, twists: list[Twist]) -> Table:
    """What is lost, as a table."""
    shown = Table("method", "pro_sup", "least area", "most area", "volume", "bow", title=title)
    shown.add_row("rest skin", "", "100 %", "100 %", "100 %", f"{1000 * rest.bow().max():.1f} mm")
    for t in twists:
        numbers = (f"{100 * t.area.min():.0f} %", f"{100 * t.area.max():.0f} %", f"{100 * t.volume:.1f} %")
        shown.add_row(t.method, f"{t.angle:+.0f}", *numbers, f"{1000 * t.sections.bow().max():.1f} mm")
    return shown


def picture(body: Body, rest: Sections, twists: list[Twist], path: Path) -> None:
    """Rendered forearms above; below, section areas and the centre line's bow."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10.5, 7.2), layout="constrained")
    FigureCanvasAgg(figure)
    grid = figure.add_gridspec(2, len(twists), height_ratios=(1.0, 1.1))
    eye, camera = view_of_forearm(twists[0])
    for column, twist in enumerate(twists):
        axes = figure.add_subplot(grid[0, column])
        axes.imshow(render([Layer(twist.skin, body.anatomy.skin_faces, SKIN)], eye, camera))
        axes.set_title(f"{twist.method}\nsmallest section {100 * twist.area.min():.0f} %", fontsize="medium")
        axes.axis("off")
    below = grid[1, :].subgridspec(1, 2)
    area, bow = figure.add_subplot(below[0, 0]), figure.add_subplot(below[0, 1])
    for twist in twists:
        area.plot(100 * LEVELS, 100 * twist.area, label=twist.method)
        bow.plot(100 * LEVELS, 1000 * twist.sections.bow(), label=twist.method)
    bow.plot(100 * LEVELS, 1000 * rest.bow(), color="black", lw=0.8, label="rest skin")
    area.axhline(100, color="black", lw=0.8)
    area.set(xlabel="along the forearm, elbow to wrist (%)", ylabel="section area (% of rest)", ylim=(0, None))
    bow.set(xlabel="along the forearm, elbow to wrist (%)", ylabel="centre line off its chord (mm)", ylim=(0, None))
    bow.legend()
    with replaced_when_complete(path) as partial:
        figure.savefig(partial, dpi=90)


def view_of_forearm(twist: Twist) -> tuple[Floats, Camera]:
    """An eye beside the forearm, and a camera that has the forearm and most of the hand in its image."""
    start, end = twist.sections.middles[0], twist.sections.middles[-1]
    t = (twist.skin - start) @ (end - start) / ((end - start) @ (end - start))
    around = twist.skin[(t > -0.15) & (t < 1.5)]
    up = np.array([0.0, 1.0, 0.0])
    eye = look_at(around, np.cross(end - start, up), up)
    return eye, framing_camera(eye, around, width=560, height=420)


@click.command()
@click.option("--anatomy", default="upper-limb-right", show_default=True)
@click.option("--out", type=click.Path(path_type=Path), default=Path("docs/images"), show_default=True)
def main(anatomy: str, out: Path) -> None:
    """Measure and draw the twist."""
    body = make_body(load_anatomy(anatomy))
    rest = forearm_sections(body, body.v_tilde.value, rest_theta(body))
    bindings = {"bound at rest": rest_theta(body), "180 degrees at once": with_twist(body, BOUND)}
    for title, bound in bindings.items():
        angles = ANGLES if bound is bindings["bound at rest"] else (-BOUND,)
        stdout.print(table(title, rest, [measure(body, m, angle, bound) for angle in angles for m in METHODS]))
    out.mkdir(parents=True, exist_ok=True)
    whole = [measure(body, method, -BOUND, bindings["180 degrees at once"]) for method in METHODS]
    picture(body, rest, whole, out / "forearm-twist.png")


if __name__ == "__main__":
    main()
