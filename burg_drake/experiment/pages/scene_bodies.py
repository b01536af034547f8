"""What pictures of trials show: objects, the printed board, the station's boxes and the hand, as
visual shapes in the frame S of the board."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from pydrake.geometry import Box, Mesh, Shape

from burg_drake.core import Array, inverse, make_pose
from burg_drake.core.terminal import Rgb
from burg_drake.scene.document import Scene
from burg_drake.station.document import Station
from burg_drake.station.world import OBSTACLE_COLOR, TABLE_COLOR, board_meshes
from burg_drake.visualization.meshcat import HandVisual, hand_visuals

PAPER, INK = (0.95, 0.95, 0.93), (0.62, 0.62, 0.61)
"""The markers are pale, so that what stands on the board stands out, in print as well."""
BELOW = 1e-3
"""By so much the table is drawn below the board, so that the sheet shows [m]."""
GROUND = "ground"
HAND = "hand"


@dataclass(frozen=True, eq=False)
class DrawnBody:
    """A shape that may be in pictures, several times in one.

    Attributes:
        key: tells it from all other bodies.
        shape: what it looks like.
        color: None for the shape's own.
    """

    key: str
    shape: Shape
    color: Rgb | None = None


@dataclass(frozen=True, eq=False)
class PlacedBody:
    """A body where it is.

    Attributes:
        name: of the instance that it is of, `hand`, or `ground`.
        body: what it looks like.
        X_SB: (4, 4) where it is.
    """

    name: str
    body: DrawnBody
    X_SB: Array


class SceneBodies:
    """The bodies of a scene on a station, the hand among them.

    Args:
        scene: what stands on the board.
        station: what is around it.

    Attributes:
        scene, station: as given.
        standing: all that stays where it is.

    Raises:
        UnknownNameError: a mesh file of the library is missing.
        InvalidInputError: the hand's model cannot be loaded.
    """

    def __init__(self, scene: Scene, station: Station) -> None:
        self.scene, self.station = scene, station
        self.standing = (*_ground(scene, station), *_objects(scene))
        self._visuals = hand_visuals(station.hand, station.hand_model, packages=station.packages)
        self._hand = [_hand_body(station, k, visual) for k, visual in enumerate(self._visuals)]

    def hand(self, X_SG: Array, width: float) -> list[PlacedBody]:
        """The hand at a grasp.

        Args:
            X_SG: (4, 4) the grasp.
            width: distance between the pads [m]; the hand is open if it is NaN.
        """
        hand = self.station.hand
        low, high = hand.opening
        closed = 0.0 if np.isnan(width) else high - float(np.clip(width, low, high))
        X_SH = hand.X_AH(X_SG)
        return [
            PlacedBody(HAND, body, X_SH @ make_pose(p_AB=closed * visual.slide) @ visual.X_HV)
            for body, visual in zip(self._hand, self._visuals, strict=True)
        ]

    def corners(self, X_SG: Array) -> Array:
        """(N, 3) points around the open hand at a grasp, in S [m]."""
        X_SH = self.station.hand.X_AH(X_SG)
        parts = [(X_SH @ v.X_HV, v.corners) for v in self._visuals if len(v.corners)]
        return np.vstack([c @ X[:3, :3].T + X[:3, 3] for X, c in parts])


def _ground(scene: Scene, station: Station) -> list[PlacedBody]:
    document = station.document
    X_SW, table = inverse(document.X_WS.matrix()), document.table
    X_WT = make_pose(p_AB=(*table.center, -table.size[2] / 2 - BELOW))
    top = DrawnBody(f"table {table.size}", Box(*table.size), TABLE_COLOR[:3])
    placed = [PlacedBody(GROUND, top, X_SW @ X_WT)]
    for part, mesh in board_meshes(scene.board).items():
        color = PAPER if part == "paper" else INK
        placed.append(
            PlacedBody(GROUND, DrawnBody(f"{part} {scene.board}", mesh, color), np.eye(4))
        )
    for box in document.background.values():
        body = DrawnBody(f"box {box.size}", Box(*box.size), OBSTACLE_COLOR[:3])
        placed.append(PlacedBody(GROUND, body, X_SW @ box.X_WB.matrix()))
    return placed


def _objects(scene: Scene) -> list[PlacedBody]:
    placed = []
    for name in (*scene.instances, *scene.background):
        path = scene.library.path(scene.entry(name).mesh)
        placed.append(
            PlacedBody(name, DrawnBody(f"mesh {path}", Mesh(str(path))), scene.X_SO(name))
        )
    return placed


def _hand_body(station: Station, number: int, visual: HandVisual) -> DrawnBody:
    color = (visual.color.r(), visual.color.g(), visual.color.b())
    own = isinstance(visual.model, Mesh)
    key = f"hand {station.hand_model} {number}"
    return DrawnBody(key, visual.model, None if own else color)


def stock(pictures: Sequence[Sequence[PlacedBody]]) -> dict[str, tuple[DrawnBody, int]]:
    """What pictures show: each body, and how often one of them shows it at most."""
    found: dict[str, tuple[DrawnBody, int]] = {}
    for picture in pictures:
        counts: dict[str, int] = {}
        for placed in picture:
            key = placed.body.key
            counts[key] = counts.get(key, 0) + 1
            most = found[key][1] if key in found else 0
            found[key] = (placed.body, max(most, counts[key]))
    return found
