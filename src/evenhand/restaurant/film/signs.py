"""What is written into a picture: the timer, what the rings mean, and how the service ended.

Dark text on an almost opaque light ground, a twentieth of the picture high: it can be read at
640 x 480, and on a phone.
"""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import matplotlib
import numpy as np
from PIL import Image, ImageDraw, ImageFont

from evenhand.restaurant import floor_plan
from evenhand.restaurant.film.rings import RINGS

PAPER = (252, 250, 245)
INK = (22, 24, 30)
_COVER = 0.9
"""Share of a sign's ground that hides the picture behind it."""


@dataclass(frozen=True, eq=False)
class Sign:
    """A sign ready to be laid over pictures.

    Attributes:
        left: first column of the picture that it covers, pixels.
        top: first row.
        ink: what it adds, [rows, columns, 3].
        clear: share of the picture that stays, [rows, columns, 1].
    """

    left: int
    top: int
    ink: np.ndarray
    clear: np.ndarray

    @property
    def box(self) -> tuple[slice, slice]:
        """Rows and columns that it covers."""
        rows, columns = self.ink.shape[:2]
        return slice(self.top, self.top + rows), slice(self.left, self.left + columns)


def lay(picture: np.ndarray, signs: Sequence[Sign]) -> None:
    """Lay signs over a picture, uint8 [height, width, 3], which is changed."""
    for sign in signs:
        under = picture[sign.box]
        under[:] = (sign.ink + sign.clear * under + 0.5).astype(np.uint8)


def timer(step: int, width: int, height: int) -> Sign:
    """Seconds and physics steps since the service began, in the upper left corner.

    Args:
        step: physics steps.
        width: of the picture, pixels.
        height: likewise.
    """
    size, pad = _sizes(width, height)
    bold, plain = _font(size, True), _font(size)
    seconds, steps = f"{step * floor_plan.TIMESTEP:.2f} s", f"step {step:>3}"
    # as wide as the widest, so that the sign does not twitch
    first, second = bold.getlength("0.00 s"), plain.getlength("step 000")
    board, draw = _board(round(first + second) + 4 * pad, _line(bold) + 2 * pad)
    draw.text((pad, pad), seconds, INK, bold)
    draw.text((3 * pad + first, pad), steps, INK, plain)
    return _finished(board, pad, pad)


def legend(width: int, height: int) -> Sign:
    """How far away from the person the rings lie, in the upper right corner."""
    size, pad = _sizes(width, height)
    # a bit smaller, so that it hides nobody who stands at the wall
    font = _font(round(0.85 * size))
    sample, line = 3 * size, _line(font)
    wide = sample + 3 * pad + round(font.getlength("1.5 m"))
    board, draw = _board(wide, line * len(RINGS) + 2 * pad)
    thick = max(3, size // 6)
    for number, ring in enumerate(RINGS):
        middle = pad + line * number + line // 2
        # as many pieces of line as make a sample that looks like the ring does
        pieces = 1 if ring.dashes == 1 else 3 if ring.drawn > 0.5 else 6
        step = sample / (pieces - 1 + ring.drawn)
        for piece in range(pieces):
            begin = pad + piece * step
            end = round(begin + ring.drawn * step)
            draw.rectangle((round(begin), middle, end, middle + thick - 1), ring.colour)
        draw.text((2 * pad + sample, pad + line * number), f"{ring.radius:.1f} m", INK, font)
    return _finished(board, width - wide - pad, pad)


def caption(lines: Sequence[str], width: int, height: int) -> Sign:
    """Lines of text at the lower edge, the first one bold; what is too long goes on below.

    Args:
        lines: of text.
        width: of the picture, pixels.
        height: likewise.
    """
    size, pad = _sizes(width, height)
    fonts = [_font(size, number == 0) for number in range(len(lines))]
    shown = [
        (part, font)
        for text, font in zip(lines, fonts, strict=True)
        for part in _wrapped(text, font, width - 6 * pad)
    ]
    wide = round(max(font.getlength(part) for part, font in shown)) + 4 * pad
    line = _line(fonts[0]) + pad // 2
    board, draw = _board(wide, line * len(shown) + 2 * pad)
    for number, (part, font) in enumerate(shown):
        middle = (wide - font.getlength(part)) / 2
        draw.text((middle, pad + line * number), part, INK, font)
    rows = board.size[1]
    return _finished(board, (width - wide) // 2, height - rows - pad)


def _wrapped(text: str, font: ImageFont.FreeTypeFont, wide: float) -> list[str]:
    """The text in lines that are not too wide."""
    lines = [""]
    for word in text.split():
        longer = f"{lines[-1]} {word}".strip()
        if font.getlength(longer) <= wide or not lines[-1]:
            lines[-1] = longer
        else:
            lines.append(word)
    return lines


def _sizes(width: int, height: int) -> tuple[int, int]:
    """Size of the text and air around it, pixels."""
    size = max(14, round(min(height, 0.75 * width) / 22))
    return size, max(4, size // 3)


@functools.cache
def _font(size: int, bold: bool = False) -> ImageFont.FreeTypeFont:
    """DejaVu Sans, which comes with Matplotlib; its digits are equally wide."""
    name = "DejaVuSans-Bold.ttf" if bold else "DejaVuSans.ttf"
    path = Path(matplotlib.get_data_path()) / "fonts" / "ttf" / name
    return ImageFont.truetype(str(path), size)


def _line(font: ImageFont.FreeTypeFont) -> int:
    """Height of a line of text, pixels."""
    return sum(font.getmetrics())


def _board(wide: int, tall: int) -> tuple[Image.Image, ImageDraw.ImageDraw]:
    board = Image.new("RGBA", (wide, tall), (*PAPER, round(255 * _COVER)))
    return board, ImageDraw.Draw(board)


def _finished(board: Image.Image, left: int, top: int) -> Sign:
    values = np.asarray(board).astype(np.float32)
    share = values[..., 3:] / 255
    return Sign(left, top, values[..., :3] * share, 1 - share)
