"""Whether a scene can stand on a station: nothing overlaps, everything is over the table."""

from __future__ import annotations

import itertools
from collections.abc import Iterable

from pydrake.multibody.tree import BodyIndex

from burg_drake.objects.collision import surface_overlap
from burg_drake.scene.document import (
    TOUCH_TOLERANCE,
    Scene,
    SceneIssue,
    SceneLike,
    as_scene,
    length_text,
)
from burg_drake.station.checks.scene_check import SceneCheck
from burg_drake.station.diagram import StationDiagram, mesh_by_pieces
from burg_drake.station.document import StationLike, as_station


def check_scene(scene: SceneLike, station: StationLike) -> tuple[SceneIssue, ...]:
    """Finds what is wrong with a scene on a station.

    That is what `burg.scenes.validate_scene` checks, overlaps with other objects and with the
    station, and overlaps of the objects' true surfaces.

    Example::

        for issue in burg.check_scene("breakfast.yaml", "panda_tabletop"):
            print(issue.message)

    Args:
        scene: the scene.
        station: where it stands; the arm is in its home posture.

    Returns:
        What was found; nothing if all is well.
    """
    scene, station = as_scene(scene), as_station(station)
    issues = SceneCheck(station, scene.library).issues(scene)
    return (*issues, *surface_issues(scene, issues))


def surface_issues(scene: Scene, known: Iterable[SceneIssue] = ()) -> tuple[SceneIssue, ...]:
    """Objects whose true surfaces are more than `TOUCH_TOLERANCE` deep in each other.

    What objects touch others with in simulation can be apart there, as convex pieces and
    primitives are smaller than the surface in places.

    Args:
        scene: the scene.
        known: issues found before; pairs that overlap by these are left out.

    Returns:
        One warning a pair, in the order of the document.

    Raises:
        MeshError: the surface of an object is damaged.
    """
    found = {(issue.instance, issue.other) for issue in known if issue.kind == "overlap"}
    free = tuple(scene.instances)
    pairs = [*itertools.combinations(free, 2), *itertools.product(free, scene.background)]
    surfaces = {}
    for name in (*free, *scene.background):
        surfaces[name] = scene.library.surface(scene.instance(name).object)
        surfaces[name].apply_transform(scene.X_SO(name))
    issues = []
    for a, b in pairs:
        (low_a, high_a), (low_b, high_b) = surfaces[a].bounds, surfaces[b].bounds
        apart = (low_a + TOUCH_TOLERANCE > high_b) | (low_b + TOUCH_TOLERANCE > high_a)
        if (a, b) in found or apart.any():
            continue
        depth = surface_overlap(surfaces[a], surfaces[b], TOUCH_TOLERANCE)
        if depth > 0.0:
            message = (
                f"the visible surfaces of {a!r} and {b!r} overlap by {length_text(depth)}"
                ", although their collision shapes do not; move them apart"
            )
            issues.append(
                SceneIssue(
                    instance=a, kind="surface_overlap", amount=depth, message=message, other=b
                )
            )
    return tuple(issues)


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
