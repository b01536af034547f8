"""Less friction: what comes to rest with it holds with something in hand.

Objects that slide to rest, or are relaxed, end where friction just holds them. There Drake's
regularized friction creeps the fastest, by tenths of a millimetre a second, for minutes: the speed
of a contact that is loaded to the share s of Coulomb's limit is s / sqrt(1 - s^2) times the
tolerance.
"""

from __future__ import annotations

from collections.abc import Mapping

from pydrake.geometry import ProximityProperties, RoleAssign
from pydrake.multibody.plant import CoulombFriction
from pydrake.multibody.tree import BodyIndex

from burg_drake.station.diagram import StationDiagram

SHARE = 0.5
"""Of friction that is left."""


def reduce_friction(built: StationDiagram, share: float = SHARE) -> None:
    """Lowers all coefficients of friction, in all Contexts that are created from now on.

    Args:
        built: a diagram.
        share: of the coefficients that is left.
    """
    bodies = [built.table, *built.free.values(), *built.fixed.values()]
    reduce_friction_of(built, dict.fromkeys(bodies, share))


def reduce_friction_of(built: StationDiagram, shares: Mapping[BodyIndex, float]) -> None:
    """Lowers the coefficients of friction of some bodies, in all Contexts that are created from now
    on.

    Args:
        built: a diagram.
        shares: of a body's coefficients that are left.
    """
    graph, source = built.diagram.mutable_scene_graph(), built.plant.get_source_id()
    inspector = graph.model_inspector()
    for index, share in shares.items():
        for geometry in built.plant.GetCollisionGeometriesForBody(built.plant.get_body(index)):
            properties = ProximityProperties(inspector.GetProximityProperties(geometry))
            friction = properties.GetProperty("material", "coulomb_friction")
            slack = CoulombFriction(
                share * friction.static_friction(), share * friction.dynamic_friction()
            )
            properties.UpdateProperty("material", "coulomb_friction", slack)
            graph.AssignRole(source, geometry, properties, RoleAssign.kReplace)
