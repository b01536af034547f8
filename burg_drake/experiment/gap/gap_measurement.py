"""Judges the same grasps in steps that each add one cause of the gap.

The steps are the hand alone, reachability by the arm, execution by the whole arm, and displaced
objects. Every step is an ordinary run, or several, in a folder of its own, which can be opened,
replayed and continued:

hand/, reach/, arm/    the grasps in this mode
scenes/NNN.yaml        the scene with displaced objects
placed/NNN/            grasps that succeed in the last mode, in this scene
tried_HASH/NNN/        further grasps, of real trials
gap.yaml               the settings
gap.html, gap.json     the results

A run in mode `reach` has the same trials of the hand as a run in mode `hand`, so the step reuses
the verdicts of the hand. Only the screens are repeated, and a trial is executed again only if the
arm can lift less far than the hand.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from burg_drake.core import (
    MODES,
    STARTING_PHASE,
    GraspSet,
    InvalidInputError,
    Listener,
    MarginNames,
    Mode,
    Outcome,
    Progress,
    ProgressMeter,
    Reporter,
    Stage,
    Verdict,
    content_hash,
    ensure_writable_folder,
    load_document,
    save_document,
    software_versions,
)
from burg_drake.evaluation import (
    JOURNAL_FILE,
    RUN_FILE,
    Candidate,
    Candidates,
    Decision,
    EvaluationSettings,
    Executor,
    Grasps,
    GraspsLike,
    Job,
    Journal,
    Judge,
    LocalExecutor,
    Run,
    StationJudge,
    StationJudgeFactory,
    WriterLock,
    arm_settings,
    create_run,
    evaluate,
    limit_settings,
    load_run,
    mode_for,
    origin_of,
    read_journal,
    read_motion,
    require_run_folder,
    require_same_run,
    run_hash,
    settings_numbers,
)
from burg_drake.experiment.gap.displaced_scenes import (
    candidates_as_commanded,
    noisy_scene,
    save_displaced_scene,
)
from burg_drake.experiment.gap.gap_steps import GapDocument, GapSettings, GapStep, GapSteps
from burg_drake.scene import Scene, SceneLike, as_scene, load_scene
from burg_drake.station import Station, StationLike, as_station

GAP_DOCUMENT_FILE = "gap.yaml"  # Settings of a gap measurement.
GAP_DOCUMENT_HEADER = "Where grasps are lost, step by step; written by burg-drake gap."
"""Comment at the top of `gap.yaml`."""


def measure_gap(
    source: Run | SceneLike,
    out: str | Path,
    *,
    station: StationLike = "panda_tabletop",
    grasps: GraspsLike | None = None,
    evaluation: EvaluationSettings | None = None,
    settings: GapSettings | None = None,
    tried: Sequence[str] = (),
    executor: Executor | None = None,
    progress: bool | Listener = True,
) -> GapSteps:
    """Judges the same grasps step by step; a repeated call continues where an earlier one stopped.

    Args:
        source: a scene, or a complete run. The grasps of a run are judged with its scene, station,
            engine and motion, and the run itself is the step of its mode.
        out: folder; created if necessary.
        station: station, if `source` is a scene.
        grasps: grasps for `evaluate`, if `source` is a scene; sampled if None.
        evaluation: settings for `evaluate`, if `source` is a scene: engine, motion and sampling.
            Each step sets the mode.
        settings: steps; if None all steps that the station allows, and five displaced scenes.
        tried: ids of grasps of real trials. They are judged in displaced scenes even if they fail
            in the last mode.
        executor: executor; if None as many processes as there are processors.
        progress: as for `evaluate`.

    Raises:
        InvalidInputError: as for `evaluate`; or the folder has other steps, or the run is
            incomplete.
    """
    from burg_drake.station import SceneCheck

    run = None
    if isinstance(source, Run):
        run, scene, station = source, source.scene(), source.station()
        if not run.complete:
            raise InvalidInputError(
                f"{run.path} is not complete; finish it first with the command in its report"
            )
    else:
        scene, station = as_scene(source), as_station(station)
    settings = settings or GapSettings()
    noise, samples, last = settings.noise, settings.samples, settings.last
    if last is None:
        last = "hand" if station.document.arm is None else "arm"
    mode_for(station, last)
    executor = LocalExecutor.of_this_machine() if executor is None else executor
    path = Path(out)
    document = _make_document(run, scene, station, last, settings)
    _start_folder(path, document)
    options = {"executor": executor, "progress": progress}
    first = {"grasps": grasps, "settings": evaluation or EvaluationSettings()}
    steps: list[GapStep] = []
    for mode in MODES[: MODES.index(last) + 1]:
        run_in_mode = _judge_in_mode(mode, run, steps, scene, station, path, options, first)
        steps.append(GapStep(mode, (run_in_mode,)))
    extra: tuple[Run, ...] = ()
    if samples:
        run = steps[-1].runs[0]
        issues = SceneCheck(station, scene.library).issues
        scenes = [noisy_scene(scene, noise, k, issues) for k in range(1, samples + 1)]
        held = [id for id, v in run.verdicts.items() if v.outcome.held]
        others = sorted({*tried}.intersection(run.candidates.id).difference(held))
        judging = _DisplacedJudging(
            run, scene, station, path, [noisy.scene for noisy in scenes], options
        )
        steps.append(GapStep("placed", judging.judge(held, "placed")))
        extra = judging.judge(others, f"tried_{content_hash(others)[:8]}")
        document = replace(
            document,
            redrawn=tuple(noisy.redrawn for noisy in scenes),
            kept={f"{k:03d}": noisy.kept for k, noisy in enumerate(scenes, 1) if noisy.kept},
        )
    save_document(document, path / GAP_DOCUMENT_FILE, GAP_DOCUMENT_HEADER)
    return GapSteps(path, document, tuple(steps), extra)


def _make_document(
    run: Run | None, scene: Scene, station: Station, last: Mode, settings: GapSettings
) -> GapDocument:
    """Settings of a call, with the installed versions."""
    noise = settings.noise
    return GapDocument(
        source="" if run is None else run.document.hash,
        scene=scene.content,
        station=station.content,
        last=last,
        place_mm=1e3 * noise.place,
        turn_deg=float(np.rad2deg(noise.turn)),
        seed=noise.seed,
        samples=settings.samples,
        versions=software_versions(),
    )


def _start_folder(path: Path, document: GapDocument) -> None:
    """Creates the folder and writes the settings first, so that later calls with other settings are
    refused.
    """
    file = path / GAP_DOCUMENT_FILE
    if not file.exists():
        ensure_writable_folder(path)
    with WriterLock(path / ".gap.lock"):
        if file.exists() and any(path.glob(f"*/{JOURNAL_FILE}")):  # otherwise no run was begun
            _require_same_settings(path, load_document(file, GapDocument), document)
        else:
            save_document(document, file, GAP_DOCUMENT_HEADER)


def _require_same_settings(path: Path, existing: GapDocument, document: GapDocument) -> None:
    """Refuses a folder with other steps; only the number of displaced scenes may grow."""
    for name in ("source", "scene", "station", "place_mm", "turn_deg", "seed"):
        old, new = getattr(existing, name), getattr(document, name)
        if old != new:
            raise InvalidInputError(
                f"{path} has steps of another measurement ({name} is {_short_value(old)} there,"
                f" {_short_value(new)} here); choose another folder, or delete it"
            ).about("out")


def _short_value(value: object) -> str:
    return f"{value[:12]!r}" if isinstance(value, str) else f"{value:g}"


def _judge_in_mode(
    mode: Mode,
    run: Run | None,
    steps: Sequence[GapStep],
    scene: Scene,
    station: Station,
    path: Path,
    options: dict[str, Any],
    first: dict[str, Any],
) -> Run:
    """Runs the step of a mode, unless the given run is this step. The arguments of `evaluate` are
    those of an earlier run, or `first` if there is none.
    """
    if run is not None and run.document.mode == mode:
        return run
    earlier = steps[0].runs[0] if steps else run
    arguments = first if earlier is None else _recorded_arguments(earlier)
    if mode == "reach":
        _start_reach_run(steps[0].runs[0], scene, station, path / mode, options)
    return evaluate(scene, station, path / mode, **_arguments_in_mode(arguments, mode), **options)


def _recorded_arguments(run: Run) -> dict[str, Any]:
    """Arguments with which `evaluate` repeats a run."""
    settings = EvaluationSettings(
        mode=run.document.mode,
        engine=run.document.engine,
        seed=run.document.seed,
        motion=read_motion(run.document.trial),
        table=run.document.table,
        **limit_settings(run.document.trial),
    )
    return {"grasps": group_candidates_by_instance(run.candidates), "settings": settings}


def _arguments_in_mode(arguments: dict[str, Any], mode: Mode) -> dict[str, Any]:
    """The arguments of `evaluate` in another mode, without setting `approach` for the whole arm,
    which always approaches.
    """
    settings = arguments["settings"]
    approach = settings.approach and mode != "arm"
    return {**arguments, "settings": replace(settings, mode=mode, approach=approach)}


def group_candidates_by_instance(candidates: Candidates) -> dict[str, GraspSet]:
    """The grasps by name of the instance."""
    names = dict.fromkeys(candidates.instance.tolist())
    return {n: candidates.grasps.select(np.flatnonzero(candidates.instance == n)) for n in names}


def _start_reach_run(
    hand: Run, scene: Scene, station: Station, folder: Path, options: dict[str, Any]
) -> None:
    """Writes the run of mode `reach` from the trials of the hand."""
    grasps = Grasps(
        origin="given",
        correction=hand.document.grasps.correction,
        count=hand.document.grasps.count,
        objects=hand.document.grasps.objects,
        content=hand.document.grasps.content,
    )
    motion = read_motion(hand.document.trial)
    document = replace(
        hand.document,
        mode="reach",
        grasps=grasps,
        arm=settings_numbers(arm_settings(motion)),
        versions=software_versions(),
        stretches=(),
        hash="",
    )
    require_run_folder(folder)
    ensure_writable_folder(folder)
    with Journal(folder / JOURNAL_FILE) as lines:
        if (folder / RUN_FILE).exists():
            require_same_run(folder, load_run(folder).document, document)
        else:
            document = replace(document, hash=run_hash(document))
            create_run(folder, document, scene, station, hand.candidates)
        known = read_journal(folder / JOURNAL_FILE)
        for id, verdict in reach_verdicts(hand, known, **options):
            lines.append(id, verdict)


@dataclass(frozen=True, eq=False)
class _DisplacedJudging:
    """Judges grasps of a run in displaced scenes."""

    run: Run
    scene: Scene
    station: Station
    path: Path
    scenes: Sequence[Scene]
    options: dict[str, Any]

    def judge(self, ids: Sequence[str], folder: str) -> tuple[Run, ...]:
        """Judges grasps in each displaced scene; returns no runs if there are no grasps."""
        if not ids:
            return ()
        candidates, chosen = self.run.candidates, set(ids)
        rows = np.flatnonzero([id in chosen for id in candidates.id])
        selected = Candidates(candidates.grasps.select(rows), candidates.instance[rows])
        return tuple(
            self._judge_in_scene(selected, scene, f"{number:03d}", folder)
            for number, scene in enumerate(self.scenes, 1)
        )

    def _judge_in_scene(
        self, candidates: Candidates, scene: Scene, number: str, folder: str
    ) -> Run:
        path = self.path / "scenes" / f"{number}.yaml"
        save_displaced_scene(scene, path)
        displaced = load_scene(path)
        moved = candidates_as_commanded(self.scene, displaced, candidates)
        arguments = _recorded_arguments(self.run)
        arguments["grasps"] = group_candidates_by_instance(moved)
        out = self.path / folder / number
        return evaluate(displaced, self.station, out, **arguments, **self.options)


@dataclass(frozen=True)
class ReachOfHandFactory:
    """Builds a judge of mode `reach` that reuses the hand's trials.

    Attributes:
        build: builds the station's judge.
        trials: executed trials by grasp id.
    """

    build: Callable[[], StationJudge]
    trials: Mapping[str, Verdict]

    def __call__(self) -> Judge:
        judge = self.build()
        ((stage, execute),) = judge.stages

        def recall(grasp: Candidate, motion: object) -> Decision:
            known = self.trials.get(grasp.id)
            if known is None or known.margins.get(MarginNames.lift_height) != grasp.lift:
                return execute(grasp, None)
            return Decision(known.outcome, **known.of_trial())

        judge.stages = [(stage, recall)]
        return judge


def reach_verdicts(
    hand: Run,
    known: Mapping[str, Verdict],
    *,
    executor: Executor,
    progress: bool | Listener,
) -> Iterator[tuple[str, Verdict]]:
    """Verdicts of mode `reach` on the grasps of a run of the hand, equal to those of `evaluate` bit
    for bit.

    Args:
        hand: a complete run in mode `hand`.
        known: existing verdicts by grasp id.
        executor: executor of the judgements.
        progress: see `evaluate`.

    Yields:
        Ids and verdicts of the grasps without an existing verdict.
    """
    origin = origin_of(hand.document)
    build = StationJudgeFactory(
        hand.scene(),
        hand.station(),
        origin.engine.serial,
        "reach",
        origin.settings(f"{hand.path}: trial"),
    )
    trials = {id: v for id, v in hand.verdicts.items() if _was_executed(v)}
    todo = [candidate for candidate in hand.candidates if candidate.id not in known]
    if not todo:
        return
    with Reporter(progress) as reporter:
        begin = Progress(STARTING_PHASE, len(known), len(hand.candidates))
        pace = ProgressMeter(reporter.show, begin, "asking the arm")
        job = Job("reach", ReachOfHandFactory(build, trials), todo)
        with closing(executor.judge([job])) as judged:
            for _, candidate, verdict in judged:
                pace.step(outcome=verdict.outcome)
                yield candidate.id, _add_trial_time(verdict, trials.get(candidate.id))


def _was_executed(verdict: Verdict) -> bool:
    lift = verdict.margins.get(MarginNames.lift_height, math.nan)
    failed = verdict.outcome is Outcome.SIMULATION_FAILED
    return verdict.stage is Stage.EXECUTED and not failed and math.isfinite(lift)


def _add_trial_time(verdict: Verdict, trial: Verdict | None) -> Verdict:
    """A copy of a verdict with the computing time of the hand's trial, if the verdict reuses it."""
    if trial is None or verdict.stage is not Stage.EXECUTED or Stage.EXECUTED not in trial.cpu:
        return verdict
    return replace(verdict, cpu={**verdict.cpu, Stage.EXECUTED: trial.cpu[Stage.EXECUTED]})
