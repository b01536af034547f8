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
    """A drag of a page.

    Attributes:
        drag: of the session.
        p_SM: (3,) what turns go about [m].
        p_SG: (3,) what was grabbed [m].
        x: of the pointer on the page at the start, 0 to 1.
        handle: of the gizmo, if one was grabbed.
    """

    drag: Drag
    p_SM: Array
    p_SG: Array
    x: float
    handle: Handle | None


class ObjectDrags:
    """Makes handles in the scene draggable.

    Args:
        actions: what may be done with the session.
        gizmo: whose handles go before objects.
    """

    def __init__(self, actions: PageActions, gizmo: Gizmo) -> None:
        self._actions, self._gizmo = actions, gizmo
        self._held: dict[int, _PageDrag] = {}
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
        """Whether a rectangle of a page is the way of a pointer that has turned something: the
        browser takes a drag with Shift for both.

        Args:
            client_id: of the page.
            corners: (2, 2) lower and upper corner of the rectangle, 0 to 1 on the page.
        """
        place_tolerance = 5e-3  # Share of the page's width and height.
        start = self._turned_from.pop(client_id, None)
        return start is not None and bool(
            (np.abs(corners - start) < place_tolerance).any(axis=0).all()
        )

    def forget_page(self, client_id: int) -> None:
        """A page is gone; what it held stays where it is."""
        self._turned_from.pop(client_id, None)
        self._actions.submit(lambda: self._end(client_id))

    def cancel_drag(self, client_id: int) -> bool:
        """Puts back what a page drags; False if it drags nothing."""
        held = self._held.pop(client_id, None)
        if held is None or held.drag.is_over:
            return False
        held.drag.cancel()
        return True

    def _follow(self, event: Any, name: str, *, turns: bool) -> None:
        """Takes what has happened on a page as an action; the event loop goes on at once."""
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
        self._held[client_id] = _PageDrag(drag, mean_center(view, names), p_SG, x, handle)

    def _follow_pointer(
        self, client_id: int, camera: PageCamera, p_SQ: Array, x: float | None
    ) -> None:
        """Moves what is held, or turns it if `x` is given."""
        held = self._held.get(client_id)
        if held is None:
            return
        X: Array | None = None
        if held.handle is not None:
            X = held.handle.motion(camera, held.p_SG, p_SQ)
        elif x is not None:
            turn = 2.0 * np.pi * (x - held.x)  # a full turn over the width of the page
            X = rotation_about_point(held.p_SM, rot_z(turn), np.zeros(3))
        elif (p_SP := camera.on_plane(p_SQ, held.p_SG, (0.0, 0.0, 1.0))) is not None:
            X = make_pose(p_AB=p_SP - held.p_SG)
        if X is None:
            return
        try:
            held.drag.transform(X, changes_height=held.handle is not None)
        except BurgError:
            self._held.pop(client_id, None)  # one error; the rest of the gesture is ignored
            raise

    def _end(self, client_id: int) -> None:
        held = self._held.pop(client_id, None)
        if held is not None and not held.drag.is_over:
            held.drag.end()


ADD_MODIFIER = "cmd/ctrl"  # Key that adds an object to the selection.


class Picking:
    """Selects instances.

    A click on an object reaches us twice, of the object and of the scene; the second one must not
    be taken for a click beside all objects.

    Args:
        scene: of viser.
        actions: what may be done with the session.
        drags: with Shift they are no rectangles.
    """

    def __init__(self, scene: viser.SceneApi, actions: PageActions, drags: ObjectDrags) -> None:
        self._actions, self._drags = actions, drags
        self._last: tuple[int, tuple[float, float]] | None = None

        async def beside(event: Any) -> None:
            last, self._last = self._last, None
            if last != (event.client_id, tuple(event.screen_pos)):
                actions.submit(lambda: actions.session.select(()), event.client)

        scene.on_click()(beside)  # type: ignore[arg-type]
        for modifier in ("shift", "cmd/ctrl+shift"):
            scene.on_rect_select(modifier=modifier)(self._rectangle)  # type: ignore[arg-type]

    def attach(self, handle: Any, name: str) -> None:
        """Lets pages select an instance by a click on a handle of viser."""

        async def choose(event: Any) -> None:
            self._last = (event.client_id, tuple(event.screen_pos))
            self._actions.submit(lambda: self._actions.session.select((name,)), event.client)

        async def add(event: Any) -> None:
            self._last = (event.client_id, tuple(event.screen_pos))
            self._actions.submit(lambda: self._toggle(name), event.client)

        handle.on_click(choose)
        handle.on_click(modifier=ADD_MODIFIER)(add)

    async def _rectangle(self, event: Any) -> None:
        camera = PageCamera.from_viser(event.client.camera)
        lower, upper = np.array(event.screen_min), np.array(event.screen_max)
        if self._drags.is_end_of_turn(event.client_id, np.stack([lower, upper])):
            return
        more = ADD_MODIFIER in (event.modifier or "")
        self._actions.submit(lambda: self._select_within(camera, lower, upper, more), event.client)

    def _select_within(self, camera: PageCamera, lower: Any, upper: Any, more: bool) -> None:
        view = self._actions.session.view
        names = [
            name for name in view.instances if _is_center_within(view, name, camera, lower, upper)
        ]
        before = view.selection if more else ()
        self._actions.session.select(dict.fromkeys((*before, *names)))

    def _toggle(self, name: str) -> None:
        selection = self._actions.session.view.selection
        if name in selection:
            self._actions.session.select([other for other in selection if other != name])
        else:
            self._actions.session.select((*selection, name))


def _is_center_within(view: Any, name: str, camera: PageCamera, lower: Any, upper: Any) -> bool:
    """Whether the middle of an instance's bounds is seen within a rectangle."""
    seen = camera.on_screen(instance_center(view, name))[0]
    return bool((seen >= lower).all() and (seen <= upper).all())
