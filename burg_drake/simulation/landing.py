"""Drops objects of a scene onto the others, with less friction, and keeps them on the board.

Friction is reduced meanwhile, so that objects come to lie flat and low. Objects that come to rest
at their friction limit would creep: Drake's regularized friction creeps fastest there.

An object beyond the edge gets the speed at which it slides back. Walls are no alternative: objects
would lean on them, and fall over without them.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Collection, Iterable, Mapping

import numpy as np
from pydrake.geometry import ProximityProperties, RoleAssign
from pydrake.multibody.math import SpatialVelocity
from pydrake.multibody.plant import CoulombFriction
from pydrake.multibody.tree import BodyIndex
from pydrake.systems.framework import Context

from burg_drake.core import Array, Pose, inverse, transform_points
from burg_drake.scene import ObjectShapes, Scene
from burg_drake.simulation.falling import fall
from burg_drake.simulation.rest_criterion import displacement_from_document
from burg_drake.station import Engine, Station, StationDiagram, build_station_diagram


def placed_scene(
    built: StationDiagram, X_WO: Mapping[str, Array], exact: Collection[str] = ()
) -> Scene:
    """The scene with new poses of its free objects.

    Args:
        built: a diagram of the original scene.
        X_WO: (4, 4) poses by name; objects without a pose are left out.
        exact: objects that get their new pose even if `has_moved` is False, as the forces between
            touching objects depend on tiny changes.
    """
    scene = built.scene
    X_SW = inverse(built.station.document.X_WS.matrix())
    instances = []
    for name, X in X_WO.items():
        instance = scene.instances[name]
        if name in exact or has_moved(built, name, X):
            instance = dataclasses.replace(instance, X_SO=Pose.readable(X_SW @ X))
        instances.append(instance)
    document = dataclasses.replace(scene.document, instances=tuple(instances))
    return Scene(document, scene.library, scene.path)


def has_moved(built: StationDiagram, name: str, X_WO: Array) -> bool:
    """Whether an object's pose differs from the document by more than a small tolerance."""
    pose_tolerance = (5e-5, float(np.deg2rad(0.02)))  # Metres and radians.
    moved = displacement_from_document(built, name, X_WO)
    return moved.distance > pose_tolerance[0] or moved.angle > pose_tolerance[1]


def reduce_friction(built: StationDiagram, share: float = 0.5) -> None:
    """Lowers all friction coefficients, in all Contexts that are created from now on.

    Args:
        built: a diagram.
        share: factor on the coefficients.
    """
    bodies = [built.table, *built.free.values(), *built.fixed.values()]
    reduce_friction_of(built, dict.fromkeys(bodies, share))


def reduce_friction_of(built: StationDiagram, shares: Mapping[BodyIndex, float]) -> None:
    """Lowers the friction coefficients of some bodies, in all Contexts that are created from now
    on.

    Args:
        built: a diagram.
        shares: factor on the coefficients, by body.
    """
    graph, source = built.diagram.mutable_scene_graph(), built.plant.get_source_id()
    inspector = graph.model_inspector()
    for index, share in shares.items():
        for geometry in built.plant.GetCollisionGeometriesForBody(built.plant.get_body(index)):
            properties = ProximityProperties(inspector.GetProximityProperties(geometry))
            friction = properties.GetProperty("material", "coulomb_friction")
            reduced = CoulombFriction(
                share * friction.static_friction(), share * friction.dynamic_friction()
            )
            properties.UpdateProperty("material", "coulomb_friction", reduced)
            graph.AssignRole(source, geometry, properties, RoleAssign.kReplace)


class BoardEdgeGuard:
    """Pushes bodies back that move beyond the edge of the board."""

    def __init__(
        self, built: StationDiagram, shapes: ObjectShapes, *, margin: float, share: float
    ) -> None:
        """
        Args:
            built: a diagram.
            shapes: shapes of the library's objects.
            margin: distance of objects from the edge [m].
            share: factor on the friction coefficients.
        """
        braking_friction = 0.3  # A little below the 0.32 of `household` on `panda_tabletop`.
        scene = built.scene
        self._plant = built.plant
        self._corners = {
            index: shapes[scene.instances[name].object].corners
            for name, index in built.free.items()
        }
        self._X_WS = built.station.document.X_WS.matrix()
        self._X_SW = inverse(self._X_WS)
        self._low, self._high = np.full(2, margin), np.array(scene.board.size) - margin
        self._braking = share * braking_friction * 9.81

    def push_back(self, context: Context, bodies: Iterable[BodyIndex]) -> None:
        """Gives bodies beyond the margin the speed at which they slide back.

        Args:
            context: the plant's Context; its velocities change.
            bodies: free bodies; locked ones are skipped.
        """
        for index in bodies:
            body = self._plant.get_body(index)
            X_WO = self._plant.EvalBodyPoseInWorld(context, body)
            p_S = transform_points(self._X_SW @ X_WO.GetAsMatrix4(), self._corners[index])[:, :2]
            inwards = np.maximum(0.0, self._low - p_S.min(axis=0))
            outwards = np.maximum(0.0, p_S.max(axis=0) - self._high)
            shift = np.append(inwards - outwards, 0.0)
            distance = np.linalg.norm(shift)
            if distance > 0.001 and not body.is_locked(context):
                direction = self._X_WS[:3, :3] @ shift / distance
                V_WO = self._plant.EvalBodySpatialVelocityInWorld(context, body)
                V_WOcm = V_WO.Shift(X_WO.rotation() @ body.default_com())
                return_speed = np.sqrt(2.0 * self._braking * distance)
                missing_speed = max(0.0, return_speed - direction @ V_WOcm.translational())
                added_velocity = SpatialVelocity(np.zeros(3), missing_speed * direction)
                self._plant.SetFreeBodySpatialVelocity(context, body, V_WO + added_velocity)


TUMBLING_ENGINE = Engine(name="tumbling", time_step=0.005, contact_model="point")
"""Engine for heaps in the air: point contact takes a third of the time of patches."""
LANDING_ENGINE = Engine(name="landing", time_step=0.01)
"""Engine for the end of a fall, and for few falling objects."""


def drop_onto_scene(
    scene: Scene,
    station: Station,
    falling: Collection[str],
    shapes: ObjectShapes,
    margin: float,
) -> Scene:
    """The scene after some objects have fallen, without those that fell off the table.

    Args:
        scene: the scene, with the falling objects above the board.
        station: table, pose of the board and obstacles.
        falling: names of the falling objects; all others stay in place.
        shapes: shapes of the library's objects.
        margin: distance by which falling objects are kept within the board's edge [m].

    Raises:
        RuntimeError, SystemExit: Drake failed.
    """
    if len(falling) == len(scene.instances):
        scene = _let_fall(scene, station, falling, shapes, margin, TUMBLING_ENGINE, 1.2)
    return _let_fall(scene, station, falling, shapes, margin, LANDING_ENGINE, 2.0)


def _let_fall(
    scene: Scene,
    station: Station,
    falling: Collection[str],
    shapes: ObjectShapes,
    margin: float,
    engine: Engine,
    time_limit: float,
) -> Scene:
    """The scene after one stage of the fall."""
    friction_share = 0.25  # Factor on friction while objects fall.
    built = build_station_diagram(scene, station, robot="none", engine=engine)
    reduce_friction(built, friction_share)
    held = [index for name, index in built.free.items() if name not in falling]
    guard = BoardEdgeGuard(built, shapes, margin=margin, share=friction_share)
    end = fall(built, time_limit, held=held, before_poll=guard.push_back)
    return placed_scene(built, end.X_WO)
