"""The objects of the scene in the browser: as they look or in a colour, with an outline each."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import viser
from scipy.spatial import ConvexHull, QhullError

from burg_drake.core import Array, BurgError, quaternion_from_rotation, transform_points
from burg_drake.core.terminal import distinct_colors
from burg_drake.geometry import hull_mesh
from burg_drake.ui.view.object_meshes import ObjectMeshes
from burg_drake.ui.widgets import FIXED, Rgb8, style_of

Coloring = Literal["objects", "random", "status"]

ROOT = "/objects"
OUTLINE_HEIGHT = 4e-4
"""Of outlines over the board [m]; at the board's own height they would flicker."""
LINE_WIDTH, SELECTED_LINE_WIDTH = 2.0, 6.0
"""Lines of outlines and of those of selected objects [pixel]."""
MISSING_COLOR: Rgb8 = (200, 60, 200)
UNKNOWN_RADIUS = 0.03
"""Of the ball in place of an object whose shape cannot be read [m]."""


@dataclass(frozen=True, eq=False)
class ShownInstance:
    """An instance as it is to be shown.

    Attributes:
        object: its name in the library.
        X_SO: (4, 4) pose.
        status: see `status_colors`.
        selected: whether it is.
        fixed: whether it is background.
    """

    object: str
    X_SO: Array
    status: str = "ok"
    selected: bool = False
    fixed: bool = False


@dataclass(eq=False)
class _Nodes:
    """What stands for an instance in the browser."""

    object: str
    frame: viser.FrameHandle
    mesh: Any
    p_OV: Array
    outline: viser.LineSegmentsHandle
    color: Rgb8
    tint: viser.MeshHandle | None = None
    drawn: tuple[bytes, str, bool] | None = None


class SceneView:
    """Shows instances and tells which one the pointer is on.

    Args:
        scene: viser's, in whose world the scene frame is the origin.
        shapes: of the library's objects.
        attach: called with each new handle that pointers may touch, and its instance.
    """

    def __init__(
        self,
        scene: viser.SceneApi,
        shapes: ObjectMeshes,
        attach: Callable[[Any, str], None],
    ) -> None:
        self._scene = scene
        self._shapes = shapes
        self._attach = attach
        self._nodes: dict[str, _Nodes] = {}
        self._coloring: Coloring = "objects"
        self._made = 0

    def use(self, shapes: ObjectMeshes) -> None:
        """Shows objects of another library from now on."""
        if shapes is not self._shapes:
            self.show({}, self._coloring)
            self._shapes = shapes

    def show(self, instances: Mapping[str, ShownInstance], coloring: Coloring) -> None:
        """Brings the browser to a scene; only what is not yet so is sent."""
        self._coloring = coloring
        for name in list(self._nodes):
            if name not in instances or instances[name].object != self._nodes[name].object:
                self._remove(name)
        for name, shown in instances.items():
            if name not in self._nodes:
                self._nodes[name] = self._add(name, shown)
            self._update(self._nodes[name], name, shown)

    def _remove(self, name: str) -> None:
        nodes = self._nodes.pop(name)
        nodes.outline.remove()
        nodes.frame.remove()

    def _add(self, name: str, shown: ShownInstance) -> _Nodes:
        frame = self._scene.add_frame(f"{ROOT}/{name}", show_axes=False)
        mesh: Any
        try:
            shape = self._shapes[shown.object]
        except BurgError:  # what is wrong with it is told elsewhere; here is where it stands
            mesh = self._scene.add_icosphere(
                f"{ROOT}/{name}/look", radius=UNKNOWN_RADIUS, color=MISSING_COLOR
            )
            p_OV = UNKNOWN_RADIUS * np.vstack([np.eye(3), -np.eye(3)])
        else:
            mesh = self._scene.add_glb(f"{ROOT}/{name}/look", shape.glb)
            p_OV = hull_mesh(shape.vertices.astype(float)).vertices
        self._attach(mesh, name)
        outline = self._scene.add_line_segments(
            f"/outlines/{name}",
            np.zeros((1, 2, 3)),
            FIXED,
            thickness=LINE_WIDTH,
            thickness_units="screen",
        )
        self._made += 1
        red, green, blue = distinct_colors(self._made)[-1]
        color = (round(255 * red), round(255 * green), round(255 * blue))
        return _Nodes(shown.object, frame, mesh, np.asarray(p_OV), outline, color)

    def _update(self, nodes: _Nodes, name: str, shown: ShownInstance) -> None:
        nodes.frame.position = shown.X_SO[:3, 3]
        nodes.frame.wxyz = quaternion_from_rotation(shown.X_SO[:3, :3])
        self._paint(nodes, name, shown)
        drawn = (shown.X_SO.tobytes(), shown.status, shown.selected)
        if drawn != nodes.drawn:
            nodes.drawn = drawn
            line = footprint(nodes.p_OV, shown.X_SO, OUTLINE_HEIGHT)
            nodes.outline.points = line.astype(np.float32)
            nodes.outline.colors = np.array(_status_color(shown), dtype=np.uint8)
            nodes.outline.thickness = SELECTED_LINE_WIDTH if shown.selected else LINE_WIDTH

    def _paint(self, nodes: _Nodes, name: str, shown: ShownInstance) -> None:
        if self._coloring == "objects":
            nodes.mesh.visible = True
            if nodes.tint is not None:
                nodes.tint.visible = False
            return
        color = nodes.color if self._coloring == "random" else _status_color(shown)
        if nodes.tint is None:
            nodes.tint = self._tinted(name, shown.object, color)
        elif nodes.tint is not None:
            nodes.tint.color = color
        if nodes.tint is not None:
            nodes.tint.visible = True
            nodes.mesh.visible = False

    def _tinted(self, name: str, object: str, color: Rgb8) -> viser.MeshHandle | None:
        try:
            shape = self._shapes[object]
        except BurgError:
            return None
        tint = self._scene.add_mesh_simple(
            f"{ROOT}/{name}/tint", shape.vertices, shape.faces, color=color, side="double"
        )
        self._attach(tint, name)
        return tint


def _status_color(shown: ShownInstance) -> Rgb8:
    return FIXED if shown.fixed and shown.status == "ok" else style_of(shown.status).color


OUTLINE_MARGIN = 0.004
"""Between an object and the outline around it [m]."""
CORNER_POINTS = 6
"""Points of an outline's rounded corner."""


def footprint(p_OV: Array, X_SO: Array, height: float, margin: float = OUTLINE_MARGIN) -> Array:
    """The outline of an object's convex hull from above.

    Args:
        p_OV: (N, 3) vertices of the object [m].
        X_SO: (4, 4) its pose.
        height: z of the outline in S [m].
        margin: by which it is larger than the object [m].

    Returns:
        (M, 2, 3) segments of a closed line in S [m].
    """
    p_SV = transform_points(X_SO, p_OV)[:, :2]
    around = np.linspace(0.0, 2.0 * np.pi, 4 * CORNER_POINTS, endpoint=False)
    disc = margin * np.stack([np.cos(around), np.sin(around)], axis=-1)
    points = (_hull(p_SV)[:, None] + disc).reshape(-1, 2)
    line = _hull(points)
    line = np.column_stack([line, np.full(len(line), height)])
    return np.stack([line, np.roll(line, -1, axis=0)], axis=1)


def _hull(points: Array) -> Array:
    """(M, 2) corners of a planar hull, counter-clockwise; all points where it is flat."""
    try:
        return np.asarray(points[ConvexHull(points).vertices])
    except QhullError:
        return points
