"""The arm's trial: the whole robot goes to the grasp, closes the hand, lifts and holds.

The arm begins at rest at the pregrasp, or at home if it shall do the transfer, too, and its servos
follow the plan's trajectories. All its links touch what they touch. Outcomes and margins are those
of the trial of the hand alone, and more: how well the arm followed its command, and what it pushed
before the hand closed.
"""

from __future__ import annotations

from functools import lru_cache, partial
from itertools import pairwise

import numpy as np
from pydrake.geometry import Meshcat
from pydrake.multibody.tree import BodyIndex

from burg_drake.core import Array, InvalidInputError, inverse, rotation_angle, swap_fingers
from burg_drake.grasping.clearance import HandClearance
from burg_drake.motion.ik import ArmKinematics
from burg_drake.motion.plans import Plan, Trajectory
from burg_drake.scene.document import SceneLike, as_scene
from burg_drake.simulation.trials.arm_carrier import ArmCarrier
from burg_drake.simulation.trials.command_sequence import CommandSequence
from burg_drake.simulation.trials.execution import Execution
from burg_drake.simulation.trials.grasp_trial import KEPT_WORLDS, DrakeTrial
from burg_drake.simulation.trials.lift_clearance import ArmLiftClearance
from burg_drake.simulation.trials.result import TrialResult
from burg_drake.simulation.trials.trial_settings import DEFAULT_TRIAL, TrialSettings
from burg_drake.simulation.trials.trial_world import TrialWorld, check_overrides
from burg_drake.station.diagram import MountedHand, StationDiagram, build_station_diagram
from burg_drake.station.document import ENGINES, Engine, StationLike, as_drake_engine, as_station

REST = 0.05
"""Time between arrival and closing, in which the arm comes to rest [s]."""
OFF_POSITION, OFF_ANGLE = 1e-3, 1e-2
"""A plan may lead so far from the grasp [m and rad]."""
APART = 1e-6
"""Ends of trajectories that are meant to meet [rad]."""


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
            its contacts are looked at after every step up to the grasp, and not only at `poll`.
        clearance: the screen of the open hand in this scene, if there is one already.
        meshcat: where to show the trials; recording is the caller's.

    Attributes:
        scene, station, engine, settings, motion, clearance: see `GraspTrial`.

    Raises:
        InvalidInputError: the station has no arm.
    """

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
        self._plain = build_station_diagram(scene, station, robot="arm")
        if clearance is None:
            clearance = HandClearance(build_station_diagram(scene, station, robot="hand"))
        super().__init__(
            scene,
            station,
            "arm",
            as_drake_engine(engine),
            settings=settings,
            clearance=clearance,
            meshcat=meshcat,
        )
        self._transfer = transfer
        arm = station.document.arm
        assert arm is not None
        self._X_WA = arm.X_WA.matrix()
        self._kinematics = ArmKinematics.of(self._plain)
        self.steps_per_check = max(1, round(settings.poll / self.engine.time_step))
        kept = lru_cache(maxsize=KEPT_WORLDS)
        self._lift_clearance = kept(partial(ArmLiftClearance, self._plain))

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
        # Which finger is on which side is the plan's; of a hand that is not symmetric that matters.
        as_planned = self._X_WG_at(plan.approach.q[-1:])[0, :3, :3]
        if rotation_angle(X_WG[:3, :3].T @ as_planned) > OFF_ANGLE:
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
        """Brings the Context to the start of a trial; nothing of an earlier one remains.

        All objects, the target among them, are locked until something moving touches them.

        Args:
            instance: the target.
            plan: where the arm goes.
            friction, mass: as in `run`.
            world: in which it runs; by default the complete one.
        """
        world = self._enter(world)
        assert isinstance(world.hand, MountedHand)
        target = world.diagram.free[instance]
        moving: set[BodyIndex] = set()
        world.prepare(instance, moving, friction, mass)
        step = self.engine.time_step
        to_grasp = [plan.transfer, plan.approach] if self._transfer else [plan.approach]
        steps = 1 if self._transfer else self.steps_per_check
        rest = max(1, round(REST / (steps * step)))
        approach = CommandSequence(to_grasp, step, steps, self._p_WG, rest)
        segments = [
            CommandSequence([segment], step, self.steps_per_check, self._p_WG)
            for segment in _phases_with_target(plan)
        ]
        plant_context = world.diagram.plant.GetMyMutableContextFromRoot(world.context)
        world.hand.place(plant_context, approach.q_at_check(0))
        world.command("arm", approach.at(0))
        world.command("hand", world.hand.opening_command())
        world.simulator.Initialize()
        closed = partial(self.closed_before_contact, instance)
        lift_clearance = partial(self._lift_clearance, instance)
        carrier = ArmCarrier(world, target, approach, segments, closed, lift_clearance)
        return Execution(world, target, moving, carrier)

    def _handle(self, diagram: StationDiagram) -> MountedHand:
        return MountedHand(diagram)

    def _check_plan(self, plan: Plan, X_WG: Array) -> None:
        """Whether a plan is one for this scene, arm and grasp; of one without an origin the arm and
        the grasp are all that can be told.

        Raises:
            InvalidInputError: it is not.
        """
        if plan.origin is not None:
            plan.require_for(self.scene, self.station)
        joints = len(self._plain.arm_joints)
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
        names = list(parts)
        for one, other in pairwise(names):
            gap = float(np.abs(parts[other].q[0] - parts[one].q[-1]).max())
            if gap > APART:
                raise InvalidInputError(
                    f"the plan's {other} starts {gap:.2g} rad from the end of its {one}"
                )
        X_WG_end = self._X_WG_at(plan.approach.q[-1:])[0]
        distance = float(np.linalg.norm(X_WG_end[:3, 3] - X_WG[:3, 3]))
        turns = [(inverse(X) @ X_WG_end)[:3, :3] for X in (X_WG, swap_fingers(X_WG))]
        angle = min(float(rotation_angle(R)) for R in turns)
        if distance > OFF_POSITION or angle > OFF_ANGLE:
            raise InvalidInputError(
                f"the plan ends {1e3 * distance:.1f} mm and {np.rad2deg(angle):.1f} degrees from"
                " the grasp; plan this grasp in this scene"
            )

    def _X_WG_at(self, q: Array) -> Array:
        """(K, 4, 4) grasp frames in the world at arm positions (K, n)."""
        return self._X_WA @ self._kinematics.forward(q)[0] @ self.station.hand.X_HG.matrix()

    def _p_WG(self, q: Array) -> Array:
        return self._X_WG_at(q)[:, :3, 3]


def _phases_with_target(plan: Plan) -> list[Trajectory]:
    """Those of retreat and lift that move the hand."""
    parts = [plan.retreat, plan.lift]
    return [part for part in parts if part is not None and (part.q[-1] != part.q[0]).any()]
