"""Where a page's camera looks from: straight down at the board, or from the front."""

from __future__ import annotations

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
FIRST_ASPECT = 0.9
"""Width over height that a new page has for the scene, at the least."""
TILT = 1e-3
"""Off the vertical, for the camera to know which way is up [rad]."""


def viewpoint(board: Board, *, from_above: bool, aspect: float) -> tuple[Array, Array, float]:
    """A camera that sees a board.

    Args:
        board: in the scene frame.
        from_above: or from the front.
        aspect: width over height of the page's scene.

    Returns:
        Its position (3,) and what it looks at (3,) in S [m], and its vertical angle of view [rad].
    """
    width, height = board.size
    target = np.array([width / 2.0, height / 2.0, 0.0])
    fov = TOP_FOV if from_above else FRONT_FOV
    elevation = np.pi / 2.0 - TILT if from_above else FRONT_ELEVATION
    high = height if from_above else height * np.sin(elevation) + 0.25 * np.cos(elevation)
    half = ROOM * max(high / 2.0, width / 2.0 / aspect)
    distance = half / np.tan(fov / 2.0) + (0.0 if from_above else height / 2.0 * np.cos(elevation))
    back = np.array([0.0, -np.cos(elevation), np.sin(elevation)])
    return target + distance * back, target, fov


def set_view(client: viser.ClientHandle, board: Board, *, from_above: bool) -> None:
    """Brings a page's camera there."""
    camera = client.camera
    position, target, fov = viewpoint(board, from_above=from_above, aspect=camera.aspect)
    with client.atomic():
        camera.up_direction = np.array([0.0, 0.0, 1.0])
        camera.fov = fov
        camera.position = position
        camera.look_at = target


def set_initial_view(server: viser.ViserServer, board: Board) -> None:
    """Where the camera of a new page is."""
    position, target, fov = viewpoint(board, from_above=False, aspect=FIRST_ASPECT)
    server.initial_camera.position = position
    server.initial_camera.look_at = target
    server.initial_camera.fov = fov
