"""Lets some objects of a scene fall onto the others, which hold still, within walls on the board.

What rolls comes to lie at a wall, and what leans on one falls over once the wall is gone: therefore
walls have no friction, and a scene is to be relaxed without them afterwards.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace

from burg_drake.core.frames import make_pose
from burg_drake.core.schema import Pose
from burg_drake.scene.scene import Scene
from burg_drake.simulation.fall import fall
from burg_drake.simulation.placed_scene import placed_scene
from burg_drake.simulation.slack import slacken_bodies
from burg_drake.station.diagram import build_station_diagram
from burg_drake.station.engine import ENGINES
from burg_drake.station.station import Obstacle, Station

WALL_INSET = 0.004
"""Walls stand so far within the board's edge [m]: they yield to what lies at them."""
WALL_HEIGHT, WALL_THICKNESS = 1.0, 0.05
"""[m]."""
LANDING_TIME = 3.0
"""Simulated at most [s]."""


def land(scene: Scene, station: Station, falling: Collection[str]) -> Scene:
    """The scene once some objects have fallen, without those that fell off the table.

    Args:
        scene: the scene; what falls hangs above the board.
        station: table, pose of the board and obstacles.
        falling: names of what falls; all else stays where it is.

    Raises:
        RuntimeError, SystemExit: from Drake.
    """
    walled, walls = _walled(scene, station)
    built = build_station_diagram(scene, walled, robot="none", engine=ENGINES["screening"])
    slacken_bodies(built, dict.fromkeys((built.fixed[wall] for wall in walls), 0.0))
    held = [index for name, index in built.free.items() if name not in falling]
    return placed_scene(built, fall(built, LANDING_TIME, held=held).X_WO)


def _walled(scene: Scene, station: Station) -> tuple[Station, list[str]]:
    """The station with four more boxes along the edges of the board; and their names."""
    (width, length), d = scene.board.size, WALL_THICKNESS
    near = WALL_INSET - d / 2
    walls = {
        "left": ((near, length / 2), (d, length)),
        "right": ((width - near, length / 2), (d, length)),
        "lower": ((width / 2, near), (width, d)),
        "upper": ((width / 2, length - near), (width, d)),
    }
    boxes, taken = dict(station.document.background), {*scene.instances, *scene.background}
    names = []
    for side, ((x, y), size) in walls.items():
        name = f"wall_{side}"
        while name in taken or name in boxes:
            name += "_"
        X_WB = station.document.X_WS.matrix() @ make_pose(None, (x, y, WALL_HEIGHT / 2))
        boxes[name] = Obstacle(X_WB=Pose.from_matrix(X_WB), size=(*size, WALL_HEIGHT))
        names.append(name)
    return replace(station, document=replace(station.document, background=boxes)), names
