"""The floating-hand trial: the open hand stands at the grasp, closes, lifts and holds.

After Rudorfer et al., "BURG-Toolkit" (2022): a grasp that collides is rejected before any step; the
fingers close with a limited force until the grip settles; the hand rises by 0.30 m along world z
and holds; success means that both fingers still hold the target.

One compiled diagram serves all trials of a scene; a trial changes only the Context, and what it
returns does not depend on the trials before it.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from pydrake.geometry import (
    CollisionFilterDeclaration,
    GeometryId,
    GeometrySet,
    Meshcat,
    ProximityProperties,
    RoleAssign,
)
from pydrake.multibody.plant import CoulombFriction
from pydrake.multibody.tree import BodyIndex, SpatialInertia
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Context

from burg_drake.core.errors import InvalidInputError
from burg_drake.core.frames import Array, check_pose
from burg_drake.core.outcome import Outcome
from burg_drake.grasping.clearance import HandClearance
from burg_drake.scene.scene import Scene
from burg_drake.simulation.contacts import ContactReader
from burg_drake.simulation.execution import Execution
from burg_drake.simulation.neighbours import Neighbours
from burg_drake.simulation.result import Margins, TrialResult
from burg_drake.simulation.rise import Rise
from burg_drake.simulation.trial_settings import DEFAULT_TRIAL, TrialSettings
from burg_drake.station.diagram import build_station_diagram
from burg_drake.station.engine import ENGINES, Engine
from burg_drake.station.floating_hand import FloatingHand
from burg_drake.station.station import Station


class HandTrial:
    """Executes grasps of one scene with the hand alone.

    Args:
        scene: the scene.
        station: table, board pose and hand.
        engine: time step and contact settings.
        settings: phases of a trial.
        lock: keep objects locked until something moving touches them. Without it all free objects
            are simulated from the start, which costs more and gives the same verdicts.
        meshcat: where to show the trials; recording is the caller's.

    Attributes:
        diagram: the station diagram that all trials share.
        clearance: the screen of the open hand in it.
        hand: the floating hand in it.
        contacts: reader of its contact results.
        neighbours: which free objects stand close to each other.
        simulator: the simulator that runs the trials.
        settings: phases of a trial.
        X_WG_start: (4, 4) grasp of the trial that runs or ran last, before the lift.
    """

    def __init__(
        self,
        scene: Scene,
        station: Station,
        *,
        engine: Engine = ENGINES["standard"],
        settings: TrialSettings = DEFAULT_TRIAL,
        lock: bool = True,
        meshcat: Meshcat | None = None,
    ) -> None:
        self.settings = settings
        self.diagram = build_station_diagram(
            scene, station, robot="hand", engine=engine, meshcat=meshcat
        )
        self.clearance = HandClearance(self.diagram)
        self.hand = FloatingHand(self.diagram)
        self.contacts = ContactReader(self.diagram.plant, self.diagram.scene_graph)
        self.X_WG_start = np.eye(4)
        self._lock = lock
        self._default = self.diagram.diagram.CreateDefaultContext()
        self.simulator = Simulator(self.diagram.diagram, self._default.Clone())
        self.neighbours = Neighbours(self.diagram)
        self._rises: dict[BodyIndex, Rise] = {}
        self._prepared: tuple[str, float | None, float | None] | None = None
        """Target, friction and mass that the Context is prepared for; None if for nothing."""

    @property
    def context(self) -> Context:
        """Context of the trial that runs or ran last."""
        return self.simulator.get_mutable_context()

    def run(
        self,
        instance: str,
        X_OG: Array,
        *,
        friction: float | None = None,
        mass: float | None = None,
    ) -> TrialResult:
        """Executes one grasp.

        Args:
            instance: name of the target in the scene.
            X_OG: (4, 4) grasp in the target's frame.
            friction: the target's friction coefficient, in place of the library's.
            mass: the target's mass [kg], in place of the library's; its inertia scales with it.

        Returns:
            The outcome with its margins. A failure of the simulator is an outcome, too.

        Raises:
            InvalidInputError: `X_OG` is not a pose, `instance` cannot be grasped, friction is below
                0, or the mass is not above 0.
        """
        X_WG = self.X_WG(instance, X_OG)
        _check_overrides(friction, mass)
        screen = self.clearance.check(instance, X_WG)
        if screen.outcome is not None:
            margins = Margins(overlap=screen.overlap, clearance=screen.clearance, end_time=0.0)
            return TrialResult(outcome=screen.outcome, margins=margins, blocker=screen.blocker)
        try:
            found = self.begin(instance, X_WG, friction=friction, mass=mass).run()
            return replace(found, margins=replace(found.margins, clearance=screen.clearance))
        except (RuntimeError, SystemExit) as error:  # Drake ends some failed checks by SystemExit
            self._prepared = None
            end_time = self.context.get_time()
            return TrialResult(
                outcome=Outcome.SIMULATION_FAILED,
                margins=Margins(overlap=0.0, clearance=screen.clearance, end_time=end_time),
                reason=" ".join(str(error).split()),
            )

    def X_WG(self, instance: str, X_OG: Array) -> Array:
        """A grasp (4, 4) of an instance in the world.

        Raises:
            InvalidInputError: `X_OG` is not a pose, or `instance` cannot be grasped.
        """
        if instance not in self.diagram.free:
            raise InvalidInputError(
                f"{instance!r} is not a free object of scene {self.diagram.scene.name!r};"
                f" free are: {', '.join(self.diagram.free) or '(none)'}"
            )
        return self.diagram.X_WO(instance) @ check_pose(X_OG, "X_OG")

    def begin(
        self,
        instance: str,
        X_WG: Array,
        *,
        friction: float | None = None,
        mass: float | None = None,
    ) -> Execution:
        """Brings the Context to the start of a trial; nothing of an earlier one remains.

        The fingers start where they would touch something first: until then nothing happens. Only
        the target, and what stands so close that it may lean on it, is free to move; others are
        released when something moving touches them. What nothing touches stays at rest, so that
        the result is the one with all objects free, at the cost of those that matter.

        Args:
            instance: the target.
            X_WG: (4, 4) grasp in the world at which the open hand is clear.
            friction, mass: as in `run`.
        """
        target = self.diagram.free[instance]
        everything = set(self.diagram.free.values())
        moving = self.neighbours.close_to({target}) if self._lock else everything
        context = self.context
        if self._prepared != (instance, friction, mass):
            context.SetTimeStateAndParametersFrom(self._default)
            self._set_still(everything - moving)
            self.set_friction(instance, friction)
            self._set_mass(target, mass)
            self._prepared = (instance, friction, mass)
        else:
            context.SetTime(0.0)
            context.SetDiscreteState(self._default.get_discrete_state())
        self.X_WG_start = X_WG
        plant_context = self.diagram.plant.GetMyMutableContextFromRoot(context)
        self.hand.place(plant_context, X_WG, self.clearance.free_travel(X_WG))
        self.command("lift", np.zeros(2))
        self.command("hand", self.hand.closing_command())
        self.simulator.Initialize()
        return Execution(self, target, moving)

    def release(self, released: set[BodyIndex], still: set[BodyIndex]) -> None:
        """Unlocks objects in the middle of a trial.

        Args:
            released: to be unlocked.
            still: those that stay locked.
        """
        self._prepared = None
        plant_context = self.diagram.plant.GetMyMutableContextFromRoot(self.context)
        for index in released:
            self.diagram.plant.get_body(index).Unlock(plant_context)
        resting = GeometrySet(self._geometries(self._resting(still)))
        declaration = CollisionFilterDeclaration()
        declaration.AllowWithin(GeometrySet(self._geometries(released)))
        declaration.AllowBetween(GeometrySet(self._geometries(released)), resting)
        self._filter(declaration)
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

    def rise(self, target: BodyIndex) -> Rise:
        """Looks along the way up with a target in the hand."""
        if target not in self._rises:
            self._rises[target] = Rise(self.diagram, target)
        return self._rises[target]

    def _set_still(self, still: set[BodyIndex]) -> None:
        """Locks free objects in place, and drops their contact with what never moves."""
        plant_context = self.diagram.plant.GetMyMutableContextFromRoot(self.context)
        for index in still:
            self.diagram.plant.get_body(index).Lock(plant_context)
        geometries = GeometrySet(self._geometries(self._resting(still)))
        self._filter(CollisionFilterDeclaration().ExcludeWithin(geometries))

    def _filter(self, declaration: CollisionFilterDeclaration) -> None:
        graph = self.diagram.scene_graph
        graph_context = graph.GetMyMutableContextFromRoot(self.context)
        graph.collision_filter_manager(graph_context).Apply(declaration)

    def _resting(self, still: set[BodyIndex]) -> set[BodyIndex]:
        """What does not move while these objects are locked."""
        return still | {self.diagram.table} | set(self.diagram.fixed.values())

    def _geometries(self, bodies: set[BodyIndex]) -> list[GeometryId]:
        plant = self.diagram.plant
        return [
            geometry
            for index in sorted(bodies)
            for geometry in plant.GetCollisionGeometriesForBody(plant.get_body(index))
        ]

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
        coulomb = CoulombFriction(friction, friction)
        graph, plant = self.diagram.scene_graph, self.diagram.plant
        graph_context = graph.GetMyMutableContextFromRoot(self.context)
        inspector = graph.model_inspector()
        for geometry in self._geometries(set(bodies)):
            properties = ProximityProperties(inspector.GetProximityProperties(geometry))
            properties.UpdateProperty("material", "coulomb_friction", coulomb)
            graph.AssignRole(
                graph_context, plant.get_source_id(), geometry, properties, RoleAssign.kReplace
            )

    def _set_mass(self, target: BodyIndex, mass: float | None) -> None:
        if mass is None:
            return
        body = self.diagram.plant.get_body(target)
        unit = body.default_spatial_inertia().get_unit_inertia()
        body.SetSpatialInertiaInBodyFrame(
            self.diagram.plant.GetMyMutableContextFromRoot(self.context),
            SpatialInertia(mass, body.default_com(), unit),
        )

    def command(self, model: str, desired_state: Array) -> None:
        """Sets the servo command of `hand` (4,) or `lift` (2,)."""
        port = self.diagram.diagram.GetInputPort(f"{model}.desired_state")
        port.FixValue(self.context, desired_state)


def _check_overrides(friction: float | None, mass: float | None) -> None:
    if friction is not None and not 0.0 <= friction < np.inf:
        raise InvalidInputError(f"friction is {friction}; give a coefficient of 0 or more")
    if mass is not None and not 0.0 < mass < np.inf:
        raise InvalidInputError(f"mass is {mass} kg; give more than 0")
