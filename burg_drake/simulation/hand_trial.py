"""The floating-hand trial: the open hand stands at the grasp, closes, lifts and holds.

After Rudorfer et al., "BURG-Toolkit" (2022): a grasp that collides is rejected before any step; the
fingers close with a limited force until the grip settles; the hand rises by 0.30 m along world z
and holds; success means that both fingers still hold the target.

One compiled diagram serves all trials of a scene; a trial changes only the Context, and what it
returns does not depend on the trials before it.
"""

from __future__ import annotations

import math
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
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Context

from burg_drake.core.errors import InvalidInputError
from burg_drake.core.frames import Array, check_pose, inverse, rotation_angle
from burg_drake.core.outcome import Outcome
from burg_drake.grasping.clearance import HandClearance
from burg_drake.scene.scene import Scene
from burg_drake.simulation.contacts import ContactReader, FingerContact
from burg_drake.simulation.neighbors import bounding_prism, taking_part
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
        lift_time: duration of the rise [s]; its speed follows a sine square, so that it peaks at
            2 height / time and the acceleration at 2 pi height / time^2.
        hold_time: how long the target must be held after the rise [s].
        poll: interval at which contacts are looked at [s].
        settled_speed: the grip has settled when the fingers are slower than this [m/s] ...
        settled_time: ... for this long [s].
        close_timeout: the fingers are stopped after this time in any case [s].
    """

    lift_height: float = 0.30
    lift_time: float = 1.5
    hold_time: float = 0.5
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
        self._hand = FloatingHand(self.diagram)
        plant, graph = self.diagram.plant, self.diagram.scene_graph
        self._contacts = ContactReader(plant, graph, self._hand.fingers)
        self._default = self.diagram.diagram.CreateDefaultContext()
        self._simulator = Simulator(self.diagram.diagram, self._default.Clone())
        self._bounds = {
            name: bounding_prism(
                np.array(scene.entry(name).lower),
                np.array(scene.entry(name).upper),
                self.diagram.X_WO(name),
            )
            for name in self.diagram.free
        }

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
            scene = self.diagram.scene
            raise InvalidInputError(
                f"{instance!r} is not a free object of scene {scene.name!r};"
                f" free are: {', '.join(self.diagram.free) or '(none)'}"
            )
        X_WG = self.diagram.X_WO(instance) @ check_pose(X_OG, "X_OG")
        screen = self.clearance.check(instance, X_WG)
        if screen.outcome is not None:
            margins = Margins(overlap=screen.overlap, end_time=0.0)
            return TrialResult(outcome=screen.outcome, margins=margins, blocker=screen.blocker)
        try:
            self._reset(instance, X_WG)
            self._set_friction(instance, friction)
            return _Execution(self, instance).run()
        except (RuntimeError, SystemExit) as error:  # Drake ends some failed checks by SystemExit
            return TrialResult(
                outcome=Outcome.SIMULATION_FAILED,
                margins=Margins(overlap=0.0, end_time=self._context.get_time()),
                reason=str(error).replace("\n", " "),
            )

    @property
    def _context(self) -> Context:
        return self._simulator.get_mutable_context()

    def _reset(self, instance: str, X_WG: Array) -> None:
        """Brings the Context to the start of a trial; nothing of an earlier one remains."""
        context = self._context
        context.SetTimeStateAndParametersFrom(self._default)
        plant = self.diagram.plant
        plant_context = plant.GetMyMutableContextFromRoot(context)
        self._hand.place(plant_context, X_WG)
        self._lock_bystanders(instance, X_WG)
        self.command("lift", np.zeros(2))
        self.command("hand", self._hand.closing_command())
        self._simulator.Initialize()

    def _lock_bystanders(self, instance: str, X_WG: Array) -> None:
        """Locks what is too far away to take part, and drops its contact with what rests."""
        plant, graph = self.diagram.plant, self.diagram.scene_graph
        hand = bounding_prism(*self._hand.bounds, X_WG)
        part = taking_part(self._bounds, instance, hand, self.settings.lift_height)
        locked = [plant.get_body(b) for name, b in self.diagram.free.items() if name not in part]
        for body in locked:
            body.Lock(plant.GetMyMutableContextFromRoot(self._context))
        resting = [plant.get_body(b) for b in (self.diagram.table, *self.diagram.fixed.values())]
        geometry = GeometrySet(
            [g for body in (*locked, *resting) for g in plant.GetCollisionGeometriesForBody(body)]
        )
        graph_context = graph.GetMyMutableContextFromRoot(self._context)
        graph.collision_filter_manager(graph_context).Apply(
            CollisionFilterDeclaration().ExcludeWithin(geometry)
        )

    def _set_friction(self, instance: str, friction: float | None) -> None:
        """Gives the fingers the target's coefficient: Drake's combination of two equal
        coefficients, 2ab/(a+b), is that coefficient."""
        bodies = list(self._hand.fingers)
        if friction is None:
            friction = self.diagram.scene.entry(instance).friction
        else:
            bodies.append(self.diagram.free[instance])
        coulomb = CoulombFriction(friction, friction)
        graph, plant = self.diagram.scene_graph, self.diagram.plant
        graph_context = graph.GetMyMutableContextFromRoot(self._context)
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
        port.FixValue(self._context, desired_state)


class _Execution:
    """One trial on the way: phases, and what was seen so far."""

    def __init__(self, trial: HandTrial, instance: str) -> None:
        self._trial = trial
        self._settings = trial.settings
        self._simulator = trial._simulator
        self._context = trial._context
        diagram = trial.diagram
        self._plant = diagram.plant
        self._plant_context = self._plant.GetMyContextFromRoot(self._context)
        self._results_port = self._plant.get_contact_results_output_port()
        self._target = self._plant.get_body(diagram.free[instance])
        self._others = [
            self._plant.get_body(b) for name, b in diagram.free.items() if name != instance
        ]
        self._start = [self._position(body) for body in self._others]
        self._com_start = self._com()
        self._others_moved = 0.0
        self._X_GO_grip: Array | None = None

    def run(self) -> TrialResult:
        touched = self._close()
        contact = self._contact()
        if not contact.both:
            if contact.any:
                return self._end(Outcome.ONE_FINGER)
            return self._end(Outcome.CLOSED_EMPTY if touched else Outcome.NO_CONTACT)
        self._X_GO_grip = inverse(self._X_WG()) @ self._X_WO()
        if not self._lift():
            return self._end(Outcome.SLIPPED)
        if not self._hold():
            return self._end(Outcome.DROPPED)
        return self._end(Outcome.LIFTED)

    def _close(self) -> bool:
        """Closes until the fingers rest; returns whether a finger touched the target."""
        settings = self._settings
        touched, slow_since = False, math.inf
        while self._context.get_time() < settings.close_timeout:
            now = self._advance(settings.poll)
            touched = touched or self._contact().any
            if self._trial._hand.finger_speed(self._plant_context) > settings.settled_speed:
                slow_since = math.inf
            else:
                slow_since = min(slow_since, now)
                if now - slow_since >= settings.settled_time - 1e-9:
                    break
        return touched

    def _lift(self) -> bool:
        """Raises the hand; returns whether the target is held at the end."""
        settings = self._settings
        steps = max(1, round(settings.lift_time / settings.poll))
        duration = steps * settings.poll
        for i in range(steps):
            # mean speed over the interval of v(t) = 2 h/T sin^2(pi t/T), so that the height is met
            phase = 2 * math.pi * np.array([i, i + 1]) / steps
            rise = (np.diff(phase) - np.diff(np.sin(phase)))[0] / (2 * math.pi)
            speed = settings.lift_height * rise / (duration / steps)
            self._trial.command("lift", np.array([0.0, speed]))
            self._advance(settings.poll)
            if not self._held_at_all():
                return False
        self._trial.command("lift", np.zeros(2))
        return self._contact().both and self._risen() >= settings.lift_height / 2

    def _hold(self) -> bool:
        """Waits; returns whether the target is held at the end."""
        for _ in range(max(1, round(self._settings.hold_time / self._settings.poll))):
            self._advance(self._settings.poll)
            if not self._held_at_all():
                return False
        return self._contact().both

    def _held_at_all(self) -> bool:
        """False once no finger touches the target any more: the outcome is decided."""
        return self._contact().any

    def _advance(self, duration: float) -> float:
        """Steps on; returns the time. Raises RuntimeError if the state is not finite any more."""
        time = self._context.get_time() + duration
        self._simulator.AdvanceTo(time)
        moved = [self._position(b) - p for b, p in zip(self._others, self._start, strict=True)]
        if moved:
            peak = float(np.linalg.norm(moved, axis=1).max())
            self._others_moved = max(self._others_moved, peak)
        if not np.isfinite(self._com()).all():
            raise RuntimeError(f"the state is not finite at {time:.3f} s")
        return time

    def _contact(self) -> FingerContact:
        results = self._results_port.Eval(self._plant_context)
        return self._trial._contacts.read(results, self._target.index())

    def _position(self, body) -> Array:  # type: ignore[no-untyped-def]
        return self._plant.EvalBodyPoseInWorld(self._plant_context, body).translation()

    def _com(self) -> Array:
        X_WO = self._plant.EvalBodyPoseInWorld(self._plant_context, self._target)
        return X_WO.multiply(self._target.default_com())

    def _X_WO(self) -> Array:
        return self._plant.EvalBodyPoseInWorld(self._plant_context, self._target).GetAsMatrix4()

    def _X_WG(self) -> Array:
        return self._trial._hand.X_WG(self._plant_context)

    def _risen(self) -> float:
        return float(self._com()[2] - self._com_start[2])

    def _end(self, outcome: Outcome) -> TrialResult:
        slip = tilt = force = math.nan
        if self._X_GO_grip is not None:
            # the point of the target that was at the grasp point when the grip had settled
            X_GG = inverse(self._X_WG()) @ self._X_WO() @ inverse(self._X_GO_grip)
            slip = float(np.linalg.norm(X_GG[:3, 3]))
            tilt = float(rotation_angle(X_GG[:3, :3]))
            closing = self._X_WG()[:3, 0]
            force = float(np.abs(self._contact().force @ closing).min())
        margins = Margins(
            overlap=0.0,
            slip=slip,
            tilt=tilt,
            pad_force=force,
            lift=self._risen(),
            others_moved=self._others_moved,
            end_time=self._context.get_time(),
        )
        return TrialResult(outcome=outcome, margins=margins)
