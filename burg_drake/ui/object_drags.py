"""Drags and selects objects with the mouse."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import viser

from burg_drake.compose import Drag
from burg_drake.core import Array, BurgError, make_pose, rot_z
from burg_drake.ui.gizmo import (
    Gizmo,
    Handle,
    PageCamera,
    instance_center,
    mean_center,
    rotation_about_point,
)
from burg_drake.ui.page_actions import PageActions


@dataclass(eq=False)
class _PageDrag:
    """A drag with the mouse on one page.

    Attributes:
        drag: drag of the session.
        p_SM: (3,) centre of turns [m].
        p_SG: (3,) grabbed point [m].
        x: horizontal position of the pointer at the start, 0 to 1 on the page.
        handle: handle of the gizmo, if one was grabbed.
    """

    drag: Drag
    p_SM: Array
    p_SG: Array
    x: float
    handle: Handle | None


class ObjectDrags:
    """Makes handles in the scene draggable.

    Args:
        actions: actions of the page.
        gizmo: its handles take precedence over objects.
    """

    def __init__(self, actions: PageActions, gizmo: Gizmo) -> None:
        self._actions, self._gizmo = actions, gizmo
        self._page_drags: dict[int, _PageDrag] = {}
        self._turned_from: dict[int, Array] = {}

    def attach(self, handle: Any, name: str) -> None:
        """Lets pages drag an instance by a handle of viser."""

        async def move(event: Any) -> None:
            self._follow(event, name, turns=False)

        async def turn(event: Any) -> None:
            self._follow(event, name, turns=True)

        handle.on_drag("left")(move)
        handle.on_drag("left", modifier="shift")(turn)

    def is_end_of_turn(self, client_id: int, corners: Array) -> bool:
        """Whether a selection rectangle comes from a pointer that has turned an object: the browser
        reports a drag with Shift as both.

        Args:
            client_id: id of the page.
            corners: (2, 2) lower and upper corner of the rectangle, 0 to 1 on the page.
        """
        place_tolerance = 5e-3  # Share of the page's width and height.
        start = self._turned_from.pop(client_id, None)
        return start is not None and bool(
            (np.abs(corners - start) < place_tolerance).any(axis=0).all()
        )

    def forget_page(self, client_id: int) -> None:
        """Ends the drag of a page that is gone; the objects stay where they are."""
        self._turned_from.pop(client_id, None)
        self._actions.submit(lambda: self._end(client_id))

    def cancel_drag(self, client_id: int) -> bool:
        """Cancels the drag of a page, if there is one; returns whether there was."""
        page_drag = self._page_drags.pop(client_id, None)
        if page_drag is None or page_drag.drag.is_over:
            return False
        page_drag.drag.cancel()
        return True

    def _follow(self, event: Any, name: str, *, turns: bool) -> None:
        """Submits a drag event of a page as an action; does not block the event loop."""
        client, client_id = event.client, event.client_id
        x = float(event.end_screen_pos[0])
        camera = PageCamera.from_viser(client.camera)
        if event.phase == "start":
            p_SG = np.array(event.start_position)
            if turns:
                self._turned_from[client_id] = np.array(event.start_screen_pos)
            self._actions.submit(lambda: self._begin(client_id, name, camera, p_SG, x), client)
        elif event.phase == "update":
            p_SQ = np.array(event.end_position)
            self._actions.submit(
                lambda: self._follow_pointer(client_id, camera, p_SQ, x if turns else None),
                client,
                key=f"drag {client_id}",
            )
        else:
            self._actions.submit(lambda: self._end(client_id), client)

    def _begin(self, client_id: int, name: str, camera: PageCamera, p_SG: Array, x: float) -> None:
        self._end(client_id)
        view = self._actions.session.view
        handle = self._gizmo.handle_under(camera, p_SG)
        names = view.selection if handle or name in view.selection else (name,)
        drag = self._actions.session.drag(names)
        self._page_drags[client_id] = _PageDrag(drag, mean_center(view, names), p_SG, x, handle)

    def _follow_pointer(
        self, client_id: int, camera: PageCamera, p_SQ: Array, x: float | None
    ) -> None:
        """Moves the dragged objects, or turns them if `x` is given."""
        page_drag = self._page_drags.get(client_id)
        if page_drag is None:
            return
        X: Array | None = None
        if page_drag.handle is not None:
            X = page_drag.handle.motion(camera, page_drag.p_SG, p_SQ)
        elif x is not None:
            turn = 2.0 * np.pi * (x - page_drag.x)  # a full turn over the width of the page
            X = rotation_about_point(page_drag.p_SM, rot_z(turn), np.zeros(3))
        elif (p_SP := camera.intersect_plane(p_SQ, page_drag.p_SG, (0.0, 0.0, 1.0))) is not None:
            X = make_pose(p_AB=p_SP - page_drag.p_SG)
        if X is None:
            return
        try:
            page_drag.drag.transform(X, changes_height=page_drag.handle is not None)
        except BurgError:
            self._page_drags.pop(client_id, None)  # report one error, ignore the rest of the drag
            raise

    def _end(self, client_id: int) -> None:
        page_drag = self._page_drags.pop(client_id, None)
        if page_drag is not None and not page_drag.drag.is_over:
            page_drag.drag.end()


ADD_MODIFIER = "cmd/ctrl"  # Key that adds an object to the selection.


class Picking:
    """Selects instances.

    A click on an object is reported twice, by the object and by the scene; the second report must
    not count as a click on the background.

    Args:
        scene: API of viser.
        actions: actions of the page.
        drags: tells turns with Shift from selection rectangles.
    """

    def __init__(self, scene: viser.SceneApi, actions: PageActions, drags: ObjectDrags) -> None:
        self._actions, self._drags = actions, drags
        self._last_object_click: tuple[int, tuple[float, float]] | None = None

        async def clear_selection(event: Any) -> None:
            last, self._last_object_click = self._last_object_click, None
            if last != (event.client_id, tuple(event.screen_pos)):
                actions.submit(lambda: actions.session.select(()), event.client)

        scene.on_click()(clear_selection)  # type: ignore[arg-type]
        for modifier in ("shift", "cmd/ctrl+shift"):
            scene.on_rect_select(modifier=modifier)(self._rectangle)  # type: ignore[arg-type]

    def attach(self, handle: Any, name: str) -> None:
        """Lets pages select an instance by a click on a handle of viser."""

        async def select(event: Any) -> None:
            self._last_object_click = (event.client_id, tuple(event.screen_pos))
            self._actions.submit(lambda: self._actions.session.select((name,)), event.client)

        async def add(event: Any) -> None:
            self._last_object_click = (event.client_id, tuple(event.screen_pos))
            self._actions.submit(lambda: self._toggle(name), event.client)

        handle.on_click(select)
        handle.on_click(modifier=ADD_MODIFIER)(add)

    async def _rectangle(self, event: Any) -> None:
        camera = PageCamera.from_viser(event.client.camera)
        lower, upper = np.array(event.screen_min), np.array(event.screen_max)
        if self._drags.is_end_of_turn(event.client_id, np.stack([lower, upper])):
            return
        add = ADD_MODIFIER in (event.modifier or "")
        self._actions.submit(lambda: self._select_within(camera, lower, upper, add), event.client)

    def _select_within(self, camera: PageCamera, lower: Any, upper: Any, add: bool) -> None:
        view = self._actions.session.view
        names = [
            name for name in view.instances if _is_center_within(view, name, camera, lower, upper)
        ]
        before = view.selection if add else ()
        self._actions.session.select(dict.fromkeys((*before, *names)))

    def _toggle(self, name: str) -> None:
        selection = self._actions.session.view.selection
        if name in selection:
            self._actions.session.select([other for other in selection if other != name])
        else:
            self._actions.session.select((*selection, name))


def _is_center_within(view: Any, name: str, camera: PageCamera, lower: Any, upper: Any) -> bool:
    """Whether an instance's centre is projected into a rectangle."""
    seen = camera.project(instance_center(view, name))[0]
    return bool((seen >= lower).all() and (seen <= upper).all())
