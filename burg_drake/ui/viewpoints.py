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
"""Radians; narrow, so that there is little perspective from above."""
TOP_VIEW_TILT = 1e-3
"""Radians off the vertical, so that the camera has an upward direction."""
VIEW_TOLERANCE = 1e-3
"""Metres, radians or ratios; cameras that differ by less are the same."""


def direction_to_camera(*, above: bool) -> Array:
    """(3,) unit vector in S from the board to a camera above it or in front of it."""
    elevation = np.pi / 2.0 - TOP_VIEW_TILT if above else float(np.deg2rad(50.0))
    return np.array([0.0, -np.cos(elevation), np.sin(elevation)])


def viewpoint(board: Board, back: Array, fov: float, aspect: float) -> tuple[Array, Array]:
    """A camera pose that has a board in view.

    Args:
        board: board in the scene frame.
        back: (3,) unit vector in S from the board to the camera.
        fov: vertical angle of view [rad].
        aspect: width over height of the page's scene.

    Returns:
        Position (3,) and target (3,) of the camera in S [m].
    """
    margin_factor = 1.22  # Extent in view relative to that of the board.
    object_height = 0.25  # Metres; visible height of objects at the far edge of the board.
    size = np.array(board.size)
    level = float(np.hypot(back[0], back[1]))
    ahead = -back[:2] / level
    width, depth = float(size @ np.abs(ahead[::-1])), float(size @ np.abs(ahead))
    tall = 0.0 if level <= TOP_VIEW_TILT else object_height * level
    share = 0.55 if aspect < 0.6 else 1.0  # of the height that is above the panel on a phone
    half_height = margin_factor * (depth * back[2] + tall) / 2.0
    half = max(half_height / share, margin_factor * width / 2.0 / aspect)
    # from the page's upper edge, as a share of its height
    middle = min(0.5, share - half_height / half / 2.0)
    distance = half / np.tan(fov / 2.0) + depth / 2.0 * level
    up = np.array([*ahead * back[2], level])
    target = np.array([*size / 2.0, 0.0])
    target -= (1.0 - 2.0 * middle) * distance * np.tan(fov / 2.0) * up
    return target + distance * back, target


@dataclass(eq=False)
class _AssignedView:
    """A view that was assigned to a page.

    Attributes:
        back: (3,) unit vector in S from the board to the camera.
        fov: vertical angle of view [rad].
        aspect: width over height of the page's scene for which it was computed.
        position, target: (3,) of the camera in S [m].
        arrived: whether the page has reported this view; earlier reports may still arrive.
        sendings_left: remaining attempts to send it; then the page keeps its own view.
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
        server: server of viser.
        board: returns the current board, in any thread.
    """

    def __init__(self, server: viser.ViserServer, board: Callable[[], Board]) -> None:
        self._server, self._board = server, board
        self._assigned: dict[int, _AssignedView] = {}
        self._shown = board().size
        camera = server.initial_camera
        camera.position, camera.look_at = viewpoint(
            board(), direction_to_camera(above=False), FRONT_FOV, aspect=0.9
        )
        camera.fov = FRONT_FOV
        server.on_client_connect(self._on_connect)

    def set_view(self, client: viser.ClientHandle | None, *, above: bool) -> None:
        """Moves a page's camera above the board, or in front of it."""
        if client is not None:
            back, fov = direction_to_camera(above=above), TOP_FOV if above else FRONT_FOV
            self._in_server_thread(lambda: self._assign_view(client, back, fov))

    def show(self) -> None:
        """After a change of the board's size, fits it on all pages, keeping the view direction."""
        if (size := self._board().size) != self._shown:
            self._shown = size
            self._in_server_thread(self._fit_all)

    def forget_page(self, client_id: int) -> None:
        """Drops the view of a page that is gone."""
        self._assigned.pop(client_id, None)

    def _in_server_thread(self, action: Callable[[], None]) -> None:
        with contextlib.suppress(RuntimeError):  # the server has stopped
            self._server.get_event_loop().call_soon_threadsafe(action)

    async def _on_connect(self, client: viser.ClientHandle) -> None:
        async def follow(camera: Any) -> None:
            self._follow(client)

        client.camera.on_update(follow)
        # `follow` is called next, with the page's first report, and sends this view.
        back = direction_to_camera(above=False)
        self._assigned[client.client_id] = self._fit_view(client.camera, back, FRONT_FOV)

    def _follow(self, client: viser.ClientHandle) -> None:
        """Handles a reported camera: it was moved, or the page's scene has another size."""
        assigned = self._assigned.get(client.client_id)
        if assigned is None:
            return
        camera = client.camera
        if abs(camera.aspect - assigned.aspect) > VIEW_TOLERANCE:
            assigned = self._fit_view(camera, assigned.back, assigned.fov)
            self._assigned[client.client_id] = assigned
        if assigned.is_shown_by(camera):
            assigned.arrived = True
        elif assigned.sendings_left and (
            not assigned.arrived
            or _is_same_point(camera.position, self._server.initial_camera.position)
        ):
            self._send(client, assigned)  # not arrived yet, or replaced by the page's initial view
        else:
            del self._assigned[client.client_id]

    def _fit_all(self) -> None:
        for client in self._server.get_clients().values():
            if (assigned := self._assigned.get(client.client_id)) is not None:
                self._assign_view(client, assigned.back, assigned.fov)
                continue
            back = client.camera.position - client.camera.look_at
            back = back / np.linalg.norm(back)
            if np.hypot(back[0], back[1]) < TOP_VIEW_TILT / 2.0:
                back = direction_to_camera(above=True)
            self._assign_view(client, back, float(client.camera.fov))

    def _assign_view(self, client: viser.ClientHandle, back: Array, fov: float) -> None:
        if client.client_id not in self._server.get_clients():
            return
        before = self._assigned.get(client.client_id)
        assigned = self._assigned[client.client_id] = self._fit_view(client.camera, back, fov)
        is_reported = before is None or before.arrived
        assigned.arrived = is_reported and assigned.is_shown_by(client.camera)
        self._send(client, assigned)

    def _send(self, client: viser.ClientHandle, assigned: _AssignedView) -> None:
        assigned.sendings_left -= 1
        camera = client.camera
        with client.atomic():
            camera.up_direction = np.array([0.0, 0.0, 1.0])
            camera.fov = assigned.fov
            camera.position = assigned.position
            camera.look_at = assigned.target

    def _fit_view(self, camera: Any, back: Array, fov: float) -> _AssignedView:
        position, target = viewpoint(self._board(), back, fov, camera.aspect)
        return _AssignedView(back, fov, camera.aspect, position, target)


def _is_same_point(p_SA: Array, p_SB: Array) -> bool:
    return bool(np.linalg.norm(np.subtract(p_SA, p_SB)) <= VIEW_TOLERANCE)
