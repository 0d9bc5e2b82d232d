"""Pictures that leave the program: what is seen, with a title, the time and what the colours mean."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from PIL.ImageFont import FreeTypeFont

Image = NDArray[np.uint8]
_INK, _PAPER = (40, 40, 40), (255, 255, 255)
_LINE, _MARGIN = 26, 12  # px


@dataclass(frozen=True)
class Key:
    """What a colour (RGB, 0 to 255) means."""

    colour: tuple[int, int, int]
    words: str


def key_of(colour: tuple[float, float, float], words: str) -> Key:
    """The key of a colour as layers have it, in [0, 1].

    >>> key_of((0.2, 0.4, 1.0), "bones").colour
    (51, 102, 255)
    """
    red, green, blue = (round(255.0 * part) for part in colour)
    return Key((red, green, blue), words)


def captioned(image: Image, title: str, said: str, keys: Sequence[Key]) -> Image:
    """The image (H, W, 3) with a line above, the title left and what is said right, and the colours' meanings below.

    Words that find no room beside each other go on in another line, so a picture may be higher than asked.

    >>> plain = np.full((100, 400, 3), 255, dtype=np.uint8)
    >>> captioned(plain, "elbow", "1.25 s", [Key((200, 0, 0), "bones")]).shape
    (176, 400, 3)
    """
    from PIL import Image as Pictures
    from PIL import ImageDraw

    height, width = image.shape[:2]
    rows = _rows(keys, width)
    below = len(rows) * _LINE + (_MARGIN if rows else 0)
    whole = Pictures.new("RGB", (width, _LINE + _MARGIN + height + below), _PAPER)
    whole.paste(Pictures.fromarray(image), (0, _LINE + _MARGIN))
    draw, font = ImageDraw.Draw(whole), _font()
    right = width - _MARGIN - font.getlength(said)
    draw.text((_MARGIN, _MARGIN), _cut(title, right - 2 * _MARGIN), fill=_INK, font=font)
    draw.text((right, _MARGIN), said, fill=_INK, font=font)
    for k, row in enumerate(rows):
        top = _LINE + _MARGIN + height + k * _LINE + _MARGIN // 2
        for left, key in row:
            draw.rectangle((left, top + 3, left + 12, top + 15), fill=key.colour)
            draw.text((left + 18, top), key.words, fill=_INK, font=font)
    return np.asarray(whole, dtype=np.uint8)


def _rows(keys: Sequence[Key], width: int) -> list[list[tuple[int, Key]]]:
    """The keys in lines, each with its left end."""
    rows: list[list[tuple[int, Key]]] = []
    left = width
    for key in keys:
        wide = 18 + int(_font().getlength(key.words)) + 2 * _MARGIN
        if left + wide > width:
            rows.append([])
            left = _MARGIN
        rows[-1].append((left, key))
        left += wide
    return rows


def _cut(text: str, width: float) -> str:
    while len(text) > 1 and _font().getlength(text) > width:
        text = text[:-2].rstrip() + "…"
    return text


@lru_cache(maxsize=1)
def _font() -> FreeTypeFont:
    """The font that matplotlib brings along, so that pictures look the same everywhere."""
    from matplotlib.font_manager import findfont
    from PIL import ImageFont

    return ImageFont.truetype(findfont("DejaVu Sans", fallback_to_default=True), 14)
