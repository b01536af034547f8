"""Timed robot motions of the trials: one file for each trial, named by the trial's number.

017_mug-3f2a.json or .csv    the motion of trial 17, with its target; see `motion.plan_files`
index.csv                    all trials with their files, or the reason why there is no motion
runs/KEY/                    the verdicts on the grasps of each run; a repeated call reuses them
"""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np

from burg_drake.core import (
    InvalidInputError,
    Listener,
    Outcome,
    Reporter,
    Verdict,
    atomic_write,
    ensure_writable_folder,
    remove_unfinished,
    require_name,
)
from burg_drake.evaluation import (
    Candidates,
    PlanFolder,
    PlanFormat,
    ReachJudgeFactory,
    Run,
    arm_settings,
    input_of,
    plan_into_folder,
    plans_document,
    read_motion,
    settings_numbers,
)
from burg_drake.experiment.trials.source_runs import Moved, load_sources
from burg_drake.experiment.trials.trial_sheet import RealTrial, load_trials
from burg_drake.station import StationLike, as_station

MOTION_INDEX_FILE = "index.csv"  # Table of the exported motions.


@dataclass(frozen=True)
class ExportedMotion:
    """Result of the motion planning for a trial.

    Attributes:
        number, block, run, grasp, instance, object: as in `RealTrial`.
        answer: `reachable`, or what hinders the arm.
        blocker: body in the way.
        reason: reason for a missing answer, or for a missing file of a reachable grasp.
        file: name of the file; empty if there is none.
        duration: duration of the motion, rounded to a millisecond [s]; None without one.
    """

    number: int
    block: int
    run: str
    grasp: str
    instance: str
    object: str
    answer: str
    blocker: str
    reason: str
    file: str
    duration: float | None


@dataclass(frozen=True)
class TrialPlans(PlanFolder):
    """Folder of a journal, with the plans in another folder, named by trial.

    Attributes:
        out: folder of the plans.
        stems: file names without suffix, by grasp id.
    """

    out: Path
    stems: Mapping[str, str]

    def plan_path(self, id: str) -> Path:
        """The file for the plan of a grasp."""
        return self.out / f"{self.stems[id]}.{self.document.format}"


def export_trials(
    path: str | Path,
    out: str | Path,
    *,
    format: PlanFormat = "json",
    station: StationLike | None = None,
    moved: Moved | None = None,
    retry_failed: bool = False,
    workers: int | None = None,
    progress: bool | Listener = False,
) -> list[ExportedMotion]:
    """Plans the motion of every trial and writes it to a file, as `reach` does.

    The hand moves as in the grasp's run. Results of an earlier call with the same trials are kept.

    Args:
        path: the trials file.
        out: folder for the plans.
        format: file format of the plans.
        station: station whose arm moves; the station of each run if None.
        moved: folders of runs in place of those in the file, by key.
        retry_failed: repeat all trials that an earlier call could not judge.
        workers: number of processes; as many as there are processors if None.
        progress: True shows a bar on standard error; a function gets the events.

    Returns:
        One row per trial, in the order of the trials file; also in index.csv.

    Raises:
        InvalidInputError: a run or grasp is missing or has changed, a station has no arm, or the
            folder cannot be written, or holds something else.
        SimulationError: the worker processes die.
    """
    sheet, out = load_trials(path), Path(out)
    for trial in sheet.trials:
        require_name(trial.grasp)
    runs = load_sources(sheet, path, moved=moved, only={trial.run for trial in sheet.trials})
    _require_export_folder(out)
    jobs = []
    for key, run in runs.items():
        trials = [trial for trial in sheet.trials if trial.run == key]
        folder = out / "runs" / key
        jobs.append((trials, _make_judge_factory(run, trials, folder, out, format, station)))
    ensure_writable_folder(out)
    remove_unfinished(out)
    rows: dict[int, ExportedMotion] = {}
    with Reporter(progress) as reporter:
        for trials, (factory, candidates) in jobs:
            plans = factory.plans
            assert isinstance(plans, TrialPlans)
            verdicts = plan_into_folder(
                plans, candidates, factory, workers or None, reporter, retry_failed=retry_failed
            )
            for trial in trials:
                rows[trial.number] = _make_row(trial, verdicts[trial.grasp], plans)
    ordered = [rows[trial.number] for trial in sheet.trials]
    atomic_write(out / MOTION_INDEX_FILE, _index_csv(ordered))
    return ordered


def _make_judge_factory(
    run: Run,
    trials: Sequence[RealTrial],
    folder: Path,
    out: Path,
    format: PlanFormat,
    station: StationLike | None,
) -> tuple[ReachJudgeFactory, Candidates]:
    """Factory of the judge for one run, and the tried grasps of the run."""
    from burg_drake.motion import require_usable_arm

    scene = run.scene()
    station = run.station() if station is None else as_station(station)
    if station.document.arm is None:
        raise InvalidInputError(
            f"station {station.name!r} of {run.path} has no arm to plan motions for; give"
            " another one"
        ).about("station")
    require_usable_arm(scene, station)
    stems: dict[str, str] = {}
    for trial in trials:
        stems.setdefault(trial.grasp, _file_stem(trial))
    chosen = np.array([id in stems for id in run.candidates.id])
    candidates = Candidates(run.candidates.grasps.select(chosen), run.candidates.instance[chosen])
    motion = read_motion(run.document.trial)
    document = plans_document(
        input_of(scene, "scenes"),
        input_of(station, "stations"),
        candidates,
        settings_numbers(arm_settings(motion)),
        exact=True,
        format=format,
    )
    plans = TrialPlans(folder, document, out, stems)
    return ReachJudgeFactory(scene, station, motion, True, plans), candidates


def _make_row(trial: RealTrial, verdict: Verdict, plans: TrialPlans) -> ExportedMotion:
    plan = plans.plan_path(trial.grasp)
    failed = verdict.outcome is Outcome.SIMULATION_FAILED
    has_plan = verdict.outcome is Outcome.REACHABLE and plan.is_file()
    own = plan.with_name(f"{_file_stem(trial)}{plan.suffix}")
    if has_plan and own != plan and not own.exists():  # two trials have the same grasp
        atomic_write(own, plan.read_bytes())
    duration = verdict.margins.get("duration") if has_plan else None
    return ExportedMotion(
        number=trial.number,
        block=trial.block,
        run=trial.run,
        grasp=trial.grasp,
        instance=trial.instance,
        object=trial.object,
        answer="" if failed else verdict.outcome.value,
        blocker=verdict.blocker,
        reason=verdict.reason,
        file=own.name if has_plan else "",
        duration=None if duration is None else round(duration, 3),
    )


def _file_stem(trial: RealTrial) -> str:
    return f"{trial.number:03d}_{trial.grasp}"


def _require_export_folder(out: Path) -> None:
    """Refuses a folder with anything but exported trials."""
    if out.is_dir() and not (out / "runs").is_dir():
        names = sorted(item.name for item in out.iterdir() if not item.name.startswith("."))
        if names:
            raise InvalidInputError(
                f"folder {out} is not empty and not an export of trials: it has {names[0]}"
                " in it; choose another folder, or empty it"
            )


def _index_csv(rows: Sequence[ExportedMotion]) -> str:
    text = io.StringIO()
    names = [field.name for field in fields(ExportedMotion)]
    writer = csv.DictWriter(text, names, lineterminator="\n")
    writer.writeheader()
    writer.writerows(map(vars, rows))
    return text.getvalue()
