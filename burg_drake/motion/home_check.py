"""Whether an arm can stand on its station: its base in no solid thing, its home posture free."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from pydrake.geometry import QueryObject

from burg_drake.core.errors import InvalidInputError
from burg_drake.motion.collision import ArmCollision
from burg_drake.station.diagram import StationDiagram
from burg_drake.station.station import Arm

BASE_TOLERANCE = 5e-3
"""How deep the base may be in what it stands on [m]: feet are modelled roughly."""
FAR = 1.0
"""What is farther from the arm than that does not count for its clearance [m]."""


@dataclass(frozen=True)
class HomeClearance:
    """How near the arm at home is to anything, itself included.

    Attributes:
        distance: of the nearest pair of bodies [m]; `FAR` if none is nearer.
        link, other: their names; empty if none is nearer than `FAR`.
    """

    distance: float
    link: str = ""
    other: str = ""


def require_free_home(station_diagram: StationDiagram, collision: ArmCollision) -> None:
    """Refuses a station whose arm stands in something, or collides in its home posture.

    Args:
        station_diagram: the arm among the objects of a scene.
        collision: its checks.

    Raises:
        InvalidInputError: one line that names the bodies.
    """
    station, scene = station_diagram.station, station_diagram.scene
    inside = base_overlaps(station_diagram)
    if inside:
        name, depth = max(inside.items(), key=lambda item: item[1])
        raise InvalidInputError(
            f"{station.path}: arm.X_WA puts the arm's base {1e3 * depth:.0f} mm deep into {name!r};"
            " move the base or what is in its place"
        )
    at_home = collision.overlaps(np.array(_arm(station_diagram).home))
    if at_home:
        pairs = ", ".join(dict.fromkeys(f"{o.link} with {o.other}" for o in at_home))
        raise InvalidInputError(
            f"{station.path}: arm.home collides in scene {scene.name!r}: {pairs}; change the"
            " posture or move what is in the way"
        )


def base_overlaps(station_diagram: StationDiagram) -> dict[str, float]:
    """What the arm's base is in deeper than `BASE_TOLERANCE`; the checks of configurations leave
    that out, as neither of the two can move.

    Returns:
        Depths [m] by the names of table, obstacles and fixed instances.
    """
    plant = station_diagram.plant
    arm = plant.GetModelInstanceByName("arm")
    base = plant.GetFrameByName(_arm(station_diagram).base, arm).body()
    parts = [b for b in plant.GetBodiesWeldedTo(base) if b.model_instance() == arm]
    around = {**station_diagram.fixed, "table": station_diagram.table}
    query = _query(station_diagram)
    found: dict[str, float] = {}
    for name, index in around.items():
        depth = max(
            (
                -query.ComputeSignedDistancePairClosestPoints(one, other).distance
                for part in parts
                for one in plant.GetCollisionGeometriesForBody(part)
                for other in plant.GetCollisionGeometriesForBody(plant.get_body(index))
            ),
            default=0.0,
        )
        if depth > BASE_TOLERANCE:
            found[name] = depth
    return found


def home_clearance(station_diagram: StationDiagram) -> HomeClearance:
    """How near the arm at home, its hand open, is to anything; the hand's own parts do not count
    against each other."""
    plant = station_diagram.plant
    inspector = station_diagram.scene_graph.model_inspector()
    hand = set(plant.GetBodyIndices(plant.GetModelInstanceByName("hand")))
    robot, names = set(station_diagram.robot_bodies), station_diagram.body_names
    nearest = HomeClearance(FAR)
    for pair in _query(station_diagram).ComputeSignedDistancePairwiseClosestPoints(FAR):
        a, b = (
            plant.GetBodyFromFrameId(inspector.GetFrameId(g)).index()
            for g in (pair.id_A, pair.id_B)
        )
        if a not in robot:
            a, b = b, a
        if pair.distance < nearest.distance and a in robot and not {a, b} <= hand:
            nearest = HomeClearance(float(pair.distance), names[a], names[b])
    return nearest


def _query(station_diagram: StationDiagram) -> QueryObject:
    """Distances in the default context, in which the arm is at home."""
    context = station_diagram.diagram.CreateDefaultContext()
    query = station_diagram.diagram.GetOutputPort("geometry_query").Eval(context)
    return query


def _arm(station_diagram: StationDiagram) -> Arm:
    arm = station_diagram.station.document.arm
    assert arm is not None  # the diagram was built with it
    return arm
