"""How training goes: its options, and the learning rate of every step."""

from __future__ import annotations

from dataclasses import dataclass

_WARM_UP = 100  # steps
_FALLING = 0.4  # of all steps


@dataclass(frozen=True)
class TrainOptions:
    """How training goes: all of it, so that the same options and data give the same weights."""

    steps: int = 12000
    batch: int = 16  # windows a process and step
    processes: int = 1  # they take the mean of what they learnt every tenth step
    seed: int = 0
    rate: float = 3e-3
    decay: float = 1e-2
    said_every: int = 200  # steps, a multiple of ten
    kept_every_s: float = 120.0


def rate_at(step: int, options: TrainOptions) -> float:
    """The learning rate of a step.

    >>> options = TrainOptions(steps=1000, rate=1.0)
    >>> [round(rate_at(step, options), 3) for step in (50, 500, 800, 1000)]
    [0.5, 1.0, 0.5, 0.0]
    """
    left = (options.steps - step) / (_FALLING * options.steps)
    return options.rate * min(1.0, step / _WARM_UP, max(0.0, left))
