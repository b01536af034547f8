"""Judges, which send a grasp through their stages until one of them decides.

Each stage returns an outcome for a grasp, or passes it on. The first stages are screens, which
take many grasps at once. The stages on a station, depending on the mode of the run: clearance of
the open hand, feasibility for the arm, and a trial in simulation, of the hand alone or of the arm.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, Protocol

import numpy as np

from burg_drake.core import (
    MODES,
    ONE_BY_ONE,
    Array,
    DeviceError,
    Findings,
    InvalidInputError,
    MarginNames,
    Mode,
    Outcome,
    Stage,
    TaskCancelled,
    Verdict,
    merge_findings,
    one_line,
    report_progress,
)
from burg_drake.evaluation.candidates import Candidate
from burg_drake.motion import ArmPath, Plan
from burg_drake.scene import Scene
from burg_drake.station import DRAKE_ENGINES, Engine, GraspMotion, Station

if TYPE_CHECKING:
    from burg_drake.grasping import HandClearance
    from burg_drake.motion import ArmReach, Reach, ReachSettings
    from burg_drake.simulation import (
        GraspTrial,
        HandTrial,
        MujocoTrial,
        TrialResult,
        TrialSettings,
    )


def mode_for(station: Station, asked: Mode | None = None) -> Mode:
    """Mode of a run on a station.

    Args:
        station: the station.
        asked: mode that the user asks for; None for `reach` if there is an arm, else `hand`.

    Raises:
        InvalidInputError: there is no such mode, or it needs an arm that the station lacks.
    """
    has_arm = station.document.arm is not None
    if asked is None:
        return "reach" if has_arm else "hand"
    if asked not in MODES:
        raise InvalidInputError(f"mode is {asked!r}; give {', '.join(MODES[:-1])} or {MODES[-1]}")
    if asked != "hand" and not has_arm:
        raise InvalidInputError(
            f"mode {asked!r} needs an arm, which station {station.name!r} lacks; give mode 'hand'"
        )
    return asked


def require_engine_for(engine: Engine, mode: Mode) -> None:
    """Refuses an engine that cannot run the trials of a mode.

    Raises:
        InvalidInputError: the engine does not support arms.
        MissingDependencyError: the engine is not installed.
    """
    if engine.simulator == "drake":
        return
    if mode == "arm":
        raise InvalidInputError(
            f"mode arm needs an engine of Drake ({', '.join(DRAKE_ENGINES)}); with engine"
            f" {engine.name} use mode reach, in which the hand alone executes what the"
            " arm can reach"
        ).about("mode")
    from burg_drake.simulation import require_mujoco, require_warp

    require_mujoco()
    if engine.parallel:
        require_warp()


def require_device(engine: Engine, device: str | None) -> None:
    """Refuses a device that this machine does not have, or that has no effect.

    Raises:
        InvalidInputError: there is no such device, no card, or the engine does not need one.
        MissingDependencyError: the engine is not installed.
    """
    if engine.parallel:
        from burg_drake.simulation import find_devices

        find_devices(device)
    elif device is not None:
        raise InvalidInputError(
            f"device {device!r} has no effect with engine {engine.name}; leave it out, or give"
            " engine mujoco-gpu"
        ).about("device", "engine")


def starting_note(engine: Engine, device: str | None) -> str:
    """Note for the line of progress if kernels have to be compiled first; empty otherwise.

    Args:
        engine: engine of the run.
        device: see `EvaluationSettings`.
    """
    if not engine.parallel:
        return ""
    from burg_drake.simulation import find_devices, kernels_are_compiled

    if kernels_are_compiled(find_devices(device)[0]):
        return ""
    return "compiling kernels, which takes up to three minutes, once"


def require_scene_for(engine: Engine, scene: Scene, station: Station) -> None:
    """Refuses objects and hands that an engine cannot simulate.

    Raises:
        InvalidInputError: an object has no convex pieces, or the hand's pads are not flat; see
            `MujocoTrial`.
    """
    if engine.simulator != "drake":
        from burg_drake.simulation import MujocoTrial

        _ = MujocoTrial(scene, station, engine=engine).complete_world


@dataclass(frozen=True)
class Decision(Findings):
    """Result of one stage for a grasp.

    Attributes:
        outcome: final outcome of the grasp; None passes it on to the next stage.
        motion: the arm's motion, if later stages need it.
        device: see `Verdict`.
    """

    outcome: Outcome | None = None
    motion: ArmPath | Plan | None = field(default=None, compare=False, repr=False, kw_only=True)
    device: str = field(default="", compare=False, kw_only=True)


class Screen(NamedTuple):
    """A stage that takes many grasps at once; its decisions do not depend on the batch.

    Attributes:
        stage: name of the stage.
        ask: returns the decision for each grasp.
        batch: batch size beyond which the cost per grasp hardly falls.
    """

    stage: Stage
    ask: Callable[[Sequence[Candidate]], list[Decision]]
    batch: int


Decide = Callable[[Candidate, "ArmPath | Plan | None"], Decision]
"""A stage that takes one grasp, with the arm's motion if an earlier stage has found one."""


class Judge(Protocol):
    """Stages in the order in which a grasp passes them.

    The last stage always decides, or the last screen if there is no stage.
    """

    @property
    def screens(self) -> Sequence[Screen]:
        """The first stages."""

    @property
    def stages(self) -> Sequence[tuple[Stage, Decide]]:
        """Name and function of each later stage."""


@dataclass(frozen=True)
class JudgingState:
    """Decisions on a grasp by the stages so far; all but the last pass the grasp on.

    Attributes:
        decisions: the decisions.
        cpu: CPU time by stage [s]; an equal share if grasps were screened together.
    """

    decisions: tuple[Decision, ...] = ()
    cpu: Mapping[Stage, float] = field(default_factory=dict)

    @property
    def outcome(self) -> Outcome | None:
        """Outcome of the grasp; None if the last stage passes it on."""
        return self.decisions[-1].outcome if self.decisions else None

    def verdict(self) -> Verdict:
        """The verdict; only valid if the last decision has an outcome."""
        return _make_verdict(self.decisions, list(self.cpu)[-1], self.cpu)

    def with_decision(self, stage: Stage, decision: Decision, cpu: float) -> JudgingState:
        """Copy with one more decision."""
        return JudgingState((*self.decisions, decision), {**self.cpu, stage: cpu})


def screen_grasps(
    judge: Judge, grasps: Sequence[tuple[Candidate, JudgingState]]
) -> list[JudgingState]:
    """Sends many grasps through their next screen at once.

    Args:
        judge: the stages.
        grasps: grasps and the decisions on them so far; all have passed the same screens.

    Returns:
        State of each grasp with the new decision. On an error each half is screened alone, and so
        on; the grasps that cause the error end in `simulation_failed`.

    Raises:
        DeviceError: the device of an engine with parallel trials failed.
        TaskCancelled: the task was cancelled.
    """
    if not grasps:
        return []
    screen = judge.screens[len(grasps[0][1].decisions)]
    start = time.process_time()
    try:
        asked = [_with_found_lift(candidate, state.decisions) for candidate, state in grasps]
        decisions = screen.ask(asked)
    except (TaskCancelled, DeviceError):
        raise
    except Exception as error:
        if len(grasps) > 1:
            half = len(grasps) // 2
            return screen_grasps(judge, grasps[:half]) + screen_grasps(judge, grasps[half:])
        decisions = [Decision(Outcome.SIMULATION_FAILED, reason=one_line(error))]
    share = (time.process_time() - start) / len(grasps)
    return [
        before.with_decision(screen.stage, decision, share)
        for (_, before), decision in zip(grasps, decisions, strict=True)
    ]


def judge_grasp(
    judge: Judge,
    candidate: Candidate,
    screened: JudgingState | None = None,
    announce: Callable[[Stage], None] = report_progress,
) -> Verdict:
    """Sends a grasp through the stages.

    Args:
        judge: the stages.
        candidate: the grasp.
        screened: decisions of the screens that the grasp has passed already.
        announce: called with each stage before it begins; a worker reports it as progress.

    Returns:
        The verdict. An error inside a stage ends in `simulation_failed` with its message.
    """
    state = screened or JudgingState()
    for screen in judge.screens[len(state.decisions) :]:
        if state.outcome is None:
            announce(screen.stage)
            (state,) = screen_grasps(judge, [(candidate, state)])
    for stage, decide in judge.stages:
        if state.outcome is not None:
            break
        announce(stage)
        motion = next((d.motion for d in reversed(state.decisions) if d.motion), None)
        start = time.process_time()
        try:
            decision = decide(_with_found_lift(candidate, state.decisions), motion)
        except Exception as error:  # any error of Drake becomes the outcome of this grasp
            decision = Decision(Outcome.SIMULATION_FAILED, reason=one_line(error))
        state = state.with_decision(stage, decision, time.process_time() - start)
    if state.outcome is None:
        raise ValueError("the last stage of a judge has to decide")
    return state.verdict()


def _with_found_lift(candidate: Candidate, decisions: Sequence[Decision]) -> Candidate:
    """Sets the lift of a grasp to the length that an earlier stage has found, unless it has one."""
    if candidate.lift is not None:
        return candidate
    name = MarginNames.lift_height
    found = [d.margins[name] for d in decisions if name in d.margins]
    return replace(candidate, lift=found[-1]) if found else candidate


def _make_verdict(
    decisions: Sequence[Decision], stage: Stage, cpu: Mapping[Stage, float]
) -> Verdict:
    last, device = decisions[-1].outcome, decisions[-1].device
    assert last is not None
    decided = stage if last is Outcome.SIMULATION_FAILED else last.stage
    return Verdict(last, decided, cpu=cpu, device=device, **merge_findings(decisions))


def trial_decision(result: TrialResult) -> Decision:
    """Decision of an executed trial, of the hand alone or of the arm."""
    return Decision(result.outcome, **result.of_trial() | {"margins": result.margins.of_trial()})


def trial_verdict(result: TrialResult) -> Verdict:
    """Verdict of a trial that went through no other stage."""
    return _make_verdict([trial_decision(result)], Stage.EXECUTED, {})


class FreeLift:
    """Collision-free lift of the hand alone, for motions that allow less than the whole lift.

    Checks the swept volume of the hand in a scene: geometry only, no arm, no time steps.

    Args:
        scene: the scene.
        station: the station with the hand.
        motion: motion of the hand.
    """

    def __init__(self, scene: Scene, station: Station, motion: GraspMotion) -> None:
        from burg_drake.motion import HandSweep, lift_heights

        self._sweep = HandSweep(scene, station, motion)
        self._heights = lift_heights(motion.shortest, motion.lift_height)

    def lengths(self, instance: str, X_WG: Array, width: Array) -> Array:
        """(N,) lengths of collision-free lifts of the hand with the target [m].

        The shortest allowed lift if even that one collides; the trial then finds the collision.

        Args:
            instance: the target.
            X_WG: (N, 4, 4) grasps in the world.
            width: (N,) distance between the pads [m]; NaN for an open hand.
        """
        low = np.zeros(len(X_WG), dtype=int)
        high = np.full(len(X_WG), len(self._heights))
        level = high - 1  # most often there is room for the whole lift
        while (high - low > 1).any():
            for k in np.unique(level[high - low > 1]):
                rows = np.flatnonzero((level == k) & (high - low > 1))
                sweep = self._sweep.lift(instance, X_WG[rows], width[rows], self._heights[k])
                low[rows[sweep.free]], high[rows[~sweep.free]] = k, k
            level = (low + high) // 2
        return np.asarray(self._heights[low])


def hand_screen(
    clearance: HandClearance, X_WO: Mapping[str, Array], free_lift: FreeLift | None = None
) -> Screen:
    """Screen of the stage `clear`.

    Args:
        clearance: clearance of the open hand in the scene.
        X_WO: (4, 4) poses of the free instances by name.
        free_lift: finds the lift lengths of clear hands, if no later stage does.
    """

    def ask(grasps: Sequence[Candidate]) -> list[Decision]:
        decisions = [Decision()] * len(grasps)
        for instance, chosen in rows_by_instance(grasps).items():
            X_WG = grasps_in_world([grasps[k] for k in chosen], X_WO)
            results = clearance.check_all(instance, X_WG)
            lifts = np.full(len(chosen), np.nan)
            clear = np.flatnonzero([result.outcome is None for result in results])
            if free_lift is not None and len(clear):
                width = np.array([grasps[chosen[k]].width for k in clear])
                lifts[clear] = free_lift.lengths(instance, X_WG[clear], width)
            for k, result, lift in zip(chosen, results, lifts.tolist(), strict=True):
                margins = {"overlap": result.overlap, "clearance": result.clearance}
                if math.isfinite(lift):
                    margins[MarginNames.lift_height] = lift
                decisions[k] = Decision(result.outcome, blocker=result.blocker, margins=margins)
        return decisions

    return Screen(Stage.CLEAR, ask, 512)  # a grasp takes about 0.025 ms in such a batch


def arm_screen(reach: ArmReach, X_WO: Mapping[str, Array], *, motions: bool = False) -> Screen:
    """Screen of the stages `reachable` and `planned` together.

    Args:
        reach: the arm in the scene.
        X_WO: (4, 4) poses of the free instances by name.
        motions: whether later stages need the arm's motions.
    """

    def ask(grasps: Sequence[Candidate]) -> list[Decision]:
        results = reach.check_all(
            [grasp.instance for grasp in grasps],
            grasps_in_world(grasps, X_WO),
            np.array([grasp.width for grasp in grasps]),
        )
        return [_reach_decision(result, motions) for result in results]

    return Screen(Stage.REACHABLE, ask, 128)  # as many as `ArmReach` judges together


def rows_by_instance(grasps: Sequence[Candidate]) -> dict[str, list[int]]:
    """Indices of grasps by the names of their targets."""
    rows: dict[str, list[int]] = {}
    for k, grasp in enumerate(grasps):
        rows.setdefault(grasp.instance, []).append(k)
    return rows


def grasps_in_world(grasps: Sequence[Candidate], X_WO: Mapping[str, Array]) -> Array:
    """(N, 4, 4) grasps in the world frame.

    Multiplied one by one: products of stacked matrices may differ in the last bit.
    """
    return np.array([X_WO[grasp.instance] @ grasp.X_OG for grasp in grasps]).reshape(-1, 4, 4)


def _reach_decision(result: Reach, motions: bool) -> Decision:
    margins = {
        "arm_clearance": result.clearance,
        "joint_excess": result.excess,
        MarginNames.lift_height: result.lift,
    }
    return Decision(
        result.outcome,
        blocker=result.blocker,
        reason=result.reason,
        margins={name: float(v) for name, v in margins.items() if math.isfinite(v)},
        q_grasp=() if result.q_grasp is None else tuple(result.q_grasp.tolist()),
        q_pregrasp=() if result.q_pregrasp is None else tuple(result.q_pregrasp.tolist()),
        motion=result.path if motions else None,
    )


def build_hand_clearance(scene: Scene, station: Station) -> tuple[HandClearance, dict[str, Array]]:
    """Clearance of the open hand, and poses of the instances; the arguments of `hand_screen`."""
    from burg_drake.grasping import HandClearance
    from burg_drake.station import build_station_diagram

    diagram = build_station_diagram(scene, station, robot="hand")
    return HandClearance(diagram), {name: diagram.X_WO(name) for name in scene.instances}


def arm_reach(
    scene: Scene, station: Station, motion: GraspMotion, *, exact: bool = True
) -> ArmReach:
    """Reachability checks of the arm in the scene.

    Args:
        scene, station: scene, and station with the arm.
        motion: motion of the hand, as in a trial.
        exact: see `ReachSettings`.
    """
    from burg_drake.motion import ArmReach

    return ArmReach(scene, station, settings=arm_settings(motion, exact=exact))


def arm_settings(motion: GraspMotion, *, exact: bool = True) -> ReachSettings:
    """Settings of `arm_reach`."""
    from burg_drake.motion import ReachSettings

    return ReachSettings(motion=motion, exact=exact)


class StationJudge:
    """Judges grasps on a station.

    Attributes:
        screens, stages: see `Judge`.
        trial: executes the grasps.
        plan: last plan that the arm has executed; None if there is none.
    """

    def __init__(
        self,
        screens: list[Screen],
        stages: list[tuple[Stage, Decide]],
        trial: GraspTrial[Any],
    ) -> None:
        self.screens = screens
        self.stages = stages
        self.trial = trial
        self.plan: Plan | None = None


class HandJudge(StationJudge):
    """Executes grasps with the hand alone; in mode `reach` only grasps that the arm can execute.

    An engine with parallel trials takes many grasps at once, as a screen does, and decides each.
    """

    def __init__(
        self,
        scene: Scene,
        station: Station,
        *,
        engine: Engine,
        mode: Literal["hand", "reach"],
        settings: TrialSettings,
        device: str | None = None,
    ) -> None:
        """Builds the diagrams that all grasps share; see `build_judge`."""
        from burg_drake.simulation import BatchTrial, hand_trial_of
        from burg_drake.station import instance_pose

        if engine.parallel:
            self._batch = BatchTrial(
                scene, station, engine=engine, settings=settings, device=device
            )
            self._trial: HandTrial | MujocoTrial = self._batch.single
        else:
            self._trial = hand_trial_of(scene, station, engine, settings=settings)
        motion = self._trial.motion
        X_WO = {name: instance_pose(scene, station, name) for name in scene.instances}
        self._lifts = settings.shake is None
        shortened = mode == "hand" and self._lifts and motion.shortest < motion.lift_height
        free_lift = FreeLift(scene, station, motion) if shortened else None
        screens = [hand_screen(self._trial.clearance, X_WO, free_lift)]
        if mode == "reach":
            screens.append(arm_screen(arm_reach(scene, station, motion), X_WO))
        stages: list[tuple[Stage, Decide]] = [(Stage.EXECUTED, self._execute)]
        if engine.parallel:
            screens.append(Screen(Stage.EXECUTED, self._execute_all, self._batch.batch_size))
            stages = []
        super().__init__(screens, stages, self._trial)

    def _execute(self, grasp: Candidate, motion: ArmPath | Plan | None) -> Decision:
        result = self._trial.run(
            grasp.instance,
            grasp.X_OG,
            friction=grasp.friction,
            mass=grasp.mass,
            lift=self._lift_of(grasp),
        )
        return self._decision(grasp, result)

    def _execute_all(self, grasps: Sequence[Candidate]) -> list[Decision]:
        """Executes many grasps in parallel."""

        def column(values: Iterable[float | None]) -> Array:
            return np.array([math.nan if v is None else v for v in values])

        decisions: list[Decision] = [Decision()] * len(grasps)
        for instance, rows in rows_by_instance(grasps).items():
            chosen = [grasps[k] for k in rows]
            results = self._batch.run(
                instance,
                np.array([grasp.X_OG for grasp in chosen]),
                friction=column(grasp.friction for grasp in chosen),
                mass=column(grasp.mass for grasp in chosen),
                lift=np.array([self._lift_of(grasp) for grasp in chosen]),
                known_clear=True,
                progress=partial(report_progress, Stage.EXECUTED),
            )
            for k, grasp, result in zip(rows, chosen, results, strict=True):
                device = ONE_BY_ONE if result.on_cpu else self._batch.device
                decisions[k] = self._decision(grasp, result, device)
        return decisions

    def _lift_of(self, grasp: Candidate) -> float:
        return self._trial.motion.lift_height if grasp.lift is None else grasp.lift

    def _decision(self, grasp: Candidate, result: TrialResult, device: str = "") -> Decision:
        decision = trial_decision(result)
        lift = {MarginNames.lift_height: self._lift_of(grasp)} if self._lifts else {}
        return replace(decision, margins={**decision.margins, **lift}, device=device)


class ArmJudge(StationJudge):
    """Plans the arm's motions, and executes them with the whole arm."""

    def __init__(
        self, scene: Scene, station: Station, *, engine: Engine, settings: TrialSettings
    ) -> None:
        """Builds the diagrams that all grasps share; see `build_judge`."""
        from burg_drake.motion import Planner
        from burg_drake.simulation import ArmTrial

        hand, X_WO = build_hand_clearance(scene, station)
        self._trial = ArmTrial(scene, station, engine=engine, settings=settings, clearance=hand)
        reach = arm_reach(scene, station, self._trial.motion)
        self._planner = Planner(reach)
        super().__init__(
            [hand_screen(hand, X_WO), arm_screen(reach, X_WO, motions=True)],
            [(Stage.PLANNED, self._time_plan), (Stage.EXECUTED, self._execute)],
            self._trial,
        )

    def _time_plan(self, grasp: Candidate, motion: ArmPath | Plan | None) -> Decision:
        assert isinstance(motion, ArmPath)
        plan = self._planner.time(grasp.instance, motion, grasp.width)
        return Decision(margins={"duration": plan.duration}, motion=plan)

    def _execute(self, grasp: Candidate, motion: ArmPath | Plan | None) -> Decision:
        assert isinstance(motion, Plan)
        self.plan = motion
        result = self._trial.run(
            grasp.instance, grasp.X_OG, motion, friction=grasp.friction, mass=grasp.mass
        )
        return trial_decision(result)


def build_judge(
    scene: Scene,
    station: Station,
    *,
    engine: Engine,
    mode: Mode,
    settings: TrialSettings | None = None,
    device: str | None = None,
) -> StationJudge:
    """Builds the judge of a mode, and the diagrams that all grasps share.

    Args:
        scene, station: scene and station to build.
        engine: physics engine of the trials.
        mode: mode of the run; all but `hand` need a station with an arm.
        settings: settings of the trial's phases; defaults if None. Without a motion in them, the
            station's is used.
        device: device of an engine with parallel trials; see `BatchTrial`.

    Raises:
        InvalidInputError: the engine does not support arms, an object or the hand.
        MissingDependencyError: the engine is not installed.
    """
    from burg_drake.simulation import TrialSettings

    require_engine_for(engine, mode)
    settings = TrialSettings() if settings is None else settings
    if mode == "arm":
        return ArmJudge(scene, station, engine=engine, settings=settings)
    return HandJudge(scene, station, engine=engine, mode=mode, settings=settings, device=device)


@dataclass(frozen=True)
class StationJudgeFactory:
    """Builds the `StationJudge` of a worker process; see `build_judge`."""

    scene: Scene
    station: Station
    engine: Engine
    mode: Mode
    settings: TrialSettings | None = None
    device: str | None = None

    def __call__(self) -> StationJudge:
        return build_judge(
            self.scene,
            self.station,
            engine=self.engine,
            mode=self.mode,
            settings=self.settings,
            device=self.device,
        )
