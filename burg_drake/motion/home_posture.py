"""Checks that the arm's base stands in no solid body and that its home posture is free."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from pydrake.geometry import QueryObject

from burg_drake.core import InvalidInputError
from burg_drake.motion.arm_collision import ArmCollision
from burg_drake.station import Arm, Station, StationDiagram


@dataclass(frozen=True)
class HomeClearance:
    """Clearance of the arm at home from the scene and from itself.

    Attributes:
        distance: distance of the nearest pair of bodies, at most 1 [m].
        link, other: their names; empty if no pair is within 1 m.
    """

    distance: float
    link: str = ""
    other: str = ""


@dataclass(frozen=True)
class BaseOverlap:
    """A shape of the arm's base that penetrates another body.

    Attributes:
        name: the other body.
        depth: [m].
        link, shape: names of the base's link and of its collision geometry.
        upwards: whether the shortest way out leads upwards.
    """

    name: str
    depth: float
    link: str
    shape: str
    upwards: bool


def require_free_home(station_diagram: StationDiagram, collision: ArmCollision) -> None:
    """Refuses a station whose arm base is inside a body, or whose home posture collides.

    Args:
        station_diagram: the arm among the objects of a scene.
        collision: collision checks of that arm.

    Raises:
        InvalidInputError: one line that names the bodies.
    """
    station, scene = station_diagram.station, station_diagram.scene
    inside = base_overlaps(station_diagram)
    if inside:
        raise InvalidInputError(f"{station.path}: {_repair_hint(inside, station)}")
    at_home = collision.overlaps(np.array(_arm_document(station_diagram).home))
    if at_home:
        pairs = ", ".join(dict.fromkeys(f"{o.link} with {o.other}" for o in at_home))
        raise InvalidInputError(
            f"{station.path}: at arm.home the arm collides in scene {scene.name!r}: {pairs};"
            " change arm.home or move the obstacle"
        )


def base_overlaps(station_diagram: StationDiagram) -> tuple[BaseOverlap, ...]:
    """Overlaps of more than 5 mm of the arm's base that `arm.stands_in` does not allow. The checks
    of configurations ignore them, as neither body can move.

    Returns:
        One for each pair of a base shape and a body (table, obstacles, fixed instances), the
        deepest first.
    """
    plant, arm = station_diagram.plant, _arm_document(station_diagram)
    model = plant.GetModelInstanceByName("arm")
    base = plant.GetFrameByName(arm.base, model).body()
    parts = [b for b in plant.GetBodiesWeldedTo(base) if b.model_instance() == model]
    bodies = {**station_diagram.fixed, "table": station_diagram.table}
    query = _default_query(station_diagram)
    shapes = [(part.name(), g) for part in parts for g in plant.GetCollisionGeometriesForBody(part)]
    found = []
    for name in bodies.keys() - set(arm.stands_in):
        others = plant.GetCollisionGeometriesForBody(plant.get_body(bodies[name]))
        for (link, shape), other in product(shapes, others):
            pair = query.ComputeSignedDistancePairClosestPoints(shape, other)
            if -pair.distance > 5e-3:  # the feet of an arm are modelled roughly
                normal = pair.nhat_BA_W if pair.id_A == shape else -pair.nhat_BA_W
                shape_name = query.inspector().GetName(shape).split("::")[-1]
                upwards = bool(normal[2] > 0.99)
                depth = float(-pair.distance)
                found.append(BaseOverlap(name, depth, link, shape_name, upwards))
    return tuple(sorted(found, key=lambda overlap: (-overlap.depth, str(overlap))))


def _repair_hint(inside: Sequence[BaseOverlap], station: Station) -> str:
    """Message that names the deepest overlap of the base, the shapes in it, and a remedy."""
    max_shapes = 3  # Shapes of the base that are listed.
    name = inside[0].name
    shapes = [overlap for overlap in inside if overlap.name == name]
    depth = 1e3 * shapes[0].depth
    listed = ", ".join(f"{s.link} {s.shape!r} {1e3 * s.depth:.0f} mm" for s in shapes[:max_shapes])
    more = f" and {len(shapes) - max_shapes} more" if len(shapes) > max_shapes else ""
    move_hint = "move the base or the obstacle"
    arm = station.document.arm
    if all(shape.upwards for shape in shapes) and arm is not None:
        x, y, z = arm.X_WA.translation
        rise = np.ceil(depth) / 1e3
        move_hint = f"raise the base by {1e3 * rise:.0f} mm (arm.X_WA.translation: "
        move_hint += f"[{x:g}, {y:g}, {z + rise:g}])"
    allowed, mount_hint = [*arm.stands_in, name] if arm is not None else [name], ""
    if name == "table" or name in station.document.background:
        mount_hint = (
            f", or write arm.stands_in: [{', '.join(allowed)}] if the base is mounted inside it"
        )
    return (
        f"arm.X_WA puts the arm's base {depth:.0f} mm deep into {name!r} by its collision shapes"
        f" ({listed}{more}); {move_hint}{mount_hint}"
    )


def home_clearance(station_diagram: StationDiagram) -> HomeClearance:
    """Clearance of the arm at home with its hand open; the hand's own parts are not checked against
    each other."""
    max_distance = 1.0  # Metres. Bodies farther away are ignored.
    plant = station_diagram.plant
    inspector = station_diagram.scene_graph.model_inspector()
    hand = set(plant.GetBodyIndices(plant.GetModelInstanceByName("hand")))
    robot, names = set(station_diagram.robot_bodies), station_diagram.body_names
    nearest = HomeClearance(max_distance)
    query = _default_query(station_diagram)
    for pair in query.ComputeSignedDistancePairwiseClosestPoints(max_distance):
        frames = (inspector.GetFrameId(geometry) for geometry in (pair.id_A, pair.id_B))
        a, b = (plant.GetBodyFromFrameId(frame).index() for frame in frames)
        if a not in robot:
            a, b = b, a
        if pair.distance < nearest.distance and a in robot and not {a, b} <= hand:
            nearest = HomeClearance(float(pair.distance), names[a], names[b])
    return nearest


def _default_query(station_diagram: StationDiagram) -> QueryObject:
    """Distances in the default context, in which the arm is at home."""
    context = station_diagram.diagram.CreateDefaultContext()
    return station_diagram.diagram.GetOutputPort("geometry_query").Eval(context)


def _arm_document(station_diagram: StationDiagram) -> Arm:
    arm = station_diagram.station.document.arm
    assert arm is not None  # the diagram was built with it
    return arm
