"""Where a page's camera looks from: straight down at the board, or from the front.

A page shows all of the board from the beginning, and does so again when the board or the room for
the scene gets another size, until somebody moves the camera.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import viser

from burg_drake.core import Array
from burg_drake.scene.document import Board

FRONT_FOV = float(np.deg2rad(42.0))
TOP_FOV = float(np.deg2rad(18.0))
"""Narrow, so that from above hardly any perspective is left [rad]."""
FRONT_ELEVATION = float(np.deg2rad(50.0))
ROOM = 1.22
"""How much more than the board is in view."""
OBJECT_HEIGHT = 0.25
"""Of objects that are to be in view at the far edge of the board [m]."""
FIRST_ASPECT = 0.9
"""Width over height of the scene before a new page has told it."""
PHONE_ASPECT, PHONE_HEIGHT = 0.6, 0.55
"""Width over height below which a page is taken for a phone's; share of the page's height left free
above a phone's panel."""
TILT = 1e-3
"""Off the vertical, for the camera to know which way is up [rad]."""
SAME_VIEW = 1e-3
"""Cameras that are nearer to each other have not been moved [m]."""


def direction_from(*, above: bool) -> Array:
    """(3,) unit vector in S from the board to a camera above it or in front of it."""
    elevation = np.pi / 2.0 - TILT if above else FRONT_ELEVATION
    return np.array([0.0, -np.cos(elevation), np.sin(elevation)])


def viewpoint(board: Board, back: Array, fov: float, aspect: float) -> tuple[Array, Array]:
    """A camera that sees a board.

    Args:
        board: in the scene frame.
        back: (3,) unit vector in S from the board to the camera.
        fov: vertical angle of view [rad].
        aspect: width over height of the page's scene.

    Returns:
        Its position (3,) and what it looks at (3,) in S [m].
    """
    size = np.array(board.size)
    level = float(np.hypot(back[0], back[1]))
    ahead = -back[:2] / level
    width, depth = float(size @ np.abs(ahead[::-1])), float(size @ np.abs(ahead))
    tall = 0.0 if level <= TILT else OBJECT_HEIGHT * level
    share = PHONE_HEIGHT if aspect < PHONE_ASPECT else 1.0
    half = ROOM * max((depth * back[2] + tall) / 2.0 / share, width / 2.0 / aspect)
    distance = half / np.tan(fov / 2.0) + depth / 2.0 * level
    up = np.array([*ahead * back[2], level])
    target = np.array([*size / 2.0, 0.0])
    target -= (1.0 - share) * distance * np.tan(fov / 2.0) * up
    return target + distance * back, target


@dataclass(eq=False)
class _Fitted:
    """A view that was given to a page.

    Attributes:
        position, target: (3,) of the camera, and what it looks at, in S [m].
        aspect: width over height that it was made for.
        arrived: the page has reported it; reports from before may come later than it was given.
        repeats: how often it may be given again until then.
    """

    position: Array
    target: Array
    aspect: float
    arrived: bool = False
    repeats: int = 20


class PageViews:
    """Keeps the board in view on every page.

    Args:
        server: of viser.
        board: gives the board of now.
        submit: has something done in the thread that all actions are done in.
    """

    def __init__(
        self, server: viser.ViserServer, board: Callable[[], Board], submit: Callable[..., Any]
    ) -> None:
        self._server, self._board, self._submit = server, board, submit
        self._fitted: dict[int, _Fitted] = {}
        self._shown = board().size
        camera = server.initial_camera
        camera.position, camera.look_at = viewpoint(
            board(), direction_from(above=False), FRONT_FOV, FIRST_ASPECT
        )
        camera.fov = FRONT_FOV
        server.on_client_connect(self._on_connect)

    def look(self, client: viser.ClientHandle, *, above: bool) -> None:
        """Brings a page's camera above the board, or in front of it."""
        self._set(client, direction_from(above=above), TOP_FOV if above else FRONT_FOV)

    def show(self) -> None:
        """Brings a board of another size into view on all pages, from where they look."""
        if (size := self._board().size) != self._shown:
            self._shown = size
            for client in self._server.get_clients().values():
                self._fit(client)

    def drop(self, client_id: int) -> None:
        """A page is gone."""
        self._fitted.pop(client_id, None)

    async def _on_connect(self, client: viser.ClientHandle) -> None:
        async def follow(camera: Any) -> None:
            self._submit(lambda: self._follow(client), client, key=f"view {client.client_id}")

        client.camera.on_update(follow)
        self._submit(lambda: self.look(client, above=False), client)

    def _follow(self, client: viser.ClientHandle) -> None:
        """The camera was moved, or the room for the scene has changed."""
        known = self._fitted.get(client.client_id)
        if known is None:
            return
        camera = client.camera
        if abs(camera.aspect - known.aspect) > SAME_VIEW:
            self._fit(client)
        elif np.linalg.norm(camera.position - known.position) <= SAME_VIEW:
            known.arrived = True
        elif known.arrived:
            del self._fitted[client.client_id]
        elif known.repeats:  # a page that is still loading may put its first view over this one
            known.repeats -= 1
            with client.atomic():
                camera.position, camera.look_at = known.position, known.target

    def _fit(self, client: viser.ClientHandle) -> None:
        back = client.camera.position - client.camera.look_at
        back = back / np.linalg.norm(back)
        if np.hypot(back[0], back[1]) < TILT / 2.0:
            back = direction_from(above=True)
        self._set(client, back, float(client.camera.fov))

    def _set(self, client: viser.ClientHandle, back: Array, fov: float) -> None:
        camera = client.camera
        position, target = viewpoint(self._board(), back, fov, camera.aspect)
        self._fitted[client.client_id] = _Fitted(position, target, camera.aspect)
        with client.atomic():
            camera.up_direction = np.array([0.0, 0.0, 1.0])
            camera.fov = fov
            camera.position = position
            camera.look_at = target
