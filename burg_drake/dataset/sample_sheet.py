"""Contact sheets: colour, depth and labels of samples side by side, as PNG or HTML."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np
from PIL import Image, ImageDraw, ImageFont

from burg_drake.core import (
    Array,
    Bytes,
    InvalidInputError,
    Single,
    atomic_write,
    distinct_colors,
    list_names,
)
from burg_drake.dataset.sample import InstanceLabel, Sample
from burg_drake.dataset.sample_encoding import encode_png
from burg_drake.visualization import map_colors, render_page

LUMA_WEIGHTS = (0.299, 0.587, 0.114)
"""Weights of red, green and blue in the lightness of a colour (ITU-R BT.601)."""


class SheetStyle:
    """Sizes [pixel] and colours (sRGB) of a contact sheet."""

    panel_width = 320
    gap = 6  # Between panels.
    background_color = (255, 255, 255)
    font_size = 12


SMALL_PNG_OPTIONS = (cv2.IMWRITE_PNG_COMPRESSION, 9)
"""Options of OpenCV for the smallest PNG files, with 0.8 of the usual bytes."""


def contact_sheet(
    samples: Sequence[Sample], path: str | Path, rows: int = 4, columns: int = 1, *, title: str = ""
) -> None:
    """Writes colour, depth and labels of samples that are evenly spaced over a data set.

    Near depth is bright, missing depth is grey; the caption has the depth limits. The sensor's
    depth, if any, is beside it in the same colours. Labels are drawn as colours of instances, with
    their names and visible bounding boxes.

    Args:
        samples: the data set.
        path: file to write, `.png` or `.html`.
        rows, columns: numbers of rows and columns of samples.
        title: title of the page.

    Raises:
        InvalidInputError: another suffix, no samples, or the file cannot be written.
    """
    suffixes = (".png", ".html")
    path = Path(path)
    if path.suffix not in suffixes:
        raise InvalidInputError(f"{path} must end in {' or '.join(suffixes)}")
    if rows < 1 or columns < 1:
        raise InvalidInputError(
            f"a sheet of {rows} x {columns} samples is empty; give at least 1 row and 1 column"
        )
    chosen = [samples[k] for k in evenly_spaced_indices(len(samples), rows * columns)]
    if not chosen:
        raise InvalidInputError(f"cannot write {path}: the data set has no samples")
    if path.suffix == ".html":
        atomic_write(path, _sheet_html(chosen, columns, title))
    else:
        atomic_write(path, sheet_png(chosen, columns))


def evenly_spaced_indices(count: int, wanted: int) -> list[int]:
    """Evenly spaced indices of a sequence, without repetitions."""
    return [int(k) for k in np.unique(np.linspace(0, count - 1, min(count, wanted)).round())]


def sheet_png(samples: Sequence[Sample], columns: int) -> bytes:
    """Samples in rows, each with a caption, as a PNG file."""
    cells = [_captioned_picture(sample) for sample in samples]
    tall, wide = (max(cell.shape[k] for cell in cells) for k in (0, 1))
    columns = min(columns, len(cells))
    rows = -(-len(cells) // columns)
    gap = SheetStyle.gap
    size = (rows * (tall + gap) + gap, columns * (wide + gap) + gap, 3)
    sheet = np.full(size, SheetStyle.background_color, dtype=np.uint8)
    for k, cell in enumerate(cells):
        y, x = gap + k // columns * (tall + gap), gap + k % columns * (wide + gap)
        sheet[y : y + cell.shape[0], x : x + cell.shape[1]] = cell
    return encode_png(sheet, SMALL_PNG_OPTIONS)


def sample_picture(sample: Sample) -> Bytes:
    """(h, w, 3) colour, depth, sensor depth and labels side by side, as far as the sample has
    them."""
    intrinsics = sample.view.intrinsics
    height = max(1, round(SheetStyle.panel_width * intrinsics.height / intrinsics.width))
    color, limits = sample.images.color, _sample_depth_limits(sample)
    panels = [] if color is None else [_resize_to_panel(color, height)]
    for depth in (sample.images.depth, sample.sensor_depth):
        if depth is not None:
            panels.append(_resize_to_panel(depth_colors(depth, limits), height))
    panels.append(_draw_labels(sample, height))
    gap = np.full((height, SheetStyle.gap, 3), SheetStyle.background_color, dtype=np.uint8)
    return np.hstack([image for panel in panels for image in (gap, panel)][1:])


def depth_colors(depth: Single, limits: tuple[float, float]) -> Bytes:
    """(H, W, 3) colours of a depth image, bright for near, between two depths [m]."""
    lower, upper = limits
    share = np.clip(1.0 - (depth - lower) / max(upper - lower, 1e-6), 0.0, 1.0)
    colors = np.rint(255.0 * map_colors(share)).astype(np.uint8)
    colors[depth <= 0.0] = (70, 70, 70)
    return colors


def depth_limits(depth: Single) -> tuple[float, float]:
    """Nearest and farthest depth of an image [m]; zeros without depth."""
    measured = depth[depth > 0.0]
    return (float(measured.min()), float(measured.max())) if measured.size else (0.0, 0.0)


def sample_caption(sample: Sample) -> str:
    """One-line caption of a sample."""
    seen = [label for label in sample.instances if label.visible_pixels]
    text = f"{sample.key}, camera {sample.view.camera}, {len(seen)} of {len(sample.instances)} seen"
    if sample.images.depth is not None or sample.sensor_depth is not None:
        lower, upper = _sample_depth_limits(sample)
        text += f", depth {lower:.2f} to {upper:.2f} m"
    return text


def _sample_depth_limits(sample: Sample) -> tuple[float, float]:
    """Limits of the exact depth, or else of the sensor's depth [m]."""
    exact = sample.images.depth
    depth = sample.sensor_depth if exact is None else exact
    return (0.0, 0.0) if depth is None else depth_limits(depth)


def _draw_labels(sample: Sample, height: int) -> Bytes:
    """Draws labels over the colours in grey, with names and boxes."""
    labels, color = sample.images.labels, sample.images.color
    if labels is None:
        return np.full((height, SheetStyle.panel_width, 3), (225, 229, 233), dtype=np.uint8)
    grey = np.full((*labels.shape, 3), 128.0)
    if color is not None:
        grey[:] = (color @ np.array(LUMA_WEIGHTS))[..., None]
    tints = _instance_colors(sample.instances)
    for label in sample.instances:
        mask = labels == label.number
        grey[mask] = 0.5 * grey[mask] + 0.5 * np.array(tints[label.number])
    picture = Image.fromarray(_resize_to_panel(grey.astype(np.uint8), height))
    draw = ImageDraw.Draw(picture)
    scale = picture.width / labels.shape[1]
    font = ImageFont.load_default(size=SheetStyle.font_size)
    seen = [label for label in sample.instances if label.visible_box is not None]
    boxes = {label.number: scale * np.array(label.visible_box, dtype=float) for label in seen}
    for number, (x, y, wide, tall) in boxes.items():
        corners = (x, y, x + max(wide - 1, 1), y + max(tall - 1, 1))
        draw.rectangle(corners, outline=tints[number])
    taken: list[Array] = []
    for label in seen:
        tint = tints[label.number]
        size = np.add(draw.textbbox((0, 0), label.name, font=font)[2:], (4, 3))
        place = place_name_tag(boxes[label.number], size, picture.size, taken)
        taken.append(place)
        draw.rectangle((*place[:2], *(place[2:] - 1)), fill=tint)
        draw.text((place[0] + 2, place[1]), label.name, fill=_contrasting_color(tint), font=font)
    return np.asarray(picture)


def place_name_tag(
    box: Array, size: Array, image: tuple[int, int], taken: Sequence[Array]
) -> Array:
    """Place for a name at a side of its box, or in it, with the least overlap with other names.

    Args:
        box: (4,) left, top, width, height [pixel].
        size: (2,) width and height of the name.
        image: width and height of the picture, which has to contain the name.
        taken: (4,) left, top, right, bottom of each name placed so far.

    Returns:
        (4,) left, top, right, bottom.
    """
    (x, y, wide, tall), (w, h) = box, size
    columns = (x, x + wide - w, x + (wide - w) / 2)
    places = [(column, row) for row in (y - h, y + tall) for column in columns]
    places += [(x + wide, y + (tall - h) / 2), (x - w, y + (tall - h) / 2), (x, y)]
    room = np.maximum(np.array(image) - size, 0)
    found = [np.concatenate([p, p + size]) for p in np.clip(np.rint(places), 0, room)]
    return min(found, key=lambda place: sum(_overlap_area(place, other) for other in taken))


def _overlap_area(one: Array, other: Array) -> float:
    """Area of the intersection of two rectangles."""
    sides = np.minimum(one[2:], other[2:]) - np.maximum(one[:2], other[:2])
    return float(np.prod(np.maximum(sides, 0.0)))


def _instance_colors(instances: Sequence[InstanceLabel]) -> dict[int, tuple[int, int, int]]:
    """Colours of instances, by number."""
    found = {}
    for label, color in zip(instances, distinct_colors(len(instances)), strict=True):
        red, green, blue = (round(255 * c) for c in color)
        found[label.number] = (red, green, blue)
    return found


def _contrasting_color(tint: tuple[int, int, int]) -> tuple[int, int, int]:
    """Black or white, whichever has more contrast."""
    return (0, 0, 0) if np.dot(tint, LUMA_WEIGHTS) > 140.0 else (255, 255, 255)


def _resize_to_panel(image: Bytes, height: int) -> Bytes:
    smaller = image.shape[1] > SheetStyle.panel_width
    how = Image.Resampling.BOX if smaller else Image.Resampling.NEAREST
    return np.asarray(Image.fromarray(image).resize((SheetStyle.panel_width, height), how))


def _captioned_picture(sample: Sample) -> Bytes:
    picture = sample_picture(sample)
    strip = Image.new("RGB", (picture.shape[1], 20), SheetStyle.background_color)
    font = ImageFont.load_default(size=SheetStyle.font_size)
    ImageDraw.Draw(strip).text((1, 2), sample_caption(sample), fill=(29, 35, 40), font=font)
    return np.vstack([np.asarray(strip), picture])


def _sheet_html(samples: Sequence[Sample], columns: int, title: str) -> str:
    figures = []
    for sample in samples:
        picture = sample_picture(sample)
        names = list_names([label.name for label in sample.instances if label.visible_pixels])
        figures.append(
            {
                "png": encode_png(picture, SMALL_PNG_OPTIONS),
                "alt": f"images of sample {sample.key}: {names}",
                "width": picture.shape[1],
                "height": picture.shape[0],
                "caption": sample_caption(sample),
            }
        )
    return render_page(
        "dataset/sample_sheet.html.jinja",
        title=title or "Samples",
        columns=columns,
        figures=figures,
    )
