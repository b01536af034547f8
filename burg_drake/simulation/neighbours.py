"""Which free objects stand so close to each other that one may lean on another."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable

from pydrake.multibody.tree import BodyIndex

from burg_drake.station.diagram import StationDiagram

GAP = 0.001
"""Objects that are closer than this may lean on each other [m]; a scene's poses are rounded."""


class Neighbours:
    """Neighbours in the default context, where objects stand as the scene places them.

    Args:
        station_diagram: a built diagram.
    """

    def __init__(self, station_diagram: StationDiagram) -> None:
        plant, graph = station_diagram.plant, station_diagram.scene_graph
        context = station_diagram.diagram.CreateDefaultContext()
        query = graph.get_query_output_port().Eval(graph.GetMyContextFromRoot(context))
        free = set(station_diagram.free.values())
        body_of = {
            geometry: index
            for index in free
            for geometry in plant.GetCollisionGeometriesForBody(plant.get_body(index))
        }
        self._beside: dict[BodyIndex, set[BodyIndex]] = defaultdict(set)
        for pair in query.ComputeSignedDistancePairwiseClosestPoints(GAP):
            one, other = body_of.get(pair.id_A), body_of.get(pair.id_B)
            if one is not None and other is not None:
                self._beside[one].add(other)
                self._beside[other].add(one)

    def close_to(self, bodies: Iterable[BodyIndex]) -> set[BodyIndex]:
        """The bodies, their neighbours, the neighbours of these, and so on."""
        found, fresh = set(), set(bodies)
        while fresh:
            found |= fresh
            fresh = {other for one in fresh for other in self._beside.get(one, ())} - found
        return found
