"""Measures how well motion tells the offset of two sensors; run as ``python -m tests.measure_offset [COUNT]``.

For each performance a pair that saw the same and a pair of which the second sensor saw another performance; 14 s at
30 and 25 Hz, sensors 40 degrees apart, noise of 2 mm at 1 m, times unsteady by 2 ms.
"""

from __future__ import annotations

import sys

import numpy as np

from capture.console import stdout
from capture.errors import RecordingError
from capture.importers import Offset, estimate_offset
from tests.test_import_offset import NAME, performance, two_views


def found(seed: int, offset_s: float, *, other_seed: int | None = None) -> Offset | None:
    """The offset found, None if it was refused."""
    other = None if other_seed is None else performance(other_seed)
    try:
        return estimate_offset(*two_views(performance(seed), offset_s=offset_s, other=other), where=NAME)
    except RecordingError:
        return None


def main(count: int) -> None:
    true = np.random.default_rng(0).uniform(-3.0, 3.0, count)
    same = [found(seed, float(true[seed])) for seed in range(count)]
    other = [found(seed, 0.0, other_seed=seed + 1000) for seed in range(count)]
    error = np.array([one.seconds - true[seed] for seed, one in enumerate(same) if one is not None])
    stated = np.array([one.deviation_s for one in same if one is not None])
    stdout.print(f"the same performance: {len(error)} of {count} found, {count - len(error)} refused")
    stdout.print(
        f"error: root mean square {1e3 * np.sqrt((error**2).mean()):.1f} ms, largest {1e3 * abs(error).max():.1f} ms"
    )
    stdout.print(f"error in stated deviations: root mean square {np.sqrt(((error / stated) ** 2).mean()):.2f}")
    stdout.print(f"another performance: {sum(one is None for one in other)} of {count} refused")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 20)
