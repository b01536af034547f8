"""Criterion for objects at rest, and their displacement from the poses in the document."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import BodyIndex, RigidBody
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Context

from burg_drake.core import Array, inverse, rotation_angle
from burg_drake.scene import Scene, support_vertices
from burg_drake.station import StationDiagram


@dataclass(frozen=True, kw_only=True)
class RestCriterion:
    """When a body counts as at rest.

    Speeds are means over the poll interval: at large time steps the momentary velocity of an object
    at rest alternates from step to step.

    Attributes:
        speed: upper bound of the speed of its centre of mass [m/s].
        turning: upper bound of its angular speed [rad/s].
        duration: time for which both must hold [s]: a rocking body stands still twice a period.
        poll: interval between checks of the poses [s].
        dying: factor on both speeds for a body that gets slower from poll to poll.
    """

    speed: float = 0.005
    turning: float = 0.02
    duration: float = 0.12
    poll: float = 0.04
    dying: float = 1.0

    def is_rest(self, now: BodySpeed, before: BodySpeed | None) -> bool:
        """Whether a body is at rest, by its speed now and at the previous poll."""
        slower = before is not None and now.speed < before.speed and now.turning < before.turning
        factor = self.dying if slower else 1.0
        return now.speed < factor * self.speed and now.turning < factor * self.turning


@dataclass(frozen=True)
class BodySpeed:
    """Linear and angular speed of a body.

    Attributes:
        speed: speed of its centre of mass [m/s].
        turning: angular speed [rad/s].
    """

    speed: float
    turning: float


@dataclass(frozen=True)
class SettlingResult:
    """Result of settling.

    Attributes:
        duration: simulated time [s].
        moving: last speed of each body that still moved shortly before the end; empty if all came
            to rest.
    """

    duration: float
    moving: dict[BodyIndex, BodySpeed] = field(default_factory=dict)

    @property
    def at_rest(self) -> bool:
        """Whether all bodies came to rest within the time limit."""
        return not self.moving


def settle(
    simulator: Simulator,
    plant: MultibodyPlant,
    bodies: Iterable[BodyIndex],
    time_limit: float,
    criterion: RestCriterion = RestCriterion(),
    before_poll: Callable[[], None] | None = None,
) -> SettlingResult:
    """Advances a simulator until bodies are at rest, or the time limit is reached.

    Args:
        simulator: simulator of a diagram that contains `plant`; its context is advanced.
        plant: a finalized plant.
        bodies: bodies that have to come to rest.
        time_limit: simulated time allowed [s].
        criterion: criterion for rest.
        before_poll: called at the beginning of each poll interval; may change the state.

    Raises:
        RuntimeError, SystemExit: Drake failed.
    """
    context = plant.GetMyContextFromRoot(simulator.get_context())
    watched = [plant.get_body(index) for index in bodies]
    start = simulator.get_context().get_time()
    steps = max(1, round(time_limit / criterion.poll))
    required_polls = max(1, round(criterion.duration / criterion.poll))
    recent: deque[dict[BodyIndex, BodySpeed]] = deque(maxlen=required_polls)
    before = [center_pose(body, context) for body in watched]
    speeds: dict[BodyIndex, BodySpeed] = {}
    for step in range(1, steps + 1):
        if before_poll is not None:
            before_poll()
        simulator.AdvanceTo(start + step * criterion.poll)
        after = [center_pose(body, context) for body in watched]
        moving = {}
        for body, old, new in zip(watched, before, after, strict=True):
            speed = mean_speed(old, new, criterion.poll)
            if not criterion.is_rest(speed, speeds.get(body.index())):  # nor is NaN
                moving[body.index()] = speed
            speeds[body.index()] = speed
        before = after
        recent.append(moving)
        if len(recent) == required_polls and not any(recent):
            break
    moved = {index: speed for moving in recent for index, speed in moving.items()}
    return SettlingResult(simulator.get_context().get_time() - start, moved)


def center_pose(body: RigidBody, context: Context) -> tuple[Array, Array]:
    """Rotation (3, 3) and centre of mass (3,) of a body in the world."""
    X_WO = body.EvalPoseInWorld(context)
    p_WOcm = X_WO @ body.CalcCenterOfMassInBodyFrame(context)
    return X_WO.rotation().matrix(), p_WOcm


def mean_speed(
    before: tuple[Array, Array], after: tuple[Array, Array], interval: float
) -> BodySpeed:
    """Mean speed between two poses of a body, an interval [s] apart."""
    turn = before[0].T @ after[0]
    # chordal distance; exact for small turns, where the cosine is not
    angle = 2.0 * np.arcsin(min(1.0, np.linalg.norm(turn - np.eye(3)) / np.sqrt(8.0)))
    travel = np.linalg.norm(after[1] - before[1])
    return BodySpeed(float(travel / interval), float(angle / interval))


@dataclass(frozen=True)
class Displacement:
    """Displacement of an object.

    Attributes:
        distance: distance that its centre of mass has moved [m].
        angle: angle by which it has turned [rad].
    """

    distance: float
    angle: float


def displacement_from_document(built: StationDiagram, name: str, X_WO: Array) -> Displacement:
    """Displacement of an instance from its pose in the document.

    Args:
        built: the diagram.
        name: name of the instance.
        X_WO: (4, 4) current pose.
    """
    X_OO = inverse(built.X_WO(name)) @ X_WO
    p_OOcm = np.array(built.scene.entry(name).mass_properties.center_of_mass)
    moved = X_OO[:3, :3] @ p_OOcm + X_OO[:3, 3] - p_OOcm
    return Displacement(float(np.linalg.norm(moved)), float(rotation_angle(X_OO[:3, :3])))


def depth_in_table(scene: Scene, X_WO: Array, name: str) -> float:
    """Depth of an instance's contact geometry at `X_WO` below the table's top [m].

    Args:
        scene: the scene.
        X_WO: (4, 4) pose of the instance.
        name: name of the instance.
    """
    p_OC = support_vertices(scene.library, scene.instance(name).object)
    return -float((p_OC @ X_WO[2, :3]).min() + X_WO[2, 3])
