"""The floating-hand trial: the open hand stands at the grasp, closes, lifts and holds.

After Rudorfer et al., "BURG-Toolkit" (2022): a grasp that collides is rejected before any step; the
fingers close with a limited force until the grip settles; the hand rises by 0.30 m along world z
and holds; success means that both fingers still hold the target.

One compiled diagram serves all trials of a scene; a trial changes only the Context, and what it
returns does not depend on the trials before it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from pydrake.geometry import (
    CollisionFilterDeclaration,
    GeometrySet,
    Meshcat,
    ProximityProperties,
    RoleAssign,
)
from pydrake.multibody.plant import CoulombFriction
from pydrake.multibody.tree import BodyIndex
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Context

from burg_drake.core.errors import InvalidInputError
from burg_drake.core.frames import Array, check_pose
from burg_drake.core.outcome import Outcome
from burg_drake.grasping.clearance import HandClearance
from burg_drake.scene.scene import Scene
from burg_drake.simulation.contacts import ContactReader
from burg_drake.simulation.execution import BystanderReached, Execution
from burg_drake.simulation.result import Margins, TrialResult
from burg_drake.station.diagram import build_station_diagram
from burg_drake.station.engine import ENGINES, Engine
from burg_drake.station.floating_hand import FloatingHand
from burg_drake.station.station import Station


@dataclass(frozen=True, kw_only=True)
class TrialSettings:
    """Phases of a trial.

    Attributes:
        lift_height: how far the hand rises [m].
        lift_time: duration of the rise [s]; half of it accelerates and half of it brakes, both by
            4 height / time^2.
        hold_time: how long the target must be held after the rise [s].
        resting_time: holding ends early when the target has moved in the hand by less than
            `settled_speed` for this long [s].
        poll: interval at which contacts are looked at [s].
        settled_speed: the grip has settled when the fingers are slower than this [m/s] ...
        settled_time: ... for this long [s].
        close_timeout: closing ends after this time in any case [s].
    """

    lift_height: float = 0.30
    lift_time: float = 1.25
    hold_time: float = 0.5
    resting_time: float = 0.1
    poll: float = 0.01
    settled_speed: float = 0.002
    settled_time: float = 0.05
    close_timeout: float = 2.0


class HandTrial:
    """Executes grasps of one scene with the hand alone.

    Args:
        scene: the scene.
        station: table, board pose and hand.
        engine: time step and contact settings.
        settings: phases of a trial.
        meshcat: where to show the trials; recording is the caller's.

    Attributes:
        diagram: the station diagram that all trials share.
        clearance: the screen of the open hand in it.
        hand: the floating hand in it.
        contacts: reader of its contact results.
        simulator: the simulator that runs the trials.
        settings: phases of a trial.
    """

    def __init__(
        self,
        scene: Scene,
        station: Station,
        *,
        engine: Engine = ENGINES["standard"],
        settings: TrialSettings = TrialSettings(),
        meshcat: Meshcat | None = None,
    ) -> None:
        self.settings = settings
        self.diagram = build_station_diagram(
            scene, station, robot="hand", engine=engine, meshcat=meshcat
        )
        self.clearance = HandClearance(self.diagram)
        self.hand = FloatingHand(self.diagram)
        self.contacts = ContactReader(self.diagram.plant, self.diagram.scene_graph)
        self._default = self.diagram.diagram.CreateDefaultContext()
        self.simulator = Simulator(self.diagram.diagram, self._default.Clone())

    @property
    def context(self) -> Context:
        """Context of the trial that runs or ran last."""
        return self.simulator.get_mutable_context()

    def run(self, instance: str, X_OG: Array, *, friction: float | None = None) -> TrialResult:
        """Executes one grasp.

        Args:
            instance: name of the target in the scene.
            X_OG: (4, 4) grasp in the target's frame.
            friction: the target's friction coefficient, in place of the library's.

        Returns:
            The outcome with its margins. A failure of the simulator is an outcome, too.

        Raises:
            InvalidInputError: `X_OG` is not a pose, or `instance` cannot be grasped.
        """
        if instance not in self.diagram.free:
            raise InvalidInputError(
                f"{instance!r} is not a free object of scene {self.diagram.scene.name!r};"
                f" free are: {', '.join(self.diagram.free) or '(none)'}"
            )
        X_WG = self.diagram.X_WO(instance) @ check_pose(X_OG, "X_OG")
        screen = self.clearance.check(instance, X_WG)
        if screen.outcome is not None:
            margins = Margins(overlap=screen.overlap, end_time=0.0)
            return TrialResult(outcome=screen.outcome, margins=margins, blocker=screen.blocker)
        try:
            return self._execute(instance, X_WG, friction)
        except (RuntimeError, SystemExit) as error:  # Drake ends some failed checks by SystemExit
            return TrialResult(
                outcome=Outcome.SIMULATION_FAILED,
                margins=Margins(overlap=0.0, end_time=self.context.get_time()),
                reason=" ".join(str(error).split()),
            )

    def _execute(self, instance: str, X_WG: Array, friction: float | None) -> TrialResult:
        """Runs the trial with the target alone free to move. When an object that is locked gets
        touched, it starts again with that object free: what nothing touches stays at rest, so
        that the result is the one with all objects free, at the cost of those that matter."""
        target = self.diagram.free[instance]
        travel = self.clearance.free_travel(X_WG)
        moving = {target}
        while True:
            self._reset(X_WG, travel, moving)
            self.set_friction(instance, friction)
            try:
                return Execution(self, target, moving).run()
            except BystanderReached as event:
                moving |= event.bodies

    def _reset(self, X_WG: Array, travel: float, moving: set[BodyIndex]) -> None:
        """Brings the Context to the start of a trial; nothing of an earlier one remains.

        The fingers start where they would touch something first: until then nothing happens.
        """
        context = self.context
        context.SetTimeStateAndParametersFrom(self._default)
        plant_context = self.diagram.plant.GetMyMutableContextFromRoot(context)
        self.hand.place(plant_context, X_WG, travel)
        self._lock(set(self.diagram.free.values()) - moving)
        self.command("lift", np.zeros(2))
        self.command("hand", self.hand.closing_command())
        self.simulator.Initialize()

    def _lock(self, still: set[BodyIndex]) -> None:
        """Locks free objects in place, and drops their contact with what never moves."""
        plant, graph = self.diagram.plant, self.diagram.scene_graph
        plant_context = plant.GetMyMutableContextFromRoot(self.context)
        for index in still:
            plant.get_body(index).Lock(plant_context)
        resting = (*still, self.diagram.table, *self.diagram.fixed.values())
        geometries = [
            geometry
            for index in resting
            for geometry in plant.GetCollisionGeometriesForBody(plant.get_body(index))
        ]
        graph.collision_filter_manager(graph.GetMyMutableContextFromRoot(self.context)).Apply(
            CollisionFilterDeclaration().ExcludeWithin(GeometrySet(geometries))
        )

    def set_friction(self, instance: str, friction: float | None) -> None:
        """Gives the fingers, and the target if `friction` is given, one coefficient.

        Drake combines two coefficients a and b to 2ab/(a+b); of two equal ones that is the same.
        """
        bodies = list(self.hand.fingers)
        if friction is None:
            friction = self.diagram.scene.entry(instance).friction
        else:
            bodies.append(self.diagram.free[instance])
        coulomb = CoulombFriction(friction, friction)
        graph, plant = self.diagram.scene_graph, self.diagram.plant
        graph_context = graph.GetMyMutableContextFromRoot(self.context)
        inspector = graph.model_inspector()
        for body in bodies:
            for geometry in plant.GetCollisionGeometriesForBody(plant.get_body(body)):
                properties = ProximityProperties(inspector.GetProximityProperties(geometry))
                properties.UpdateProperty("material", "coulomb_friction", coulomb)
                graph.AssignRole(
                    graph_context, plant.get_source_id(), geometry, properties, RoleAssign.kReplace
                )

    def command(self, model: str, desired_state: Array) -> None:
        """Sets the servo command of `hand` (4,) or `lift` (2,)."""
        port = self.diagram.diagram.GetInputPort(f"{model}.desired_state")
        port.FixValue(self.context, desired_state)
