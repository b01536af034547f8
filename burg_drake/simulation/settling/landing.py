"""Lets some objects of a scene fall onto the others, which hold still, and keeps them on the board.

There is less friction meanwhile, so that they come to lie flat and low, where they stay.
"""

from __future__ import annotations

from collections.abc import Collection

from burg_drake.scene.arrangement import ObjectShapes
from burg_drake.scene.document import Scene
from burg_drake.simulation.rest import fall
from burg_drake.simulation.settling.board_edge import BoardEdgeGuard
from burg_drake.simulation.settling.reduced_friction import reduce_friction
from burg_drake.simulation.settling.scene_state import placed_scene
from burg_drake.station.diagram import build_station_diagram
from burg_drake.station.document import Engine, Station

TUMBLING = Engine(name="tumbling", time_step=0.005, contact_model="point")
"""How time is stepped while all objects of a heap fall: points of contact take a third of the time
of patches, but nothing comes to rest on them."""
TUMBLING_TIME = 1.2
"""[s]."""
LANDING = Engine(name="landing", time_step=0.01)
"""How time is stepped then, or when few objects fall."""
LANDING_TIME = 2.0
"""Simulated at most [s]."""
FRICTION = 0.25
"""Share of friction that is left while something falls."""


def drop_onto_scene(
    scene: Scene,
    station: Station,
    falling: Collection[str],
    shapes: ObjectShapes,
    margin: float,
) -> Scene:
    """The scene once some objects have fallen, without those that fell off the table.

    Args:
        scene: the scene; what falls hangs above the board.
        station: table, pose of the board and obstacles.
        falling: names of what falls; all else stays where it is.
        shapes: of the library's objects.
        margin: what falls is kept so far within the board's edge [m].

    Raises:
        RuntimeError, SystemExit: from Drake.
    """
    if len(falling) == len(scene.instances):
        scene = _fallen(scene, station, falling, shapes, margin, TUMBLING, TUMBLING_TIME)
    return _fallen(scene, station, falling, shapes, margin, LANDING, LANDING_TIME)


def _fallen(
    scene: Scene,
    station: Station,
    falling: Collection[str],
    shapes: ObjectShapes,
    margin: float,
    engine: Engine,
    time_limit: float,
) -> Scene:
    """The scene after a stage of falling."""
    built = build_station_diagram(scene, station, robot="none", engine=engine)
    reduce_friction(built, FRICTION)
    held = [index for name, index in built.free.items() if name not in falling]
    guard = BoardEdgeGuard(built, shapes, margin=margin, share=FRICTION)
    end = fall(built, time_limit, held=held, before_poll=guard.push_back)
    return placed_scene(built, end.X_WO)
