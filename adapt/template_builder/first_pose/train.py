"""Training: steps of AdamW on simulated windows, by one process or several that share what they learn.

The learning rate rises over the first steps, stays, and falls to nothing over the last 40 %. What is kept and judged
is a running mean of the weights. All is written to ``checkpoint.pt`` every few minutes; a run that was killed goes on
from there, and with the same data, seed and number of processes comes out as if it had not been killed.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, distributed, multiprocessing

from adapt.template_builder.first_pose.batches import draw_batch
from adapt.template_builder.first_pose.loss import figure_loss
from adapt.template_builder.first_pose.make import read_shards
from adapt.template_builder.first_pose.measure import measure
from adapt.template_builder.first_pose.net import FigureNet
from adapt.template_builder.first_pose.options import TrainOptions, rate_at
from capture.errors import BonetrackError
from capture.files import replaced_when_complete

CHECKPOINT = "checkpoint.pt"
_LONGEST_MEAN = 0.995
_CLIP = 5.0
_SHARED_EVERY = 10  # steps


def train(data: Path, held: Path, out: Path, options: TrainOptions, say: Callable[[str], object]) -> None:
    """Train on the shards of ``data``, judge by those of ``held``, and keep everything in the folder ``out``.

    Raises:
        BonetrackError: there is no shard in one of the folders, or the checkpoint is none.
    """
    for folder in (data, held):
        if not read_shards(folder):
            raise BonetrackError("no shard of windows there", where=folder, remedy="run `make` first")
    out.mkdir(parents=True, exist_ok=True)
    if options.processes == 1:
        _run(0, data, held, out, options, say)
    else:
        (out / "meeting").unlink(missing_ok=True)
        multiprocessing.spawn(_run, (data, held, out, options, say), nprocs=options.processes)


def _run(rank: int, data: Path, held: Path, out: Path, options: TrainOptions, say: Callable[[str], object]) -> None:
    torch.set_num_threads(1)
    torch.manual_seed(options.seed)
    net = FigureNet().to(memory_format=torch.channels_last)
    if options.processes > 1:
        meeting = f"file://{(out / 'meeting').resolve()}"
        distributed.init_process_group("gloo", init_method=meeting, rank=rank, world_size=options.processes)
    optimiser = torch.optim.AdamW(net.parameters(), options.rate, weight_decay=options.decay)
    mean = {name: value.clone() for name, value in net.state_dict().items()}
    start = _resume(out / CHECKPOINT, net, optimiser, mean)
    shards = read_shards(data)
    if rank == 0:
        say(f"step {start} of {options.steps}, {sum(map(len, shards))} windows, {options.processes} processes")
    kept, terms = time.monotonic(), []
    for step in range(start + 1, options.steps + 1):
        rng = np.random.default_rng([options.seed, rank, step])
        terms.append(_step(net, optimiser, rate_at(step, options), rng, shards, options.batch))
        _follow(mean, net, step)
        last = step == options.steps
        if not last and step % _SHARED_EVERY:
            continue
        if options.processes > 1:
            _share(net, optimiser, options.processes)
        if rank == 0 and (last or time.monotonic() - kept > options.kept_every_s):
            save_checkpoint(out / CHECKPOINT, net, optimiser, mean, step, sum(map(len, shards)), options)
            kept = time.monotonic()
        if rank == 0 and (last or step % options.said_every == 0):
            say(f"step {step} loss {np.mean(terms, axis=0).round(3)}; {measure(mean, read_shards(held))}")
            terms = []
    if options.processes > 1:
        distributed.destroy_process_group()


def _share(net: FigureNet, optimiser: Any, processes: int) -> None:
    """Give all processes the mean of their weights and of what the optimiser remembers: one exchange for many steps.

    To exchange at every step takes many times as long where other programs keep the processors busy.
    """
    values = [value for value in net.state_dict().values() if value.is_floating_point()]
    values += [state[name] for state in optimiser.state.values() for name in ("exp_avg", "exp_avg_sq")]
    together = torch.cat([value.reshape(-1) for value in values])
    distributed.all_reduce(together)
    means = (together / processes).split([value.numel() for value in values])
    with torch.no_grad():
        for value, mean in zip(values, means, strict=True):
            value.copy_(mean.view(value.shape))


def _step(
    net: Any, optimiser: Any, rate: float, rng: np.random.Generator, shards: list[NDArray[np.void]], size: int
) -> list[float]:
    """One step; returns the terms of the loss."""
    batch = draw_batch(rng, shards, size)
    fed = torch.from_numpy(batch.fed).contiguous(memory_format=torch.channels_last)
    for group in optimiser.param_groups:
        group["lr"] = rate
    with torch.autocast("cpu", torch.bfloat16):
        joints, parts = net(fed)
    asked = (torch.from_numpy(array) for array in (batch.places, batch.labels, batch.somebody))
    loss, *terms = figure_loss(joints, parts, *asked)
    optimiser.zero_grad()
    loss.backward()
    torch.nn.utils.clip_grad_norm_(net.parameters(), _CLIP)
    optimiser.step()
    return [float(term.detach()) for term in terms]


def _follow(mean: dict[str, Tensor], net: FigureNet, step: int) -> None:
    """Move the running mean of the weights on."""
    share = min(_LONGEST_MEAN, step / (step + 50.0))
    with torch.no_grad():
        for name, value in net.state_dict().items():
            if value.is_floating_point():
                mean[name].mul_(share).add_(value, alpha=1.0 - share)
            else:
                mean[name].copy_(value)


def save_checkpoint(
    path: Path, net: FigureNet, optimiser: Any, mean: dict[str, Tensor], step: int, windows: int, options: TrainOptions
) -> None:
    """Write what a run needs to go on, whole or not at all."""
    state = {"net": net.state_dict(), "optimiser": optimiser.state_dict(), "mean": mean}
    with replaced_when_complete(path) as partial:
        torch.save(state | {"step": step, "windows": windows, "options": asdict(options)}, partial)


def read_checkpoint(path: Path) -> dict[str, Any]:
    """What ``save_checkpoint`` wrote; BonetrackError if it is something else."""
    try:
        state = torch.load(path, weights_only=True)
        return {name: state[name] for name in ("net", "optimiser", "mean", "step", "windows", "options")}
    except Exception as error:  # torch's reader raises whatever it stumbles over
        raise BonetrackError("not a checkpoint of this training", where=path, remedy="move it away") from error


def _resume(path: Path, net: FigureNet, optimiser: Any, mean: dict[str, Tensor]) -> int:
    """The step that was done last, with everything as it was then; 0 where there is no checkpoint."""
    if not path.exists():
        return 0
    state = read_checkpoint(path)
    net.load_state_dict(state["net"])
    optimiser.load_state_dict(state["optimiser"])
    mean.update(state["mean"])
    return int(state["step"])
