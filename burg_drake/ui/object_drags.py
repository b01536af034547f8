"""Objects dragged with the mouse: over the board, or, with Shift, about the vertical.

A drag moves in the plane through the point that was grabbed, parallel to the board: what is under
the pointer stays under it, from wherever the camera looks.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from burg_drake.compose.drag import Drag
from burg_drake.core.errors import BurgError
from burg_drake.core.frames import Array
from burg_drake.ui.page_actions import PageActions
from burg_drake.ui.pointer import Eye

UP = np.array([0.0, 0.0, 1.0])
FULL_TURN = 4.0 * np.pi
"""By which an object turns while the pointer goes across the whole page [rad]."""


@dataclass(eq=False)
class _Held:
    """A drag of a page.

    Attributes:
        drag: of the session.
        p_SG: (3,) what was grabbed [m].
        x: of the pointer on the page at the start, 0 to 1.
    """

    drag: Drag
    p_SG: Array
    x: float


class ObjectDrags:
    """Makes handles in the scene draggable.

    Args:
        actions: what may be done with the session.
    """

    def __init__(self, actions: PageActions) -> None:
        self._actions = actions
        self._held: dict[int, _Held] = {}

    def attach(self, handle: Any, name: str) -> None:
        """Lets pages drag an instance by a handle of viser."""

        async def move(event: Any) -> None:
            self._follow(event, name, turns=False)

        async def turn(event: Any) -> None:
            self._follow(event, name, turns=True)

        handle.on_drag("left")(move)
        handle.on_drag("left", modifier="shift")(turn)

    def drop(self, client_id: int) -> None:
        """A page is gone; what it held stays where it is."""
        self._actions.ask(lambda: self._end(client_id))

    def _follow(self, event: Any, name: str, *, turns: bool) -> None:
        """Takes what has happened on a page as an action; the event loop goes on at once."""
        client, who = event.client, event.client_id
        x = float(event.end_screen_pos[0])
        if event.phase == "start":
            p_SG = np.array(event.start_position)
            self._actions.ask(lambda: self._begin(who, name, p_SG, x), client)
        elif event.phase == "update":
            eye, p_SQ = Eye.of(client.camera), np.array(event.end_position)
            self._actions.ask(
                lambda: self._turn(who, x) if turns else self._move(who, eye, p_SQ),
                client,
                key=f"drag {who}",
            )
        else:
            self._actions.ask(lambda: self._end(who), client)

    def _begin(self, who: int, name: str, p_SG: Array, x: float) -> None:
        self._end(who)
        selection = self._actions.session.view.selection
        names = selection if name in selection else (name,)
        self._held[who] = _Held(self._actions.session.drag(names), p_SG, x)

    def _move(self, who: int, eye: Eye, p_SQ: Array) -> None:
        held = self._held.get(who)
        if held is None:
            return
        p_SP = eye.on_plane(p_SQ, held.p_SG, UP)
        if p_SP is not None:
            x, y, _ = p_SP - held.p_SG
            self._carry(who, held, (float(x), float(y)), 0.0)

    def _turn(self, who: int, x: float) -> None:
        held = self._held.get(who)
        if held is not None:
            self._carry(who, held, (0.0, 0.0), FULL_TURN * (x - held.x))

    def _carry(self, who: int, held: _Held, offset: tuple[float, float], yaw: float) -> None:
        try:
            held.drag.move_by((*offset, 0.0), yaw)
        except BurgError:
            self._held.pop(who, None)  # told once; the rest of the gesture is nothing any more
            raise

    def _end(self, who: int) -> None:
        held = self._held.pop(who, None)
        if held is not None and not held.drag.is_over:
            held.drag.end()
