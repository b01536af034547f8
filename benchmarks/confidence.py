"""Calibrates the confidence of verdicts, and says how far it can be trusted.

    python benchmarks/confidence.py [-o FOLDER] [--scans FOLDER] [--each N] [--workers N]
        [--engine NAME ...] [--fit] [--plot docs/images/reliability.svg]

Objects are those of the oracle (`oracle.catalogue`), of the built-in library, and scans; of each in
its resting poses so many grasps with the friction and mass of ordinary things, and as many with
friction near what holds them. Each is executed by the engines as it is; by `standard` in four more
worlds: friction 5 % other, the hand half a millimetre and half a degree off (standard deviations),
the object 1 % larger or smaller, the lift 0.7 or 1.4 times as long; and, where the object is the
oracle's, by the oracle. A verdict, held to the end or not, is confirmed in as many of these as give
the same.

More than half of the objects are held out. `--fit` fits the curves of `simulation.confidence` to
the others, and writes them. Then, in any case, what the package says of each verdict is held
against how often it was confirmed: expected calibration error over ten bins of as many grasps each,
by worlds and by the oracle. `--plot` draws that of the held-out objects.

FOLDER keeps the libraries, the grasps and a journal (trials.jsonl): a run that was interrupted goes
on where it was. After a change of trials take a new folder.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass
from functools import lru_cache
from itertools import groupby
from multiprocessing import get_context
from pathlib import Path

from confidence_fit import Judged, fit_all, print_report
from confidence_plot import reliability_diagram
from confidence_trials import TARGET, WORLDS, Grasp, build, draw, make_trial, perturbed, poses
from oracle.cases import Case, judge
from oracle.catalogue import HELD_OUT, TUNED
from trial_journal import Row, TrialJournal

from burg_drake.core import Outcome
from burg_drake.simulation import CALIBRATION_FILE, HandTrial, MujocoTrial, grip_signs
from burg_drake.station import ENGINES

ORACLE = "oracle"
WORLD = "world "
CHUNK = 16
"""Trials that a worker executes before it reports."""
SPARSE = {"reference": 5}
"""An engine that takes ten times as long as the others executes every so many grasps."""


@dataclass(frozen=True)
class Run:
    """One trial.

    Attributes:
        grasp: what is executed.
        label: an engine, a world such as `world 1`, or the oracle.
        folder: of the libraries.
    """

    grasp: Grasp
    label: str
    folder: str

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
    parser.add_argument("--scans", type=Path, help="folder of meshes in metres")
    parser.add_argument("--each", type=int, default=16, help="grasps of both kinds, a pose")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--engine", action="append", choices=list(ENGINES), help="may be repeated")
    parser.add_argument("--fit", action="store_true", help="fit the curves, and write them")
    parser.add_argument("--plot", type=Path, metavar="FILE", help="reliability diagram, an SVG")
    arguments = parser.parse_args()
    out: Path = arguments.output
    out.mkdir(parents=True, exist_ok=True)
    engines = list(dict.fromkeys(arguments.engine or ENGINES))
    build(out, arguments.scans)
    journal = TrialJournal(out / "trials.jsonl")
    with ProcessPoolExecutor(arguments.workers, get_context("spawn")) as pool:
        grasps = all_grasps(out, arguments.each, pool)
        labels = [*engines, *(f"{WORLD}{k}" for k in range(1, len(WORLDS))), ORACLE]
        runs = [
            Run(grasp, label, str(out))
            for number, grasp in enumerate(grasps)
            for label in labels
            if number % SPARSE.get(label, 1) == 0
            if label != ORACLE or grasp.case.object in (*TUNED, *HELD_OUT)
        ]
        journal.complete(pool, runs, chunked, execute)
    verdicts = {e: judged(grasps, e, journal.rows) for e in engines}
    if arguments.fit:
        CALIBRATION_FILE.write_text(fit_all(verdicts), encoding="utf-8")
    print_report(verdicts)
    if arguments.plot is not None:
        arguments.plot.write_text(reliability_diagram(verdicts), encoding="utf-8")


def all_grasps(out: Path, each: int, pool: ProcessPoolExecutor) -> list[Grasp]:
    """The grasps of all objects, drawn once."""
    path = out / f"grasps_{each}.json"
    if not path.exists():
        asked = poses(out)
        drawn = pool.map(
            draw, *zip(*((out, name, pose, each) for name, pose in asked), strict=True)
        )
        rows = [asdict(grasp) for some in drawn for grasp in some]
        path.write_text(json.dumps(rows), encoding="utf-8")
    found = []
    for row in json.loads(path.read_text(encoding="utf-8")):
        case = {**row["case"], "X_OG": tuple(map(tuple, row["case"]["X_OG"]))}
        found.append(Grasp(Case(**case), row["kind"]))
    return found


def chunked(runs: Sequence[Run]) -> list[list[Run]]:
    """What a worker executes before it reports: of one object in one pose."""

    def place(run: Run) -> tuple[str, int, str]:
        return run.grasp.case.object, run.grasp.case.pose, run.label

    pieces = []
    for _, some in groupby(sorted(runs, key=place), place):
        group = list(some)
        pieces += [group[i : i + CHUNK] for i in range(0, len(group), CHUNK)]
    return pieces


def execute(runs: list[Run]) -> list[Row]:
    """Executes runs in a worker."""
    return [execute_one(run) for run in runs]


def execute_one(run: Run) -> Row:
    """Executes one run."""
    start, case = time.process_time(), run.grasp.case
    if run.label == ORACLE:
        found = judge(case)
        row: Row = {"executed": not found.fouled, "held": found.lifted}
    else:
        world = int(run.label.removeprefix(WORLD)) if run.label.startswith(WORLD) else 0
        engine = "standard" if world else run.label
        trial = kept_trial(run.folder, case.object, case.pose, world, engine)
        X_OG, friction = perturbed(case, world)
        result = trial.run(TARGET, X_OG, friction=friction, mass=case.mass)
        outcome = result.outcome
        executed = outcome.stage.value == "executed" and outcome is not Outcome.SIMULATION_FAILED
        row = {"executed": executed, "held": outcome.held, "outcome": str(outcome)}
        if executed and not world:
            load = trial.grip_load(
                TARGET, trial.X_WG(TARGET, X_OG), friction=friction, mass=case.mass
            )
            row |= {"signs": dict(grip_signs(result.margins, load))}
    return {"key": run.key, "cpu": time.process_time() - start, **row}


@lru_cache(maxsize=8)
def kept_trial(
    folder: str, name: str, pose: int, world: int, engine: str
) -> HandTrial | MujocoTrial:
    """A trial that chunks share."""
    return make_trial(Path(folder), name, pose, WORLDS[world], engine)


def judged(grasps: Sequence[Grasp], engine: str, rows: dict[str, Row]) -> list[Judged]:
    """The executed verdicts of an engine, with who confirms them."""
    found = []
    for grasp in grasps:
        own = rows.get(f"{grasp.case.id} {engine}")
        if own is None or not own["executed"]:
            continue
        worlds = [rows[f"{grasp.case.id} {WORLD}{k}"] for k in range(1, len(WORLDS))]
        same = [float(row["held"] == own["held"]) for row in worlds if row["executed"]]
        oracle = rows.get(f"{grasp.case.id} {ORACLE}")
        asked = oracle is not None and oracle["executed"]
        found.append(
            Judged(
                engine=engine,
                object=grasp.case.object,
                held_out=grasp.held_out,
                kind=grasp.kind,
                outcome=Outcome(own["outcome"]),
                signs=own["signs"],
                worlds=tuple(same),
                oracle=float(oracle["held"] == own["held"]) if asked else None,
            )
        )
    return found


if __name__ == "__main__":
    main()
