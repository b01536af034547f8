"""Calibrates the confidence of verdicts, and tests it on other objects.

    python benchmarks/confidence.py [-o FOLDER] [--each N] [--workers N] [--engine NAME ...]
        [--fit] [--plot docs/images/reliability.svg]

Confidence is the probability that the oracle, an independent model of contact, finds the same:
that the object is held to the end, or that it is lost. The oracle does not get the same trial but
two that a laboratory can hardly tell from it: with friction 5 % other, and the hand half a
millimetre and half a degree off (standard deviations).

The 78 objects are those of `oracle.strangers`, of which every second is held out, and of
`oracle.catalogue`. Of each, N grasps are executed by each engine and by the oracle: a third with
the friction and mass of ordinary things, the others with friction near what holds them.

`--fit` fits the curves of `simulation.confidence` to the objects that are not held out, and writes
them with the range of these objects. Then the confidence of each verdict on the others is held
against how often the oracle confirmed it. `--plot` draws that.

FOLDER keeps the library, the grasps and a journal (trials.jsonl): a run that was interrupted goes
on where it was. After a change of trials take a new folder.
"""

from __future__ import annotations

import argparse
import json
import math
import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass
from itertools import groupby, repeat
from multiprocessing import get_context
from pathlib import Path

import numpy as np
from confidence_fit import Judged, fit_all, print_report
from confidence_plot import reliability_diagram
from confidence_trials import OBJECTS, Grasp, changed, draw
from contact_oracle_trials import build, make_trial
from oracle.cases import Case, judge
from trial_journal import Row, TrialJournal

from burg_drake.core import Outcome
from burg_drake.objects import ObjectLibrary, load_library
from burg_drake.simulation import CALIBRATION_FILE, Population, grip_signs
from burg_drake.station import ENGINES

ORACLE = ("oracle 0", "oracle 1")
"""Labels of the oracle's trials."""
SERIAL = tuple(name for name, engine in ENGINES.items() if not engine.parallel)
"""Engines with curves of their own; those in parallel use the curves of these."""


@dataclass(frozen=True)
class Run:
    """One trial.

    Attributes:
        grasp: what is executed.
        label: an engine, or one of the oracle's.
        library: folder of the objects.
    """

    grasp: Grasp
    label: str
    library: str

    @property
    def key(self) -> str:
        """Tells runs apart in the journal."""
        return f"{self.grasp.case.id} {self.label}"


def main() -> None:
    """Runs the study, or what is left of it."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("-o", "--output", type=Path, default=Path("confidence"))
    parser.add_argument("--each", type=int, default=12, help="grasps of an object")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--engine", action="append", choices=SERIAL, help="may be repeated")
    parser.add_argument("--fit", action="store_true", help="fit the curves, and write them")
    parser.add_argument("--plot", type=Path, metavar="FILE", help="reliability diagram, an SVG")
    arguments = parser.parse_args()
    out: Path = arguments.output
    out.mkdir(parents=True, exist_ok=True)
    engines = list(dict.fromkeys(arguments.engine or SERIAL))
    library = str(build(out / "library", OBJECTS, None).resolve())
    journal = TrialJournal(out / "trials.jsonl")
    of_five = {"reference": 2}  # It takes four times as long as the others.
    with ProcessPoolExecutor(arguments.workers, get_context("spawn")) as pool:
        grasps = all_grasps(out, arguments.each, pool)
        runs = [
            Run(grasp, label, library)
            for label in (*ORACLE, *engines)
            for number, grasp in enumerate(grasps)
            if number % 5 < of_five.get(label, 5)
        ]
        journal.complete(pool, runs, chunked, execute)
    verdicts = {engine: judged(grasps, engine, journal.rows) for engine in engines}
    if arguments.fit:
        population = population_of([g for g in grasps if not g.held_out], load_library(library))
        CALIBRATION_FILE.write_text(fit_all(verdicts, population), encoding="utf-8")
    print_report(verdicts)
    if arguments.plot is not None:
        arguments.plot.write_text(reliability_diagram(verdicts), encoding="utf-8")


def population_of(grasps: Sequence[Grasp], library: ObjectLibrary) -> Population:
    """The objects of grasps and their range, to two digits outwards."""
    names = {grasp.case.object for grasp in grasps}
    entries = [library.entry(name) for name in names]
    extents = np.array([np.subtract(entry.upper, entry.lower) for entry in entries])
    return Population(
        objects=len(names),
        max_mass=rounded(max(grasp.case.mass for grasp in grasps), math.ceil),
        min_thickness=rounded(extents.min(), math.floor),
        min_length=rounded(extents.max(axis=1).min(), math.floor),
        max_length=rounded(extents.max(), math.ceil),
    )


def rounded(value: float, direction: Callable[[float], int]) -> float:
    """A value to two digits, up or down."""
    unit = 10.0 ** (math.floor(math.log10(value)) - 1)
    return float(f"{direction(round(value / unit, 6)) * unit:.6g}")


def all_grasps(out: Path, each: int, pool: ProcessPoolExecutor) -> list[Grasp]:
    """The grasps of all objects, drawn once."""
    path = out / f"grasps_{each}.json"
    if not path.exists():
        drawn = pool.map(draw, OBJECTS, repeat(each))
        rows = [asdict(grasp) for some in drawn for grasp in some]
        path.write_text(json.dumps(rows), encoding="utf-8")
    found = []
    for row in json.loads(path.read_text(encoding="utf-8")):
        case = {**row["case"], "X_OG": tuple(map(tuple, row["case"]["X_OG"]))}
        found.append(Grasp(Case(**case), row["kind"]))
    return found


def chunked(runs: Sequence[Run]) -> list[list[Run]]:
    """What a worker executes before it reports: an object in a pose by one engine."""

    def place(run: Run) -> tuple[str, str, int]:
        return run.label, run.grasp.case.object, run.grasp.case.pose

    return [list(some) for _, some in groupby(sorted(runs, key=place), place)]


def execute(runs: list[Run]) -> list[Row]:
    """Executes runs in a worker."""
    return [execute_one(run) for run in runs]


def execute_one(run: Run) -> Row:
    """Executes one run."""
    start, case = time.process_time(), run.grasp.case
    if run.label in ORACLE:
        found = judge(changed(case, ORACLE.index(run.label)))
        row: Row = {"executed": not found.fouled, "held": found.lifted}
    else:
        trial = make_trial(run.library, case.object, case.pose, run.label)
        given = {"friction": case.friction, "mass": case.mass}
        result = trial.run("target", case.matrix, **given)
        outcome = result.outcome
        executed = outcome.stage.value == "executed" and outcome is not Outcome.SIMULATION_FAILED
        row = {"executed": executed, "held": outcome.held, "outcome": str(outcome)}
        if executed:
            load = trial.grip_load("target", trial.X_WG("target", case.matrix), **given)
            row |= {"signs": dict(grip_signs(result.margins, load))}
    return {"key": run.key, "cpu": time.process_time() - start, **row}


def judged(grasps: Sequence[Grasp], engine: str, rows: Mapping[str, Row]) -> list[Judged]:
    """The executed verdicts of an engine, and how often the oracle confirms them."""
    found = []
    for grasp in grasps:
        own = rows.get(f"{grasp.case.id} {engine}")
        truths = [rows[f"{grasp.case.id} {label}"] for label in ORACLE]
        same = [own["held"] == truth["held"] for truth in truths if own and truth["executed"]]
        if own is None or not own["executed"] or not same:
            continue
        found.append(
            Judged(
                engine=engine,
                object=grasp.case.object,
                held_out=grasp.held_out,
                kind=grasp.kind,
                outcome=Outcome(own["outcome"]),
                signs=own["signs"],
                confirmed=sum(same) / len(same),
            )
        )
    return found


if __name__ == "__main__":
    main()
