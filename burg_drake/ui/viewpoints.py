"""Viewpoints of a page's camera: from above the board, or from the front."""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import viser

from burg_drake.core import Array
from burg_drake.scene import Board

FRONT_FOV = float(np.deg2rad(42.0))  # Radians; vertical angle of view from the front.
TOP_FOV = float(np.deg2rad(18.0))
"""Radians; narrow, so that hardly any perspective is left from above."""
TOP_VIEW_TILT = 1e-3
"""Radians off the vertical, so that the camera has an upward direction."""
VIEW_TOLERANCE = 1e-3
"""Metres, radians or ratios; cameras that differ by less are the same."""


def direction_to_camera(*, above: bool) -> Array:
    """(3,) unit vector in S from the board to a camera above it or in front of it."""
    elevation = np.pi / 2.0 - TOP_VIEW_TILT if above else float(np.deg2rad(50.0))
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
    margin_factor = 1.22  # Extent in view relative to that of the board.
    object_height = 0.25  # Metres; objects at the far edge of the board are in view up to this.
    size = np.array(board.size)
    level = float(np.hypot(back[0], back[1]))
    ahead = -back[:2] / level
    width, depth = float(size @ np.abs(ahead[::-1])), float(size @ np.abs(ahead))
    tall = 0.0 if level <= TOP_VIEW_TILT else object_height * level
    share = 0.55 if aspect < 0.6 else 1.0  # of the height, above the panel on a phone
    half_height = margin_factor * (depth * back[2] + tall) / 2.0
    half = max(half_height / share, margin_factor * width / 2.0 / aspect)
    # from the page's upper edge, in its heights
    middle = min(0.5, share - half_height / half / 2.0)
    distance = half / np.tan(fov / 2.0) + depth / 2.0 * level
    up = np.array([*ahead * back[2], level])
    target = np.array([*size / 2.0, 0.0])
    target -= (1.0 - 2.0 * middle) * distance * np.tan(fov / 2.0) * up
    return target + distance * back, target


@dataclass(eq=False)
class _AssignedView:
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

    def is_shown_by(self, camera: Any) -> bool:
        """Whether a camera of viser has this view."""
        return (
            _is_same_point(camera.position, self.position)
            and _is_same_point(camera.look_at, self.target)
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
        self._given: dict[int, _AssignedView] = {}
        self._shown = board().size
        camera = server.initial_camera
        camera.position, camera.look_at = viewpoint(
            board(), direction_to_camera(above=False), FRONT_FOV, aspect=0.9
        )
        camera.fov = FRONT_FOV
        server.on_client_connect(self._on_connect)

    def set_view(self, client: viser.ClientHandle | None, *, above: bool) -> None:
        """Brings a page's camera above the board, or in front of it."""
        if client is not None:
            back, fov = direction_to_camera(above=above), TOP_FOV if above else FRONT_FOV
            self._in_server_thread(lambda: self._assign_view(client, back, fov))

    def show(self) -> None:
        """Brings a board of another size into view on all pages, from where they look."""
        if (size := self._board().size) != self._shown:
            self._shown = size
            self._in_server_thread(self._fit_all)

    def forget_page(self, client_id: int) -> None:
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
        back = direction_to_camera(above=False)
        self._given[client.client_id] = self._fit_view(client.camera, back, FRONT_FOV)

    def _follow(self, client: viser.ClientHandle) -> None:
        """A page has reported its camera: it was moved, or the room for the scene has changed."""
        given = self._given.get(client.client_id)
        if given is None:
            return
        camera = client.camera
        if abs(camera.aspect - given.aspect) > VIEW_TOLERANCE:
            given = self._fit_view(camera, given.back, given.fov)
            self._given[client.client_id] = given
        if given.is_shown_by(camera):
            given.arrived = True
        elif given.sendings_left and (
            not given.arrived
            or _is_same_point(camera.position, self._server.initial_camera.position)
        ):
            self._send(client, given)  # it is not there yet, or the page has put its first over it
        else:
            del self._given[client.client_id]

    def _fit_all(self) -> None:
        for client in self._server.get_clients().values():
            if (given := self._given.get(client.client_id)) is not None:
                self._assign_view(client, given.back, given.fov)
                continue
            back = client.camera.position - client.camera.look_at
            back = back / np.linalg.norm(back)
            if np.hypot(back[0], back[1]) < TOP_VIEW_TILT / 2.0:
                back = direction_to_camera(above=True)
            self._assign_view(client, back, float(client.camera.fov))

    def _assign_view(self, client: viser.ClientHandle, back: Array, fov: float) -> None:
        if client.client_id not in self._server.get_clients():
            return
        before = self._given.get(client.client_id)
        given = self._given[client.client_id] = self._fit_view(client.camera, back, fov)
        is_reported = before is None or before.arrived
        given.arrived = is_reported and given.is_shown_by(client.camera)
        self._send(client, given)

    def _send(self, client: viser.ClientHandle, given: _AssignedView) -> None:
        given.sendings_left -= 1
        camera = client.camera
        with client.atomic():
            camera.up_direction = np.array([0.0, 0.0, 1.0])
            camera.fov = given.fov
            camera.position = given.position
            camera.look_at = given.target

    def _fit_view(self, camera: Any, back: Array, fov: float) -> _AssignedView:
        position, target = viewpoint(self._board(), back, fov, camera.aspect)
        return _AssignedView(back, fov, camera.aspect, position, target)


def _is_same_point(p_SA: Array, p_SB: Array) -> bool:
    return bool(np.linalg.norm(np.subtract(p_SA, p_SB)) <= VIEW_TOLERANCE)
