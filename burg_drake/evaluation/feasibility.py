"""Feasibility of grasps for the arm in a scene (`reach`), and folders of arm plans."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any, Literal

import numpy as np

from burg_drake.core import (
    STARTING_PHASE,
    GraspSet,
    InvalidInputError,
    Listener,
    MarginNames,
    Outcome,
    Progress,
    ProgressMeter,
    Reporter,
    Stage,
    TableShape,
    Verdict,
    content_hash,
    ensure_writable_folder,
    load_document,
    one_line,
    remove_unfinished,
    require_name,
    save_document,
    software_versions,
)
from burg_drake.evaluation.candidates import (
    INSTANCE_COLUMN,
    Candidate,
    Candidates,
    given_candidates,
)
from burg_drake.evaluation.executor import judge_all
from burg_drake.evaluation.grasp_sets.given_grasps import group_by_names
from burg_drake.evaluation.grasp_sets.input import set_documents
from burg_drake.evaluation.journal import JOURNAL_FILE, Journal, read_journal
from burg_drake.evaluation.judge import (
    Decide,
    Decision,
    arm_reach,
    arm_screen,
    arm_settings,
    build_hand_clearance,
    hand_screen,
)
from burg_drake.evaluation.results_table import Columns, columns_of_verdicts, pose_columns
from burg_drake.evaluation.run_document import HASH_DIGITS, Input, input_of, settings_numbers
from burg_drake.evaluation.run_identity import (
    identity_differences,
    input_difference,
    setting_differences,
)
from burg_drake.evaluation.trial_origin import motion_text, read_motion, without_motion
from burg_drake.motion import ArmPath, Plan, ReachSettings
from burg_drake.scene import Scene, SceneLike, as_scene
from burg_drake.station import GraspMotion, Station, StationLike, as_station

PlanFormat = Literal["json", "csv"]
PLANS_FILE = "plans.yaml"


@dataclass(frozen=True)
class PlanOutput:
    """Output folder and format of the plans of `reach`.

    Attributes:
        folder: gets the timed motion of each grasp that the arm can execute, as
            `INSTANCE-GRASP.json`, see `Plan.to_json`. It is new, empty, or left by an interrupted
            call, which the same call continues: finished grasps are kept, except those whose
            worker process was killed from outside or whose plan is missing.
        format: `csv` for tables, each with a description of its columns in a file beside it; see
            `Plan.to_csv`. `load_plan` reads both.
        retry_failed: retry all grasps that an earlier call with this folder could not judge.
    """

    folder: str | Path
    format: PlanFormat = "json"
    retry_failed: bool = False


@dataclass(frozen=True, kw_only=True)
class PlansDocument:
    """A folder of arm motions, one for each grasp (`plans.yaml`).

    Attributes:
        scene: the scene.
        station: the station.
        grasps: number of grasps.
        content: hash of the grasps.
        arm: settings of the search for arm motions, in SI units.
        exact: whether Drake's collision checker confirmed each motion.
        format: format of the motions.
        versions: versions of the software and the machine.
    """

    version: int = 1
    scene: Input
    station: Input
    grasps: int
    content: str
    arm: dict[str, float]
    exact: bool
    format: PlanFormat
    versions: dict[str, str]


@dataclass(frozen=True)
class PlanFolder:
    """A folder of plans.

    Attributes:
        path: path of the folder.
        document: inputs and settings of the plans.
    """

    path: Path
    document: PlansDocument

    def plan_path(self, id: str) -> Path:
        """Path of the plan of a grasp."""
        return self.path / f"{id}.{self.document.format}"

    @contextmanager
    def opened(self) -> Iterator[Journal]:
        """Creates or reopens the folder, and locks it while the context is open.

        Raises:
            InvalidInputError: the folder cannot be written, holds other files or plans of other
                inputs, or another process is writing it.
        """
        header = "Record of the plans in this folder; written by the program."
        self._require_only_plans()
        ensure_writable_folder(self.path)
        with Journal(self.path / JOURNAL_FILE) as journal:
            document = self.path / PLANS_FILE
            if document.exists():
                self._require_same_inputs(load_document(document, PlansDocument))
            else:
                save_document(self.document, document, header)
            remove_unfinished(self.path)
            yield journal

    def verdicts(self) -> dict[str, Verdict]:
        """Verdicts in the journal, by grasp id."""
        return read_journal(self.path / JOURNAL_FILE)

    def finished(self, *, retry_failed: bool = False) -> dict[str, Verdict]:
        """Final verdicts by grasp id; a reachable grasp also needs its plan in the folder.

        Args:
            retry_failed: see `Verdict.is_open`.
        """
        return {
            id: verdict
            for id, verdict in self.verdicts().items()
            if not verdict.is_open(retry_failed=retry_failed)
            and (verdict.outcome is not Outcome.REACHABLE or self.plan_path(id).is_file())
        }

    def _require_only_plans(self) -> None:
        """Refuses a folder with other files, to keep plans apart from them."""
        if not self.path.is_dir() or (self.path / PLANS_FILE).exists():
            return
        held = sorted(item.name for item in self.path.iterdir() if not item.name.startswith("."))
        journal = self.path / JOURNAL_FILE
        begun = held == [JOURNAL_FILE] and journal.is_file() and journal.stat().st_size == 0
        if held and not begun:
            raise InvalidInputError(
                f"folder {self.path} has {held[0]} in it, but no {PLANS_FILE}; plans"
                " need a folder of their own: choose another one, or empty it"
            )

    def _require_same_inputs(self, there: PlansDocument) -> None:
        here = self.document
        counts = f"grasps are {there.grasps} there, {here.grasps} here"
        same = there.grasps == here.grasps
        words = {
            "scene": [input_difference("scene", there.scene, here.scene, behind="objects")],
            "station": [input_difference("station", there.station, here.station)],
            "grasps": ["the number of grasps is the same, but not the grasps" if same else counts],
            "settings of the arm": setting_differences(
                _other_arm_settings(there), _other_arm_settings(here)
            ),
        }
        found = identity_differences(_plans_identity(there), _plans_identity(here), words)
        if found:
            raise InvalidInputError(
                f"folder {self.path} has plans of another evaluation ({'; '.join(found)}"
                "); choose another one, or delete it"
            )


def plans_document(
    scene: Input,
    station: Input,
    candidates: Candidates,
    arm: dict[str, float],
    *,
    exact: bool,
    format: PlanFormat,
) -> PlansDocument:
    """Document of a call's inputs and settings, with the installed versions."""
    return PlansDocument(
        scene=scene,
        station=station,
        grasps=len(candidates),
        content=candidates.content,
        arm=arm,
        exact=exact,
        format=format,
        versions=software_versions(),
    )


def _plans_identity(document: PlansDocument) -> dict[str, str]:
    """Properties that two calls must share to work on the same plans, as texts by topic."""
    return {
        "scene": f"content {document.scene.content[:HASH_DIGITS]}",
        "station": f"content {document.station.content[:HASH_DIGITS]}",
        "grasps": f"{document.grasps}, content {document.content[:HASH_DIGITS]}",
        "check": "exact" if document.exact else "screening",
        "settings of the arm": content_hash(_other_arm_settings(document))[:HASH_DIGITS],
        "motion": motion_text(read_motion(document.arm)),
        "format": document.format,
        "burg_drake": document.versions.get("burg_drake", ""),
        "drake": document.versions.get("drake", ""),
    }


def _other_arm_settings(document: PlansDocument) -> dict[str, float]:
    """Settings of the arm that have no topic of their own in `_plans_identity`."""
    return without_motion({k: v for k, v in document.arm.items() if k != "exact"})


REACH_MARGIN_COLUMNS = (
    "clearance",
    *(name for name in MarginNames.arm_screen if name != MarginNames.lift_height),
    MarginNames.lift_height,
)
"""Margins of a verdict that become columns; NaN where undefined."""


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
    """Checks for every grasp whether the arm can execute it, without a trial.

    A grasp is reachable if the open hand is free of collisions at the grasp and on the straight
    approach, and the hand with the target on the straight retreat and lift; if the arm can follow
    these lines; and if a path leads from the arm's home posture to the pregrasp.

    Example::

        grasps = burg.sample_grasps("tabletop_six", "panda_tabletop", 50)
        judged = burg.reach("tabletop_six", "panda_tabletop", grasps)
        good = judged.select(judged.column("outcome") == "reachable")

    Args:
        scene, station: as loaded, or references for `load_scene` and `load_station`.
        grasps: grasps in their objects' frames. A set goes to the instances that its column
            `instance` names, or else to all instances of its objects; a mapping has sets by
            instance, as `read_grasps` returns.
        motion: approach, retreat and lift of the hand; the station's if None.
        exact: whether Drake's `CollisionChecker` confirms each reachable grasp; otherwise the
            answers are those of a screening, which is several times faster.
        plans: folder that gets the timed motion of each grasp that the arm can execute; the same
            call continues an interrupted one. `PlanOutput` has more options.
        workers: number of processes; one per processor if None.
        progress: True shows a bar on standard error; a function gets the events.

    Returns:
        The grasps by instance in the scene's order, without duplicates, with columns: `instance`;
        `outcome`, `reachable` or the obstacle for the arm; `blocker`; `reason`, the error if a
        computation of the outcome or of the plan failed; `clearance` of the open hand at the grasp
        [m]; `arm_clearance` [m] and `joint_excess` [rad], see `Margins`; `lift_height` [m], the
        asked one or as far as there is room; `q_grasp_1` and so on, `q_pregrasp_1` and so on: the
        arm's configuration at grasp and pregrasp [rad], NaN if there is none; and `cpu` [s].
        Results do not depend on batch, order or number of workers. The provenance records
        documents, versions and settings.

    Raises:
        InvalidInputError: the station has no arm, or one that overlaps the scene, collides in its
            home posture, or does not reach the board; a set does not fit the scene; the folder
            cannot be written, or holds other files or plans of other inputs.
        UnknownNameError: a reference, instance or object does not exist.
        SimulationError: the worker processes die.
    """
    from burg_drake.motion import require_usable_arm

    scene, station = as_scene(scene), as_station(station)
    if station.document.arm is None:
        raise InvalidInputError(f"station {station.name!r} has no arm; give a station with an arm")
    motion = motion or station.document.motion
    given = group_by_names(scene, grasps) if isinstance(grasps, GraspSet) else grasps
    candidates = given_candidates(scene, given)
    require_usable_arm(scene, station)
    settings = arm_settings(motion, exact=exact)
    output = PlanOutput(plans) if isinstance(plans, (str, Path)) else plans
    with Reporter(progress) as reporter:
        if output is None:
            factory = ReachJudgeFactory(scene, station, motion, exact)
            verdicts = _judge_grasps(candidates, factory, workers, reporter)
        else:
            document = plans_document(
                input_of(scene, "scenes"),
                input_of(station, "stations"),
                candidates,
                settings_numbers(settings),
                exact=exact,
                format=output.format,
            )
            folder = PlanFolder(Path(output.folder), document)
            factory = ReachJudgeFactory(scene, station, motion, exact, folder)
            verdicts = plan_into_folder(
                folder,
                candidates,
                factory,
                workers,
                reporter,
                retry_failed=output.retry_failed,
            )
    rows = [verdicts[id] for id in candidates.id]
    return _add_columns(candidates, rows, scene, station, settings)


def plan_into_folder(
    folder: PlanFolder,
    candidates: Candidates,
    factory: ReachJudgeFactory,
    workers: int | None,
    reporter: Reporter,
    *,
    retry_failed: bool,
) -> dict[str, Verdict]:
    """Judges the grasps that a folder of plans lacks, and writes their plans.

    Args:
        folder: the folder.
        candidates: the grasps of the folder.
        factory: builds the judge that writes into it.
        workers: number of processes; one per processor if None.
        reporter: shows the progress.
        retry_failed: also retry grasps that an earlier call could not judge.

    Returns:
        Verdicts by grasp id, as a later call will read them from the journal.

    Raises:
        InvalidInputError: the folder cannot be written, or has plans of other inputs.
        SimulationError: the worker processes die.
    """
    with folder.opened() as journal:
        known = folder.finished(retry_failed=retry_failed)
        _judge_grasps(candidates, factory, workers, reporter, known, journal)
        return folder.verdicts()


def _judge_grasps(
    candidates: Candidates,
    factory: ReachJudgeFactory,
    workers: int | None,
    reporter: Reporter,
    known: Mapping[str, Verdict] = MappingProxyType({}),
    journal: Journal | None = None,
) -> dict[str, Verdict]:
    """Judges the grasps without a known verdict, and writes each new one to the journal at once.

    Returns:
        All verdicts by grasp id.
    """
    verdicts = dict(known)
    left = [candidate for candidate in candidates if candidate.id not in verdicts]
    outcomes = Counter(v.outcome for v in verdicts.values())
    done, total = len(candidates) - len(left), len(candidates)
    event = Progress(
        STARTING_PHASE, done, total, outcomes=outcomes, counted_outcome=Outcome.REACHABLE
    )
    meter = ProgressMeter(reporter.show, event, "judging")
    with closing(judge_all(left, factory, workers=workers)) as judged:
        for candidate, verdict in judged:
            verdicts[candidate.id] = verdict
            if journal is not None:
                journal.append(candidate.id, verdict)
            meter.step(outcome=verdict.outcome)
    return verdicts


class ReachJudge:
    """Judges whether the arm can execute a grasp.

    Attributes:
        screens, stages: see `Judge`.
    """

    def __init__(self, factory: ReachJudgeFactory) -> None:
        from burg_drake.motion import Planner

        scene, station = factory.scene, factory.station
        hand, X_WO = build_hand_clearance(scene, station)
        arm = arm_reach(scene, station, factory.motion, exact=factory.exact)
        with_plans = factory.plans is not None
        self.screens = (hand_screen(hand, X_WO), arm_screen(arm, X_WO, motions=with_plans))
        self.stages: tuple[tuple[Stage, Decide], ...] = ((Stage.PLANNED, self._plan),)
        self._plans = factory.plans
        self._planner = Planner(arm) if with_plans else None

    def _plan(self, grasp: Candidate, motion: ArmPath | Plan | None) -> Decision:
        if self._planner is None or self._plans is None:
            return Decision(Outcome.REACHABLE)
        assert isinstance(motion, ArmPath)
        try:
            plan = self._planner.time(grasp.instance, motion, grasp.width)
            require_name(grasp.id)
            path = self._plans.plan_path(grasp.id)
            (plan.to_csv if path.suffix == ".csv" else plan.to_json)(path)
        except Exception as error:  # the grasp is reachable even if its plan fails
            return Decision(Outcome.REACHABLE, reason=f"no plan: {one_line(error)}")
        return Decision(Outcome.REACHABLE, margins={"duration": plan.duration})


@dataclass(frozen=True)
class ReachJudgeFactory:
    """Builds the `ReachJudge` of a worker process.

    Attributes:
        scene, station: scene and station of the grasps.
        motion, exact: as in `reach`.
        plans: folder of the plans; None for no plans.
    """

    scene: Scene
    station: Station
    motion: GraspMotion
    exact: bool = True
    plans: PlanFolder | None = None

    def __call__(self) -> ReachJudge:
        return ReachJudge(self)


def _add_columns(
    candidates: Candidates,
    rows: Sequence[Verdict],
    scene: Scene,
    station: Station,
    settings: ReachSettings,
) -> GraspSet:
    arm = station.document.arm
    assert arm is not None
    failed = Outcome.SIMULATION_FAILED
    texts = {
        "outcome": ["" if v.outcome is failed else v.outcome.value for v in rows],
        "blocker": [v.blocker for v in rows],
        "reason": [v.reason for v in rows],
    }
    columns: dict[str, Any] = {
        INSTANCE_COLUMN: candidates.instance,
        **{name: np.array(values, dtype=np.str_) for name, values in texts.items()},
    }
    for name in REACH_MARGIN_COLUMNS:
        columns[name] = np.array([v.margins.get(name, np.nan) for v in rows], dtype=float)
    if any("duration" in v.margins for v in rows):
        columns["duration"] = np.array([v.margins.get("duration", np.nan) for v in rows])
    columns |= columns_of_verdicts(rows, "posture", TableShape("reach", joints=len(arm.home)))
    columns["cpu"] = np.array([sum(v.cpu.values()) for v in rows], dtype=float)
    objects = sorted(set(candidates.grasps.object.tolist()))
    provenance = {
        **candidates.grasps.provenance,
        **set_documents(scene.library, scene, station, objects),
        "reach": {**settings_numbers(settings), "exact": settings.exact},
    }
    return replace(candidates.grasps, provenance=provenance).with_columns(**columns)


def reach_columns(grasps: GraspSet) -> Columns:
    """Table of the grasps that `reach` returned: ids as in runs, quaternions, all its columns."""
    return {
        "id": np.array(Candidates(grasps, grasps.column(INSTANCE_COLUMN)).id, dtype=np.str_),
        INSTANCE_COLUMN: grasps.column(INSTANCE_COLUMN),
        "object": grasps.object,
        "width": grasps.width,
        "score": grasps.score,
        **pose_columns(grasps.X_OG),
        **{name: values for name, values in grasps.columns.items() if name != INSTANCE_COLUMN},
    }
