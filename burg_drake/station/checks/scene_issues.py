"""Whether a scene can stand on a station: nothing overlaps, everything is over the table."""

from __future__ import annotations

from pydrake.multibody.tree import BodyIndex

from burg_drake.scene.document import SceneIssue, SceneLike, as_scene
from burg_drake.station.checks.scene_check import SceneCheck
from burg_drake.station.diagram import StationDiagram, mesh_by_pieces
from burg_drake.station.document import StationLike, as_station


def check_scene(scene: SceneLike, station: StationLike) -> tuple[SceneIssue, ...]:
    """All that `validate_scene` checks, and overlaps with other objects and with the station.

    Args:
        scene: the scene.
        station: where it stands; the arm is in its home posture.

    Returns:
        What was found; nothing if all is well.
    """
    scene, station = as_scene(scene), as_station(station)
    return SceneCheck(station, scene.library).issues(scene)


def overlaps(station_diagram: StationDiagram) -> dict[tuple[str, str], float]:
    """Penetrating pairs of bodies in the default context, at least one of them a scene's instance.

    Returns:
        Depth of the deepest overlap [m] by the pair's names: instances in the document's order
        before everything else; robot links go by their own names.
    """
    plant = station_diagram.plant
    names = _names(station_diagram)
    order = {name: i for i, name in enumerate(station_diagram.scene.instances)}
    context = station_diagram.diagram.CreateDefaultContext()
    mesh_by_pieces(station_diagram, context)
    query = station_diagram.diagram.GetOutputPort("geometry_query").Eval(context)
    inspector = query.inspector()
    found: dict[tuple[str, str], float] = {}
    for pair in query.ComputePointPairPenetration():
        bodies = [
            plant.GetBodyFromFrameId(inspector.GetFrameId(g)).index()
            for g in (pair.id_A, pair.id_B)
        ]
        a, b = sorted((names[i] for i in bodies), key=lambda n: order.get(n, len(order)))
        if a in order:
            found[a, b] = max(found.get((a, b), 0.0), pair.depth)
    return dict(sorted(found.items(), key=lambda item: order[item[0][0]]))


def _names(station_diagram: StationDiagram) -> dict[BodyIndex, str]:
    named = {**station_diagram.free, **station_diagram.fixed, "table": station_diagram.table}
    names = {index: name for name, index in named.items()}
    plant = station_diagram.plant
    return names | {i: plant.get_body(i).name() for i in station_diagram.robot_bodies}
