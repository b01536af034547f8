"""Which grasps of a set the arm can execute in a scene, and what hinders it at the others."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from burg_drake.core import InvalidInputError, one_line, quaternion_from_rotation
from burg_drake.core.grasps import (
    ARM_SCREEN_MARGINS,
    LIFT_HEIGHT,
    GraspSet,
    Outcome,
    Stage,
    TableShape,
    Verdict,
)
from burg_drake.core.paths import require_name
from burg_drake.core.terminal import STARTING, Listener, Progress, ProgressMeter, Reporter
from burg_drake.evaluation.candidates import (
    INSTANCE,
    Candidate,
    Candidates,
    given_candidates,
)
from burg_drake.evaluation.grasp_sets import by_names, set_documents
from burg_drake.evaluation.records import Columns, Journal, columns_of_verdicts, input_of, numbers
from burg_drake.evaluation.stages import (
    Decide,
    Decision,
    arm_reach,
    arm_screen,
    arm_settings,
    hand_alone,
    hand_screen,
)
from burg_drake.evaluation.store import PlanFolder, PlanOutput, plans_document
from burg_drake.evaluation.workers import judge_all
from burg_drake.motion.lines import ReachSettings
from burg_drake.motion.plans import Plan
from burg_drake.motion.reach import Witness
from burg_drake.scene.document import Scene, SceneLike, as_scene
from burg_drake.station.document import GraspMotion, Station, StationLike, as_station

YES = Outcome.REACHABLE
ANSWERS = tuple(outcome for outcome in Outcome if outcome is not Outcome.SIMULATION_FAILED)
"""What becomes of a grasp, unless the computation itself fails."""
MARGIN_COLUMNS = (
    "clearance",
    *(name for name in ARM_SCREEN_MARGINS if name != LIFT_HEIGHT),
    LIFT_HEIGHT,
)
"""Margins of a verdict that become columns; NaN where they are not defined."""


def reach(
    scene: SceneLike,
    station: StationLike,
    grasps: GraspSet | Mapping[str, GraspSet],
    *,
    motion: GraspMotion | None = None,
    exact: bool = True,
    plans: str | Path | PlanOutput | None = None,
    workers: int | None = None,
    progress: bool | Listener = False,
) -> GraspSet:
    """Asks of every grasp whether the arm can execute it, without a trial.

    That is: the open hand is clear, also on the straight approach, and with the target in it on the
    straight retreat and lift; the arm can follow them; and it finds a way from home to where they
    begin.

    Example::

        grasps = burg.sample_grasps("tabletop_six", "panda_tabletop", 50)
        judged = burg.reach("tabletop_six", "panda_tabletop", grasps)
        good = judged.select(judged.column("outcome") == "reachable")

    Args:
        scene, station: as loaded, or references for `load_scene` and `load_station`.
        grasps: in the frames of their objects. A set goes to the instances that its column
            `instance` names, or else to all instances of its objects; a mapping has sets by
            instance, such as those of `read_grasps`.
        motion: how the hand goes to a grasp and away from it; as the station says if None.
        exact: whether each yes is checked by Drake's `CollisionChecker`; without, it is a
            screening, several times faster.
        plans: folder that gets the timed motion of each grasp that the arm can execute, which the
            same call goes on with if it was interrupted; and more of it, see `PlanOutput`.
        workers: number of processes; as many as there are processors if None.
        progress: True shows a bar on standard error; a function gets the events.

    Returns:
        The grasps by instance in the scene's order, each one once on its instance, with columns:
        `instance`; `outcome`, `reachable` or what hinders the arm; `blocker`; `reason`, why there
        is no outcome, or no plan of what is reachable, should a computation fail; `clearance`
        of the open hand at the grasp [m]; `arm_clearance` [m] and `joint_excess` [rad], see
        `core.grasps.Margins`; `lift_height` [m], as asked or as far as there is room;
        `q_grasp_1` and so on, `q_pregrasp_1` and so on: the arm there [rad], NaN where there is
        none; and `cpu` [s]. Answers do not depend on the batch, the order or the number of workers.
        The provenance tells documents, versions and settings.

    Raises:
        InvalidInputError: the station has no arm, or one that stands in something, collides in
            its home posture, or does not reach the board; a set does not fit the scene; the folder
            cannot be written, or holds something else, or plans of something else.
        UnknownNameError: a reference, instance or object that does not exist.
        SimulationError: the worker processes die.
    """
    from burg_drake.motion.workspace import require_usable_arm

    scene, station = as_scene(scene), as_station(station)
    if station.document.arm is None:
        raise InvalidInputError(f"station {station.name!r} has no arm; give a station with an arm")
    motion = motion or station.document.motion
    given = by_names(scene, grasps) if isinstance(grasps, GraspSet) else grasps
    candidates = given_candidates(scene, given)
    require_usable_arm(scene, station)
    settings = arm_settings(motion, exact=exact)
    output = PlanOutput(plans) if isinstance(plans, (str, Path)) else plans
    with Reporter(progress) as reporter:
        if output is None:
            factory = ReachJudgeFactory(scene, station, motion, exact)
            verdicts = _judged(candidates, factory, workers, reporter)
        else:
            document = plans_document(
                input_of(scene, "scenes"),
                input_of(station, "stations"),
                candidates,
                numbers(settings),
                exact=exact,
                format=output.format,
            )
            folder = PlanFolder(Path(output.folder), document)
            factory = ReachJudgeFactory(scene, station, motion, exact, folder)
            with folder.opened() as journal:
                known = folder.finished(retry_failed=output.retry_failed)
                _judged(candidates, factory, workers, reporter, known, journal)
                verdicts = folder.verdicts()  # with the digits that a later call will find
    rows = [verdicts[id] for id in candidates.id]
    return _with_columns(candidates, rows, scene, station, settings)


def _judged(
    candidates: Candidates,
    factory: ReachJudgeFactory,
    workers: int | None,
    reporter: Reporter,
    known: Mapping[str, Verdict] = MappingProxyType({}),
    journal: Journal | None = None,
) -> dict[str, Verdict]:
    """Verdicts by grasp id; each that is not known is written to the journal at once."""
    verdicts = dict(known)
    left = [candidate for candidate in candidates if candidate.id not in verdicts]
    outcomes = Counter(v.outcome for v in verdicts.values())
    done, total = len(candidates) - len(left), len(candidates)
    event = Progress(STARTING, done, total, outcomes=outcomes, counted_outcome=YES)
    pace = ProgressMeter(reporter.show, event, "judging")
    with closing(judge_all(left, factory, workers=workers)) as judged:
        for candidate, verdict in judged:
            verdicts[candidate.id] = verdict
            if journal is not None:
                journal.append(candidate.id, verdict)
            pace.step(outcome=verdict.outcome)
    return verdicts


class ReachJudge:
    """Asks whether the arm can execute a grasp.

    Attributes:
        screens, stages: see `judge.Judge`.
    """

    def __init__(self, factory: ReachJudgeFactory) -> None:
        from burg_drake.motion import Planner

        scene, station = factory.scene, factory.station
        hand, X_WO = hand_alone(scene, station)
        arm = arm_reach(scene, station, factory.motion, exact=factory.exact)
        wanted = factory.plans is not None
        self.screens = (hand_screen(hand, X_WO), arm_screen(arm, X_WO, motions=wanted))
        self.stages: tuple[tuple[Stage, Decide], ...] = ((Stage.PLANNED, self._plan),)
        self._plans = factory.plans
        self._planner = Planner(arm) if wanted else None

    def _plan(self, grasp: Candidate, motion: Witness | Plan | None) -> Decision:
        if self._planner is None or self._plans is None:
            return Decision(YES)
        assert isinstance(motion, Witness)
        try:
            plan = self._planner.time(grasp.instance, motion, grasp.width)
            require_name(grasp.id)
            path = self._plans.plan(grasp.id)
            (plan.to_csv if path.suffix == ".csv" else plan.to_json)(path)
        except Exception as error:  # the grasp is reachable, whatever becomes of its plan
            return Decision(YES, reason=f"no plan: {one_line(error)}")
        return Decision(YES, margins={"duration": plan.duration})


@dataclass(frozen=True)
class ReachJudgeFactory:
    """What a worker process needs to build its `ReachJudge`.

    Attributes:
        scene, station: where the grasps are.
        motion, exact: as in `reach`.
        plans: where plans go, if they are wanted.
    """

    scene: Scene
    station: Station
    motion: GraspMotion
    exact: bool = True
    plans: PlanFolder | None = None

    def __call__(self) -> ReachJudge:
        return ReachJudge(self)


def _with_columns(
    candidates: Candidates,
    rows: Sequence[Verdict],
    scene: Scene,
    station: Station,
    settings: ReachSettings,
) -> GraspSet:
    arm = station.document.arm
    assert arm is not None
    columns: dict[str, Any] = {
        INSTANCE: candidates.instance,
        "outcome": _texts([v.outcome.value if v.outcome in ANSWERS else "" for v in rows]),
        "blocker": _texts([v.blocker for v in rows]),
        "reason": _texts([v.reason for v in rows]),
    }
    for name in MARGIN_COLUMNS:
        columns[name] = np.array([v.margins.get(name, np.nan) for v in rows], dtype=float)
    if any("duration" in v.margins for v in rows):
        columns["duration"] = np.array([v.margins.get("duration", np.nan) for v in rows])
    columns |= columns_of_verdicts(rows, "posture", TableShape("reach", joints=len(arm.home)))
    columns["cpu"] = np.array([sum(v.cpu.values()) for v in rows], dtype=float)
    objects = sorted(set(candidates.grasps.object.tolist()))
    provenance = {
        **candidates.grasps.provenance,
        **set_documents(scene.library, scene, station, objects),
        "reach": {**numbers(settings), "exact": settings.exact},
    }
    return replace(candidates.grasps, provenance=provenance).with_columns(**columns)


def reach_columns(grasps: GraspSet) -> Columns:
    """What `reach` returns as a table: ids as in runs, poses as quaternions, all its columns."""
    wxyz = quaternion_from_rotation(grasps.X_OG[:, :3, :3]) if len(grasps) else np.empty((0, 4))
    return {
        "id": _texts(Candidates(grasps, grasps.column(INSTANCE)).id),
        INSTANCE: grasps.column(INSTANCE),
        "object": grasps.object,
        "width": grasps.width,
        "score": grasps.score,
        **{name: grasps.X_OG[:, k, 3] for k, name in enumerate("xyz")},
        **{name: wxyz[:, k] for k, name in enumerate(("qw", "qx", "qy", "qz"))},
        **{name: values for name, values in grasps.columns.items() if name != INSTANCE},
    }


def _texts(values: Sequence[str]) -> np.ndarray:
    return np.array(values, dtype=np.str_)
