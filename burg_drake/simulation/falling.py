"""Lets the objects of a scene fall, tumble and roll until all of them are slow.

Two rigid objects meet at a single point per pair of pieces. Objects of many pieces meet at many
points, which carry them while they fall; a block on a block would tumble off its point, so objects
of few pieces are compliant.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass

import numpy as np
from pydrake.math import RigidTransform
from pydrake.multibody.math import SpatialVelocity
from pydrake.multibody.tree import BodyIndex
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Context

from burg_drake.core import Array
from burg_drake.simulation.contacts import freeze_bodies
from burg_drake.simulation.rest_criterion import BodySpeed, RestCriterion, settle
from burg_drake.station import StationDiagram, make_compliant


def compliant_while_falling(built: StationDiagram) -> list[str]:
    """Names of free objects of few pieces that are in the air, or below an object in the air.

    Args:
        built: a diagram, with all objects where the documents place them.
    """
    lateral_margin = 0.01  # Metres between bounding boxes, seen from above.
    bounds = {name: _world_bounds(built, name) for name in built.free}
    found: set[str] = set()
    for lower, upper in bounds.values():
        # Objects higher above the table stand on another object or fall.
        if lower[2] < 0.0005:
            continue
        for other, (low, high) in bounds.items():
            near = (lower[:2] - lateral_margin < high[:2]) & (low[:2] - lateral_margin < upper[:2])
            if near.all():  # also itself: it may meet the background
                found.add(other)
    # Compliant objects of more than 8 pieces take twice the time.
    return [name for name in built.free if name in found and _piece_count(built, name) <= 8]


def _piece_count(built: StationDiagram, name: str) -> int:
    return len(built.plant.GetCollisionGeometriesForBody(built.plant.get_body(built.free[name])))


def _world_bounds(built: StationDiagram, name: str) -> tuple[Array, Array]:
    """Lower and upper corner (3,) of an object's bounding boxes in the world."""
    body, inspector = built.plant.get_body(built.free[name]), built.scene_graph.model_inspector()
    X_WO = RigidTransform(built.X_WO(name))
    corners = []
    for geometry in built.plant.GetCollisionGeometriesForBody(body):
        box = inspector.GetObbInGeometryFrame(geometry)
        X_WB = X_WO @ inspector.GetPoseInFrame(geometry) @ box.pose()
        reach = np.abs(X_WB.rotation().matrix()) @ box.half_width()
        corners += [X_WB.translation() - reach, X_WB.translation() + reach]
    return np.min(corners, axis=0), np.max(corners, axis=0)


SLOW_CRITERION = RestCriterion(speed=0.01, turning=0.1, dying=6.0)
"""Speeds below which an object may come to rest in `relax`."""


@dataclass(frozen=True)
class FallResult:
    """Final state of a simulated fall.

    Attributes:
        X_WO: (4, 4) poses of the objects that are still on the table, by name.
        fallen: objects that fell off the table.
        moving: speed of each object on the table that is not slow, by name.
        duration: simulated time [s].
    """

    X_WO: Mapping[str, Array]
    fallen: frozenset[str]
    moving: Mapping[str, BodySpeed]
    duration: float


def fall(
    built: StationDiagram,
    time_limit: float,
    progress: Callable[[float, int], None] | None = None,
    *,
    held: Collection[BodyIndex] = (),
    before_poll: Callable[[Context, Collection[BodyIndex]], None] | None = None,
) -> FallResult:
    """Simulates until all objects are slow, or the time limit is reached.

    Args:
        built: the scene without a robot; everything starts where the documents place it.
        time_limit: simulated time allowed [s].
        progress: called regularly with the simulated time since the last call [s] and the number of
            objects that still move.
        held: free bodies that are locked.
        before_poll: called regularly with the plant's Context, whose velocities it may change, and
            the falling bodies.

    Raises:
        RuntimeError, SystemExit: Drake failed, or a pose is not finite.
    """
    make_compliant(built, compliant_while_falling(built))
    simulator = Simulator(built.diagram)
    context = built.plant.GetMyMutableContextFromRoot(simulator.get_mutable_context())
    freeze_bodies(built, simulator.get_mutable_context(), held)
    names = {index: name for name, index in built.free.items() if index not in held}
    fallen: set[str] = set()
    while True:
        now = simulator.get_context().get_time()
        watched = [index for index, name in names.items() if name not in fallen]

        def intervene(watched: list[BodyIndex] = watched) -> None:
            _damp_rotation(built, context, watched, SLOW_CRITERION.poll)
            if before_poll is not None:
                before_poll(context, watched)

        # Every 0.5 s there is a check for objects that fell off the table.
        settled = settle(
            simulator,
            built.plant,
            watched,
            min(0.5, time_limit - now),
            SLOW_CRITERION,
            before_poll=intervene,
        )
        for index in settled.moving:
            if is_below(built, context, index):
                fallen.add(names[index])
                built.plant.get_body(index).Lock(context)
        moving = {names[i]: v for i, v in settled.moving.items() if names[i] not in fallen}
        before, now = now, simulator.get_context().get_time()
        if progress is not None:
            progress(now - before, len(moving))
        if settled.at_rest or now >= time_limit - 1e-9:
            break
    X_WO = {n: X for n, X in free_poses(built, context).items() if n not in fallen}
    return FallResult(X_WO, frozenset(fallen), moving, now)


def free_poses(built: StationDiagram, context: Context) -> dict[str, Array]:
    """Poses (4, 4) of the free instances in the world, by name.

    Args:
        built: the scene.
        context: Context of its plant.
    """
    return {
        name: built.plant.EvalBodyPoseInWorld(context, built.plant.get_body(index)).GetAsMatrix4()
        for name, index in built.free.items()
    }


def is_below(built: StationDiagram, context: Context, index: BodyIndex) -> bool:
    """Whether the centre of mass of a free body is below the table's top.

    Raises:
        RuntimeError: its pose is not finite.
    """
    body = built.plant.get_body(index)
    p_WOcm = built.plant.EvalBodyPoseInWorld(context, body).multiply(body.default_com())
    if not np.isfinite(p_WOcm).all():
        raise RuntimeError(f"the pose of {built.body_names[index]!r} is not finite")
    return bool(p_WOcm[2] < 0.0)


def _damp_rotation(
    built: StationDiagram, context: Context, bodies: list[BodyIndex], interval: float
) -> None:
    """Damps the rotation of bodies about their centres of mass over an interval [s]."""
    time_constant = 0.1  # Seconds. Stands for air and rolling resistance, which Drake lacks.
    plant, lost = built.plant, -math.expm1(-interval / time_constant)
    for index in bodies:
        body = plant.get_body(index)
        V_WO = plant.EvalBodySpatialVelocityInWorld(context, body)
        R_WO = plant.EvalBodyPoseInWorld(context, body).rotation()
        w_lost = lost * V_WO.rotational()
        v_lost = np.cross(w_lost, -(R_WO @ body.default_com()))  # of O, as Ocm keeps its velocity
        plant.SetFreeBodySpatialVelocity(context, body, V_WO - SpatialVelocity(w_lost, v_lost))
