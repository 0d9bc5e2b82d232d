"""What training minimises.

L = CE(scores of cells, a Gaussian of 0.8 cells about the joint) + L1s(offsets) + 6 L1s(depths) + CE(parts)

with L1s the smooth L1 loss over the cells about each joint, nothing counted half and arms twice among the parts. A
joint outside the window, or more than 1.5 m nearer or farther, is not asked for. Where there is nobody, scores are to
be even over all cells: that is what makes the mass at the peak a measure of confidence.
"""

from __future__ import annotations

import torch
import torch.nn.functional as nn
from torch import Tensor

from adapt.search.figure.names import JOINTS, LIMBS, PARTS

CELL = 4  # pixels
CELLS = 32
_SPREAD, _NEAR_SPREAD = 0.8, 1.5  # cells
_FARTHEST = 1.5  # m
_DEPTH_WEIGHT = 6.0


def figure_loss(joints: Tensor, parts: Tensor, places: Tensor, labels: Tensor, somebody: Tensor) -> tuple[Tensor, ...]:
    """The loss and its four terms (cells, offsets, depths, parts).

    ``places`` (N, 19, 3) are where joints are in the window, ``labels`` (N, 64, 64) parts, -1 where there is no depth,
    ``somebody`` (N,) is 1 where there is a person and 0 where there is nobody.
    """
    scores, right, down, depth = joints.float().split(len(JOINTS), dim=1)
    middles = torch.arange(CELLS, dtype=torch.float32) + 0.5
    u, v, z = places[..., 0] / CELL, places[..., 1] / CELL, places[..., 2]
    inside = (u > 0) & (u < CELLS) & (v > 0) & (v < CELLS) & (z.abs() < _FARTHEST)
    asked = inside.float() * somebody[:, None]
    du, dv = u[..., None, None] - middles, v[..., None, None] - middles[:, None]
    square = du**2 + dv**2
    wanted = torch.exp(-square / (2.0 * _SPREAD**2))
    wanted = wanted / (wanted.sum((2, 3), keepdim=True) + 1e-9)
    nobody = (1.0 - somebody)[:, None, None, None]
    wanted = torch.where(nobody > 0, torch.full_like(wanted, 1.0 / CELLS**2), wanted)
    counted = asked + 0.5 * (1.0 - somebody[:, None])
    entropy = -(wanted.flatten(2) * nn.log_softmax(scores.flatten(2), 2)).sum(2)
    cells = (entropy * counted).sum() / counted.sum().clamp(min=1.0)
    near = torch.exp(-square / (2.0 * _NEAR_SPREAD**2)) * (square < 9.0) * asked[..., None, None]
    near = near / near.sum().clamp(min=1e-9)
    offsets = (nn.smooth_l1_loss(right, du.expand_as(right), reduction="none", beta=0.3) * near).sum() + (
        nn.smooth_l1_loss(down, dv.expand_as(down), reduction="none", beta=0.3) * near
    ).sum()
    depths = (nn.smooth_l1_loss(depth, z[..., None, None].expand_as(depth), reduction="none", beta=0.03) * near).sum()
    weights = torch.ones(len(PARTS))
    weights[0] = 0.5
    weights[list(LIMBS["arm_l"] + LIMBS["arm_r"])] = 2.0
    labelled = nn.cross_entropy(parts.float(), labels, weight=weights, ignore_index=-1)
    return cells + offsets + _DEPTH_WEIGHT * depths + labelled, cells, offsets, depths, labelled
