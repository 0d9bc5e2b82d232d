"""The network: a small U-Net from a window's features (N, 4, 128, 128) to joints (N, 76, 32, 32) and parts.

Joints are given cell by cell, a cell being 4 x 4 pixels: 19 scores, whose softmax over the cells says in which cell
each joint is; 19 offsets to the right and 19 down, from the cell's middle, in cells; 19 depths beyond the window's (m).
Parts (N, 15, 64, 64) are scores whose softmax over the parts says what every second pixel belongs to.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn

from adapt.search.figure.names import JOINTS, PARTS

_WIDTHS = (16, 32, 64, 128)


def _convolution(inputs: int, outputs: int, size: int, stride: int = 1) -> nn.Sequential:
    return nn.Sequential(
        nn.Conv2d(inputs, outputs, size, stride, size // 2, bias=False), nn.BatchNorm2d(outputs), nn.ReLU(inplace=True)
    )


class _Block(nn.Module):  # type: ignore[misc]
    """Two convolutions whose outcome is added to what came in."""

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.first = _convolution(channels, channels, 3)
        self.second = nn.Conv2d(channels, channels, 3, padding=1, bias=False)
        self.norm = nn.BatchNorm2d(channels)

    def forward(self, x: Tensor) -> Tensor:
        return torch.relu(x + self.norm(self.second(self.first(x))))


class FigureNet(nn.Module):  # type: ignore[misc]
    """1.26 million parameters; four sizes from 64 x 64 down to 8 x 8 and back."""

    def __init__(self) -> None:
        super().__init__()
        a, b, c, d = _WIDTHS
        self.down1 = _convolution(4, a, 5, 2)
        self.down2 = nn.Sequential(_convolution(a, b, 3, 2), _Block(b))
        self.down3 = nn.Sequential(_convolution(b, c, 3, 2), _Block(c), _Block(c))
        self.down4 = nn.Sequential(_convolution(c, d, 3, 2), _Block(d), _Block(d), _Block(d))
        self.narrow3, self.up3 = _convolution(d, c, 1), _Block(c)
        self.narrow2, self.up2 = _convolution(c, b, 1), _Block(b)
        self.narrow1, self.up1 = _convolution(b, a, 1), _convolution(a, 24, 3)
        self.joints = nn.Conv2d(b, 4 * len(JOINTS), 1)
        self.parts = nn.Conv2d(24, len(PARTS), 3, padding=1)
        self.larger = nn.Upsample(scale_factor=2)

    def forward(self, x: Tensor) -> tuple[Tensor, Tensor]:
        """Joints (N, 76, 32, 32) and parts (N, 15, 64, 64), both as scores."""
        one = self.down1(x)
        two = self.down2(one)
        three = self.down3(two)
        four = self.down4(three)
        three = self.up3(three + self.larger(self.narrow3(four)))
        two = self.up2(two + self.larger(self.narrow2(three)))
        one = self.up1(one + self.larger(self.narrow1(two)))
        return self.joints(two), self.parts(one)
