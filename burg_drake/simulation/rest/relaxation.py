"""Brings what is nearly at rest to rest, so that it stays there.

Something slow may still have far to go: a banana rocks for seconds, and what leans creeps. Kinetic
damping takes a body to its equilibrium on the shortest way: whenever it has got slower, which means
that it has passed the equilibrium, it is stopped (dynamic relaxation, P. Cundall 1976, as used for
form finding of nets and membranes). Steps are long.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping, Set
from dataclasses import dataclass, replace

import numpy as np
from pydrake.multibody.math import SpatialVelocity
from pydrake.multibody.tree import BodyIndex, RigidBody
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Context

from burg_drake.core import Array
from burg_drake.simulation.rest.contact_islands import freeze, islands
from burg_drake.simulation.rest.criterion import BodySpeed, body_place, mean_speed
from burg_drake.simulation.rest.falling import is_below
from burg_drake.simulation.rest.rolling_resistance import resist_rolling
from burg_drake.station.diagram import StationDiagram
from burg_drake.station.document import Engine

RELAXING = Engine(name="relaxing", time_step=0.01)
"""How time is stepped."""
RELAXING_ON_TRIANGLES = replace(RELAXING, contact_surface="triangle")
"""How it is stepped where a wide, flat body starts to rock by itself: a step knows how a force
grows with depth in each face alone, and polygons give such a body few, large faces."""
WINDOW = 10
"""Steps between two looks."""
WINDOW_TIME = WINDOW * RELAXING.time_step
"""The same in seconds."""
CALM_SPEED = BodySpeed(speed=3e-5, turning=float(np.deg2rad(0.02)))
"""What moves [m/s] and turns [rad/s] by less during a window, from rest or in creep, stays."""
GROUP_CALM_SPEED = BodySpeed(speed=1e-4, turning=float(np.deg2rad(0.1)))
"""The same of objects that touch each other, which creep, slower and slower, for long."""
ROLLING_SHARE = 0.5
"""Relaxing uses half of the rolling resistance, so that the other half is a margin."""
CALM_WINDOWS = 2
"""So many windows in succession."""
STOPPED = SpatialVelocity(np.zeros(3), np.zeros(3))


@dataclass(frozen=True)
class Relaxed:
    """Where relaxing ended.

    Attributes:
        X_WO: (4, 4) poses of what is still on the table, by name.
        together: those that were not at rest, and touched others.
    """

    X_WO: Mapping[str, Array]
    together: frozenset[str]


def relax(
    built: StationDiagram,
    moving: Iterable[str],
    time_limit: float,
    before_window: Callable[[Context, Collection[BodyIndex]], None] | None = None,
) -> Relaxed:
    """Steps objects of a scene, from where the documents place everything, until they are calm.

    Objects that touch each other come to rest together; once they are, they are left alone.

    Args:
        built: the scene without a robot, with `RELAXING` steps.
        moving: objects that are to come to rest, with all that touches them; others stay.
        time_limit: time that may be stepped [s].
        before_window: called every 0.1 s with the plant's Context, whose velocities it may change,
            and what is awake.

    Raises:
        RuntimeError, SystemExit: from Drake.
    """
    relaxation = _Relaxation(built, {built.free[name] for name in moving})
    windows = max(1, round(time_limit / WINDOW_TIME))
    for _ in range(windows):
        if before_window is not None:
            before_window(relaxation.context, relaxation.awake)
        if not relaxation.window():
            break
    return relaxation.result()


@dataclass
class _Island:
    """Objects that touch each other, and for how many windows all of them have been calm."""

    bodies: list[BodyIndex]
    calm: int = 0


class _Relaxation:
    def __init__(self, built: StationDiagram, loose: Set[BodyIndex]) -> None:
        self._built, self._plant = built, built.plant
        self._simulator = Simulator(built.diagram)
        self._root = self._simulator.get_mutable_context()
        self.context = self._plant.GetMyMutableContextFromRoot(self._root)
        resist_rolling(built, self._simulator, share=ROLLING_SHARE)
        found = islands(built)
        self._islands = [_Island(bodies) for bodies in found if not loose.isdisjoint(bodies)]
        self._alone = {bodies[0] for bodies in found if len(bodies) == 1}
        self._loose = {index for island in self._islands for index in island.bodies}
        freeze(built, self._root, [i for i in built.free.values() if i not in self._loose])
        self._energy = dict.fromkeys(built.free.values(), 0.0)
        self._speed: dict[BodyIndex, BodySpeed] = {}
        self._fallen: set[BodyIndex] = set()
        self._steps = 0

    @property
    def awake(self) -> list[BodyIndex]:
        """Bodies that are not calm yet."""
        return [index for island in self._islands for index in island.bodies]

    def window(self) -> int:
        """Steps on; returns how many islands are not calm yet."""
        awake = [self._plant.get_body(index) for index in self.awake]
        before = {body.index(): body_place(body, self.context) for body in awake}
        for _ in range(WINDOW):
            self._steps += 1
            self._simulator.AdvanceTo(self._steps * RELAXING.time_step)
            for body in awake:
                self._damp(body)
        for body in awake:
            place = body_place(body, self.context)
            self._speed[body.index()] = mean_speed(before[body.index()], place, WINDOW_TIME)
        for island in list(self._islands):
            self._inspect(island)
        return len(self._islands)

    def result(self) -> Relaxed:
        """Where everything is now."""
        built, together = self._built, self._loose - self._alone
        X_WO = {}
        for name, index in built.free.items():
            if index not in self._loose:
                X_WO[name] = built.X_WO(name)
            elif index not in self._fallen:
                body = self._plant.get_body(index)
                X_WO[name] = body.EvalPoseInWorld(self.context).GetAsMatrix4()
        return Relaxed(X_WO, frozenset(n for n in X_WO if built.free[n] in together))

    def _inspect(self, island: _Island) -> None:
        """Takes what has fallen out of an island, and freezes it once it is calm."""
        for index in [i for i in island.bodies if is_below(self._built, self.context, i)]:
            island.bodies.remove(index)
            self._fallen.add(index)
            self._plant.get_body(index).Lock(self.context)
        limit = CALM_SPEED if self._alone.issuperset(island.bodies) else GROUP_CALM_SPEED
        calm = all(is_slower(self._speed[index], limit) for index in island.bodies)
        island.calm = island.calm + 1 if calm else 0
        if island.calm == CALM_WINDOWS:
            self._islands.remove(island)
            freeze(self._built, self._root, island.bodies)

    def _damp(self, body: RigidBody) -> None:
        """Stops a body that has got slower."""
        V_WO = self._plant.EvalBodySpatialVelocityInWorld(self.context, body)
        R_WO = self._plant.EvalBodyPoseInWorld(self.context, body).rotation()
        M_OO_W = body.default_spatial_inertia().ReExpress(R_WO)
        energy = 0.5 * float((M_OO_W * V_WO).dot(V_WO))
        if energy < self._energy[body.index()]:
            self._plant.SetFreeBodySpatialVelocity(self.context, body, STOPPED)
            energy = 0.0
        self._energy[body.index()] = energy


def is_slower(speed: BodySpeed, limit: BodySpeed) -> bool:
    """Whether a body moves and turns slower than a limit."""
    return speed.speed < limit.speed and speed.turning < limit.turning
