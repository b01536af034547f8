"""A scene on a station in Drake in which trials run: how a trial changes and reads its Context.

A trial changes only the Context, and its result does not depend on the trials before it.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from pydrake.geometry import CollisionFilterDeclaration, GeometryId, GeometrySet
from pydrake.multibody.plant import ContactResults
from pydrake.multibody.tree import BodyIndex, SpatialInertia
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Context, DiscreteValues

from burg_drake.core import Array, InvalidInputError
from burg_drake.objects import hull_corners
from burg_drake.simulation.contacts import (
    BodyContact,
    ContactReader,
    Neighbours,
    assign_friction,
)
from burg_drake.simulation.settings import TrialSettings
from burg_drake.simulation.trial_execution import OtherTouched
from burg_drake.station import (
    HandHandle,
    StationDiagram,
    collision_geometries,
    filter_contact_pairs,
)


class TrialWorld:
    """A scene on a station with a robot, and a simulator that executes grasps in it.

    In a world of one target alone the others only stand there (see `build_station_diagram`): what
    happens in it is what happens, as long as neither target nor robot meets one of them.

    Args:
        diagram: the station diagram.
        hand: the hand in it.
        settings: phases of a trial.

    Attributes:
        diagram, hand, settings: as given.
        engine: how it is stepped.
        free, standing: bodies by name: what can move, and what could in the complete world.
        robot: bodies of the robot.
        fingers: of these the fingers.
        hand_document: the hand.
        fixed, table, body_names, robot_bodies: those of the diagram.
        plant_context: the plant's part of `context`.
        contacts: reader of the diagram's contact results.
        neighbours: which free objects stand close to each other.
        simulator: the simulator that runs the trials.
    """

    def __init__(self, diagram: StationDiagram, hand: HandHandle, settings: TrialSettings) -> None:
        self.diagram, self.hand, self.settings = diagram, hand, settings
        self.engine, self.free, self.standing = diagram.engine, diagram.free, diagram.standing
        self.table, self.fixed, self.body_names = diagram.table, diagram.fixed, diagram.body_names
        self.fingers, self.hand_document = hand.fingers, hand.document
        self.robot_bodies = diagram.robot_bodies
        self.contacts = ContactReader(diagram.plant, diagram.scene_graph)
        self.neighbours = Neighbours(diagram)
        standing = self._geometries(set(diagram.standing.values()))
        self._hulls = frozenset([*diagram.parts.hulls, *standing])
        self._default = diagram.diagram.CreateDefaultContext()
        self.simulator = Simulator(diagram.diagram, self._default.Clone())
        self.plant_context = diagram.plant.GetMyMutableContextFromRoot(self.context)
        self._results_port = diagram.plant.get_contact_results_output_port()
        self.robot = frozenset(diagram.robot_bodies)
        self._corners: dict[BodyIndex, Array] = {}
        self._prepared: tuple[str, float | None, float | None] | None = None
        """Target, friction and mass that the Context is prepared for; None if for nothing."""

    @property
    def context(self) -> Context:
        """Context of the trial that runs or ran last."""
        return self.simulator.get_mutable_context()

    @property
    def time(self) -> float:
        """Since the start of the trial [s]."""
        return float(self.context.get_time())

    def robot_positions(self, model: str) -> Array | None:
        """Of one of `ROBOT_MODELS`; None if there is none."""
        plant = self.diagram.plant
        if not plant.HasModelInstanceNamed(model):
            return None
        return np.asarray(
            plant.GetPositions(self.plant_context, plant.GetModelInstanceByName(model))
        )

    def finger_speed(self) -> float:
        """Speed of the faster finger [m/s]."""
        return self.hand.finger_speed(self.plant_context)

    def X_WG(self) -> Array:
        """(4, 4) grasp frame."""
        return self.hand.X_WG(self.plant_context)

    def X_WB(self, body: BodyIndex) -> Array:
        """(4, 4) of a body."""
        plant = self.diagram.plant
        X_WB = plant.EvalBodyPoseInWorld(self.plant_context, plant.get_body(body))
        return np.asarray(X_WB.GetAsMatrix4())

    def center(self, body: BodyIndex) -> Array:
        """Centre of mass (3,) of a body in the world [m]."""
        found = self.diagram.plant.get_body(body)
        X_WB = self.diagram.plant.EvalBodyPoseInWorld(self.plant_context, found)
        return np.asarray(X_WB.multiply(found.default_com()))

    def look(self) -> list[BodyContact]:
        """All that touch.

        Raises:
            OtherTouched: what happens now is for the complete world to say.
        """
        results = self._results_port.Eval(self.plant_context)
        if self.meets_another(results):
            raise OtherTouched
        return self.contacts.read(results)

    def state(self) -> DiscreteValues:
        """What `go_back` goes back to."""
        return self.context.get_discrete_state().Clone()

    def go_back(self, time: float, state: DiscreteValues) -> None:
        """Is again as at a time [s]."""
        self.context.SetTime(time)
        self.context.SetDiscreteState(state)

    def close_to(self, bodies: Iterable[BodyIndex]) -> set[BodyIndex]:
        """The bodies, and all that stand so close to one of them that they may lean on it."""
        return self.neighbours.close_to(bodies)

    def corners(self, index: BodyIndex) -> Array:
        """(N, 3) corners of the convex hull of a free object in its frame O [m]; read once."""
        if index not in self._corners:
            name = next(name for name, free in self.diagram.free.items() if free == index)
            scene = self.diagram.scene
            self._corners[index] = hull_corners(scene.library, scene.entry(name))
        return self._corners[index]

    def is_usable(self) -> bool:
        """Whether trials can begin in it. In a world of a target alone that is so if there is
        nothing but the table that the target may lean on where it stands."""
        if not self._hulls:
            return True
        graph = self.diagram.scene_graph
        query = graph.get_query_output_port().Eval(graph.GetMyContextFromRoot(self._default))
        # A target closer than 1 mm to another body may lean on it.
        pairs = query.ComputeSignedDistancePairwiseClosestPoints(0.001)
        return not any(pair.id_A in self._hulls or pair.id_B in self._hulls for pair in pairs)

    def meets_another(self, results: ContactResults) -> bool:
        """Whether, in a world of a target alone, it or the robot meets what else could move, or it
        meets something fixed: what happens then is for the complete world to say."""
        return bool(self._hulls) and self.contacts.has_any(results, self._hulls)

    @property
    def robot_meets_hull(self) -> bool:
        """Whether, in a world of a target alone, parts of the robot meet the target's hull and not
        the target as it is: those that are not hydroelastic."""
        inspector = self.diagram.scene_graph.model_inspector()
        robot = self._geometries(set(self.robot))
        hulls = self.diagram.parts.hulls
        return any(not inspector.CollisionFiltered(h, part) for h in hulls for part in robot)

    def prepare(
        self, instance: str, moving: set[BodyIndex], friction: float | None, mass: float | None
    ) -> None:
        """Brings objects and surfaces to the start of a trial; nothing of an earlier one remains.

        Args:
            instance: the target.
            moving: free objects that are not locked; the same for each trial of this target.
            friction: of the target, if not the library's.
            mass: of the target, if not the library's [kg].
        """
        context = self.context
        if self._prepared != (instance, friction, mass):
            context.SetTimeStateAndParametersFrom(self._default)
            self._set_still(set(self.diagram.free.values()) - moving)
            self.set_friction(instance, friction)
            self._set_mass(self.diagram.free[instance], mass)
            self._prepared = (instance, friction, mass)
        else:
            context.SetTime(0.0)
            context.SetDiscreteState(self._default.get_discrete_state())

    def invalidate(self) -> None:
        """Has the next trial prepare the Context from scratch."""
        self._prepared = None

    def release(self, released: set[BodyIndex], still: set[BodyIndex]) -> None:
        """Unlocks objects in the middle of a trial.

        Args:
            released: to be unlocked.
            still: those that stay locked.
        """
        self._prepared = None
        for index in released:
            self.diagram.plant.get_body(index).Unlock(self.plant_context)
        resting = GeometrySet(self._geometries(self._resting(still)))
        declaration = CollisionFilterDeclaration()
        declaration.AllowWithin(GeometrySet(self._geometries(released)))
        declaration.AllowBetween(GeometrySet(self._geometries(released)), resting)
        self._filter(declaration)
        filter_contact_pairs(self.diagram, self.context)
        self.simulator.Initialize()

    def isolate(self, target: BodyIndex) -> None:
        """Leaves hand and target alone with each other, in the middle of a trial: all other objects
        are locked, and neither they nor what is fixed can be touched."""
        self._prepared = None
        others = set(self.diagram.free.values()) - {target}
        self._set_still(others)
        carried = GeometrySet(self._geometries({target, *self.diagram.robot_bodies}))
        resting = GeometrySet(self._geometries(self._resting(others)))
        self._filter(CollisionFilterDeclaration().ExcludeBetween(carried, resting))
        self.simulator.Initialize()

    def set_friction(self, instance: str, friction: float | None) -> None:
        """Gives the fingers, and the target if `friction` is given, one coefficient.

        Drake combines two coefficients a and b to 2ab/(a+b); of two equal ones that is the same.
        """
        self._prepared = None
        bodies = list(self.hand.fingers)
        if friction is None:
            friction = self.diagram.scene.entry(instance).friction
        else:
            bodies.append(self.diagram.free[instance])
        assign_friction(self.diagram, self.context, bodies, friction)

    def command(self, model: str, desired_state: Array) -> None:
        """Sets the servo command of `hand` (4,), `lift` (2,) or an `arm` with n joints (2 n,)."""
        port = self.diagram.diagram.GetInputPort(f"{model}.desired_state")
        port.FixValue(self.context, desired_state)

    def _set_still(self, still: set[BodyIndex]) -> None:
        """Locks free objects in place, and drops their contact with what never moves."""
        for index in still:
            self.diagram.plant.get_body(index).Lock(self.plant_context)
        geometries = GeometrySet(self._geometries(self._resting(still)))
        self._filter(CollisionFilterDeclaration().ExcludeWithin(geometries))

    def _filter(self, declaration: CollisionFilterDeclaration) -> None:
        graph = self.diagram.scene_graph
        graph_context = graph.GetMyMutableContextFromRoot(self.context)
        graph.collision_filter_manager(graph_context).Apply(declaration)

    def _resting(self, still: set[BodyIndex]) -> set[BodyIndex]:
        """What does not move while these objects are locked."""
        diagram = self.diagram
        return still | {diagram.table, *diagram.fixed.values(), *diagram.standing.values()}

    def _geometries(self, bodies: set[BodyIndex]) -> list[GeometryId]:
        return collision_geometries(self.diagram.plant, bodies)

    def _set_mass(self, target: BodyIndex, mass: float | None) -> None:
        if mass is None:
            return
        body = self.diagram.plant.get_body(target)
        unit = body.default_spatial_inertia().get_unit_inertia()
        inertia = SpatialInertia(mass, body.default_com(), unit)
        body.SetSpatialInertiaInBodyFrame(self.plant_context, inertia)


def check_overrides(friction: float | None, mass: float | None) -> None:
    """Refuses what is no friction coefficient or mass.

    Raises:
        InvalidInputError: friction is below 0, or the mass is not above 0.
    """
    if friction is not None and not 0.0 <= friction < np.inf:
        raise InvalidInputError(f"friction is {friction}; give a coefficient of 0 or more")
    if mass is not None and not 0.0 < mass < np.inf:
        raise InvalidInputError(f"mass is {mass} kg; give more than 0")
