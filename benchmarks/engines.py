"""Agreement of engines with the reference, and what they cost, on a thousand mixed grasps.

    python benchmarks/engines.py [-o FOLDER] [--library L ...] [--grasps N] [--workers N]
        [--variant NAME:TIME_STEP:APPROXIMATION[:whole] ...]

Executes the same grasps (see engine_cases.py) with every preset and every variant; APPROXIMATION is
`lagged`, `similar`, `sap` or `point`, which is point contact under `lagged`. A verdict is whether
the object is held at the end. The reference also runs every grasp once more, moved by 0.5 mm and
turned by 0.5 degrees: how often it disagrees with itself then is the noise floor.

For each grasp on which an engine disagrees, the reference runs again with 2 % less and 2 % more
friction, and with four other such motions. If its verdict changes in any of these, the grasp is
marginal: the disagreement is within what nobody controls on a real robot. Otherwise it is
unexplained, and is listed as such.

The presets were tuned on some of the objects (TUNED) with other grasps; the others are reported as
held out. FOLDER keeps a journal (trials.jsonl): a run that was interrupted goes on where it was,
and an engine added later runs alone. Trials are told apart by the grasp, its overrides and the
engine's settings; after a change of the trial itself or of Drake take a new folder.
"""

from __future__ import annotations

import argparse
import dataclasses
import time
from collections.abc import Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import lru_cache
from multiprocessing import get_context
from pathlib import Path
from typing import get_args, get_type_hints

import numpy as np
from engine_cases import (
    NOISE,
    PROBES,
    Case,
    Resting,
    draw_cases,
    make_trial,
    moved,
    resting_objects,
)
from engine_report import print_report
from trial_journal import Row, TrialJournal

import burg_drake as burg
from burg_drake.core import InvalidInputError, content_hash
from burg_drake.station import DRAKE_ENGINES, ENGINES, Engine

LIBRARY = "household"
CHUNK = 8
"""Grasps that a worker executes before it reports."""


@dataclass(frozen=True)
class Run:
    """One trial of a case.

    Attributes:
        case: the case.
        label: the engine's name, or what is changed for the reference, such as `moved 1`.
        engine: how it is stepped.
        friction_factor: to the case's or the object's friction.
        motion: number of the motion of the grasp; 0 for none.
    """

    case: Case
    label: str
    engine: Engine
    friction_factor: float = 1.0
    motion: int = 0

    @property
    def key(self) -> str:
        """Tells runs apart in the journal."""
        case = self.case
        what = (case.X_OG, case.friction, case.mass, dataclasses.asdict(self.engine))
        return f"{case.id} {self.label} {content_hash(what)[:12]}"


def main() -> None:
    """Runs the study, or what is left of it."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("-o", "--output", type=Path, default=Path("engines"), help="folder")
    parser.add_argument("--library", action="append", default=[], help="further objects")
    parser.add_argument("--grasps", type=int, default=140, help="for each object")
    parser.add_argument("--variant", action="append", default=[], type=variant)
    parser.add_argument("--workers", type=int, default=2)
    arguments = parser.parse_args()
    presets = [ENGINES[name] for name in DRAKE_ENGINES]
    engines = {e.name: e for e in (*presets, *arguments.variant)}
    arguments.output.mkdir(parents=True, exist_ok=True)
    context = get_context("spawn")
    with ProcessPoolExecutor(arguments.workers, context) as pool:
        cases = all_cases(pool, [LIBRARY, *arguments.library], arguments.grasps)
        print(f"{len(cases)} grasps", flush=True)
        journal = TrialJournal(arguments.output / "trials.jsonl")
        runs = [r for case in cases for r in case_runs(case, engines)]
        journal.complete(pool, runs, chunked, execute)
        disputed = [c for c in cases if is_disputed(journal, c, engines)]
        probes = [probe(case, label) for case in disputed for label in PROBES]
        journal.complete(pool, probes, chunked, execute)
    print_report(cases, engines, lambda case, label: find(journal, case, label, engines))


def variant(text: str) -> Engine:
    """An engine from the command line.

    Raises:
        argparse.ArgumentTypeError: not `NAME:TIME_STEP:APPROXIMATION[:whole]`, or no such engine.
    """
    known = [*get_args(get_type_hints(Engine)["contact_approximation"]), "point"]
    name, step, approximation, *whole = (text + "::").split(":")[:4]
    try:
        time_step = float(step)
    except ValueError as error:
        raise argparse.ArgumentTypeError(f"{text!r}: time step {step!r} is no number") from error
    if approximation not in known or whole[0] not in ("", "whole") or name in ENGINES:
        raise argparse.ArgumentTypeError(
            f"{text!r}: give NAME:TIME_STEP:APPROXIMATION[:whole], with a new name and one of"
            f" {', '.join(known)}"
        )
    point = approximation == "point"
    try:
        return Engine(
            name=name,
            time_step=time_step,
            contact_approximation="lagged" if point else approximation,
            contact_model="point" if point else "hydroelastic_with_fallback",
            whole_trial=whole[0] == "whole",
        )
    except InvalidInputError as error:
        raise argparse.ArgumentTypeError(str(error)) from error


def all_cases(pool: ProcessPoolExecutor, libraries: list[str], count: int) -> list[Case]:
    """Cases of all objects, `count` of each where the hand finds as many."""
    resting = [r for library in libraries for r in resting_objects(library)]
    drawn = list(pool.map(draw_cases, resting, [count] * len(resting)))
    cases: list[Case] = []
    for library, name in dict.fromkeys((r.library, r.object) for r in resting):
        own = [
            c
            for r, c in zip(resting, drawn, strict=True)
            if (r.library, r.object) == (library, name)
        ]
        chosen: list[Case] = []
        for k, poses in enumerate(own):  # what a pose lacks, the next ones add
            chosen += poses[: -(-(count - len(chosen)) // (len(own) - k))]
        if len(chosen) < count:
            print(f"{name}: {len(chosen)} clear grasps")
        cases += chosen
    return cases


def case_runs(case: Case, engines: dict[str, Engine]) -> Iterator[Run]:
    """What is executed of every case; in turn, so that a busy machine slows all of them."""
    for name, engine in engines.items():
        yield Run(case, name, engine)
    yield probe(case, NOISE)


def probe(case: Case, label: str) -> Run:
    """The reference with a small change."""
    return Run(case, label, ENGINES["reference"], *PROBES[label])


def is_disputed(journal: TrialJournal, case: Case, engines: dict[str, Engine]) -> bool:
    """Whether the engines disagree on the verdict."""
    return len({journal.rows[Run(case, n, e).key]["held"] for n, e in engines.items()}) > 1


def find(journal: TrialJournal, case: Case, label: str, engines: dict[str, Engine]) -> Row | None:
    """The row of a case with an engine, or with what is changed for the reference."""
    return journal.rows.get(Run(case, label, engines.get(label, ENGINES["reference"])).key)


def chunked(runs: Iterable[Run]) -> Iterator[list[Run]]:
    """Runs of a few cases of the same object."""
    by_object: dict[Resting, dict[str, list[Run]]] = {}
    for run in runs:
        by_object.setdefault(run.case.resting, {}).setdefault(run.case.id, []).append(run)
    for cases in by_object.values():
        lists = list(cases.values())
        for i in range(0, len(lists), CHUNK):
            yield [run for one in lists[i : i + CHUNK] for run in one]


@lru_cache(maxsize=16)
def trial_of(resting: Resting, engine: Engine) -> burg.HandTrial:
    """Built once in a process, as long as the object does not change too often."""
    return make_trial(resting, engine)


def execute(runs: list[Run]) -> list[Row]:
    """Executes runs in a worker."""
    return [execute_one(run) for run in runs]


def execute_one(run: Run) -> Row:
    """Executes one run."""
    case = run.case
    trial = trial_of(case.resting, run.engine)
    X_OG = np.array(case.X_OG)
    if run.motion:
        X_OG = moved(X_OG, f"{case.id} {run.motion}")
    friction = case.friction
    if run.friction_factor != 1.0:
        own = trial.scene.entry("target").friction
        friction = run.friction_factor * (own if friction is None else friction)
    start = time.process_time()
    result = trial.run("target", X_OG, friction=friction, mass=case.mass)
    return {
        "key": run.key,
        "outcome": str(result.outcome),
        "held": result.outcome.held,
        "cpu": time.process_time() - start,
        "reason": result.reason,
        **dataclasses.asdict(result.margins),
    }


if __name__ == "__main__":
    main()
