"""Pictures of the experiments: figures that need no screen, and surfaces coloured by a distance."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from adapt.anatomy import Floats, Ints
from capture.files import replaced_when_complete
from track.view.render import Layer

_COLOURS = 10
_MAP = "viridis"


def new_figure(width: float, height: float) -> Any:
    """An empty figure of so many inches."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def save_figure(figure: Any, path: Path, *, dpi: int = 90) -> None:
    """Write a figure as PNG."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with replaced_when_complete(path) as partial:
        figure.savefig(partial, dpi=dpi)


def coloured_layers(vertices: Floats, faces: Ints, values: Floats, *, limit: float) -> list[Layer]:
    """A surface, (V, 3) m and (F, 3), in steps of colour by ``values`` (V,): from 0 to ``limit``, and beyond."""
    from matplotlib import colormaps

    step = np.minimum(_COLOURS * values[faces].mean(axis=1) / limit, _COLOURS - 1).astype(int)
    colours = colormaps[_MAP](np.linspace(0.0, 1.0, _COLOURS))[:, :3]
    return [
        Layer(vertices, faces[step == k], (float(c[0]), float(c[1]), float(c[2])))
        for k, c in enumerate(colours)
        if (step == k).any()
    ]


def colour_bar(figure: Any, axes: Any, *, limit: float, label: str) -> None:
    """The key to the colours of ``coloured_layers``."""
    from matplotlib import colormaps
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize

    scale = ScalarMappable(Normalize(0.0, limit), colormaps[_MAP].resampled(_COLOURS))
    figure.colorbar(scale, ax=axes, label=label, extend="max", shrink=0.8)
