"""A reachability map as an inline SVG: the board from above, as its sheet is read."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy.spatial import ConvexHull

from burg_drake.core import Array
from burg_drake.motion.workspace import ReachabilityMap
from burg_drake.scene.document import Scene, placed_vertices
from burg_drake.visualization.style import Html, element, hex_color, join, map_colors

WIDTH = 320
TITLE = 18
"""Size of the chart and height of its title in SVG units."""
OUTLINE = "fill:none;stroke:#fff;stroke-width:1.2"
NAME = (
    "fill:#fff;font-size:10px;text-anchor:middle;paint-order:stroke;stroke:#0008;stroke-width:2.5px"
)
STEPS = 10
"""Of the key."""
KEY_STEP, KEY_HEIGHT = 16, 10


def reachability_chart(
    reachability: ReachabilityMap, height: int, outlines: Mapping[str, Array]
) -> Html:
    """The map at one height, with outlines of objects on it.

    Args:
        reachability: the map.
        height: index of the height.
        outlines: corners (N, 2) around each object in the scene frame [m], by name.
    """
    dx, dy = reachability.cell
    depth = dy * len(reachability.y)
    scale = WIDTH / (dx * len(reachability.x))
    cells, shapes = [], []
    for (j, i), share in np.ndenumerate(reachability.share[height]):
        tip = f"x {reachability.x[i]:.2f} m, y {reachability.y[j]:.2f} m: {100 * share:.0f} %"
        cells.append(
            element(
                "rect",
                element("title", tip),
                x=f"{scale * i * dx:.2f}",
                y=f"{TITLE + scale * (depth - (j + 1) * dy):.2f}",
                width=f"{scale * dx:.2f}",
                height=f"{scale * dy:.2f}",
                fill=hex_color(map_colors(share)),
            )
        )
    for name, corners in outlines.items():
        u, v = scale * corners[:, 0], TITLE + scale * (depth - corners[:, 1])
        d = "M" + "L".join(f"{a:.1f} {b:.1f}" for a, b in zip(u, v, strict=True)) + "Z"
        middle = (u.min() + u.max()) / 2, (v.min() + v.max()) / 2 + 3.5
        shapes.append(element("path", d=d, style=OUTLINE))
        shapes.append(element("text", name, x=f"{middle[0]:.1f}", y=f"{middle[1]:.1f}", style=NAME))
    title = f"{100 * reachability.heights[height]:g} cm above the board"
    return element(
        "svg",
        element("text", title, x=0, y=12, class_="title"),
        element("g", *cells, shape_rendering="crispEdges"),
        *shapes,
        viewBox=f"0 0 {WIDTH} {TITLE + scale * depth:.1f}",
        class_="histogram",
        role="img",
        aria_label=f"What the arm reaches {title}",
    )


def reachability_key() -> Html:
    """What the colours stand for, from none to all orientations."""
    colors = map_colors((np.arange(STEPS) + 0.5) / STEPS)
    bars = [
        element(
            "rect", x=k * KEY_STEP, y=0, width=KEY_STEP, height=KEY_HEIGHT, fill=hex_color(color)
        )
        for k, color in enumerate(colors)
    ]
    size = STEPS * KEY_STEP
    picture = element(
        "svg", *bars, viewBox=f"0 0 {size} {KEY_HEIGHT}", width=size, height=KEY_HEIGHT
    )
    return element("p", join("none ", picture, " all orientations"), class_="legend")


def outlines(scene: Scene) -> dict[str, Array]:
    """Convex outlines (N, 2) of a scene's free objects, seen from above, in the scene frame [m]."""
    found = {}
    for name in scene.instances:
        p_SV = placed_vertices(scene, name)[:, :2]
        found[name] = p_SV[ConvexHull(p_SV).vertices]
    return found
