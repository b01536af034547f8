"""Brings objects that hardly move to rest, with the rolling resistance that Drake's contacts lack.

A slow object may still move far: a banana rocks for seconds. Kinetic damping takes a body to its
equilibrium directly: a body that has slowed down has passed its equilibrium, and is stopped
(dynamic relaxation, P. Cundall 1976).

Rolling resistance is a moment of at most c R N, for a radius R pressed on with N, so that balls and
lying cylinders stay on slopes up to c. Below that limit the moment is that of a damped spring from
where the body stopped: the elastic-plastic model (C) of Ai, Chen, Rotter and Ooi, "Assessment of
rolling resistance models in discrete element simulations", Powder Technology 206, 2011.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping, Set
from dataclasses import dataclass, replace

import numpy as np
from pydrake.multibody.math import SpatialForce, SpatialVelocity
from pydrake.multibody.plant import ExternallyAppliedSpatialForce
from pydrake.multibody.tree import BodyIndex, RigidBody
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Context, EventStatus

from burg_drake.core import Array
from burg_drake.objects import Primitive
from burg_drake.simulation.contacts import contact_islands, freeze_bodies
from burg_drake.simulation.falling import is_below
from burg_drake.simulation.rest_criterion import BodySpeed, center_pose, mean_speed
from burg_drake.station import Engine, StationDiagram

ROLLING_RESISTANCE = 0.002
"""Coefficient of hard balls on hard floors; steel on steel has 0.001 to 0.0024."""


def resist_rolling(built: StationDiagram, simulator: Simulator, share: float = 1.0) -> None:
    """Applies rolling resistance to the free balls and cylinders of a scene.

    Args:
        built: the diagram; nothing else applies forces to it.
        simulator: simulator of the diagram; its monitor is replaced.
        share: factor on the resistance.
    """
    rolling = []
    for name in built.free:
        primitive = built.scene.entry(name).contact.primitive
        if primitive is not None and primitive.shape != "box":
            rolling.append(_RollingBody(built, name, primitive, share))
    if not rolling:
        return
    port = built.diagram.GetInputPort("applied_forces")

    def update(root: Context) -> EventStatus:
        context = built.plant.GetMyContextFromRoot(root)
        port.FixValue(root, [body.force(context) for body in rolling])
        return EventStatus.Succeeded()

    simulator.set_monitor(update)


class _RollingBody:
    """A ball, or a cylinder, which only rolls about its axis."""

    def __init__(
        self, built: StationDiagram, name: str, primitive: Primitive, share: float
    ) -> None:
        spring_share = 0.2  # Share of the stiffness that stops a rolling body in a time step.
        damper_share = 0.5  # Share of the damping that stops a rolling body in a time step.
        self._body = built.plant.get_body(built.free[name])
        axis = primitive.X_OP.matrix()[:3, 2]
        self._along = np.eye(3) if primitive.shape == "sphere" else np.outer(axis, axis)
        radius, properties = primitive.size[0], built.scene.entry(name).mass_properties
        inertia = max(properties.inertia[:3]) if primitive.shape == "sphere" else 0.0
        inertia += properties.mass * radius**2
        self._time_step = built.engine.time_step
        self._stiffness = spring_share * inertia / self._time_step**2
        self._damping = damper_share * inertia / self._time_step
        self._limit = share * ROLLING_RESISTANCE * radius * properties.mass * 9.81
        self._turned = np.zeros(3)

    def force(self, context: Context) -> ExternallyAppliedSpatialForce:
        """The moment against its rolling; called once per time step."""
        R_WO = self._body.EvalPoseInWorld(context).rotation().matrix()
        w_WO = self._body.EvalSpatialVelocityInWorld(context).rotational()
        rolling = R_WO @ self._along @ R_WO.T @ w_WO
        turned = self._turned + self._time_step * rolling
        self._turned = _limit_length(turned, self._limit / self._stiffness)
        moment = -self._stiffness * self._turned - self._damping * rolling
        applied = ExternallyAppliedSpatialForce()
        applied.body_index = self._body.index()
        applied.F_Bq_W = SpatialForce(_limit_length(moment, self._limit), np.zeros(3))
        return applied


def _limit_length(vector: Array, limit: float) -> Array:
    """A vector (3,), shortened to a length of at most `limit`."""
    length = float(np.linalg.norm(vector))
    return vector if length <= limit else vector * (limit / length)


RELAXING_ENGINE = Engine(name="relaxing", time_step=0.01)
"""Time step and contact model while objects relax."""
TRIANGLE_RELAXING_ENGINE = replace(RELAXING_ENGINE, contact_surface="triangle")
"""Engine for wide, flat bodies, which rock by themselves on few large contact polygons."""
STEPS_PER_WINDOW = 10
"""Time steps between two measurements of the speeds."""
WINDOW_DURATION = STEPS_PER_WINDOW * RELAXING_ENGINE.time_step
"""Seconds."""
CALM_SPEED = BodySpeed(speed=3e-5, turning=float(np.deg2rad(0.02)))
"""Mean speed over a window below which an object stays where it is."""
GROUP_CALM_SPEED = BodySpeed(speed=1e-4, turning=float(np.deg2rad(0.1)))
"""The same for objects that touch each other, whose creep decays."""
ZERO_VELOCITY = SpatialVelocity(np.zeros(3), np.zeros(3))


@dataclass(frozen=True)
class RelaxationResult:
    """Final state of a relaxation.

    Attributes:
        X_WO: (4, 4) poses of the objects that are still on the table, by name.
        together: objects that were not at rest, and touched others.
    """

    X_WO: Mapping[str, Array]
    together: frozenset[str]


def relax(
    built: StationDiagram,
    moving: Iterable[str],
    time_limit: float,
    before_window: Callable[[Context, Collection[BodyIndex]], None] | None = None,
) -> RelaxationResult:
    """Steps objects of a scene, from where the documents place everything, until they are calm.

    Objects that touch each other come to rest together, and are then frozen.

    Args:
        built: the scene without a robot, with `RELAXING_ENGINE` steps.
        moving: objects that are to come to rest, with all that touches them; others stay.
        time_limit: simulated time allowed [s].
        before_window: called every 0.1 s with the plant's Context, whose velocities it may change,
            and the moving bodies.

    Raises:
        RuntimeError, SystemExit: Drake failed.
    """
    relaxation = _Relaxation(built, {built.free[name] for name in moving})
    windows = max(1, round(time_limit / WINDOW_DURATION))
    for _ in range(windows):
        if before_window is not None:
            before_window(relaxation.context, relaxation.moving_bodies)
        if not relaxation.advance_window():
            break
    return relaxation.result()


@dataclass
class _Island:
    """Objects that touch each other, and the number of windows for which all have been calm."""

    bodies: list[BodyIndex]
    calm: int = 0


class _Relaxation:
    def __init__(self, built: StationDiagram, loose: Set[BodyIndex]) -> None:
        self._built, self._plant = built, built.plant
        self._simulator = Simulator(built.diagram)
        self._root = self._simulator.get_mutable_context()
        self.context = self._plant.GetMyMutableContextFromRoot(self._root)
        # The other half of the rolling resistance is a margin.
        resist_rolling(built, self._simulator, share=0.5)
        islands = contact_islands(built)
        self._islands = [_Island(bodies) for bodies in islands if not loose.isdisjoint(bodies)]
        self._alone = {bodies[0] for bodies in islands if len(bodies) == 1}
        self._loose = {index for island in self._islands for index in island.bodies}
        freeze_bodies(built, self._root, [i for i in built.free.values() if i not in self._loose])
        self._energy = dict.fromkeys(built.free.values(), 0.0)
        self._speed: dict[BodyIndex, BodySpeed] = {}
        self._fallen: set[BodyIndex] = set()
        self._steps = 0

    @property
    def moving_bodies(self) -> list[BodyIndex]:
        """Bodies that are not calm yet."""
        return [index for island in self._islands for index in island.bodies]

    def advance_window(self) -> int:
        """Simulates one window; returns the number of islands that are not calm yet."""
        awake = [self._plant.get_body(index) for index in self.moving_bodies]
        before = {body.index(): center_pose(body, self.context) for body in awake}
        for _ in range(STEPS_PER_WINDOW):
            self._steps += 1
            self._simulator.AdvanceTo(self._steps * RELAXING_ENGINE.time_step)
            for body in awake:
                self._damp(body)
        for body in awake:
            after = center_pose(body, self.context)
            self._speed[body.index()] = mean_speed(before[body.index()], after, WINDOW_DURATION)
        for island in list(self._islands):
            self._inspect(island)
        return len(self._islands)

    def result(self) -> RelaxationResult:
        """The current state as a result."""
        built, together = self._built, self._loose - self._alone
        X_WO = {}
        for name, index in built.free.items():
            if index not in self._loose:
                X_WO[name] = built.X_WO(name)
            elif index not in self._fallen:
                body = self._plant.get_body(index)
                X_WO[name] = body.EvalPoseInWorld(self.context).GetAsMatrix4()
        return RelaxationResult(X_WO, frozenset(n for n in X_WO if built.free[n] in together))

    def _inspect(self, island: _Island) -> None:
        """Removes fallen objects from an island, and freezes the island once it is calm."""
        for index in [i for i in island.bodies if is_below(self._built, self.context, i)]:
            island.bodies.remove(index)
            self._fallen.add(index)
            self._plant.get_body(index).Lock(self.context)
        limit = CALM_SPEED if self._alone.issuperset(island.bodies) else GROUP_CALM_SPEED
        calm = all(is_slower(self._speed[index], limit) for index in island.bodies)
        island.calm = island.calm + 1 if calm else 0
        if island.calm == 2:
            self._islands.remove(island)
            freeze_bodies(self._built, self._root, island.bodies)

    def _damp(self, body: RigidBody) -> None:
        """Stops a body that has slowed down."""
        V_WO = self._plant.EvalBodySpatialVelocityInWorld(self.context, body)
        R_WO = self._plant.EvalBodyPoseInWorld(self.context, body).rotation()
        M_OO_W = body.default_spatial_inertia().ReExpress(R_WO)
        energy = 0.5 * float((M_OO_W * V_WO).dot(V_WO))
        if energy < self._energy[body.index()]:
            self._plant.SetFreeBodySpatialVelocity(self.context, body, ZERO_VELOCITY)
            energy = 0.0
        self._energy[body.index()] = energy


def is_slower(speed: BodySpeed, limit: BodySpeed) -> bool:
    """Whether a body moves and turns slower than a limit."""
    return speed.speed < limit.speed and speed.turning < limit.turning
