"""From a checkpoint to the file that ships: one ONNX file for OpenCV, and the record that stands beside it."""

from __future__ import annotations

import warnings
from datetime import date
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import torch

from adapt.search.figure.network import FigureNetwork
from adapt.search.figure.window import PIXELS
from adapt.template_builder.first_pose.net import FigureNet
from adapt.template_builder.first_pose.train import read_checkpoint
from adapt.template_builder.sources_makehuman import PACKAGE
from capture.errors import BonetrackError
from capture.files import replaced_when_complete

_OPSET = 13  # what OpenCV 4.10 and 5 read
_FARTHEST_OFF = 1e-3


def net_of(weights: dict[str, Any]) -> FigureNet:
    """The network with these weights, as it is run."""
    net = FigureNet()
    net.load_state_dict(weights)
    net.eval()
    return net


def write_network(net: FigureNet, path: Path) -> None:
    """Write the ONNX file, once OpenCV has been seen to give what the network gives.

    Raises:
        BonetrackError: OpenCV's numbers are others.
    """
    example = np.random.default_rng(0).normal(0.0, 0.5, (2, 4, PIXELS, PIXELS)).astype(np.float32)
    with replaced_when_complete(path) as partial:
        names = {"input_names": ["window"], "output_names": ["joints", "parts"]}
        axes = {name: {0: "n"} for name in ("window", "joints", "parts")}
        with warnings.catch_warnings():  # of the newer way to export, whose files need a package more
            warnings.simplefilter("ignore", DeprecationWarning)
            torch.onnx.export(
                net,
                torch.zeros(1, 4, PIXELS, PIXELS),
                str(partial),
                dynamo=False,
                opset_version=_OPSET,
                dynamic_axes=axes,
                **names,
            )
        with torch.no_grad():
            wanted = [out.numpy() for out in net(torch.from_numpy(example))]
        off = max(float(np.abs(a - b).max()) for a, b in zip(wanted, FigureNetwork(partial)(example), strict=True))
        if off > _FARTHEST_OFF:
            raise BonetrackError(f"OpenCV gives numbers that are up to {off:.2g} off", where=path)


def write_record(path: Path, state: dict[str, Any], measured: str) -> None:
    """Write the Markdown file beside the network: program, data, licences, options, and what was measured."""
    options = ", ".join(f"{name} {value}" for name, value in state["options"].items())
    with replaced_when_complete(path) as partial:
        partial.write_text(
            f"""# first-pose

Trained by `python -m adapt.template_builder.first_pose`, see `docs/first-pose.md`; written on \
{date.today().isoformat()}.

## Sources

| what | from | licence |
|---|---|---|
| bodies, shapes, rig | MakeHuman's base mesh hm08, shape targets and rig `cmu_mb`, CC0, as packed in PyPI `{PACKAGE}` \
{version(PACKAGE)} (whose code was not used) | CC0-1.0, see `LICENSE-makehuman.md` |
| poses, clothes, rooms, sensor faults | drawn by the program from ranges; no captured motion, no recording | ours |
| weights | trained from random ones on nothing but these simulated images | ours, as the rest of the package |

## Training

{state["step"]} steps on {state["windows"]} simulated windows, by torch {torch.__version__}; options: {options}.

## Measured

All of it on synthetic images, truth and answer by MakeHuman's joint centres
(`python -m track.evaluation.first_pose`):

{measured}
""",
            encoding="utf-8",
        )


def export(checkpoint: Path, out: Path, measured: str | None) -> None:
    """Write ``first-pose.onnx`` of a checkpoint into a folder and, with Markdown of what was measured, the record."""
    state = read_checkpoint(checkpoint)
    out.mkdir(parents=True, exist_ok=True)
    write_network(net_of(state["mean"]), out / "first-pose.onnx")
    if measured is not None:
        write_record(out / "first-pose.md", state, measured)
