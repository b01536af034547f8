"""Objects dragged with the mouse: over the board, or, with Shift, about the vertical.

A drag moves in the plane through the point that was grabbed, parallel to the board: what is under
the pointer stays under it, from wherever the camera looks. A drag that begins where a handle of the
gizmo is drawn belongs to that handle, whatever object is there.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from burg_drake.compose.editing import Drag
from burg_drake.core import Array, BurgError, make_pose, rot_z
from burg_drake.ui.pointing.centers import mean_center, motion_about
from burg_drake.ui.pointing.gizmo import Gizmo
from burg_drake.ui.pointing.handles import Handle
from burg_drake.ui.pointing.pointer import PageCamera
from burg_drake.ui.widgets import PageActions

UP = np.array([0.0, 0.0, 1.0])
TURN_PER_PAGE_WIDTH = 2.0 * np.pi
"""By which an object turns while the pointer goes across the whole page [rad]."""
SAME_PLACE_TOLERANCE = 5e-3
"""Places on a page that differ by less are one, as a share of its width and height."""


@dataclass(eq=False)
class _Held:
    """A drag of a page.

    Attributes:
        drag: of the session.
        X_SO: (4, 4) poses by instance at the start.
        p_SM: (3,) what turns go about [m].
        p_SG: (3,) what was grabbed [m].
        x: of the pointer on the page at the start, 0 to 1.
        handle: of the gizmo, if one was grabbed.
    """

    drag: Drag
    X_SO: dict[str, Array]
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
        self._held: dict[int, _Held] = {}
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
        start = self._turned_from.pop(client_id, None)
        return start is not None and bool(
            (np.abs(corners - start) < SAME_PLACE_TOLERANCE).any(axis=0).all()
        )

    def drop(self, client_id: int) -> None:
        """A page is gone; what it held stays where it is."""
        self._turned_from.pop(client_id, None)
        self._actions.submit(lambda: self._end(client_id))

    def put_back(self, client_id: int) -> bool:
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
        camera = PageCamera.of(client.camera)
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
        X_SO = {held: view.X_SO(held) for held in names}
        drag = self._actions.session.drag(names)
        self._held[client_id] = _Held(drag, X_SO, mean_center(view, names), p_SG, x, handle)

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
            X = motion_about(held.p_SM, rot_z(TURN_PER_PAGE_WIDTH * (x - held.x)), np.zeros(3))
        elif (p_SP := camera.on_plane(p_SQ, held.p_SG, UP)) is not None:
            X = make_pose(p_AB=p_SP - held.p_SG)
        if X is not None:
            self._carry(client_id, held, X)

    def _carry(self, client_id: int, held: _Held, X: Array) -> None:
        """Holds what is dragged where a motion (4, 4) in S brings it from the start."""
        try:
            held.drag.move(
                {name: X @ X_SO for name, X_SO in held.X_SO.items()},
                changes_height=held.handle is not None,
            )
        except BurgError:
            self._held.pop(client_id, None)  # one error; the rest of the gesture is ignored
            raise

    def _end(self, client_id: int) -> None:
        held = self._held.pop(client_id, None)
        if held is not None and not held.drag.is_over:
            held.drag.end()
