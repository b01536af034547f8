"""The stages of a station, by the mode of the run: clearance of the hand, feasibility for the arm,
and a trial in simulation, of the hand alone or of the whole arm."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from burg_drake.core.grasps import Stage
from burg_drake.evaluation.candidates import Candidate
from burg_drake.evaluation.stages.judge import LIFT_HEIGHT, Decide, Decision, Screen, trial_decision
from burg_drake.evaluation.stages.mode import Mode
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

    def __init__(
        self,
        scene: Scene,
        station: Station,
        *,
        engine: Engine,
        mode: Mode,
        settings: TrialSettings | None = None,
    ) -> None:
        """Builds the diagrams that all grasps share.

        Args:
            scene, station: what to build.
            engine: how the trial is stepped.
            mode: what to ask; but for `hand` the station needs an arm.
            settings: phases of the trial, if not the usual ones; where they have no motion, it is
                the station's.
        """
        from burg_drake.simulation.trials import HandTrial, TrialSettings

        settings = TrialSettings() if settings is None else settings
        motion = settings.motion or station.document.motion
        settings = replace(settings, motion=motion)
        self.plan: Plan | None = None
        if mode == "arm":
            self._build_arm_trial(scene, station, engine, settings, motion)
            return
        self._hand = HandTrial(scene, station, engine=engine, settings=settings)
        X_WO = {name: self._hand.diagram.X_WO(name) for name in scene.instances}
        self.screens: list[Screen] = [
            hand_screen(self._hand.clearance, X_WO, self._room(scene, station, motion, mode))
        ]
        self.stages: list[tuple[Stage, Decide]] = [(Stage.EXECUTED, self._execute)]
        if mode == "reach":
            self.screens.append(arm_screen(arm_reach(scene, station, motion), X_WO))

    def _build_arm_trial(
        self,
        scene: Scene,
        station: Station,
        engine: Engine,
        settings: TrialSettings,
        motion: GraspMotion,
    ) -> None:
        from burg_drake.motion import Planner
        from burg_drake.simulation.trials import ArmTrial

        hand, X_WO = hand_alone(scene, station)
        reach = arm_reach(scene, station, motion)
        self._planner = Planner(reach)
        self._arm = ArmTrial(scene, station, engine=engine, settings=settings, clearance=hand)
        self.screens = [hand_screen(hand, X_WO), arm_screen(reach, X_WO, motions=True)]
        self.stages = [(Stage.PLANNED, self._time), (Stage.EXECUTED, self._execute_by_arm)]

    @staticmethod
    def _room(scene: Scene, station: Station, motion: GraspMotion, mode: Mode) -> LiftRoom | None:
        """What says how far the hand can lift, where the arm is not asked and it may be less."""
        from burg_drake.evaluation.stages.lift_room import LiftRoom

        if mode == "hand" and motion.shortest < motion.lift_height:
            return LiftRoom(scene, station, motion)
        return None

    def _execute(self, grasp: Candidate, motion: Witness | Plan | None) -> Decision:
        lift = self._hand.motion.lift_height if grasp.lift is None else grasp.lift
        decision = trial_decision(
            self._hand.run(
                grasp.instance, grasp.X_OG, friction=grasp.friction, mass=grasp.mass, lift=lift
            )
        )
        return replace(decision, margins={**decision.margins, LIFT_HEIGHT: lift})

    def _time(self, grasp: Candidate, motion: Witness | Plan | None) -> Decision:
        assert isinstance(motion, Witness)
        plan = self._planner.time(grasp.instance, motion, grasp.width)
        return Decision(margins={"duration": plan.duration}, motion=plan)

    def _execute_by_arm(self, grasp: Candidate, motion: Witness | Plan | None) -> Decision:
        assert isinstance(motion, Plan)
        self.plan = motion
        return trial_decision(
            self._arm.run(
                grasp.instance, grasp.X_OG, motion, friction=grasp.friction, mass=grasp.mass
            )
        )


@dataclass(frozen=True)
class StationJudgeFactory:
    """What a worker process needs to build its `StationJudge`."""

    scene: Scene
    station: Station
    engine: Engine
    mode: Mode
    motion: GraspMotion | None = None

    def __call__(self) -> StationJudge:
        from burg_drake.simulation.trials import TrialSettings

        return StationJudge(
            self.scene,
            self.station,
            engine=self.engine,
            mode=self.mode,
            settings=TrialSettings(motion=self.motion),
        )
