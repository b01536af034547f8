"""Short texts drawn into images: names, numbers, notices."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from burg_drake.core import Bytes

PADDING = (6, 3)
"""Around a text, to the sides and above and below [pixels]."""
DARK = (24, 28, 34)
WHITE = (255, 255, 255)
NOTICE = (255, 214, 120)
NOTICE_CORNER = (8, 8)


@lru_cache(maxsize=512)
def tag(
    text: str, color: tuple[int, int, int] = WHITE, height: int = 14
) -> tuple[Bytes, NDArray[np.uint16]]:
    """A line of text on a dark rounded plate.

    Args:
        text: one line.
        color: of the letters, 0 to 255.
        height: of the font [pixels].

    Returns:
        (h, w, 3) colours, and (h, w, 1) opacity in 0 to 256.
    """
    font = ImageFont.load_default(height)
    left, _, right, _ = font.getbbox(text or " ")
    # The line's height, and not the letters', so that plates of all texts are alike.
    _, line_top, _, line_bottom = font.getbbox("Ag")
    width = int(np.ceil(right - left)) + 2 * PADDING[0]
    lines = int(np.ceil(line_bottom - line_top)) + 2 * PADDING[1]
    picture = Image.new("RGB", (width, lines), DARK)
    ImageDraw.Draw(picture).text(
        (PADDING[0] - left, PADDING[1] - line_top), text, fill=color, font=font
    )
    plate = Image.new("L", (4 * width, 4 * lines), 0)
    ImageDraw.Draw(plate).rounded_rectangle((0, 0, 4 * width - 1, 4 * lines - 1), 20, fill=255)
    opacity = np.asarray(plate.resize((width, lines), Image.Resampling.BOX), np.uint16)
    ink = np.abs(np.asarray(picture, np.int16) - DARK).max(axis=2) > 0
    opacity = np.where(ink, opacity, opacity * 9 // 10)
    return np.asarray(picture), (opacity * 256 // 255)[..., None].astype(np.uint16)


def notice(image: Bytes, text: str) -> Bytes:
    """A copy of an image (H, W, 3) with a line of text in its corner, wrapped where it is long."""
    drawn = np.array(image, order="C")
    y = NOTICE_CORNER[1]
    for line in _wrapped(text, drawn.shape[1] - 2 * NOTICE_CORNER[0]):
        plate = tag(line, NOTICE)
        paste(drawn, plate, (NOTICE_CORNER[0], y))
        y += plate[0].shape[0] + 2
    return drawn


def _wrapped(text: str, width: int) -> list[str]:
    """Lines whose tags are not wider than that [pixels], unless a word is."""
    lines = [""]
    for word in text.split():
        longer = f"{lines[-1]} {word}".strip()
        if lines[-1] and tag(longer, NOTICE)[0].shape[1] > width:
            lines.append(word)
        else:
            lines[-1] = longer
    return lines


def paste(image: Bytes, plate: tuple[Bytes, NDArray[np.uint16]], corner: tuple[int, int]) -> None:
    """Draws a tag into an image (H, W, 3), in place; what lies outside is cut off.

    Args:
        corner: where its upper left corner goes: column, row.
    """
    colors, opacity = plate
    x, y = corner
    height, width = image.shape[:2]
    x0, y0 = max(x, 0), max(y, 0)
    x1, y1 = min(x + colors.shape[1], width), min(y + colors.shape[0], height)
    if x0 >= x1 or y0 >= y1:
        return
    a = opacity[y0 - y : y1 - y, x0 - x : x1 - x]
    c = colors[y0 - y : y1 - y, x0 - x : x1 - x]
    under = image[y0:y1, x0:x1]
    image[y0:y1, x0:x1] = (under * (256 - a) + c * a) >> 8
