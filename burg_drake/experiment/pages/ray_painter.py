"""Paints by rays (embree), where Drake's renderer lacks its system libraries: plain shaded
surfaces, each object in a colour of its own."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from burg_drake.cameras.optics import FieldOfView
from burg_drake.core import Array, Indices, transform_points
from burg_drake.core.terminal import CATEGORIES, distinct_colors
from burg_drake.experiment.pages.painting import BACKGROUND, NOTHING, Painting, Viewpoint
from burg_drake.experiment.pages.scene_bodies import GROUND, HAND, PlacedBody
from burg_drake.geometry import RayCaster
from burg_drake.station.diagram import Triangles, shape_triangles

LIGHT = np.array([0.35, -0.45, 0.82])
"""Where the light comes from, in S."""
AMBIENT = 0.45
"""Brightness of what the light does not reach."""
HAND_COLOR = (0.86, 0.87, 0.88)


class RayPainter:
    """Paints any bodies."""

    def __init__(self) -> None:
        self._triangles: dict[str, Triangles] = {}

    def paint(self, placed: Sequence[PlacedBody], view: Viewpoint) -> Painting:
        """See `Painter.paint`."""
        vertices, faces, owner = self.joined(placed)
        directions = FieldOfView(view.intrinsics).directions
        rays = (directions / np.linalg.norm(directions, axis=-1, keepdims=True)).reshape(-1, 3)
        rays = rays @ view.X_SC[:3, :3].T
        start = np.broadcast_to(view.X_SC[:3, 3], rays.shape)
        face, _ = RayCaster(vertices, faces).first_hits(start, rays)
        colors = np.array(_colors(placed))[owner]
        corners = vertices[faces]
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-30)
        lit = np.abs(normals @ (LIGHT / np.linalg.norm(LIGHT)))
        colors = colors * (AMBIENT + (1.0 - AMBIENT) * lit)[:, None]
        image = np.where((face >= 0)[:, None], colors[face], BACKGROUND)
        shape = directions.shape[:2]
        return Painting(
            np.round(255.0 * image.reshape(*shape, 3)).astype(np.uint8),
            np.where(face >= 0, owner[face], NOTHING).reshape(shape).astype(np.int32),
        )

    def joined(self, placed: Sequence[PlacedBody]) -> tuple[Array, Indices, Indices]:
        """Bodies as one mesh.

        Returns:
            (V, 3) vertices in S [m], (F, 3) faces, (F,) index of the body that a face belongs to.
        """
        vertices, faces, owner, first = [], [], [], 0
        for index, one in enumerate(placed):
            if one.body.key not in self._triangles:
                self._triangles[one.body.key] = shape_triangles(one.body.shape)
            corners, mine = self._triangles[one.body.key]
            vertices.append(transform_points(one.X_SB, corners))
            faces.append(mine + first)
            owner.append(np.full(len(mine), index))
            first += len(corners)
        return np.concatenate(vertices), np.concatenate(faces), np.concatenate(owner)


def _colors(placed: Sequence[PlacedBody]) -> list[tuple[float, float, float]]:
    names = list(dict.fromkeys(one.name for one in placed if one.name not in (GROUND, HAND)))
    more = distinct_colors(len(names))
    own = {n: CATEGORIES[i][:3] if i < len(CATEGORIES) else more[i] for i, n in enumerate(names)}
    return [own.get(one.name, one.body.color or HAND_COLOR) for one in placed]
