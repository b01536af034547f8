"""Short texts drawn into images, and where they are placed."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from burg_drake.core import Array, Booleans, Bytes

PLATE_COLOR = (24, 28, 34)  # RGB behind a text.
TEXT_COLOR = (255, 255, 255)  # RGB of texts.
NOTICE_COLOR = (255, 214, 120)  # RGB of notices.

PixelCorner = tuple[int, int]
"""Column and row of a tag's upper left corner [pixels]."""
Tag = tuple[Bytes, NDArray[np.uint16]]
"""(h, w, 3) colours of a tag and (h, w, 1) its opacity in 0 to 256."""


@lru_cache(maxsize=512)
def render_tag(text: str, color: tuple[int, int, int] = TEXT_COLOR, height: int = 14) -> Tag:
    """Renders a tag: a line of text on a dark rounded rectangle.

    Args:
        text: one line.
        color: RGB of the letters, 0 to 255.
        height: size of the font [pixels].

    Returns:
        (h, w, 3) colours, and (h, w, 1) opacity in 0 to 256.
    """
    padding = (6, 3)  # Pixels at the sides, and above and below the text.
    font = ImageFont.load_default(height)
    left, _, right, _ = font.getbbox(text or " ")
    # Letters that ascend and descend, so that the tags of all texts have the same height.
    _, line_top, _, line_bottom = font.getbbox("Ag")
    width = int(np.ceil(right - left)) + 2 * padding[0]
    height = int(np.ceil(line_bottom - line_top)) + 2 * padding[1]
    picture = Image.new("RGB", (width, height), PLATE_COLOR)
    ImageDraw.Draw(picture).text(
        (padding[0] - left, padding[1] - line_top), text, fill=color, font=font
    )
    # Drawn at four times the size and averaged, for smooth corners.
    rounded = Image.new("L", (4 * width, 4 * height), 0)
    ImageDraw.Draw(rounded).rounded_rectangle((0, 0, 4 * width - 1, 4 * height - 1), 20, fill=255)
    opacity = np.asarray(rounded.resize((width, height), Image.Resampling.BOX), np.uint16)
    ink = np.abs(np.asarray(picture, np.int16) - PLATE_COLOR).max(axis=2) > 0
    opacity = np.where(ink, opacity, opacity * 9 // 10)
    return np.asarray(picture), (opacity * 256 // 255)[..., None].astype(np.uint16)


def draw_notice(image: Bytes, text: str) -> Bytes:
    """Copies an image (H, W, 3) and draws a text in its corner, wrapped if it is long."""
    drawn = np.array(image, order="C")
    x, y = 8, 8
    for line in _wrap_text(text, drawn.shape[1] - 2 * x):
        tag = render_tag(line, NOTICE_COLOR)
        _draw_tag(drawn, tag, (x, y))
        y += tag[0].shape[0] + 2
    return drawn


def _wrap_text(text: str, width: int) -> list[str]:
    """Wraps a text to lines whose tags are at most `width` pixels wide; long words stay whole."""
    lines = [""]
    for word in text.split():
        longer = f"{lines[-1]} {word}".strip()
        if lines[-1] and render_tag(longer, NOTICE_COLOR)[0].shape[1] > width:
            lines.append(word)
        else:
            lines[-1] = longer
    return lines


def _draw_tag(image: Bytes, tag: Tag, corner: PixelCorner) -> None:
    """Draws a tag into an image (H, W, 3), in place, clipped to the image.

    Args:
        corner: column and row of the tag's upper left corner.
    """
    colors, opacity = tag
    x, y = corner
    height, width = image.shape[:2]
    x0, y0 = max(x, 0), max(y, 0)
    x1, y1 = min(x + colors.shape[1], width), min(y + colors.shape[0], height)
    if x0 >= x1 or y0 >= y1:
        return
    inside = slice(y0 - y, y1 - y), slice(x0 - x, x1 - x)
    alpha, under = opacity[inside], image[y0:y1, x0:x1]
    image[y0:y1, x0:x1] = (under * (256 - alpha) + colors[inside] * alpha) >> 8


def draw_tags(image: Bytes, boxes: Array, tags: Sequence[Tag], keep_clear: Booleans) -> None:
    """Draws tags into an image (H, W, 3), in place; see `find_tag_corners`.

    A tag far from its box gets a line to the middle of the box.
    """
    sizes = [(colors.shape[1], colors.shape[0]) for colors, _ in tags]
    corners = find_tag_corners(boxes, sizes, keep_clear)
    for corner, size, box in zip(corners, sizes, boxes, strict=True):
        low, high = np.array(corner), np.array(corner) + size
        gap = np.maximum(np.maximum(box[0] - high, low - box[1]), 0.0)
        if np.hypot(*gap) > 12.0:  # Pixels.
            middle = np.round(box.mean(axis=0)).astype(int)
            start = np.clip(middle, low, high)
            cv2.line(image, start.tolist(), middle.tolist(), PLATE_COLOR, 1, cv2.LINE_AA)
    for tag, corner in zip(tags, corners, strict=True):
        _draw_tag(image, tag, corner)


def find_tag_corners(
    boxes: Array, sizes: Sequence[tuple[int, int]], keep_clear: Booleans
) -> list[PixelCorner]:
    """Finds a place for each tag.

    Args:
        boxes: (N, 2, 2) boxes of the named objects, least and largest x and y [pixels].
        sizes: width and height of the tags [pixels].
        keep_clear: (H, W) pixels of the image that the tags should not cover.

    Returns:
        Column and row of the tags' upper left corners: near the box, without overlap if possible,
        at the lowest cost: the covered share plus the distance from the box.
    """
    image = keep_clear.shape[1], keep_clear.shape[0]
    covered = cv2.integral(keep_clear.astype(np.uint8))
    placed: list[tuple[int, int, int, int]] = []
    corners: list[PixelCorner] = [(0, 0)] * len(sizes)

    def cost(corner: PixelCorner, step: int, size: tuple[int, int]) -> float:
        (x, y), (width, height) = corner, size
        right, bottom = min(x + width, image[0]), min(y + height, image[1])
        hidden = covered[bottom, right] - covered[y, right] - covered[bottom, x] + covered[y, x]
        # Cost of moving a tag by its height, as a covered fraction of the tag.
        return float(hidden) / (width * height) + 0.05 * step

    # From the top of the image down: tags go above their boxes, so higher objects choose first.
    for i in np.argsort(boxes[:, 0, 1], kind="stable"):
        size = sizes[i]
        options = []
        for corner, step in _candidate_corners(boxes[i], *size):
            limits = zip(corner, size, image, strict=True)
            x, y = (min(max(c, 0), max(n - s, 0)) for c, s, n in limits)
            options.append(((x, y), step))
        free = [o for o in options if not any(_boxes_overlap((*o[0], *size), p) for p in placed)]
        corners[i] = min(free or options, key=lambda o: cost(o[0], o[1], size))[0]
        placed.append((*corners[i], *sizes[i]))
    return corners


def _candidate_corners(box: Array, width: int, height: int) -> list[tuple[PixelCorner, int]]:
    """Candidate corners of a tag around a box, with their distance in steps. Their order breaks
    ties.
    """
    (left, top), (right, bottom) = np.round(box).astype(int).tolist()
    x, y = (left + right - width) // 2, (top + bottom - height) // 2
    options: list[tuple[PixelCorner, int]] = []
    for step in range(4):  # Distances from the box, in heights of a tag.
        away = 4 + step * (height + 2)  # Pixels.
        for tag_x in (x, left, right - width):
            options += [((tag_x, top - height - away), step), ((tag_x, bottom + away), step)]
        for tag_y in (y, top, bottom - height):
            options += [((right + away, tag_y), step), ((left - width - away, tag_y), step)]
    return [*options, ((x, y), 0)]


def _boxes_overlap(a: tuple[int, int, int, int], b: tuple[int, int, int, int]) -> bool:
    return all(a[k] < b[k] + b[k + 2] + 1 and b[k] < a[k] + a[k + 2] + 1 for k in (0, 1))
