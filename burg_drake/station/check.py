"""Whether a scene can stand on a station: nothing overlaps, everything is over the table."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from pydrake.multibody.tree import BodyIndex

from burg_drake.scene.scene import Scene
from burg_drake.scene.validate import TOUCH_TOLERANCE, SceneIssue, validate_scene
from burg_drake.station.diagram import Robot, StationDiagram, build_station_diagram, instance_pose
from burg_drake.station.hollow import mesh_by_pieces
from burg_drake.station.sound_scene import require_sound_scene as require_sound_scene
from burg_drake.station.station import Station


def check_scene(scene: Scene, station: Station) -> tuple[SceneIssue, ...]:
    """All that `validate_scene` checks, and overlaps with other objects and with the station.

    Args:
        scene: the scene.
        station: where it stands; the arm is in its home posture.

    Returns:
        What was found; nothing if all is well.
    """
    issues = list(validate_scene(scene))
    buried = {issue.instance for issue in issues if issue.kind == "in_ground"}
    for name in scene.instances:
        issue = _table_issue(scene, station, name)
        if issue is not None:
            issues.append(issue)
    robot: Robot = "arm" if station.document.arm is not None else "none"
    station_diagram = build_station_diagram(scene, station, robot=robot)
    parts = _robot_parts(station_diagram)
    for (a, b), depth in overlaps(station_diagram).items():
        if depth <= TOUCH_TOLERANCE or (b == "table" and a in buried):
            continue
        message = _overlap(a, b, depth, parts, station.path)
        issues.append(
            SceneIssue(instance=a, kind="overlap", amount=depth, message=message, other=b)
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


def _robot_parts(station_diagram: StationDiagram) -> dict[str, tuple[str, str]]:
    """Of each body of the robot, by name: what to say of it, and what of the station puts it
    there."""
    arm, plant = station_diagram.station.document.arm, station_diagram.plant
    if arm is None:
        return {}
    base = plant.GetFrameByName(arm.base, plant.GetModelInstanceByName("arm")).body()
    still = {body.index() for body in plant.GetBodiesWeldedTo(base)}
    return {
        plant.get_body(index).name(): ("where the arm stands", "arm.X_WA")
        if index in still
        else ("of the arm in its home posture", "arm.home")
        for index in station_diagram.robot_bodies
    }


def _overlap(a: str, b: str, depth: float, parts: dict[str, tuple[str, str]], path: Path) -> str:
    """One line about two bodies that overlap; a is an instance."""
    by = f"by {depth * 1e3:.1f} mm"
    if b not in parts:
        return f"{a!r} and {b!r} overlap {by}; move them apart"
    what, key = parts[b]
    return f"{a!r} overlaps {b!r} {what} {by}; move {a!r}, or change {key} in {path}"


def _names(station_diagram: StationDiagram) -> dict[BodyIndex, str]:
    named = {**station_diagram.free, **station_diagram.fixed, "table": station_diagram.table}
    names = {index: name for name, index in named.items()}
    plant = station_diagram.plant
    return names | {i: plant.get_body(i).name() for i in station_diagram.robot_bodies}


def _table_issue(scene: Scene, station: Station, name: str) -> SceneIssue | None:
    """Whether the centre of mass is beside the table, so that the object cannot stay."""
    table = station.document.table
    center_of_mass = (*scene.entry(name).mass_properties.center_of_mass, 1.0)
    p_WOcm = (instance_pose(scene, station, name) @ center_of_mass)[:3]
    beyond = np.abs(p_WOcm[:2] - table.center) - np.array(table.size[:2]) / 2
    if beyond.max() <= 0.0:
        return None
    return SceneIssue(
        instance=name,
        kind="out_of_bounds",
        amount=float(beyond.max()),
        message=(
            f"{name!r} stands {beyond.max() * 1e3:.0f} mm beside the table of station"
            f" {station.name!r}"
        ),
    )
