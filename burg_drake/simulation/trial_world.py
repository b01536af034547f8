"""A scene on a station in Drake in which trials run: how a trial changes and reads its Context.

A trial changes only the Context, and its result does not depend on the trials before it.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from pydrake.geometry import (
    CollisionFilterDeclaration,
    GeometryId,
    GeometrySet,
    ProximityProperties,
)
from pydrake.multibody.math import SpatialForce
from pydrake.multibody.plant import ContactResults, ExternallyAppliedSpatialForce
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
from burg_drake.simulation.object_motions import MovingBody
from burg_drake.simulation.settings import TrialSettings
from burg_drake.simulation.trial_execution import OtherTouched
from burg_drake.station import (
    HandHandle,
    StationDiagram,
    assign_contact,
    collision_geometries,
    filter_contact_pairs,
    make_compliant,
)


class TrialWorld:
    """A scene on a station with a robot, and a simulator that executes grasps in it.

    In a single-target world the other objects are welded (see `build_station_diagram`). Its results
    are valid as long as neither target nor robot touches one of them.

    Args:
        diagram: the station diagram.
        hand: the hand in it.
        settings: phases of a trial.

    Attributes:
        diagram, hand, settings: as given.
        engine: time step and contact settings.
        free: bodies that can move, by name.
        standing: bodies that can move only in the complete world, by name.
        robot: bodies of the robot.
        fingers: bodies of the two fingers.
        hand_document: the hand's document.
        fixed, table, body_names, robot_bodies: as in the diagram.
        plant_context: the plant's part of `context`.
        contacts: reader of the diagram's contact results.
        neighbours: groups of free objects that are close to each other.
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
        self._own_contact = self._make_others_compliant()
        self._default = diagram.diagram.CreateDefaultContext()
        self.simulator = Simulator(diagram.diagram, self._default.Clone())
        self.plant_context = diagram.plant.GetMyMutableContextFromRoot(self.context)
        self._results_port = diagram.plant.get_contact_results_output_port()
        self.robot = frozenset(diagram.robot_bodies)
        self._corners: dict[BodyIndex, Array] = {}
        self._prepared: tuple[str, float | None, float | None] | None = None
        """Target, friction and mass that the Context is prepared for; None if unprepared."""

    def _make_others_compliant(self) -> dict[str, dict[GeometryId, ProximityProperties]]:
        """Makes objects compliant for each other; returns their own contact properties, which a
        target keeps for the pads.

        Two rigid objects touch at a single point, which jumps along an edge: an object that falls
        on another turns it and moves it too far.
        """
        # s/m, Hunt-Crossley. With 5, `reference` moves a cube by 16 mm in one of 11 drops in which
        # a rigid model moves it by none (`benchmarks/neighbours.py`); with 2 by 1 mm.
        dissipation = 2.0
        meet = len(self.free) > 1 and self.engine.contact_model != "point"
        names = self.free if meet else ()
        return make_compliant(self.diagram, names, if_rigid=True, dissipation=dissipation)

    @property
    def context(self) -> Context:
        """Context of the current or last trial."""
        return self.simulator.get_mutable_context()

    @property
    def time(self) -> float:
        """Time since the start of the trial [s]."""
        return float(self.context.get_time())

    @property
    def gravity(self) -> Array:
        """(3,) gravity in the world [m/s^2]."""
        return np.asarray(self.diagram.plant.gravity_field().gravity_vector())

    def robot_positions(self, model: str) -> Array | None:
        """Positions of one of `ROBOT_MODELS`; None if missing."""
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
        """Grasp frame (4, 4) in the world."""
        return self.hand.X_WG(self.plant_context)

    def X_WB(self, body: BodyIndex) -> Array:
        """Pose (4, 4) of a body in the world."""
        plant = self.diagram.plant
        X_WB = plant.EvalBodyPoseInWorld(self.plant_context, plant.get_body(body))
        return np.asarray(X_WB.GetAsMatrix4())

    def center(self, body: BodyIndex) -> Array:
        """Centre of mass (3,) of a body in the world [m]."""
        found = self.diagram.plant.get_body(body)
        X_WB = self.diagram.plant.EvalBodyPoseInWorld(self.plant_context, found)
        return np.asarray(X_WB.multiply(found.default_com()))

    def moving_body(self, body: BodyIndex) -> MovingBody:
        """State of a free body."""
        context, found = self.plant_context, self.diagram.plant.get_body(body)
        X_WB = self.diagram.plant.EvalBodyPoseInWorld(context, found)
        M_B, R_WB = found.CalcSpatialInertiaInBodyFrame(context), X_WB.rotation().matrix()
        p_BCm = M_B.get_com()
        velocity = found.EvalSpatialVelocityInWorld(context).Shift(R_WB @ p_BCm)
        inertia = M_B.Shift(p_BCm).CalcRotationalInertia().CopyToFullMatrix3()
        return MovingBody(
            M_B.get_mass(),
            R_WB @ inertia @ R_WB.T,
            np.asarray(X_WB.multiply(p_BCm)),
            np.asarray(velocity.translational()),
            np.asarray(velocity.rotational()),
        )

    def shift(self, body: BodyIndex, distance_W: Array) -> None:
        """Shifts a free body by a distance (3,) [m]."""
        plant, context = self.diagram.plant, self.plant_context
        found, positions = plant.get_body(body), plant.GetPositions(context)
        at = found.floating_positions_start() + 4  # After the quaternion.
        positions[at : at + 3] += distance_W
        plant.SetPositions(context, positions)

    def push(self, body: BodyIndex, force_W: Array, torque_W: Array) -> None:
        """Applies a force (3,) at the centre of mass of a body [N] and a torque (3,) [N m], and
        none to others, until the next call."""
        force = ExternallyAppliedSpatialForce()
        force.body_index = body
        force.p_BoBq_B = self.diagram.plant.get_body(body).default_com()
        force.F_Bq_W = SpatialForce(torque_W, force_W)
        self.diagram.diagram.GetInputPort("applied_forces").FixValue(self.context, [force])

    def advance(self, steps: int) -> None:
        """Advances the simulation by time steps, with the rounding of Drake's own steps."""
        step = self.engine.time_step
        self.simulator.AdvanceTo((round(self.time / step) + steps) * step)

    def read_contacts(self) -> list[BodyContact]:
        """Current contacts.

        Raises:
            OtherTouched: the trial has to run in the complete world.
        """
        results = self._results_port.Eval(self.plant_context)
        if self.meets_another(results):
            raise OtherTouched
        return self.contacts.read(results)

    def state(self) -> DiscreteValues:
        """The state that `restore_state` restores."""
        return self.context.get_discrete_state().Clone()

    def restore_state(self, time: float, state: DiscreteValues) -> None:
        """Restores a state and its time [s]."""
        self.context.SetTime(time)
        self.context.SetDiscreteState(state)

    def with_neighbours(self, bodies: Iterable[BodyIndex]) -> set[BodyIndex]:
        """The bodies, and all bodies so close that they may lean on each other."""
        return self.neighbours.with_neighbours(bodies)

    def corners(self, index: BodyIndex) -> Array:
        """(N, 3) corners of the convex hull of a free object in its frame O [m]; read once."""
        if index not in self._corners:
            name = next(name for name, free in self.diagram.free.items() if free == index)
            scene = self.diagram.scene
            self._corners[index] = hull_corners(scene.library, scene.entry(name))
        return self._corners[index]

    def is_usable(self) -> bool:
        """Whether trials can begin in this world: in a single-target world, if the target can lean
        on nothing but the table."""
        if not self._hulls:
            return True
        graph = self.diagram.scene_graph
        query = graph.get_query_output_port().Eval(graph.GetMyContextFromRoot(self._default))
        # A target closer than 1 mm to another body may lean on it.
        pairs = query.ComputeSignedDistancePairwiseClosestPoints(0.001)
        return not any(pair.id_A in self._hulls or pair.id_B in self._hulls for pair in pairs)

    def meets_another(self, results: ContactResults) -> bool:
        """Whether, in a single-target world, target or robot touch another movable object, or the
        target touches a fixed one, so that the trial has to run in the complete world."""
        return bool(self._hulls) and self.contacts.has_any(results, self._hulls)

    @property
    def robot_meets_hull(self) -> bool:
        """Whether, in a single-target world, parts of the robot that are not hydroelastic meet the
        target's hull instead of its surface."""
        inspector = self.diagram.scene_graph.model_inspector()
        robot = self._geometries(set(self.robot))
        hulls = self.diagram.parts.hulls
        return any(not inspector.CollisionFiltered(h, part) for h in hulls for part in robot)

    def prepare(
        self, instance: str, moving: set[BodyIndex], friction: float | None, mass: float | None
    ) -> None:
        """Resets objects and surfaces to the start of a trial.

        Args:
            instance: the target.
            moving: free objects that are not locked; the same for each trial of this target.
            friction: the target's coefficient, if not the library's.
            mass: the target's mass, if not the library's [kg].
        """
        context = self.context
        if self._prepared != (instance, friction, mass):
            context.SetTimeStateAndParametersFrom(self._default)
            assign_contact(self.diagram, context, self._own_contact.get(instance, {}))
            self._set_still(set(self.diagram.free.values()) - moving)
            self.set_friction(instance, friction)
            self._set_mass(self.diagram.free[instance], mass)
            self._prepared = (instance, friction, mass)
        else:
            context.SetTime(0.0)
            context.SetDiscreteState(self._default.get_discrete_state())

    def invalidate(self) -> None:
        """Makes the next trial prepare the Context from scratch."""
        self._prepared = None

    def release(self, released: set[BodyIndex], still: set[BodyIndex]) -> None:
        """Unlocks objects in the middle of a trial.

        Args:
            released: objects to unlock.
            still: objects that stay locked.
        """
        self._prepared = None
        for index in released:
            self.diagram.plant.get_body(index).Unlock(self.plant_context)
        resting = GeometrySet(self._geometries(self._immovable_bodies(still)))
        declaration = CollisionFilterDeclaration()
        declaration.AllowWithin(GeometrySet(self._geometries(released)))
        declaration.AllowBetween(GeometrySet(self._geometries(released)), resting)
        self._filter(declaration)
        filter_contact_pairs(self.diagram, self.context)
        self.simulator.Initialize()

    def isolate(self, target: BodyIndex) -> None:
        """Isolates hand and target in the middle of a trial: locks all other objects, and excludes
        contact with them and with fixed bodies."""
        self._prepared = None
        others = set(self.diagram.free.values()) - {target}
        self._set_still(others)
        carried = GeometrySet(self._geometries({target, *self.diagram.robot_bodies}))
        resting = GeometrySet(self._geometries(self._immovable_bodies(others)))
        self._filter(CollisionFilterDeclaration().ExcludeBetween(carried, resting))
        self.simulator.Initialize()

    def set_friction(self, instance: str, friction: float | None) -> None:
        """Sets the friction coefficient of the whole fingers, and of the target if `friction` is
        given. Without it, the fingers get the target's coefficient in the library.

        Drake combines two coefficients a and b to 2ab/(a+b), so two equal ones stay as they are.
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
        """Locks free objects in place, and excludes their contacts with immovable bodies."""
        for index in still:
            self.diagram.plant.get_body(index).Lock(self.plant_context)
        geometries = GeometrySet(self._geometries(self._immovable_bodies(still)))
        self._filter(CollisionFilterDeclaration().ExcludeWithin(geometries))

    def _filter(self, declaration: CollisionFilterDeclaration) -> None:
        graph = self.diagram.scene_graph
        graph_context = graph.GetMyMutableContextFromRoot(self.context)
        graph.collision_filter_manager(graph_context).Apply(declaration)

    def _immovable_bodies(self, still: set[BodyIndex]) -> set[BodyIndex]:
        """All bodies that cannot move while these objects are locked."""
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
    """Rejects an invalid friction coefficient or mass.

    Raises:
        InvalidInputError: friction is below 0, or the mass is not above 0.
    """
    if friction is not None and not 0.0 <= friction < np.inf:
        raise InvalidInputError(f"friction is {friction}; give a coefficient of 0 or more")
    if mass is not None and not 0.0 < mass < np.inf:
        raise InvalidInputError(f"mass is {mass} kg; give more than 0")
