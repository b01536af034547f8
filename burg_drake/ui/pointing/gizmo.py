"""Handles at the selection, which move it and turn it.

While movement is restricted there are an arrow upwards beside what is selected and a ring about the
vertical; otherwise there are arrows, squares and rings for all six directions.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import viser

from burg_drake.compose.document import bounds, missing_objects
from burg_drake.compose.editing import Drag, SessionView
from burg_drake.core import (
    Array,
    inverse,
    make_pose,
    quaternion_from_rotation,
    rotation_from_quaternion,
)
from burg_drake.ui.pointing.centers import mean_center
from burg_drake.ui.pointing.handles import GIZMO_SIZE, Handle, handle_under
from burg_drake.ui.pointing.pointer import PageCamera
from burg_drake.ui.widgets import PageActions

ARROW_OFFSET = 0.02
"""From the selection to the vertical arrow, which must not hide it when seen from above [m]."""
EVERY_AXIS = (True, True, True)
Z_AXIS_ONLY, XY_AXES = (False, False, True), (True, True, False)
"""Active axes of the vertical arrow, and of the ring about the vertical."""


@dataclass(eq=False)
class _Part:
    """Arrows, or rings.

    Attributes:
        name: of the node.
        node: of viser, once it was needed.
        X_SG: (4, 4) where it is shown.
    """

    name: str
    node: viser.TransformControlsHandle | None = None
    X_SG: Array | None = None


class Gizmo:
    """Shows handles at what is selected.

    Args:
        scene: of viser.
        actions: what may be done with the session.
    """

    def __init__(self, scene: viser.SceneApi, actions: PageActions) -> None:
        self._scene, self._actions = scene, actions
        self._arrows, self._rings = _Part("/gizmo/arrows"), _Part("/gizmo/rings")
        self._along_object = False
        self._planar = True
        self._drag: Drag | None = None
        self._who: int | None = None
        self._held: _Part | None = None
        self._X_SGi = np.eye(4)
        self._start: dict[str, Array] = {}

    def show(self, view: SessionView) -> None:
        """Brings the handles to a view; those that are dragged are the pointer's."""
        self._planar = view.planar
        going_on = self._drag is not None and not self._drag.is_over
        lost = missing_objects(view.state)
        names = tuple(name for name in view.selection if name not in lost)
        for part, X_SG in (
            (self._arrows, self._arrows_pose(view, names) if names else None),
            (self._rings, self._rings_pose(view, names) if names else None),
        ):
            if going_on and part is self._held:
                continue
            part.X_SG = X_SG
            if X_SG is None:
                if part.node is not None:
                    part.node.visible = False
                continue
            if part.node is None:
                part.node = self._made(part)
            axes = EVERY_AXIS
            if view.planar:
                axes = Z_AXIS_ONLY if part is self._arrows else XY_AXES
            if part.node.active_axes != axes:
                part.node.active_axes = axes
                part.node.disable_sliders = view.planar or part is self._rings
            part.node.position = X_SG[:3, 3]
            part.node.wxyz = quaternion_from_rotation(X_SG[:3, :3])
            part.node.visible = True

    def switch_axes(self) -> None:
        """Arrows along the object's own axes in place of the board's, or the other way round."""
        self._along_object = not self._along_object
        self.show(self._actions.session.view)

    def handle_under(self, camera: PageCamera, p_SQ: Array) -> Handle | None:
        """The handle that is drawn at a pointer, if any is; see `handles.handle_under`."""
        parts: list[Handle] = []
        if (X_SG := self._arrows.X_SG) is not None:
            axes = (2,) if self._planar else (0, 1, 2)
            parts += [Handle("arrow", X_SG, axis) for axis in axes]
            if not self._planar:
                parts += [Handle("square", X_SG, axis) for axis in axes]
        if (X_SG := self._rings.X_SG) is not None:
            axes = (2,) if self._planar else (0, 1, 2)
            parts += [Handle("ring", X_SG, axis) for axis in axes]
        return handle_under(parts, camera, p_SQ)

    def drop(self, client_id: int) -> None:
        """A page is gone; what it held stays where it is."""
        self._actions.submit(lambda: self._end(client_id))

    def put_back(self, client_id: int) -> bool:
        """Puts back what a page drags; False if it drags nothing."""
        if self._who != client_id or self._drag is None or self._drag.is_over:
            return False
        self._drag.cancel()
        return True

    def _arrows_pose(self, view: SessionView, names: tuple[str, ...]) -> Array:
        middle = mean_center(view, names)
        if view.planar:
            right = max(float(bounds(view.state, name)[1, 0]) for name in names)
            return make_pose(p_AB=(right + ARROW_OFFSET, middle[1], middle[2]))
        R_SO = view.X_SO(names[0])[:3, :3]
        alone = len(names) == 1
        return make_pose(R_SO if alone and self._along_object else np.eye(3), middle)

    def _rings_pose(self, view: SessionView, names: tuple[str, ...]) -> Array:
        own = len(names) == 1 and not view.planar
        R_SG = view.X_SO(names[0])[:3, :3] if own else np.eye(3)
        return make_pose(R_SG, mean_center(view, names))

    def _made(self, part: _Part) -> viser.TransformControlsHandle:
        node = self._scene.add_transform_controls(
            part.name,
            scale=GIZMO_SIZE,
            line_width=3.0,
            disable_axes=part is self._rings,
            disable_sliders=part is self._rings,
            disable_rotations=part is self._arrows,
            depth_test=False,
            opacity=0.9,
        )

        @node.on_update
        async def _(event: Any) -> None:
            X_SG = make_pose(
                rotation_from_quaternion(event.target.wxyz), np.array(event.target.position)
            )
            who, client = event.client_id, event.client
            if event.phase == "start":
                self._actions.submit(lambda: self._begin(who, part, X_SG), client)
            elif event.phase == "update":
                self._actions.submit(lambda: self._move(who, X_SG), client, key=f"gizmo {who}")
            else:
                self._actions.submit(lambda: self._end(who), client)

        return node

    def _begin(self, who: int | None, part: _Part, X_SG: Array) -> None:
        self._who, self._held = who, part
        view = self._actions.session.view
        self._X_SGi = X_SG
        self._start = {name: view.X_SO(name) for name in view.selection}
        self._drag = self._actions.session.drag(view.selection)

    def _move(self, who: int | None, X_SG: Array) -> None:
        if who != self._who or self._drag is None or self._drag.is_over:
            return
        X = X_SG @ inverse(self._X_SGi)
        self._drag.move({name: X @ X_SO for name, X_SO in self._start.items()}, changes_height=True)

    def _end(self, who: int | None) -> None:
        if who != self._who:
            return
        drag, self._drag, self._who, self._held = self._drag, None, None, None
        if drag is not None and not drag.is_over:
            drag.end()
        self.show(self._actions.session.view)
