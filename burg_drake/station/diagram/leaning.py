"""Objects that lean on each other: which they are, and how they can do so without walking off.

In Drake two rigid objects meet at single points, and on a single point no block rests on a block:
the contact jumps from corner to corner, and the upper one turns and slides by a millimetre in a few
seconds. Free objects that touch others are therefore compliant, and meet them on patches. An object
that stands by itself stays rigid: pads, which are compliant, it meets on patches anyway, and so it
does a table unless it has feet (see `world.contact_parts`), in two thirds of the time.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Iterable, Mapping

import numpy as np
from pydrake.geometry import (
    AddCompliantHydroelasticProperties,
    AddContactMaterial,
    GeometryId,
    ProximityProperties,
    RoleAssign,
)
from pydrake.multibody.tree import BodyIndex

from burg_drake.station.diagram.station_diagram import StationDiagram
from burg_drake.station.world import DISSIPATION, is_ball, is_mesh

GAP = 0.001
"""Objects that are closer than this may lean on each other [m]; a scene's poses are rounded."""
MODULUS = 5e7
"""Hydroelastic modulus of objects that touch others [Pa]. At 1e7, that of the pads, the edge of one
sinks into another by more than a millimetre."""


def touching(
    station_diagram: StationDiagram, bodies: Collection[BodyIndex]
) -> Mapping[BodyIndex, frozenset[BodyIndex]]:
    """Which bodies are closer to each other than `GAP`, where the documents place them.

    Args:
        station_diagram: a built diagram.
        bodies: among these.

    Returns:
        The others that touch it, of each body that touches any.
    """
    plant, graph = station_diagram.plant, station_diagram.scene_graph
    body_of: dict[GeometryId, BodyIndex] = {
        geometry: index
        for index in bodies
        for geometry in plant.GetCollisionGeometriesForBody(plant.get_body(index))
    }
    beside: dict[BodyIndex, set[BodyIndex]] = defaultdict(set)
    if len(bodies) > 1:
        context = station_diagram.diagram.CreateDefaultContext()
        query = graph.get_query_output_port().Eval(graph.GetMyContextFromRoot(context))
        for pair in query.ComputeSignedDistancePairwiseClosestPoints(GAP):
            one, other = body_of.get(pair.id_A), body_of.get(pair.id_B)
            if one is not None and other is not None and one != other:
                beside[one].add(other)
                beside[other].add(one)
    return {body: frozenset(others) for body, others in beside.items()}


def soften_touching(station_diagram: StationDiagram) -> None:
    """Makes free objects that touch other objects of the scene compliant, in all Contexts that are
    created from now on."""
    scene = station_diagram.scene
    fixed = [station_diagram.fixed[name] for name in scene.background]
    beside = touching(station_diagram, {*station_diagram.free.values(), *fixed})
    soften(station_diagram, [n for n, index in station_diagram.free.items() if index in beside])


def soften(station_diagram: StationDiagram, names: Iterable[str]) -> None:
    """Makes free objects compliant, in all Contexts that are created from now on. Rigid meshes and
    balls stay as they are: those cannot be, and these meet everything at a point."""
    plant, scene = station_diagram.plant, station_diagram.scene
    for name in names:
        if not is_mesh(scene, name) and not is_ball(scene, name):
            body = plant.get_body(station_diagram.free[name])
            for geometry in list(plant.GetCollisionGeometriesForBody(body)):
                if geometry in station_diagram.parts.all:
                    continue
                _soften(station_diagram, geometry)


def _soften(station_diagram: StationDiagram, geometry: GeometryId) -> None:
    graph = station_diagram.diagram.mutable_scene_graph()
    inspector = graph.model_inspector()
    rigid = inspector.GetProximityProperties(geometry)
    half_width = inspector.GetObbInGeometryFrame(geometry).half_width()
    hint = rigid.GetPropertyOrDefault("hydroelastic", "resolution_hint", float(np.min(half_width)))
    properties = ProximityProperties()
    AddCompliantHydroelasticProperties(hint, MODULUS, properties)
    AddContactMaterial(
        dissipation=DISSIPATION,
        friction=rigid.GetProperty("material", "coulomb_friction"),
        properties=properties,
    )
    source = station_diagram.plant.get_source_id()
    graph.AssignRole(source, geometry, properties, RoleAssign.kReplace)
