"""The page about a calibration: residuals, coverage, lens distortion, and uncertainty."""

from __future__ import annotations

import math

import numpy as np

from burg_drake.cameras import (
    BOUND_SIGMAS,
    COVERAGE_GRID,
    Calibration,
    camera_error,
    corner_coverage,
    image_grid,
)
from burg_drake.core import Array, atomic_write
from burg_drake.visualization.html_page import (
    Html,
    element,
    render_page,
    svg_rectangle,
    svg_text,
)

FIGURE_WIDTH = 460.0
"""Width of a drawing of the image, in CSS pixels."""


TEXT_HEX = "#1f2630"
"""Colour of text and points."""
ACCENT_HEX = "#b3261e"
"""Colour of residuals, uncertainty and advice."""
BAR_HEX = "#2f6db5"
"""Colour of bars, coverage and distortion."""


def write_calibration_report(calibration: Calibration, advice: list[str], path: str) -> None:
    """Writes the page, which needs no other file and no network.

    Args:
        calibration: the calibration.
        advice: suggestions for improvement, as sentences.
        path: file to write.

    Raises:
        InvalidInputError: the file cannot be written.
    """
    page = render_page(
        "visualization/calibration_report.html.jinja",
        calibration=calibration,
        advice=advice,
        figures=[
            _residual_figure(calibration),
            _coverage_figure(calibration),
            _uncertainty_figure(calibration),
            _distortion_figure(calibration),
        ],
    )
    atomic_write(path, page)


CaptionedDrawing = tuple[Html, str]
"""A drawing and its caption."""


def _image_svg(calibration: Calibration, *shapes: Html) -> Html:
    """SVG of the image's outline and shapes, in pixels of the image."""
    k = calibration.intrinsics
    line = _line_width(calibration)
    frame = svg_rectangle(
        -0.5, -0.5, k.width, k.height, fill="none", stroke="#c4cad4", stroke_width=line
    )
    height = FIGURE_WIDTH * k.height / k.width
    view = f"-0.5 -0.5 {k.width} {k.height}"
    return element("svg", *shapes, frame, width=FIGURE_WIDTH, height=height, viewBox=view)


def _line_width(calibration: Calibration) -> float:
    """Width of a line of one screen pixel [pixels of the image]."""
    return round(calibration.intrinsics.width / FIGURE_WIDTH, 3)


def _draw_arrows(calibration: Calibration, start: Array, vectors: Array, color: str) -> list[Html]:
    ends = np.concatenate([start, start + vectors], axis=1).round(1)
    path = "".join(f"M{a:g} {b:g}L{c:g} {d:g}" for a, b, c, d in ends.tolist())
    width = _line_width(calibration)
    dots = "".join(f"M{a:g} {b:g}h0" for a, b, _, _ in ends.tolist())
    dot: dict[str, str | float] = {"stroke_width": 2 * width, "stroke_linecap": "round"}
    return [
        element("path", d=path, stroke=color, stroke_width=width, fill="none"),
        element("path", d=dots, stroke=TEXT_HEX, **dot, fill="none"),
    ]


def _residual_figure(calibration: Calibration) -> CaptionedDrawing:
    corners = np.concatenate([used.view.corners for used in calibration.views])
    residuals = np.concatenate([used.residuals for used in calibration.views])
    scale = _floor_to_one_digit(0.03 * calibration.intrinsics.width / max(calibration.rms, 1e-6))
    arrows = _draw_arrows(calibration, corners, scale * residuals, ACCENT_HEX)
    return (
        _image_svg(calibration, *arrows),
        f"Residuals of all corners, {scale:g} times as long. Where neighbours agree, the lens model"
        " is too simple or the target is bent.",
    )


def _draw_cells(calibration: Calibration, shades: Array, words: list[str], color: str) -> Html:
    """Draws a grid over the image, with shades (rows, columns) from 0 to 1 and tooltips."""
    k = calibration.intrinsics
    rows, columns = shades.shape
    width, height = k.width / columns, k.height / rows
    shapes = []
    for index, word in enumerate(words):
        row, column = divmod(index, columns)
        x, y = column * width - 0.5, row * height - 0.5
        opacity = round(float(0.85 * shades[row, column]), 3)
        shapes.append(svg_rectangle(x, y, width, height, fill=color, fill_opacity=opacity))
        ink = "#ffffff" if opacity > 0.5 else TEXT_HEX
        x, y, size = x + width / 2, y + 0.6 * height, 0.026 * k.width
        shapes.append(svg_text(word, x, y, text_anchor="middle", font_size=size, fill=ink))
    return _image_svg(calibration, *shapes)


def _coverage_figure(calibration: Calibration) -> CaptionedDrawing:
    size = (calibration.intrinsics.width, calibration.intrinsics.height)
    counts = corner_coverage([used.view for used in calibration.views], size)
    shades = np.sqrt(counts / max(1, counts.max()))
    words = [str(n) for n in counts.ravel().tolist()]
    return (
        _draw_cells(calibration, shades, words, BAR_HEX),
        "Corners seen in each part of the image. Where there are none, the lens is a guess.",
    )


def _uncertainty_figure(calibration: Calibration) -> CaptionedDrawing:
    max_error = 10.0  # Pixels. Larger errors have the same shade.
    rows, columns = COVERAGE_GRID
    k = calibration.intrinsics
    u = (np.arange(columns) + 0.5) * k.width / columns - 0.5
    v = (np.arange(rows) + 0.5) * k.height / rows - 0.5
    places = np.stack(np.meshgrid(u, v), axis=-1).reshape(-1, 2)
    bounds = BOUND_SIGMAS * camera_error(
        calibration.intrinsics, calibration.hypotheses, calibration.corners, places
    )
    bounds = np.nan_to_num(bounds, posinf=1e9, nan=1e9)
    shades = np.clip(bounds / max(1.0, min(bounds.max(), max_error)), 0.0, 1.0)
    words = [f"{b:.2f}" if b < max_error else f">{max_error:g}" for b in bounds.tolist()]
    return (
        _draw_cells(calibration, shades.reshape(COVERAGE_GRID), words, ACCENT_HEX),
        "How far the camera model may be off in the middle of each part, in 19 of 20 cases"
        " [pixels]; towards the corners of the image it is more. It counts the scatter of the"
        " residuals, how far the views disagree, and how far lens models differ that fit as well."
        " Where it is large, show more of the target.",
    )


def _distortion_figure(calibration: Calibration) -> CaptionedDrawing:
    k = calibration.intrinsics
    seen = image_grid(k, 17, 13)
    moved, straight = seen - k.undistort(seen), "a straight image"
    if k.is_fisheye:
        rays = k.rays(seen)
        angle = np.arccos(rays[:, 2:])
        even = rays[:, :2] / np.maximum(np.sin(angle), 1e-9) * angle
        moved, straight = seen - (even * k.focal + k.center), "an image of even angles"
    longest = float(np.linalg.norm(moved, axis=1).max())
    scale = _floor_to_one_digit(min(1.0, 0.08 * k.width / max(longest, 1e-6)))
    arrows = _draw_arrows(calibration, seen - scale * moved, scale * moved, BAR_HEX)
    return (
        _image_svg(calibration, *arrows),
        f"Where the lens moves points of {straight} to (dots: from), {scale:g} times as long;"
        f" {longest:.1f} pixels at most.",
    )


def _floor_to_one_digit(value: float) -> float:
    """Rounds a number down to one significant digit."""
    power = 10.0 ** math.floor(math.log10(value))
    return float(f"{math.floor(value / power) * power:.1g}")
