"""Lets the objects of a scene fall, tumble and roll until all of them are slow."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass

import numpy as np
from pydrake.multibody.math import SpatialVelocity
from pydrake.multibody.tree import BodyIndex
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Context

from burg_drake.core import Array
from burg_drake.simulation.rest.contact_islands import freeze
from burg_drake.simulation.rest.criterion import BodySpeed, RestCriterion, settle
from burg_drake.simulation.rest.falling_contacts import compliant_while_falling
from burg_drake.station.diagram import StationDiagram, soften

BRAKING_INTERVAL = 0.5
"""What falls off the table is looked for at this interval [s]."""
BRAKING_TIME = 0.1
"""Turning is braked with this time constant [s], as by air and rolling resistance, which Drake does
not have: a marble would roll, and a banana that hangs on its tips would swing, for ever."""
SLOW = RestCriterion(speed=0.01, turning=0.1, dying=6.0)
"""Below this an object may come to rest in `relax`."""


@dataclass(frozen=True)
class Fall:
    """Where a fall ended.

    Attributes:
        X_WO: (4, 4) poses of what is still on the table, by name.
        fallen: objects that fell off the table.
        moving: objects on the table that are not slow, with their speed.
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
) -> Fall:
    """Simulates until all objects are slow, or time is up.

    Args:
        built: the scene without a robot; everything starts where the documents place it.
        time_limit: simulated time allowed [s].
        progress: called now and then with the simulated time since the last call [s] and how many
            objects still move.
        held: free bodies that stay where they are.
        before_poll: called now and then with the plant's Context, whose velocities it may change,
            and what falls.

    Raises:
        RuntimeError, SystemExit: from Drake, or a pose is not finite.
    """
    soften(built, compliant_while_falling(built))
    simulator = Simulator(built.diagram)
    context = built.plant.GetMyMutableContextFromRoot(simulator.get_mutable_context())
    freeze(built, simulator.get_mutable_context(), held)
    names = {index: name for name, index in built.free.items() if index not in held}
    fallen: set[str] = set()
    while True:
        now = simulator.get_context().get_time()
        watched = [index for index, name in names.items() if name not in fallen]

        def intervene(watched: list[BodyIndex] = watched) -> None:
            _brake(built, context, watched, SLOW.poll)
            if before_poll is not None:
                before_poll(context, watched)

        settled = settle(
            simulator,
            built.plant,
            watched,
            min(BRAKING_INTERVAL, time_limit - now),
            SLOW,
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
    X_WO = {
        name: built.plant.EvalBodyPoseInWorld(context, built.plant.get_body(index)).GetAsMatrix4()
        for name, index in built.free.items()
        if name not in fallen
    }
    return Fall(X_WO, frozenset(fallen), moving, now)


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


def _brake(
    built: StationDiagram, context: Context, bodies: list[BodyIndex], interval: float
) -> None:
    """Takes from the turning of bodies about their centres of mass what an interval costs."""
    plant, lost = built.plant, -math.expm1(-interval / BRAKING_TIME)
    for index in bodies:
        body = plant.get_body(index)
        V_WO = plant.EvalBodySpatialVelocityInWorld(context, body)
        R_WO = plant.EvalBodyPoseInWorld(context, body).rotation()
        w_lost = lost * V_WO.rotational()
        v_lost = np.cross(w_lost, -(R_WO @ body.default_com()))  # of O, as Ocm keeps its velocity
        plant.SetFreeBodySpatialVelocity(context, body, V_WO - SpatialVelocity(w_lost, v_lost))
