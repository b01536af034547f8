"""Where a page's camera looks from: straight down at the board, or from the front.

A page shows all of the board from the beginning, and does so again when the board or the room for
the scene gets another size, until somebody moves the camera.

While a page loads it also moves its camera by itself: it begins with a view of its own, and puts
the server's `initial_camera` over it as late as its scheduler likes, even over a view that it was
given meanwhile. Only what pages report tells where their cameras are; `client.camera` has what was
last set as well, so reports are taken and views are given in one thread, that of the server.
"""

from __future__ import annotations

import contextlib
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
VIEW_MARGIN_FACTOR = 1.22
"""How much more than the board is in view."""
OBJECT_HEIGHT = 0.25
"""Of objects that are to be in view at the far edge of the board [m]."""
FIRST_ASPECT = 0.9
"""Width over height of the scene before a new page has told it."""
PHONE_ASPECT, PHONE_HEIGHT = 0.6, 0.55
"""Width over height below which a page is taken for a phone's; share of the page's height left free
above a phone's panel. The board lies at the lower end of that, in reach of a thumb."""
TOP_VIEW_TILT = 1e-3
"""Off the vertical, for the camera to know which way is up [rad]."""
VIEW_TOLERANCE = 1e-3
"""Cameras that are nearer to each other have not been moved [m]."""


def direction_from(*, above: bool) -> Array:
    """(3,) unit vector in S from the board to a camera above it or in front of it."""
    elevation = np.pi / 2.0 - TOP_VIEW_TILT if above else FRONT_ELEVATION
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
    tall = 0.0 if level <= TOP_VIEW_TILT else OBJECT_HEIGHT * level
    share = PHONE_HEIGHT if aspect < PHONE_ASPECT else 1.0
    half_height = VIEW_MARGIN_FACTOR * (depth * back[2] + tall) / 2.0
    half = max(half_height / share, VIEW_MARGIN_FACTOR * width / 2.0 / aspect)
    middle = min(
        0.5, share - half_height / half / 2.0
    )  # from the page's upper edge, in its heights
    distance = half / np.tan(fov / 2.0) + depth / 2.0 * level
    up = np.array([*ahead * back[2], level])
    target = np.array([*size / 2.0, 0.0])
    target -= (1.0 - 2.0 * middle) * distance * np.tan(fov / 2.0) * up
    return target + distance * back, target


@dataclass(eq=False)
class _GivenView:
    """A view that was given to a page.

    Attributes:
        back: (3,) unit vector in S from the board to the camera.
        fov: vertical angle of view [rad].
        aspect: width over height that it was made for.
        position, target: (3,) of the camera, and what it looks at, in S [m].
        arrived: the page has reported it; reports from before may come later than it was given.
        sendings_left: how often it may still be sent; a page that cannot have it keeps its own.
    """

    back: Array
    fov: float
    aspect: float
    position: Array
    target: Array
    arrived: bool = False
    sendings_left: int = 20

    def is_seen_by(self, camera: Any) -> bool:
        """Whether a camera of viser has this view."""
        return (
            _same(camera.position, self.position)
            and _same(camera.look_at, self.target)
            and abs(camera.fov - self.fov) <= VIEW_TOLERANCE
        )


class PageViews:
    """Keeps the board in view on every page.

    Args:
        server: of viser.
        board: gives the board of now, in any thread.
    """

    def __init__(self, server: viser.ViserServer, board: Callable[[], Board]) -> None:
        self._server, self._board = server, board
        self._given: dict[int, _GivenView] = {}
        self._shown = board().size
        camera = server.initial_camera
        camera.position, camera.look_at = viewpoint(
            board(), direction_from(above=False), FRONT_FOV, FIRST_ASPECT
        )
        camera.fov = FRONT_FOV
        server.on_client_connect(self._on_connect)

    def look(self, client: viser.ClientHandle, *, above: bool) -> None:
        """Brings a page's camera above the board, or in front of it."""
        fov = TOP_FOV if above else FRONT_FOV
        self._in_server_thread(lambda: self._give(client, direction_from(above=above), fov))

    def show(self) -> None:
        """Brings a board of another size into view on all pages, from where they look."""
        if (size := self._board().size) != self._shown:
            self._shown = size
            self._in_server_thread(self._fit_all)

    def drop(self, client_id: int) -> None:
        """A page is gone."""
        self._given.pop(client_id, None)

    def _in_server_thread(self, action: Callable[[], None]) -> None:
        with contextlib.suppress(RuntimeError):  # the server has stopped, and no page is left
            self._server.get_event_loop().call_soon_threadsafe(action)

    async def _on_connect(self, client: viser.ClientHandle) -> None:
        async def follow(camera: Any) -> None:
            self._follow(client)

        client.camera.on_update(follow)
        # `follow` is called next, with the report that made the page connect, and sends this view.
        back = direction_from(above=False)
        self._given[client.client_id] = self._fitted(client.camera, back, FRONT_FOV)

    def _follow(self, client: viser.ClientHandle) -> None:
        """A page has reported its camera: it was moved, or the room for the scene has changed."""
        given = self._given.get(client.client_id)
        if given is None:
            return
        camera = client.camera
        if abs(camera.aspect - given.aspect) > VIEW_TOLERANCE:
            given = self._fitted(camera, given.back, given.fov)
            self._given[client.client_id] = given
        if given.is_seen_by(camera):
            given.arrived = True
        elif given.sendings_left and (
            not given.arrived or _same(camera.position, self._server.initial_camera.position)
        ):
            self._send(client, given)  # it is not there yet, or the page has put its first over it
        else:
            del self._given[client.client_id]

    def _fit_all(self) -> None:
        for client in self._server.get_clients().values():
            if (given := self._given.get(client.client_id)) is not None:
                self._give(client, given.back, given.fov)
                continue
            back = client.camera.position - client.camera.look_at
            back = back / np.linalg.norm(back)
            if np.hypot(back[0], back[1]) < TOP_VIEW_TILT / 2.0:
                back = direction_from(above=True)
            self._give(client, back, float(client.camera.fov))

    def _give(self, client: viser.ClientHandle, back: Array, fov: float) -> None:
        if client.client_id not in self._server.get_clients():
            return
        before = self._given.get(client.client_id)
        given = self._given[client.client_id] = self._fitted(client.camera, back, fov)
        is_reported = before is None or before.arrived
        given.arrived = is_reported and given.is_seen_by(client.camera)
        self._send(client, given)

    def _send(self, client: viser.ClientHandle, given: _GivenView) -> None:
        given.sendings_left -= 1
        camera = client.camera
        with client.atomic():
            camera.up_direction = np.array([0.0, 0.0, 1.0])
            camera.fov = given.fov
            camera.position = given.position
            camera.look_at = given.target

    def _fitted(self, camera: Any, back: Array, fov: float) -> _GivenView:
        position, target = viewpoint(self._board(), back, fov, camera.aspect)
        return _GivenView(back, fov, camera.aspect, position, target)


def _same(p_SA: Array, p_SB: Array) -> bool:
    return bool(np.linalg.norm(np.subtract(p_SA, p_SB)) <= VIEW_TOLERANCE)
