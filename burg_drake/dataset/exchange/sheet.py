"""The contact sheet: samples as a person looks at them, with colour, depth and labels side by side.

As one PNG, or as a page that stands alone.
"""

from __future__ import annotations

import base64
from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np
from PIL import Image, ImageDraw, ImageFont

from burg_drake.core import Array, Bytes, InvalidInputError, Single, listing
from burg_drake.core.files import atomic_write
from burg_drake.core.terminal import distinct_colors
from burg_drake.dataset.labels import InstanceLabel
from burg_drake.dataset.samples import Sample, encode_png
from burg_drake.visualization.style import Html, element, html_document, map_colors

PANEL = 320
"""Width of each image [pixel]."""
GAP, CAPTION = 6, 20
PAPER, INK = (255, 255, 255), (29, 35, 40)
NOTHING = (70, 70, 70)
"""Where there is no depth."""
MISSING = (225, 229, 233)
"""In place of labels that the sample has not."""
OPACITY = 0.5
"""Of labels on the picture."""
LUMA = (0.299, 0.587, 0.114)
"""Share of red, green and blue in the lightness of a colour (ITU-R BT.601)."""
TEXT = 12
SMALLEST = (cv2.IMWRITE_PNG_COMPRESSION, 9)
"""Pages are sent around: 0.8 of the bytes."""
SUFFIXES = (".png", ".html")
STYLE = """
body { font: 14px/1.4 system-ui, sans-serif; color: #1d2328; background: #fff; margin: 16px; }
main { display: grid; gap: 16px; }
figure { margin: 0; } img { max-width: 100%; height: auto; display: block; }
figcaption { color: #5b656e; overflow-wrap: anywhere; }
"""


def contact_sheet(
    samples: Sequence[Sample], path: str | Path, rows: int = 4, columns: int = 1, *, title: str = ""
) -> None:
    """Writes samples from all over a data set, evenly spaced: colour, depth and labels of each.

    Depth is bright where it is near, and grey where there is none; its limits are in the caption.
    Beside it is that of the sensor, if there is one, in the same colours.
    Labels are colours of instances, with names and the boxes of what is visible.

    Args:
        samples: the data set.
        path: file to write, `.png` or `.html`.
        rows, columns: of samples.
        title: of the page.

    Raises:
        InvalidInputError: another suffix, no samples, or the file cannot be written.
    """
    path = Path(path)
    if path.suffix not in SUFFIXES:
        raise InvalidInputError(f"{path} must end in {' or '.join(SUFFIXES)}")
    if rows < 1 or columns < 1:
        raise InvalidInputError(
            f"a sheet of {rows} x {columns} samples is empty; give at least 1 row and 1 column"
        )
    chosen = [samples[k] for k in spread(len(samples), rows * columns)]
    if not chosen:
        raise InvalidInputError(f"cannot write {path}: the data set has no samples")
    if path.suffix == ".html":
        atomic_write(path, _page(chosen, columns, title))
    else:
        atomic_write(path, sheet_png(chosen, columns))


def spread(count: int, wanted: int) -> list[int]:
    """Positions in a sequence, evenly spaced, without repetitions."""
    return [int(k) for k in np.unique(np.linspace(0, count - 1, min(count, wanted)).round())]


def sheet_png(samples: Sequence[Sample], columns: int) -> bytes:
    """Samples in rows, each with a caption, as a PNG file."""
    cells = [_captioned(sample) for sample in samples]
    tall, wide = (max(cell.shape[k] for cell in cells) for k in (0, 1))
    columns = min(columns, len(cells))
    rows = -(-len(cells) // columns)
    size = (rows * (tall + GAP) + GAP, columns * (wide + GAP) + GAP, 3)
    sheet = np.full(size, PAPER, dtype=np.uint8)
    for k, cell in enumerate(cells):
        y, x = GAP + k // columns * (tall + GAP), GAP + k % columns * (wide + GAP)
        sheet[y : y + cell.shape[0], x : x + cell.shape[1]] = cell
    return encode_png(sheet, SMALLEST)


def sample_picture(sample: Sample) -> Bytes:
    """(h, w, 3) colour, depth, that of the sensor and labels side by side; what the sample has not
    is left out."""
    intrinsics = sample.view.intrinsics
    height = max(1, round(PANEL * intrinsics.height / intrinsics.width))
    color, limits = sample.images.color, _limits(sample)
    panels = [] if color is None else [_panel(color, height)]
    for depth in (sample.images.depth, sample.sensor_depth):
        if depth is not None:
            panels.append(_panel(depth_colors(depth, limits), height))
    panels.append(_labelled(sample, height))
    gap = np.full((height, GAP, 3), PAPER, dtype=np.uint8)
    return np.hstack([image for panel in panels for image in (gap, panel)][1:])


def depth_colors(depth: Single, limits: tuple[float, float]) -> Bytes:
    """(H, W, 3) colours of a depth image, bright for near, between two depths [m]."""
    lower, upper = limits
    share = np.clip(1.0 - (depth - lower) / max(upper - lower, 1e-6), 0.0, 1.0)
    colors = np.rint(255.0 * map_colors(share)).astype(np.uint8)
    colors[depth <= 0.0] = NOTHING
    return colors


def depth_limits(depth: Single) -> tuple[float, float]:
    """Nearest and farthest depth of an image [m]; zeros if there is none."""
    there = depth[depth > 0.0]
    return (float(there.min()), float(there.max())) if there.size else (0.0, 0.0)


def sample_caption(sample: Sample) -> str:
    """What a sample shows, in a line."""
    seen = [label for label in sample.instances if label.visible_pixels]
    text = f"{sample.key}, camera {sample.view.camera}, {len(seen)} of {len(sample.instances)} seen"
    if sample.images.depth is not None or sample.sensor_depth is not None:
        lower, upper = _limits(sample)
        text += f", depth {lower:.2f} to {upper:.2f} m"
    return text


def _limits(sample: Sample) -> tuple[float, float]:
    """Limits of the exact depth, else of the sensor's [m]."""
    exact = sample.images.depth
    depth = sample.sensor_depth if exact is None else exact
    return (0.0, 0.0) if depth is None else depth_limits(depth)


def _labelled(sample: Sample, height: int) -> Bytes:
    """Labels over the picture in grey, with names and boxes."""
    labels, color = sample.images.labels, sample.images.color
    if labels is None:
        return np.full((height, PANEL, 3), MISSING, dtype=np.uint8)
    grey = np.full((*labels.shape, 3), 128.0)
    if color is not None:
        grey[:] = (color @ np.array(LUMA))[..., None]
    tints = _tints(sample.instances)
    for label in sample.instances:
        mask = labels == label.number
        grey[mask] = (1.0 - OPACITY) * grey[mask] + OPACITY * np.array(tints[label.number])
    picture = Image.fromarray(_panel(grey.astype(np.uint8), height))
    draw = ImageDraw.Draw(picture)
    scale = picture.width / labels.shape[1]
    font = ImageFont.load_default(size=TEXT)
    seen = [label for label in sample.instances if label.visible_box is not None]
    boxes = {label.number: scale * np.array(label.visible_box, dtype=float) for label in seen}
    for number, (x, y, wide, tall) in boxes.items():
        corners = (x, y, x + max(wide - 1, 1), y + max(tall - 1, 1))
        draw.rectangle(corners, outline=tints[number])
    taken: list[Array] = []
    for label in seen:
        tint = tints[label.number]
        size = np.add(draw.textbbox((0, 0), label.name, font=font)[2:], (4, 3))
        place = tag_place(boxes[label.number], size, picture.size, taken)
        taken.append(place)
        draw.rectangle((*place[:2], *(place[2:] - 1)), fill=tint)
        draw.text((place[0] + 2, place[1]), label.name, fill=_readable(tint), font=font)
    return np.asarray(picture)


def tag_place(box: Array, size: Array, image: tuple[int, int], taken: Sequence[Array]) -> Array:
    """Where a name is written: at one of the sides of its box, or in it, wherever it covers least
    of the names that are there.

    Args:
        box: (4,) left, top, width, height [pixel].
        size: (2,) width and height of the name.
        image: width and height of the picture, which it does not leave.
        taken: (4,) left, top, right, bottom of each name that is there.

    Returns:
        (4,) left, top, right, bottom.
    """
    (x, y, wide, tall), (w, h) = box, size
    columns = (x, x + wide - w, x + (wide - w) / 2)
    places = [(column, row) for row in (y - h, y + tall) for column in columns]
    places += [(x + wide, y + (tall - h) / 2), (x - w, y + (tall - h) / 2), (x, y)]
    room = np.maximum(np.array(image) - size, 0)
    found = [np.concatenate([p, p + size]) for p in np.clip(np.rint(places), 0, room)]
    return min(found, key=lambda place: sum(_shared(place, other) for other in taken))


def _shared(one: Array, other: Array) -> float:
    """Area that two rectangles share."""
    sides = np.minimum(one[2:], other[2:]) - np.maximum(one[:2], other[:2])
    return float(np.prod(np.maximum(sides, 0.0)))


def _tints(instances: Sequence[InstanceLabel]) -> dict[int, tuple[int, int, int]]:
    """Colours by number."""
    found = {}
    for label, color in zip(instances, distinct_colors(len(instances)), strict=True):
        red, green, blue = (round(255 * c) for c in color)
        found[label.number] = (red, green, blue)
    return found


def _readable(tint: tuple[int, int, int]) -> tuple[int, int, int]:
    """Black or white, whichever stands out."""
    return (0, 0, 0) if np.dot(tint, LUMA) > 140.0 else (255, 255, 255)


def _panel(image: Bytes, height: int) -> Bytes:
    smaller = image.shape[1] > PANEL
    how = Image.Resampling.BOX if smaller else Image.Resampling.NEAREST
    return np.asarray(Image.fromarray(image).resize((PANEL, height), how))


def _captioned(sample: Sample) -> Bytes:
    picture = sample_picture(sample)
    strip = Image.new("RGB", (picture.shape[1], CAPTION), PAPER)
    font = ImageFont.load_default(size=TEXT)
    ImageDraw.Draw(strip).text((1, 2), sample_caption(sample), fill=INK, font=font)
    return np.vstack([np.asarray(strip), picture])


def _page(samples: Sequence[Sample], columns: int, title: str) -> str:
    heading = title or "Samples"
    grid = f"{STYLE}main {{ grid-template-columns: repeat({columns}, minmax(0, 1fr)); }}"
    figures = [_figure(sample) for sample in samples]
    return html_document(heading, grid, element("h1", heading), element("main", *figures))


def _figure(sample: Sample) -> Html:
    picture = sample_picture(sample)
    data = base64.b64encode(encode_png(picture, SMALLEST)).decode()
    names = listing([label.name for label in sample.instances if label.visible_pixels])
    return element(
        "figure",
        element(
            "img",
            src=f"data:image/png;base64,{data}",
            alt=f"images of sample {sample.key}: {names}",
            width=picture.shape[1],
            height=picture.shape[0],
        ),
        element("figcaption", sample_caption(sample)),
    )
