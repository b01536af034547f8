"""Plates as thin as their drawing on the board, in light and shade, drawn by closed form."""

from __future__ import annotations

import numpy as np
import trimesh

from burg_drake.cameras import (
    Intrinsics,
    PinholeView,
    SilhouetteAligner,
    TargetShape,
    empty_board,
    target_shape,
)
from burg_drake.core import Array, make_pose, rot_z
from burg_drake.scene import Board
from tests.cameras.placement_views import looking
from tests.cameras.synthetic import ImageDegradation, board_image, levels, light_of

BOARD = Board()
INTRINSICS = Intrinsics(width=320, height=240, focal=(600.0, 600.0), center=(159.5, 119.5))
X_SC = looking(np.array([0.85, 0.62, 0.58]), np.array([0.32, 0.2, 0.0]))
VIEW = PinholeView(INTRINSICS.K, (320, 240), X_SC)

Place = tuple[float, float, float]
"""x, y [m] and angle [rad]."""


def plate(size: tuple[float, float], place: Place) -> TargetShape:
    """A plate as thin as its drawing."""
    mesh = trimesh.creation.box((*size, 1e-6))
    X_SO = make_pose(rot_z(place[2]), (place[0], place[1], 5e-7))
    return target_shape(mesh.vertices, mesh.faces, X_SO)


def cover(size: tuple[float, float], place: Place, q: Array) -> tuple[float, ...]:
    """What `drawing` takes for a plate that is displaced."""
    x, y, turn = np.array(place) + q
    return x, y, size[0] / 2, size[1] / 2, turn


def drawing(
    plates: list[tuple[float, ...]], look: ImageDegradation, shade: Array | None = None
) -> Array:
    """(240, 320, 3) photo of plates.

    Args:
        plates: see `cover`.
        look: of the photo.
        shade: (240, 320) share of the light that reaches each pixel; all of it if None.
    """
    covers = np.array(plates).reshape(-1, 5)
    rng = np.random.default_rng(0)
    photo = board_image(BOARD, INTRINSICS, X_SC, covers=covers, look=look, rng=rng)
    if shade is None:
        return photo
    return np.rint(levels(light_of(photo) * shade[..., None])).astype(np.uint8)


def aligner(image: Array) -> SilhouetteAligner:
    """Of a photo."""
    picture = empty_board(BOARD, image, INTRINSICS.K, X_SC)
    assert picture is not None
    return SilhouetteAligner(VIEW, image, picture)
