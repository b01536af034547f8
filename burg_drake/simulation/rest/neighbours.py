"""Which free objects stand so close to each other that one may lean on another."""

from __future__ import annotations

from collections.abc import Iterable

from pydrake.multibody.tree import BodyIndex

from burg_drake.station.diagram import StationDiagram, touching


class Neighbours:
    """Neighbours in the default context, where objects stand as the scene places them.

    Args:
        station_diagram: a built diagram.
    """

    def __init__(self, station_diagram: StationDiagram) -> None:
        self._beside = touching(station_diagram, station_diagram.free.values())

    def close_to(self, bodies: Iterable[BodyIndex]) -> set[BodyIndex]:
        """The bodies, their neighbours, the neighbours of these, and so on."""
        found, fresh = set(), set(bodies)
        while fresh:
            found |= fresh
            fresh = {other for one in fresh for other in self._beside.get(one, ())} - found
        return found
