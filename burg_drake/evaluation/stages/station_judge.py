"""The stages of a station, by the mode of the run: clearance of the hand, feasibility for the arm,
and a trial in simulation, of the hand alone or of the whole arm."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Literal

from burg_drake.core.grasps import LIFT_HEIGHT, Mode, Stage
from burg_drake.evaluation.candidates import Candidate
from burg_drake.evaluation.stages.judge import Decide, Decision, Screen, trial_decision
from burg_drake.evaluation.stages.mode import require_engine_for
from burg_drake.evaluation.stages.screening import arm_reach, arm_screen, hand_alone, hand_screen
from burg_drake.motion.plans import Plan
from burg_drake.motion.reach import Witness
from burg_drake.scene.document import Scene
from burg_drake.station.document import Engine, GraspMotion, Station

if TYPE_CHECKING:
    from burg_drake.evaluation.stages.lift_room import LiftRoom
    from burg_drake.simulation.trials import TrialSettings


class StationJudge:
    """Judges grasps on a station.

    Attributes:
        screens, stages: see `judge.Judge`.
        plan: the one that the arm has executed last, if it has executed any.
    """

    def __init__(self, screens: list[Screen], stages: list[tuple[Stage, Decide]]) -> None:
        self.screens = screens
        self.stages = stages
        self.plan: Plan | None = None


class HandJudge(StationJudge):
    """Has the hand alone execute grasps; in mode `reach` those that the arm can execute."""

    def __init__(
        self,
        scene: Scene,
        station: Station,
        *,
        engine: Engine,
        mode: Literal["hand", "reach"],
        settings: TrialSettings,
    ) -> None:
        """Builds the diagrams that all grasps share; see `build_judge`."""
        from burg_drake.simulation.mujoco import hand_trial_of
        from burg_drake.station.diagram import instance_pose

        self._trial = hand_trial_of(scene, station, engine, settings=settings)
        motion = self._trial.motion
        X_WO = {name: instance_pose(scene, station, name) for name in scene.instances}
        room = _room(scene, station, motion) if mode == "hand" else None
        screens = [hand_screen(self._trial.clearance, X_WO, room)]
        if mode == "reach":
            screens.append(arm_screen(arm_reach(scene, station, motion), X_WO))
        super().__init__(screens, [(Stage.EXECUTED, self._execute)])

    def _execute(self, grasp: Candidate, motion: Witness | Plan | None) -> Decision:
        lift = self._trial.motion.lift_height if grasp.lift is None else grasp.lift
        decision = trial_decision(
            self._trial.run(
                grasp.instance, grasp.X_OG, friction=grasp.friction, mass=grasp.mass, lift=lift
            )
        )
        return replace(decision, margins={**decision.margins, LIFT_HEIGHT: lift})


class ArmJudge(StationJudge):
    """Plans the arm's motions, and has the whole arm execute them."""

    def __init__(
        self, scene: Scene, station: Station, *, engine: Engine, settings: TrialSettings
    ) -> None:
        """Builds the diagrams that all grasps share; see `build_judge`."""
        from burg_drake.motion import Planner
        from burg_drake.simulation.trials import ArmTrial

        hand, X_WO = hand_alone(scene, station)
        self._trial = ArmTrial(scene, station, engine=engine, settings=settings, clearance=hand)
        reach = arm_reach(scene, station, self._trial.motion)
        self._planner = Planner(reach)
        super().__init__(
            [hand_screen(hand, X_WO), arm_screen(reach, X_WO, motions=True)],
            [(Stage.PLANNED, self._time), (Stage.EXECUTED, self._execute)],
        )

    def _time(self, grasp: Candidate, motion: Witness | Plan | None) -> Decision:
        assert isinstance(motion, Witness)
        plan = self._planner.time(grasp.instance, motion, grasp.width)
        return Decision(margins={"duration": plan.duration}, motion=plan)

    def _execute(self, grasp: Candidate, motion: Witness | Plan | None) -> Decision:
        assert isinstance(motion, Plan)
        self.plan = motion
        return trial_decision(
            self._trial.run(
                grasp.instance, grasp.X_OG, motion, friction=grasp.friction, mass=grasp.mass
            )
        )


def build_judge(
    scene: Scene,
    station: Station,
    *,
    engine: Engine,
    mode: Mode,
    settings: TrialSettings | None = None,
) -> StationJudge:
    """Builds the judge of a mode, and the diagrams that all grasps share.

    Args:
        scene, station: what to build.
        engine: how the trial is stepped.
        mode: what to ask; but for `hand` the station needs an arm.
        settings: phases of the trial, if not the usual ones; where they have no motion, it is the
            station's.

    Raises:
        InvalidInputError: the engine has no arm, or cannot have an object or the hand.
        MissingDependencyError: it is not installed.
    """
    from burg_drake.simulation.trials import TrialSettings

    require_engine_for(engine, mode)
    settings = TrialSettings() if settings is None else settings
    if mode == "arm":
        return ArmJudge(scene, station, engine=engine, settings=settings)
    return HandJudge(scene, station, engine=engine, mode=mode, settings=settings)


def _room(scene: Scene, station: Station, motion: GraspMotion) -> LiftRoom | None:
    """What says how far the hand can lift, where it may be less than asked for."""
    from burg_drake.evaluation.stages.lift_room import LiftRoom

    return LiftRoom(scene, station, motion) if motion.shortest < motion.lift_height else None


@dataclass(frozen=True)
class StationJudgeFactory:
    """What a worker process needs to build its `StationJudge`; see `build_judge`."""

    scene: Scene
    station: Station
    engine: Engine
    mode: Mode
    settings: TrialSettings | None = None

    def __call__(self) -> StationJudge:
        return build_judge(
            self.scene,
            self.station,
            engine=self.engine,
            mode=self.mode,
            settings=self.settings,
        )
