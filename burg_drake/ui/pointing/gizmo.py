"""Handles at the selection while it may move freely: arrows and rings for all six directions.

Where movement is restricted to the plane there are none; the mouse drags objects themselves there.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import viser

from burg_drake.compose.editing import Drag, SessionView
from burg_drake.core import (
    Array,
    inverse,
    make_pose,
    quaternion_from_rotation,
    rotation_from_quaternion,
)
from burg_drake.ui.pointing.centers import mean_center
from burg_drake.ui.widgets import PageActions

SIZE = 0.11
"""Length of the arrows [m]."""


class Gizmo:
    """Shows handles at what is selected.

    Args:
        scene: of viser.
        actions: what may be done with the session.
    """

    def __init__(self, scene: viser.SceneApi, actions: PageActions) -> None:
        self._scene, self._actions = scene, actions
        self._handle: viser.TransformControlsHandle | None = None
        self._drag: Drag | None = None
        self._who: int | None = None
        self._X_SGi = np.eye(4)
        self._start: dict[str, Array] = {}

    def show(self, view: SessionView) -> None:
        """Brings the handles to a view; while they are dragged they are the pointer's."""
        if self._drag is not None and not self._drag.is_over:
            return
        if not view.selection or view.planar:
            if self._handle is not None:
                self._handle.visible = False
            return
        if self._handle is None:
            self._handle = self._made()
        alone = len(view.selection) == 1
        R_SG = view.X_SO(view.selection[0])[:3, :3] if alone else np.eye(3)
        self._handle.position = mean_center(view, view.selection)
        self._handle.wxyz = quaternion_from_rotation(R_SG)
        self._handle.visible = True

    def drop(self, client_id: int) -> None:
        """A page is gone; what it held stays where it is."""
        self._actions.submit(lambda: self._end(client_id))

    def put_back(self, client_id: int) -> bool:
        """Puts back what a page drags; False if it drags nothing."""
        if self._who != client_id or self._drag is None or self._drag.is_over:
            return False
        self._drag.cancel()
        return True

    def _made(self) -> viser.TransformControlsHandle:
        handle = self._scene.add_transform_controls(
            "/gizmo",
            scale=SIZE,
            line_width=3.0,
            depth_test=False,
            opacity=0.9,
        )

        @handle.on_update
        async def _(event: Any) -> None:
            X_SG = make_pose(
                rotation_from_quaternion(event.target.wxyz), np.array(event.target.position)
            )
            who, client = event.client_id, event.client
            if event.phase == "start":
                self._actions.submit(lambda: self._begin(who, X_SG), client)
            elif event.phase == "update":
                self._actions.submit(lambda: self._move(who, X_SG), client, key=f"gizmo {who}")
            else:
                self._actions.submit(lambda: self._end(who), client)

        return handle

    def _begin(self, who: int | None, X_SG: Array) -> None:
        self._who = who
        view = self._actions.session.view
        self._X_SGi = X_SG
        self._start = {name: view.X_SO(name) for name in view.selection}
        self._drag = self._actions.session.drag(view.selection)

    def _move(self, who: int | None, X_SG: Array) -> None:
        if who != self._who or self._drag is None or self._drag.is_over:
            return
        X = X_SG @ inverse(self._X_SGi)
        self._drag.move({name: X @ X_SO for name, X_SO in self._start.items()})

    def _end(self, who: int | None) -> None:
        if who != self._who:
            return
        drag, self._drag, self._who = self._drag, None, None
        if drag is not None and not drag.is_over:
            drag.end()
        self.show(self._actions.session.view)
