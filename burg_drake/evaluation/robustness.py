"""Robustness tests of the lifted grasps of a run in worker processes, and their table."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import asdict, dataclass, replace
from operator import itemgetter
from pathlib import Path
from typing import TypeVar

import numpy as np

from burg_drake.core import (
    JUDGING_PACKAGES,
    STARTING_PHASE,
    InvalidInputError,
    Listener,
    Outcome,
    Progress,
    ProgressMeter,
    Reporter,
    Stage,
    TextTable,
    Verdict,
    default_workers,
    ensure_writable_folder,
    format_number,
    software_versions,
)
from burg_drake.evaluation.candidates import Candidate
from burg_drake.evaluation.executor import judge_all
from burg_drake.evaluation.journal import JOURNAL_FILE, Journal, read_journal
from burg_drake.evaluation.judge import require_engine_for
from burg_drake.evaluation.results_table import Columns
from burg_drake.evaluation.robustness_probes import (
    ProbeAnswer,
    ProbeJudgeFactory,
    RobustnessProbe,
    known_answers,
    make_probes,
)
from burg_drake.evaluation.run_document import origin_of
from burg_drake.evaluation.run_folder import RUN_FILE, Run, load_run
from burg_drake.evaluation.settings import (
    DEFAULT_BEST_COUNT,
    LOADED_TESTS,
    ROBUSTNESS_TESTS,
    RobustnessSettings,
)
from burg_drake.evaluation.table_file import require_table, write_table
from burg_drake.evaluation.trial_origin import engine_label, pairs_text, require_lifts
from burg_drake.simulation import SHAKE_AXES, TUG_DIRECTIONS, HoldForces, SuccessRate
from burg_drake.station import Engine

T = TypeVar("T")


@dataclass(frozen=True)
class GraspRobustness:
    """Results of the robustness tests of one grasp.

    Attributes:
        id, instance, object: the grasp and its target.
        friction: friction coefficient of the target.
        tug, shake: loads that the grip withstands; None if not tested or failed.
        friction_min: smallest friction coefficient that lifts; None if not tested or failed.
        success: success rate of the perturbed repeats; None if not tested.
        failed: names of failed tests; failed perturbed repeats are counted in `success`.
    """

    id: str
    instance: str
    object: str
    friction: float
    tug: HoldForces | None = None
    shake: HoldForces | None = None
    friction_min: float | None = None
    success: SuccessRate | None = None
    failed: tuple[str, ...] = ()


def gather_answers(
    id: str, instance: str, object: str, friction: float, answers: Sequence[ProbeAnswer]
) -> GraspRobustness:
    """Combines the answers to the probes of a grasp."""
    by_test = {answer.test: answer for answer in answers if answer.test != "noise"}
    repeats = Counter(a.outcome for a in answers if a.test == "noise" and a.outcome is not None)
    tug, shake, friction_min = (by_test.get(test) for test in ("tug", "shake", "friction"))
    return GraspRobustness(
        id,
        instance,
        object,
        friction,
        tug=tug.forces if tug else None,
        shake=shake.forces if shake else None,
        friction_min=friction_min.friction if friction_min else None,
        success=SuccessRate(repeats) if repeats else None,
        failed=tuple(test for test, answer in by_test.items() if answer.failed),
    )


def robustness_columns(
    grasps: Sequence[GraspRobustness],
    settings: RobustnessSettings,
    engines: Sequence[Engine],
    run: str,
) -> Columns:
    """Table of the results; `engines` has the engine of each grasp."""
    # Outcomes that are possible without an arm.
    hand_outcomes = tuple(o for o in Outcome if o.stage in (Stage.CLEAR, Stage.EXECUTED))
    columns = {n: _text_column(getattr(g, n) for g in grasps) for n in ("id", "instance", "object")}
    tugs = [None if g.tug is None else g.tug.accelerations for g in grasps]
    forces = [None if g.tug is None else g.tug.forces for g in grasps]
    shakes = [None if g.shake is None else g.shake.accelerations for g in grasps]
    columns |= {f"tug_{name}_g": _float_column(tugs, itemgetter(name)) for name in TUG_DIRECTIONS}
    columns |= {f"tug_{name}_N": _float_column(forces, itemgetter(name)) for name in TUG_DIRECTIONS}
    columns |= {f"shake_{name}_g": _float_column(shakes, itemgetter(name)) for name in SHAKE_AXES}
    columns["friction_min"] = _float_column([g.friction_min for g in grasps], float)
    columns["friction"] = np.array([g.friction for g in grasps], dtype=float)
    rates = [g.success for g in grasps]
    columns["repeats"] = _integer_column(rates, lambda r: r.trials)
    columns["lifted"] = _integer_column(rates, lambda r: r.lifted)
    columns["success"] = _float_column(rates, lambda r: r.probability)
    columns["success_low"] = _float_column(rates, lambda r: r.interval[0])
    columns["success_high"] = _float_column(rates, lambda r: r.interval[1])
    counts = [None if rate is None else rate.outcomes for rate in rates]
    columns |= {
        f"n_{outcome}": _integer_column(counts, itemgetter(outcome)) for outcome in hand_outcomes
    }
    columns["failed"] = _text_column(" ".join(g.failed) for g in grasps)
    columns["engine"] = _text_column(map(engine_label, engines))
    columns["seed"] = np.full(len(grasps), settings.seed, dtype=np.int64)
    columns["settings"] = _text_column([_settings_text(settings)] * len(grasps))
    columns["run"] = _text_column([run] * len(grasps))
    return columns


def _settings_text(settings: RobustnessSettings) -> str:
    return pairs_text(
        {
            f"{group}.{name}": value
            for group in ("loads", "friction", "noise")
            for name, value in asdict(getattr(settings, group)).items()
        }
    )


def robustness_view(grasps: Sequence[GraspRobustness], settings: RobustnessSettings) -> TextTable:
    """Table for a terminal: weakest directions, friction and success."""
    table = TextTable("Robustness of lifted grasps", caption=_table_caption(settings)).texts(
        "grasp"
    )
    heads = {"tug": "tug", "shake": "shake", "friction": "least mu", "noise": "success"}
    table.numbers(*(heads[test] for test in settings.tests))
    if "noise" in settings.tests:
        table.numbers("95 % CI")
    largest = settings.loads.largest
    for g in grasps:
        cells = {
            "tug": _weakest_text(g.tug, largest),
            "shake": _weakest_text(g.shake, largest),
            "friction": _friction_text(g, settings),
            "noise": "-" if g.success is None else f"{g.success.lifted} of {g.success.trials}",
        }
        row = [cells[test] for test in settings.tests]
        if "noise" in settings.tests:
            low, high = (0.0, 1.0) if g.success is None else g.success.interval
            row.append(f"{100 * low:.0f}-{100 * high:.0f} %")
        table.row(g.id, *row)
    return table


def _weakest_text(forces: HoldForces | None, largest: float) -> str:
    if forces is None:
        return "-"
    name, value = forces.lowest_limit
    return f"> {largest:g} g   " if math.isinf(value) else f"{format_number(value, 1)} g {name:>2}"


def _friction_text(grasp: GraspRobustness, settings: RobustnessSettings) -> str:
    if grasp.friction_min is None:
        return "-"
    if grasp.friction_min == 0.0:
        return f"< {settings.friction.smallest:g}"
    if math.isinf(grasp.friction_min):
        return f"> {settings.friction.largest:g}"
    return f"{format_number(grasp.friction_min, 3)} of {format_number(grasp.friction)}"


def _table_caption(settings: RobustnessSettings) -> str:
    parts = []
    if {"tug", "shake"} & set(settings.tests):
        parts.append(
            "tug, shake: acceleration withstood along the weakest direction of the grasp frame"
            " (x closing, z approach), in g = 9.81 m/s²"
        )
    if "friction" in settings.tests:
        parts.append("least mu: smallest friction coefficient that lifts, and the object's own")
    if "noise" in settings.tests:
        noise = settings.noise
        parts.append(
            f"success: lifted of the repeats with deviations of"
            f" {noise.translation * 1e3:g} mm, {math.degrees(noise.rotation):g} deg,"
            f" mass {100 * noise.mass:g} %, friction {100 * noise.friction:g} %"
        )
    return "\n".join(parts)


def _text_column(values: Iterable[str]) -> np.ndarray:
    return np.array(list(values), dtype=np.str_)


def _integer_column(values: Sequence[T | None], count: Callable[[T], int]) -> np.ndarray:
    """Column of `count` of each value; None for a missing value."""
    return np.array([None if v is None else count(v) for v in values], dtype=object)


def _float_column(values: Sequence[T | None], number: Callable[[T], float]) -> np.ndarray:
    """Column of `number` of each value; NaN for a missing value."""
    return np.array([math.nan if v is None else number(v) for v in values], dtype=float)


TEST_COSTS = {"tug": 40.0, "shake": 50.0, "friction": 30.0, "noise": 2.0}
"""Measured CPU time of each test, as a multiple of the grasp's own trial."""


@dataclass(frozen=True, eq=False)
class Robustness:
    """Results of `assess_robustness`.

    Attributes:
        grasps: results by grasp, in the order of the request.
        table_path: path of the table.
        failures: ids of probes that could not be simulated, with the reason.
        interrupted: number of failures whose worker process was killed from outside.
    """

    grasps: tuple[GraspRobustness, ...]
    table_path: Path
    failures: dict[str, str]
    interrupted: int = 0


@dataclass(frozen=True, eq=False)
class _EngineTests:
    """Robustness tests of the grasps that one engine has judged.

    Attributes:
        factory: builds the judge of the probes.
        context: inputs and versions, besides the settings of the tests, that determine answers.
    """

    factory: ProbeJudgeFactory
    context: tuple[object, ...]

    @classmethod
    def of(cls, factory: ProbeJudgeFactory) -> _EngineTests:
        """Tests with the context of the installed versions."""
        packages = factory.engine.packages
        versions = software_versions({**JUDGING_PACKAGES, **packages})
        names = ("burg_drake", "drake", *packages)
        return cls(factory, (*factory.content(), *(versions[name] for name in names)))

    def probes(self, grasp: Candidate) -> Iterator[RobustnessProbe]:
        """Probes of a grasp."""
        return make_probes(grasp, self.factory.scene, self.factory.settings, self.context)

    def combine_answers(self, grasp: Candidate, answers: Mapping[str, Verdict]) -> GraspRobustness:
        """Combines the answers on a grasp, given by the id of the probe."""
        scene, settings = self.factory.scene, self.factory.settings
        return gather_answers(
            grasp.id,
            grasp.instance,
            scene.instance(grasp.instance).object,
            scene.entry(grasp.instance).friction,
            known_answers(grasp.id, answers, settings, self.context),
        )


def assess_robustness(
    run: Run | str | Path,
    *,
    grasps: Sequence[str] | None = None,
    best: int = DEFAULT_BEST_COUNT,
    only: Iterable[str] | None = None,
    settings: RobustnessSettings | None = None,
    out: str | Path | None = None,
    workers: int | None = None,
    retry_failed: bool = False,
    progress: bool | Listener = True,
) -> Robustness:
    """Tests the robustness of lifted grasps of a run, and writes a table.

    Each grasp is tested with the engine of its verdict: the run's, or the one that judged again.

    Args:
        run: the run, or its folder.
        grasps: ids of grasps; the best of the run if None.
        best: without `grasps`, number of best grasps of each object to test; see `best_rows`.
        only: without `grasps`, names of the objects or instances to test; all if None.
        settings: settings of the tests; all tests with their defaults if None.
        out: path of the table, .csv or .parquet; `robustness.csv` in the run's folder if None. The
            journal is the file of the same name with the suffix .jsonl.
        workers: number of processes; one per processor if None.
        retry_failed: retry all probes that an earlier call could not simulate, not only those whose
            worker process was killed from outside.
        progress: True shows a bar on standard error, False nothing; a function gets the events.

    Raises:
        UnknownNameError: a grasp, object or instance is not in the run.
        InvalidInputError: a grasp was not lifted, the engine that judged it does not support a
            test, the scene has changed since the run, or the table cannot be written.
        MissingDependencyError: the engine is not installed.
        SimulationError: the simulation of the scene cannot be built.
    """
    run = run if isinstance(run, Run) else load_run(run)
    settings = RobustnessSettings() if settings is None else settings
    table = run.path / "robustness.csv" if out is None else Path(out)
    require_table(table)
    journal_path = table.with_suffix(".jsonl")
    _require_other_files(run, table, journal_path)
    chosen = _choose_grasps(run, grasps, best, only)
    tests = _tests_by_grasp(run, chosen, settings)
    probes = [probe for grasp in chosen for probe in tests[grasp.id].probes(grasp)]
    ensure_writable_folder(table.parent)
    with Reporter(progress) as reporter, Journal(journal_path) as journal:
        before = read_journal(journal_path)
        known = {id for id, v in before.items() if not v.is_open(retry_failed=retry_failed)}
        _answer_probes(run, probes, tests, journal, known, workers, reporter)
    answers = read_journal(journal_path)
    found = tuple(tests[grasp.id].combine_answers(grasp, answers) for grasp in chosen)
    engines = [tests[grasp.id].factory.engine for grasp in chosen]
    write_table(table, robustness_columns(found, settings, engines, run.document.hash))
    asked = {probe.id: answers[probe.id] for probe in probes}
    failed = Outcome.SIMULATION_FAILED
    failures = {id: v.reason for id, v in asked.items() if v.outcome is failed}
    interrupted = sum(answers[id].interrupted for id in failures)
    return Robustness(found, table, failures, interrupted)


def _require_other_files(run: Run, *written: Path) -> None:
    """Refuses to overwrite the run's own results or journal."""
    own = [path.resolve() for path in (run.table_path, run.path / JOURNAL_FILE)]
    for path in written:
        if path.resolve() in own:
            error = InvalidInputError(f"{path} belongs to the run itself; choose another file")
            raise error.about("out")


def _choose_grasps(
    run: Run, ids: Sequence[str] | None, best: int, only: Iterable[str] | None
) -> list[Candidate]:
    if ids is None:
        ids = run.best(best, each=True, only=only)
        if not ids:
            raise InvalidInputError(f"{run.path}: no grasp was lifted, so there is nothing to test")
    chosen = {id: run.trial(id).candidate for id in ids}
    for id in chosen:
        verdict = run.verdicts.get(id)
        if verdict is None:
            raise InvalidInputError(f"{run.path}: grasp {id!r} is not judged yet")
        if not verdict.outcome.held:
            raise InvalidInputError(
                f"{run.path}: grasp {id!r} was not lifted ({verdict.outcome}); robustness"
                " tests need a lifted grasp"
            )
    return list(chosen.values())


def _tests_by_grasp(
    run: Run, chosen: Iterable[Candidate], settings: RobustnessSettings
) -> dict[str, _EngineTests]:
    """Tests by id of the grasp; grasps judged by the same engine share one object."""
    scene, station, origin = run.scene(), run.station(), origin_of(run.document)
    require_lifts(origin.trial, run.path, "robustness tests are about")
    trial = origin.settings(f"{run.path / RUN_FILE}: trial")
    loaded = [test for test in settings.tests if test in LOADED_TESTS]
    by_judge: dict[str, _EngineTests] = {}
    found = {}
    for grasp in chosen:
        judge = run.verdicts[grasp.id].judged_again
        if judge not in by_judge:
            engine = origin.judged_by(judge).engine
            if engine.simulator != "drake" and loaded:
                others = ",".join(test for test in ROBUSTNESS_TESTS if test not in LOADED_TESTS)
                raise InvalidInputError(
                    f"tests {' and '.join(loaded)} need Drake, but {grasp.id} was judged"
                    f" by engine {engine.name}; give the tests {others}"
                ).about("tests")
            require_engine_for(engine, "hand")
            factory = ProbeJudgeFactory(scene, station, engine, trial, settings)
            by_judge[judge] = _EngineTests.of(factory)
        found[grasp.id] = by_judge[judge]
    return found


def _answer_probes(
    run: Run,
    probes: Sequence[RobustnessProbe],
    tests: Mapping[str, _EngineTests],
    journal: Journal,
    known: Collection[str],
    workers: int | None,
    reporter: Reporter,
) -> None:
    """Answers the probes that are not known yet, and writes each answer to the journal at once."""
    todo = [probe for probe in probes if probe.id not in known]
    work = sum(TEST_COSTS[probe.test] for probe in todo)
    expected = work * _trial_time(run, probes) / (workers or default_workers())
    begin = Progress(
        STARTING_PHASE, len(probes) - len(todo), len(probes), unit="tests", left=expected or None
    )
    meter = ProgressMeter(reporter.show, begin, "testing", work=work)
    for engine in dict.fromkeys(tests.values()):
        test_by_id = {probe.id: probe.test for probe in todo if tests[probe.grasp] is engine}
        trials = [probe.trial for probe in todo if probe.id in test_by_id]
        factory = replace(engine.factory, tests=test_by_id)
        with closing(judge_all(trials, factory, workers=workers)) as answers:
            for trial, verdict in answers:
                journal.append(trial.id, verdict)
                meter.step(work=TEST_COSTS[test_by_id[trial.id]])


def _trial_time(run: Run, probes: Sequence[RobustnessProbe]) -> float:
    """Mean CPU time of the run's own trials of the grasps [s]."""
    took = [run.verdicts[id].cpu.get(Stage.EXECUTED, 0.0) for id in {p.grasp for p in probes}]
    return sum(took) / max(len(took), 1)
