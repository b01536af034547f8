"""Foretells whether objects that seem to be at rest stay where they are.

What creeps in Drake does so at nearly the same pace whatever the time step, and gets slower: 0.4 s
from rest in steps of 10 ms foretell 5 s in steps of 1 ms, and rather too much than too little. In
piles of ten, single objects went 0.46 to 0.97 times as far.
"""

from __future__ import annotations

from collections.abc import Mapping

from pydrake.systems.analysis import Simulator

from burg_drake.core.frames import Array
from burg_drake.simulation.displacement import Displacement, displacement
from burg_drake.simulation.fall import is_below
from burg_drake.simulation.settle import BodySpeed, body_place, mean_speed
from burg_drake.simulation.stillness import STILL_DURATION, has_stayed, poses
from burg_drake.station.diagram import StationDiagram

YIELDING_TIME = 0.1
"""After which all has yielded to its load [s] that was let go from rounded poses."""
FORETELLING_TIME = 0.4
"""Simulated altogether [s]."""


def creep(built: StationDiagram) -> Mapping[str, BodySpeed]:
    """Lets a scene go, from where the documents place everything.

    Args:
        built: the scene without a robot.

    Returns:
        The free objects that would move further in `STILL_DURATION` than those of a settled scene
        may, and their mean speed in that time, by name; none if all is at rest.

    Raises:
        RuntimeError, SystemExit: from Drake.
    """
    simulator = Simulator(built.diagram)
    context = built.plant.GetMyContextFromRoot(simulator.get_context())
    bodies = {name: built.plant.get_body(index) for name, index in built.free.items()}
    simulator.AdvanceTo(YIELDING_TIME)
    before = {name: body_place(body, context) for name, body in bodies.items()}
    simulator.AdvanceTo(FORETELLING_TIME)
    X_WO, moving = poses(built, context), {}
    left = STILL_DURATION - FORETELLING_TIME
    for name, body in bodies.items():
        place = body_place(body, context)
        speed = mean_speed(before[name], place, FORETELLING_TIME - YIELDING_TIME)
        now = displacement(built, name, X_WO[name])
        way = Displacement(now.distance + left * speed.speed, now.angle + left * speed.turning)
        if not has_stayed(way):  # nor has NaN
            moving[name] = BodySpeed(way.distance / STILL_DURATION, way.angle / STILL_DURATION)
    return moving


def let_go(built: StationDiagram, duration: float) -> Mapping[str, Array]:
    """Where the free objects of a scene are after a while, from where the documents place them.

    Args:
        built: the scene without a robot.
        duration: to simulate [s].

    Returns:
        (4, 4) poses in the world by name, of what is still on the table.

    Raises:
        RuntimeError, SystemExit: from Drake.
    """
    simulator = Simulator(built.diagram)
    simulator.AdvanceTo(duration)
    context = built.plant.GetMyContextFromRoot(simulator.get_context())
    X_WO = poses(built, context)
    return {n: X_WO[n] for n, i in built.free.items() if not is_below(built, context, i)}
