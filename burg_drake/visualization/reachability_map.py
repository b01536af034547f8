"""Reachability maps from above: as an inline SVG of the board, and as an image of the board."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from burg_drake.core import Array
from burg_drake.motion import ReachabilityMap, ReachLayer
from burg_drake.scene import Scene, placed_vertices
from burg_drake.visualization.colors import hex_color, map_colors
from burg_drake.visualization.html_page import (
    Html,
    element,
    join,
    svg_rectangle,
    svg_text,
)

CHART_WIDTH = 320  # Width of the chart, in SVG units.
CHART_TITLE_HEIGHT = 18
"""Height of the chart's title, in SVG units."""


def reachability_chart(
    reachability: ReachabilityMap, height: int, outlines: Mapping[str, Array]
) -> Html:
    """The map at one height, with outlines of objects on it.

    Args:
        reachability: the map.
        height: index of the height.
        outlines: corners (N, 2) around each object in the scene frame [m], by name.
    """
    outline_style = "fill:none;stroke:#fff;stroke-width:1.2"
    name_style = (
        "fill:#fff;font-size:10px;text-anchor:middle;paint-order:stroke;stroke:#0008;"
        "stroke-width:2.5px"
    )
    dx, dy = reachability.cell
    depth = dy * len(reachability.y)
    scale = CHART_WIDTH / (dx * len(reachability.x))
    cells, shapes = [], []
    for (j, i), share in np.ndenumerate(reachability.share[height]):
        tip = f"x {reachability.x[i]:.2f} m, y {reachability.y[j]:.2f} m: {100 * share:.0f} %"
        x, y = scale * i * dx, CHART_TITLE_HEIGHT + scale * (depth - (j + 1) * dy)
        color = hex_color(map_colors(share))
        cells.append(svg_rectangle(x, y, scale * dx, scale * dy, element("title", tip), fill=color))
    for name, corners in outlines.items():
        u, v = scale * corners[:, 0], CHART_TITLE_HEIGHT + scale * (depth - corners[:, 1])
        d = "M" + "L".join(f"{a:.1f} {b:.1f}" for a, b in zip(u, v, strict=True)) + "Z"
        shapes.append(element("path", d=d, style=outline_style))
        x, y = (u.min() + u.max()) / 2, (v.min() + v.max()) / 2 + 3.5
        shapes.append(svg_text(name, float(x), float(y), style=name_style))
    title = f"{100 * reachability.heights[height]:g} cm above the board"
    return element(
        "svg",
        svg_text(title, 0, 12, "title"),
        element("g", *cells, shape_rendering="crispEdges"),
        *shapes,
        viewBox=f"0 0 {CHART_WIDTH} {CHART_TITLE_HEIGHT + scale * depth:.1f}",
        class_="histogram",
        role="img",
        aria_label=f"What the arm reaches {title}",
    )


def reachability_key() -> Html:
    """Colour key, from no to all hand orientations."""
    colors = map_colors((np.arange(10) + 0.5) / 10)
    bars = [
        svg_rectangle(16 * k, 0, 16, 10, fill=hex_color(color)) for k, color in enumerate(colors)
    ]
    picture = element("svg", *bars, viewBox="0 0 160 10", width=160, height=10)
    return element("p", join("none ", picture, " all orientations"), class_="legend")


def object_outlines(scene: Scene) -> dict[str, Array]:
    """Convex outlines (N, 2) of a scene's free objects, seen from above, in the scene frame [m]."""
    found = {}
    for name in scene.instances:
        p_SV = placed_vertices(scene, name)[:, :2]
        found[name] = p_SV[ConvexHull(p_SV).vertices]
    return found


def reach_image(layer: ReachLayer, *, pixels: int = 1, opacity: float = 1.0) -> NDArray[np.uint8]:
    """Image of the shares of reachable hand orientations at one height.

    Args:
        layer: the layer of the map.
        pixels: pixels along each side of a point's cell.
        opacity: opacity of all colours, 0 to 1.

    Returns:
        (H, W, 4) red, green, blue, opacity; it covers the board, its first row along the upper edge
        of the sheet (largest y of S), its first column along the left one.
    """
    colors = np.empty((*layer.share.shape, 4))
    colors[..., :3] = map_colors(layer.share)
    colors[..., 3] = opacity
    bytes_ = np.round(255.0 * np.clip(colors[::-1], 0.0, 1.0)).astype(np.uint8)
    return np.ascontiguousarray(bytes_.repeat(pixels, axis=0).repeat(pixels, axis=1))
