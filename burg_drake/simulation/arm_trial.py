"""The arm's trial: servos follow a plan to the grasp, the hand closes, the arm lifts and holds.

The arm starts at rest at the pregrasp, or at home if it also executes the transfer. Outcomes and
margins are those of the hand's trial, with two more: how well the arm followed its commands, and
what it pushed before the hand closed.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import lru_cache, partial
from itertools import pairwise

import numpy as np
from pydrake.geometry import Meshcat
from pydrake.multibody.tree import BodyIndex

from burg_drake.core import Array, InvalidInputError, inverse, rotation_angle, swap_fingers
from burg_drake.grasping import HandClearance
from burg_drake.motion import ArmKinematics, Plan, Trajectory
from burg_drake.scene import SceneLike, as_scene
from burg_drake.simulation.contacts import BodyContact, RobotContactWatch
from burg_drake.simulation.grasp_trial import MAX_KEPT_WORLDS, DrakeTrial
from burg_drake.simulation.hand_carrier import ArmLiftClearance
from burg_drake.simulation.settings import DEFAULT_TRIAL, TrialSettings
from burg_drake.simulation.trial_execution import Execution, HandSegment
from burg_drake.simulation.trial_result import TrialResult
from burg_drake.simulation.trial_world import TrialWorld, check_overrides
from burg_drake.station import (
    ENGINES,
    Engine,
    MountedHand,
    StationLike,
    as_drake_engine,
    as_station,
    build_station_diagram,
)


class CommandSequence:
    """Samples consecutive trajectories at the simulation's steps, then holds the last position.

    A trajectory begins at the first step after the previous one has ended.

    Args:
        trajectories: at least one; each begins where the one before it ends.
        step: time step of the simulation [s].
        steps_per_check: steps between contact checks.
        forward: (K, 3) positions of the grasp frame in the world at arm positions (K, n) [m].
        rest: contact checks after the end.

    Attributes:
        steps_per_check: as given.
        checks: number of contact checks from start to end.
        desired: (S + 1, 2 n) positions and velocities, by steps since the start.
        p_WG: (checks + 1, 3) positions of the grasp frame in the world at the contact checks [m].
    """

    def __init__(
        self,
        trajectories: Sequence[Trajectory],
        step: float,
        steps_per_check: int,
        forward: Callable[[Array], Array],
        rest: int = 0,
    ) -> None:
        parts = [_desired_states(trajectories[0], np.zeros(1))]
        for trajectory in trajectories:
            count = int(np.ceil(trajectory.duration / step - 1e-6))
            parts.append(_desired_states(trajectory, step * np.arange(1.0, count + 1.0)))
        self.desired = np.concatenate(parts)
        self.checks = -(-(len(self.desired) - 1) // steps_per_check) + rest
        self.steps_per_check = steps_per_check
        self.p_WG = forward(np.array([self.q_at_check(check) for check in range(self.checks + 1)]))

    def at(self, step: int) -> Array:
        """Desired positions and velocities (2 n,) at the end of a step, counted from the start."""
        desired: Array = self.desired[min(step, len(self.desired) - 1)]
        return desired

    def q_at_check(self, check: int) -> Array:
        """Desired positions (n,) at a contact check, counted from the start."""
        return self.at(check * self.steps_per_check)[: self.desired.shape[1] // 2]


def _desired_states(trajectory: Trajectory, time: Array) -> Array:
    """Positions and velocities (T, 2 n) of a trajectory at times (T,)."""
    v = [np.interp(time, trajectory.t, column) for column in trajectory.v.T]
    return np.concatenate([trajectory.at(time), np.stack(v, axis=1)], axis=1)


class ArmCarrier:
    """Moves the hand with the arm; see `Carrier`.

    Commands change at every step of the simulation, which is what a real arm's controller gets (a
    Panda's takes one a millisecond). The servos are part of a step, so each command is the state
    desired at its end.

    Args:
        world: world of a trial with an arm, prepared for its start.
        target: the grasped body.
        approach: commands from the pregrasp, or from further back, to the grasp.
        segments: commands of each straight segment from the grasp on, at least one.
        closed: returns how far the fingers can close at a grasp (4, 4) in the world before contact.
        lift_clearance: makes the check of the path ahead with the target in the hand.
    """

    def __init__(
        self,
        world: TrialWorld,
        target: BodyIndex,
        approach: CommandSequence,
        segments: Sequence[CommandSequence],
        closed: Callable[[Array], float],
        lift_clearance: Callable[[], ArmLiftClearance],
    ) -> None:
        assert isinstance(world.hand, MountedHand)
        diagram = world.diagram
        self._world = world
        self._closed_before_contact = closed
        self._hand = world.hand
        self._lift_clearance = lift_clearance
        self._step = diagram.engine.time_step
        self._plant_context = world.plant_context
        self._port = diagram.diagram.GetInputPort("arm.desired_state")
        self._approach, self._commands = approach, tuple(segments)
        self._gravity = float(np.linalg.norm(diagram.plant.gravity_field().gravity_vector()))
        interval = segments[-1].steps_per_check * self._step
        self._loads = _specific_loads(segments[-1].p_WG, interval, self._gravity)
        speed = np.linalg.norm(np.diff(segments[-1].p_WG, axis=0), axis=1)
        self._fastest_check = int(speed.argmax())
        self._touches = RobotContactWatch(diagram, world.hand.links, target)
        self._current: CommandSequence | None = None
        self._segment_index = 0
        self._start = 0
        self._arrived = False
        self.approach_checks = approach.checks
        self.approach_steps = approach.steps_per_check
        self.segments = tuple(_hand_segment(segment) for segment in segments)
        self.lift_time = sum(segment.checks for segment in segments) * interval
        self.tracking_error = self.tracking_distance = math.nan

    @property
    def touched(self) -> str:
        """The robot's first unplanned contact; see `TrialResult`."""
        return self._touches.first

    def approach(self) -> None:
        """Follows the path to the grasp."""
        self._follow(self._approach)

    def close(self) -> None:
        """Closes the hand. If nothing has been moved, the fingers start just before the first
        contact."""
        self._arrived = True
        self._follow(None)
        world = self._world
        world.command("hand", self._hand.closing_command())
        if not self.touched:
            X_WG = self._hand.X_WG(self._plant_context)
            self._hand.set_fingers(self._plant_context, self._closed_before_contact(X_WG))
            world.simulator.Initialize()

    def lift(self, segment_index: int, check: int) -> None:
        """Follows one segment of the plan."""
        if check == 0:
            self._segment_index = segment_index
            self._follow(self._commands[segment_index])

    def stop(self) -> None:
        """Holds the arm at the end of the last segment."""
        self._follow(None)

    def advance_to(self, time: float) -> None:
        """Advances the simulation, with a new command for each step."""
        context, simulator = self._world.context, self._world.simulator
        if self._current is None:
            simulator.AdvanceTo(time)
            return
        done, last = self._steps(context.get_time()), self._steps(time)
        for step in range(done + 1, last + 1):
            self._port.FixValue(context, self._current.at(step - self._start))
            simulator.AdvanceTo(step * self._step)

    def watch(self, contacts: list[BodyContact]) -> str:
        """Checks the contacts of the whole robot, and records its tracking error."""
        if self._current is not None:
            self._track(self._current)
        return self._touches.update(contacts, self._arrived)

    def travelled(self) -> float:
        """Commanded distance of the grasp frame from the start of its segment [m]."""
        p_WG = self._hand.X_WG(self._plant_context)[:3, 3]
        p_GG_W = p_WG - self._commands[self._segment_index].p_WG[0]
        return float(p_GG_W @ self.segments[self._segment_index].direction_W)

    def carries_full_load(self, check: int) -> bool:
        """Compares past and future loads from gravity and the planned acceleration.

        Unless the hand moves straight up, braking and accelerating load the grip in different
        directions, and both count.
        """
        polls = self._world.settings.steady_polls
        window = self._loads[max(0, check + 1 - polls) : check + 1]
        ahead = np.append(self._loads[check + 1 :], self._gravity).max()
        brakes = self.segments[-1].is_straight_up or check >= self._fastest_check + polls
        return bool(brakes and ahead <= 1.01 * window.max())

    def is_free_ahead(self) -> bool:
        """Checks the rest of the planned motion for collisions."""
        spacing = 0.01  # Metres of the hand's path between checks of the rest of the lift.
        commands = self._commands[-1]
        check = self._checks_done(commands)
        p_WG = commands.p_WG[check:]
        gone = np.append(0.0, np.linalg.norm(np.diff(p_WG, axis=0), axis=1).cumsum())
        marks = np.append(np.arange(spacing, gone[-1], spacing), gone[-1])
        rows = check + np.searchsorted(gone, marks - 1e-9)
        q = np.array([commands.q_at_check(row) for row in rows])
        return self._lift_clearance().is_free(self._world, q)

    def _follow(self, commands: CommandSequence | None) -> None:
        """Follows a sequence of commands from now on; None keeps the last command."""
        self._current = commands
        self._start = self._steps(self._world.context.get_time())

    def _steps(self, time: float) -> int:
        return round(time / self._step)

    def _checks_done(self, commands: CommandSequence) -> int:
        """Number of contact checks since the start of the command sequence."""
        steps = self._steps(self._world.context.get_time()) - self._start
        return steps // commands.steps_per_check

    def _track(self, commands: CommandSequence) -> None:
        check = self._checks_done(commands)
        q = self._hand.q(self._plant_context)
        p_WG = self._hand.X_WG(self._plant_context)[:3, 3]
        error = float(np.abs(q - commands.q_at_check(check)).max())
        distance = float(np.linalg.norm(p_WG - commands.p_WG[check]))
        self.tracking_error = float(np.fmax(self.tracking_error, error))
        self.tracking_distance = float(np.fmax(self.tracking_distance, distance))


def _hand_segment(commands: CommandSequence) -> HandSegment:
    """The straight segment along which a command sequence moves the hand."""
    p_GG_W = commands.p_WG[-1] - commands.p_WG[0]
    # A plan may leave its straight segment by half a millimetre.
    direction_W = np.round(p_GG_W / np.linalg.norm(p_GG_W), 3)
    direction_W /= np.linalg.norm(direction_W)
    return HandSegment(direction_W, float(p_GG_W @ direction_W), commands.checks)


def _specific_loads(p_WG: Array, interval: float, gravity: float) -> Array:
    """Load of gravity and the hand's acceleration on a held target per mass (L,) [m/s^2], in each
    interval between positions (L + 1, 3)."""
    velocity = np.diff(p_WG, axis=0) / interval
    velocity = np.concatenate([np.zeros((1, 3)), velocity, np.zeros((1, 3))])
    at_ends = np.diff(velocity, axis=0) / interval
    at_ends[:, 2] += gravity
    load = np.linalg.norm(at_ends, axis=1)
    peak: Array = np.maximum(load[:-1], load[1:])
    return peak


MAX_PLAN_DISTANCE = 1e-3  # Metres between the grasp and the end of a plan's approach.
MAX_PLAN_ANGLE = 1e-2  # Radians between the grasp and the end of a plan's approach.


class ArmTrial(DrakeTrial):
    """Executes plans in one scene with the whole robot.

    Example::

        scene, station = burg.load_scene("tabletop_six"), burg.load_station("panda_tabletop")
        X_OG = burg.sample_grasps(scene, station, 1, only=["box"]).X_OG[0]
        plan = burg.plan(scene, station, "box", X_OG)
        if isinstance(plan, burg.Plan):
            print(burg.ArmTrial(scene, station).run("box", X_OG, plan).outcome)

    Args:
        scene: the scene.
        station: a station with an arm.
        engine: time step and contact settings, or the name of a preset.
        settings: phases of a trial; the hand's paths come from the plan, so that `motion` and
            `lift_time` do not count.
        transfer: begin at the home posture, and go to the pregrasp first. As the arm is fast there,
            contacts are checked after every step up to the grasp, and not only at `poll`.
        clearance: the screen of the open hand in this scene, if there is one already.
        meshcat: where to show the trials; recording is the caller's.

    Attributes:
        scene, station, engine, settings, motion, clearance: see `GraspTrial`.

    Raises:
        InvalidInputError: the station has no arm.
    """

    robot = "arm"
    hand_type = MountedHand

    def __init__(
        self,
        scene: SceneLike,
        station: StationLike,
        *,
        engine: Engine | str = ENGINES["standard"],
        settings: TrialSettings = DEFAULT_TRIAL,
        transfer: bool = False,
        clearance: HandClearance | None = None,
        meshcat: Meshcat | None = None,
    ) -> None:
        scene, station = as_scene(scene), as_station(station)
        self._plain_diagram = build_station_diagram(scene, station, robot="arm")
        if clearance is None:
            clearance = HandClearance(build_station_diagram(scene, station, robot="hand"))
        super().__init__(
            scene, station, as_drake_engine(engine), settings=settings, clearance=clearance
        )
        self._transfer, self._meshcat = transfer, meshcat
        arm = station.document.arm
        assert arm is not None
        self._X_WA = arm.X_WA.matrix()
        self._kinematics = ArmKinematics.of(self._plain_diagram)
        self.steps_per_check = max(1, round(settings.poll / self.engine.time_step))
        self._lift_clearance = lru_cache(MAX_KEPT_WORLDS)(
            partial(ArmLiftClearance, self._plain_diagram)
        )

    @property
    def hand(self) -> MountedHand:
        """The hand in `world`."""
        hand = self.world.hand
        assert isinstance(hand, MountedHand)
        return hand

    def run(
        self,
        instance: str,
        X_OG: Array,
        plan: Plan,
        *,
        friction: float | None = None,
        mass: float | None = None,
    ) -> TrialResult:
        """Executes the plan of one grasp.

        Args:
            instance: name of the target in the scene.
            X_OG: (4, 4) grasp in the target's frame.
            plan: leads to that grasp, or to the same one with the fingers swapped.
            friction: the target's friction coefficient, in place of the library's.
            mass: the target's mass [kg], in place of the library's; its inertia scales with it.

        Returns:
            The outcome with its margins. A failure of the simulator is an outcome, too.

        Raises:
            InvalidInputError: `X_OG` is not a pose, `instance` cannot be grasped, friction is below
                0, or the mass is not above 0; the plan is for another scene or arm, has gaps, or
                leads elsewhere.
        """
        X_WG = self.X_WG(instance, X_OG)
        check_overrides(friction, mass)
        self._check_plan(plan, X_WG)
        # The plan decides which finger is on which side; that matters if the hand is not symmetric.
        as_planned = self._X_WG_at(plan.approach.q[-1:])[0, :3, :3]
        if rotation_angle(X_WG[:3, :3].T @ as_planned) > MAX_PLAN_ANGLE:
            X_WG = swap_fingers(X_WG)

        def begin(world: TrialWorld) -> Execution:
            return self.begin(instance, plan, friction=friction, mass=mass, world=world)

        return self.execute(instance, X_WG, begin, friction=friction, mass=mass)

    def begin(
        self,
        instance: str,
        plan: Plan,
        *,
        friction: float | None = None,
        mass: float | None = None,
        world: TrialWorld | None = None,
    ) -> Execution:
        """Resets the Context to the start of a trial.

        All objects, the target among them, are locked until something moving touches them.

        Args:
            instance: the target.
            plan: the arm's motion.
            friction, mass: as in `run`.
            world: world of the trial; by default the complete one.
        """
        world = self._use_world(world)
        assert isinstance(world.hand, MountedHand)
        target = world.diagram.free[instance]
        moving: set[BodyIndex] = set()
        world.prepare(instance, moving, friction, mass)
        step = self.engine.time_step
        to_grasp = [plan.transfer, plan.approach] if self._transfer else [plan.approach]
        steps = 1 if self._transfer else self.steps_per_check
        rest = max(1, round(0.05 / (steps * step)))  # 0.05 s between arrival and closing
        approach = CommandSequence(to_grasp, step, steps, self._p_WG, rest)
        segments = [
            CommandSequence([segment], step, self.steps_per_check, self._p_WG)
            for segment in _phases_with_target(plan)
        ]
        world.hand.place(world.plant_context, approach.q_at_check(0))
        world.command("arm", approach.at(0))
        world.command("hand", world.hand.opening_command())
        world.simulator.Initialize()
        closed = partial(self.closed_before_contact, instance)
        lift_clearance = partial(self._lift_clearance, instance)
        carrier = ArmCarrier(world, target, approach, segments, closed, lift_clearance)
        return Execution(world, target, moving, carrier)

    def _check_plan(self, plan: Plan, X_WG: Array) -> None:
        """Checks that a plan is for this scene, arm and grasp; without an origin, for arm and grasp
        only.

        Raises:
            InvalidInputError: the plan is for another one.
        """
        if plan.origin is not None:
            plan.require_for(self.scene, self.station)
        joints = len(self._plain_diagram.arm_joints)
        parts = {name: part for name, part in plan.phases.items() if name != "close"}
        if not self._transfer:
            del parts["transfer"]
        if not _phases_with_target(plan):
            raise InvalidInputError(
                "the plan does not move the hand while it holds the object; it needs a lift or a"
                " retreat"
            )
        for name, part in parts.items():
            if part.q.shape[1] != joints:
                raise InvalidInputError(
                    f"the plan's {name} has {part.q.shape[1]} joints, but the arm of station"
                    f" {self.station.name!r} has {joints}"
                )
        for one, other in pairwise(parts):
            gap = float(np.abs(parts[other].q[0] - parts[one].q[-1]).max())
            if gap > 1e-6:
                raise InvalidInputError(
                    f"the plan's {other} starts {gap:.2g} rad from the end of its {one}"
                )
        X_WG_end = self._X_WG_at(plan.approach.q[-1:])[0]
        distance = float(np.linalg.norm(X_WG_end[:3, 3] - X_WG[:3, 3]))
        turns = [(inverse(X) @ X_WG_end)[:3, :3] for X in (X_WG, swap_fingers(X_WG))]
        angle = min(float(rotation_angle(R)) for R in turns)
        if distance > MAX_PLAN_DISTANCE or angle > MAX_PLAN_ANGLE:
            raise InvalidInputError(
                f"the plan ends {1e3 * distance:.1f} mm and {np.rad2deg(angle):.1f} degrees from"
                " the grasp; plan this grasp in this scene"
            )

    def _X_WG_at(self, q: Array) -> Array:
        """Grasp frames in the world (K, 4, 4) at arm positions (K, n)."""
        return self._X_WA @ self._kinematics.forward(q)[0] @ self.station.hand.X_HG.matrix()

    def _p_WG(self, q: Array) -> Array:
        return self._X_WG_at(q)[:, :3, 3]


def _phases_with_target(plan: Plan) -> list[Trajectory]:
    """The phases of retreat and lift in which the hand moves."""
    parts = [plan.retreat, plan.lift]
    return [part for part in parts if part is not None and (part.q[-1] != part.q[0]).any()]
