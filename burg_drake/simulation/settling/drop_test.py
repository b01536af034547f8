"""Drops one object on a table from just above it, again and again with the same diagram.

The world is fixed: table, density and friction of the object do not come from documents. The table
is as those of stations. A softer one lets what rests on edges and points sink in by a millimetre,
and tilts it by degrees.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from pydrake.geometry import ProximityProperties, RoleAssign
from pydrake.math import RigidTransform
from pydrake.multibody.plant import CoulombFriction
from pydrake.multibody.tree import RotationalInertia, SpatialInertia
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Context

from burg_drake.core import Array, make_pose, rot_z, rotation_from_rpy, transform_points
from burg_drake.objects.library import ObjectLibrary
from burg_drake.scene.document import Instance, Scene, SceneDocument
from burg_drake.simulation.rest import settle
from burg_drake.station.diagram import StationDiagram, build_station_diagram
from burg_drake.station.document import Engine, Station, StationDocument, Table, load_hand

TILT = np.deg2rad(2.0)
"""Tilt of an object when it is dropped [rad], as a careful hand sets it down. What came of 4
degrees was the same for every pose of 16 household objects and scans."""

CLEARANCE = 5e-4
"""Height of its lowest point over the table when it is dropped [m]."""

DENSITY = 500.0
"""Density of the object's material [kg/m^3]: between cardboard boxes and full cans."""

FRICTION = 0.5
"""Friction coefficient of object and table."""

TIME_STEP = 0.005
"""Of the plant [s]. At 2 ms every verdict on those 16 objects was the same."""

TIME_LIMIT = 1.5
"""Simulated time allowed to come to rest [s]; what rolls is looked at then."""

TABLE = Table(size=(4.0, 4.0, 0.1), friction=FRICTION)
"""Large enough for what rolls; thick as the default, on which its stiffness depends."""


@dataclass(frozen=True)
class Dropped:
    """How a drop ended.

    Attributes:
        down: (3,) unit vector of O that points down.
        at_rest: it came to rest within the time allowed.
        duration: simulated time [s].
    """

    down: Array
    at_rest: bool
    duration: float


class DropTest:
    """Drops of one object.

    Args:
        library: the library; its folder holds the object's SDF.
        name: the object.
        support: (N, 3) points of O whose hull rests on the table [m].
        tilt: of the object when it is dropped [rad].

    Raises:
        InvalidInputError: the SDF cannot be loaded.
        RuntimeError, SystemExit: from Drake.
    """

    def __init__(
        self, library: ObjectLibrary, name: str, support: Array, tilt: float = float(TILT)
    ) -> None:
        self.tilt, self.support = tilt, support
        self.built = _build(library, name)
        self._body = self.built.plant.get_body(self.built.free[name])
        self._default = self.built.diagram.CreateDefaultContext()
        properties = library.entry(name).mass_properties
        plant_context = self.built.plant.GetMyMutableContextFromRoot(self._default)
        moments = np.array(properties.inertia) / properties.mass
        mass = DENSITY * properties.volume
        self._body.SetSpatialInertiaInBodyFrame(
            plant_context,
            SpatialInertia.MakeFromCentralInertia(
                mass,
                np.array(properties.center_of_mass),
                RotationalInertia(*(mass * moments)),
            ),
        )
        self._set_friction()
        self._simulator = Simulator(self.built.diagram, self._default.Clone())

    def run(self, X_SO: Array, side: float) -> Dropped:
        """Drops the object.

        Args:
            X_SO: (4, 4) resting pose.
            side: azimuth in S towards which it is tilted from there [rad].

        Raises:
            RuntimeError, SystemExit: from Drake, or the object flew away.
        """
        plant, context = self.built.plant, self._simulator.get_mutable_context()
        context.SetTimeStateAndParametersFrom(self._default)
        X_WO = self._start(X_SO, side)
        plant_context = plant.GetMyMutableContextFromRoot(context)
        plant.SetFloatingBaseBodyPoseInWorldFrame(plant_context, self._body, RigidTransform(X_WO))
        self._raise(plant_context)
        self._simulator.Initialize()
        return self.resume()

    def resume(self) -> Dropped:
        """Goes on until it is at rest, for as long as is allowed once more.

        Raises:
            RuntimeError, SystemExit: from Drake, or the object flew away.
        """
        plant = self.built.plant
        settled = settle(self._simulator, plant, [self._body.index()], TIME_LIMIT)
        plant_context = plant.GetMyContextFromRoot(self._simulator.get_context())
        end = plant.EvalBodyPoseInWorld(plant_context, self._body).GetAsMatrix4()
        center = transform_points(end, self.support.mean(axis=0, keepdims=True))[0]
        if not np.isfinite(end).all() or center[2] < 0.0:
            raise RuntimeError("the dropped object left the table")
        return Dropped(-end[2, :3], settled.at_rest, settled.duration)

    def _start(self, X_SO: Array, side: float) -> Array:
        """`X_WO` (4, 4) from which the object is dropped; S is in the world's origin."""
        R = rot_z(side) @ rotation_from_rpy([0.0, self.tilt, 0.0]) @ rot_z(-side)
        X_WO = make_pose(R) @ X_SO
        X_WO[2, 3] += CLEARANCE - transform_points(X_WO, self.support)[:, 2].min()
        return X_WO

    def _raise(self, plant_context: Context) -> None:
        """Lifts the object where its contact geometry is in the table: it may exceed the support
        points by the error of its fit."""
        graph = self.built.scene_graph
        query = graph.get_query_output_port().Eval(
            graph.GetMyContextFromRoot(self._simulator.get_context())
        )
        depth = max((pair.depth for pair in query.ComputePointPairPenetration()), default=0.0)
        if depth > 0.0:
            X_WO = self.built.plant.EvalBodyPoseInWorld(plant_context, self._body)
            x, y, z = X_WO.translation()
            X_WO.set_translation([x, y, z + depth + CLEARANCE])
            self.built.plant.SetFloatingBaseBodyPoseInWorldFrame(plant_context, self._body, X_WO)

    def _set_friction(self) -> None:
        graph, plant = self.built.scene_graph, self.built.plant
        graph_context = graph.GetMyMutableContextFromRoot(self._default)
        inspector = graph.model_inspector()
        for geometry in plant.GetCollisionGeometriesForBody(self._body):
            properties = ProximityProperties(inspector.GetProximityProperties(geometry))
            properties.UpdateProperty(
                "material", "coulomb_friction", CoulombFriction(FRICTION, FRICTION)
            )
            graph.AssignRole(
                graph_context, plant.get_source_id(), geometry, properties, RoleAssign.kReplace
            )


def _build(library: ObjectLibrary, name: str) -> StationDiagram:
    hand = load_hand("panda_hand")  # a station has one; here it stays out
    document = StationDocument(name="drop", table=TABLE)
    station = Station(document, hand, Path(hand.model), None, Path("drop"))
    scene = Scene(
        SceneDocument(name="drop", library="", instances=(Instance(object=name),)),
        library,
        Path("drop"),
    )
    engine = Engine(name="drop", time_step=TIME_STEP)
    return build_station_diagram(scene, station, robot="none", engine=engine)
