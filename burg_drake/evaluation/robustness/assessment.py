"""Robustness of grasps that a run found to lift: probes in worker processes, journal and table.

Answers are appended to a journal beside the table as they come. The same call goes on where an
interrupted one stopped, and a call that asks for more asks only what is new. The table has all
answers known about the grasps of the last call, those of earlier calls with equal settings, too.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path

from burg_drake.core import (
    JUDGING,
    InvalidInputError,
    software_versions,
)
from burg_drake.core.files import writable_folder
from burg_drake.core.grasps import Outcome, Stage, Verdict
from burg_drake.core.terminal import STARTING, Listener, Progress, ProgressMeter, Reporter
from burg_drake.core.workers import default_workers
from burg_drake.evaluation.candidates import Candidate
from burg_drake.evaluation.records import (
    Journal,
    origin_of,
    read_journal,
    require_table,
    write_table,
)
from burg_drake.evaluation.robustness.probe_judge import ProbeJudgeFactory
from burg_drake.evaluation.robustness.probes import (
    Probe,
    known_answers,
    make_probes,
)
from burg_drake.evaluation.robustness.settings import (
    DEFAULT_BEST,
    LOADED_TESTS,
    TESTS,
    RobustnessSettings,
)
from burg_drake.evaluation.robustness.table import GraspRobustness, gathered, robustness_columns
from burg_drake.evaluation.stages import require_engine_for
from burg_drake.evaluation.store import JOURNAL_FILE, RUN_FILE, Run, load_run
from burg_drake.evaluation.workers import judge_all

TABLE_FILE = "robustness.csv"
COST = {"tug": 40.0, "shake": 50.0, "friction": 30.0, "noise": 2.0}
"""CPU time of tests in units of the grasp's own trial, measured on the built-in scene."""


@dataclass(frozen=True, eq=False)
class Robustness:
    """What was found.

    Attributes:
        grasps: answers by grasp, in the order asked.
        table_path: the table.
        failures: ids of probes that could not be simulated, with the reason.
        interrupted: how many of them failed because their worker process was ended from outside.
    """

    grasps: tuple[GraspRobustness, ...]
    table_path: Path
    failures: dict[str, str]
    interrupted: int = 0


@dataclass(frozen=True, eq=False)
class _EngineTests:
    """How grasps are tested whose verdicts one engine has given.

    Attributes:
        factory: how.
        context: what decides about the answers beside the settings of the tests.
    """

    factory: ProbeJudgeFactory
    context: tuple[object, ...]

    @classmethod
    def of(cls, factory: ProbeJudgeFactory) -> _EngineTests:
        """With the versions that are installed."""
        packages = factory.engine.packages
        versions = software_versions({**JUDGING, **packages})
        names = ("burg_drake", "drake", *packages)
        return cls(factory, (*factory.content(), *(versions[name] for name in names)))

    def probes(self, grasp: Candidate) -> Iterator[Probe]:
        """All questions about a grasp."""
        return make_probes(grasp, self.factory.scene, self.factory.settings, self.context)

    def gathered(self, grasp: Candidate, answers: Mapping[str, Verdict]) -> GraspRobustness:
        """What answers, by the id of the probe, say of a grasp."""
        scene, settings = self.factory.scene, self.factory.settings
        return gathered(
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
    best: int = DEFAULT_BEST,
    only: Iterable[str] | None = None,
    settings: RobustnessSettings | None = None,
    out: str | Path | None = None,
    workers: int | None = None,
    retry_failed: bool = False,
    progress: bool | Listener = True,
) -> Robustness:
    """Tests how robust lifted grasps of a run are, and writes a table.

    Each is tested by the engine whose verdict it has: the run's, or the one that judged it again.

    Args:
        run: the run, or its folder.
        grasps: ids; the best ones of the run if None.
        best: how many of those of each object at most; see `best_rows`.
        only: names of the objects or instances whose best grasps are meant; all if None.
        settings: what is asked; all tests with their defaults if None.
        out: the table, .csv or .parquet; `robustness.csv` in the run's folder if None. The journal
            is the file of the same name with the suffix .jsonl.
        workers: number of processes; as many as there are processors if None.
        retry_failed: ask all again that an earlier call could not simulate, not only that whose
            worker process was ended from outside.
        progress: True shows a bar on standard error, False nothing; a function gets the events.

    Raises:
        UnknownNameError: a grasp, object or instance is not in the run.
        InvalidInputError: a grasp was not lifted, the engine that judged it cannot have a test, the
            scene has changed since the run, or the table cannot be written.
        MissingDependencyError: that engine is not installed.
        SimulationError: the simulation of the scene cannot be built.
    """
    run = run if isinstance(run, Run) else load_run(run)
    settings = RobustnessSettings() if settings is None else settings
    table = run.path / TABLE_FILE if out is None else Path(out)
    require_table(table)
    journal_path = table.with_suffix(".jsonl")
    _require_other_files(run, table, journal_path)
    chosen = _choose(run, grasps, best, only)
    tests = _tests_by_grasp(run, chosen, settings)
    probes = [probe for grasp in chosen for probe in tests[grasp.id].probes(grasp)]
    writable_folder(table.parent)
    with Reporter(progress) as reporter, Journal(journal_path) as journal:
        known = {
            id
            for id, verdict in read_journal(journal_path).items()
            if not verdict.is_open(retry_failed=retry_failed)
        }
        _answer(run, probes, tests, journal, known, workers, reporter)
    answers = read_journal(journal_path)
    found = tuple(tests[grasp.id].gathered(grasp, answers) for grasp in chosen)
    engines = [tests[grasp.id].factory.engine for grasp in chosen]
    write_table(table, robustness_columns(found, settings, engines, run.document.hash))
    failures = {
        p.id: answers[p.id].reason
        for p in probes
        if answers[p.id].outcome is Outcome.SIMULATION_FAILED
    }
    interrupted = sum(answers[id].interrupted for id in failures)
    return Robustness(found, table, failures, interrupted)


def _require_other_files(run: Run, *written: Path) -> None:
    """Refuses to write over the run's own results or journal."""
    own = [path.resolve() for path in (run.table_path, run.path / JOURNAL_FILE)]
    for path in written:
        if path.resolve() in own:
            raise InvalidInputError(f"{path} belongs to the run itself; choose another file").about(
                "out"
            )


def _choose(
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
    """How grasps are tested, by id."""
    scene, station, origin = run.scene(), run.station(), origin_of(run.document)
    trial = origin.settings(f"{run.path / RUN_FILE}: trial")
    loaded = [test for test in settings.tests if test in LOADED_TESTS]
    by_judge: dict[str, _EngineTests] = {}
    found = {}
    for grasp in chosen:
        judge = run.verdicts[grasp.id].judged_again
        if judge not in by_judge:
            engine = origin.judged_by(judge).engine
            if engine.simulator != "drake" and loaded:
                raise InvalidInputError(
                    f"tests {' and '.join(loaded)} need Drake, but {grasp.id} was judged"
                    f" by engine {engine.name}; give the tests "
                    f"{','.join(test for test in TESTS if test not in LOADED_TESTS)}"
                ).about("tests")
            require_engine_for(engine, "hand")
            factory = ProbeJudgeFactory(scene, station, engine, trial, settings)
            by_judge[judge] = _EngineTests.of(factory)
        found[grasp.id] = by_judge[judge]
    return found


def _answer(
    run: Run,
    probes: Sequence[Probe],
    tests: Mapping[str, _EngineTests],
    journal: Journal,
    known: Collection[str],
    workers: int | None,
    reporter: Reporter,
) -> None:
    """Asks what is not known yet; each answer is on disk at once."""
    todo = [probe for probe in probes if probe.id not in known]
    work = sum(COST[probe.test] for probe in todo)
    expected = work * _trial_time(run, probes) / (workers or default_workers())
    begin = Progress(
        STARTING, len(probes) - len(todo), len(probes), unit="tests", left=expected or None
    )
    pace = ProgressMeter(reporter.show, begin, "testing", work=work)
    for engine in dict.fromkeys(tests.values()):
        own = {probe.id: probe.test for probe in todo if tests[probe.grasp] is engine}
        trials = [probe.trial for probe in todo if probe.id in own]
        factory = replace(engine.factory, tests=own)
        with closing(judge_all(trials, factory, workers=workers)) as answered:
            for asked, verdict in answered:
                journal.append(asked.id, verdict)
                pace.step(work=COST[own[asked.id]])


def _trial_time(run: Run, probes: Sequence[Probe]) -> float:
    """CPU time that the run's own trials of the grasps took on average [s]."""
    took = [run.verdicts[id].cpu.get(Stage.EXECUTED, 0.0) for id in {p.grasp for p in probes}]
    return sum(took) / max(len(took), 1)
