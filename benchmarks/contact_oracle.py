"""Agreement of engines with an oracle that shares no code with them (see `oracle`).

    python benchmarks/contact_oracle.py [--engine NAME ...] [--contact KIND] [--hard | --all N]
        [--converge] [-o FOLDER] [--workers N]

The objects go through the pipeline as fine meshes, and touch as it decides, or as KIND says. Each
stands alone on the table; `burg.HandTrial` runs the same grasps as the oracle, with the same mass,
friction and pose. A verdict is whether the object is held at the end.

`--hard`, the default, takes the frozen grasps on which a method can be wrong (see `oracle.cases`);
`--all` takes N random antipodal grasps of each object with mixed friction and mass. Of these the
oracle judges 3 % less and 3 % more friction as well: where its verdict changes, the grasp is
marginal, and counts apart. Two canaries always run: engines that are known to be worse, which must
show.

The oracle also judges every grasp over a table as soft as the engine's, of 1/150 of the stiffness,
and with pads of twice the damping. Where its verdict changes, the grasp hinges on what neither
method knows of the world; it counts, but is told apart.

`--converge` has the oracle judge the hard cases at half the step and with twice as many samples: of
72, no verdict changes.

FOLDER keeps the library and a journal (trials.jsonl): a run that was interrupted goes on where it
was. After a change of contact geometry or engine take a new folder.
"""

from __future__ import annotations

import argparse
import json
import time
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from itertools import islice
from multiprocessing import get_context
from pathlib import Path
from typing import Any, get_args

from contact_oracle_report import Probes, print_convergence, print_report
from contact_oracle_trials import CANARIES, KNOWN, build, run_engine
from oracle.cases import MARGIN, Case, draw_cases, judge, load_cases
from oracle.catalogue import HELD_OUT, SPACING, TUNED
from oracle.trial import DEFAULT_NUMERICS, Numerics

from burg_drake.core.content import content_hash
from burg_drake.objects.library.entry import ContactKind

ENGINES = ("standard", "reference")
ORACLE = "oracle"
PROBES = {"less friction": 1.0 - MARGIN, "more friction": 1.0 + MARGIN}
FINER = {
    "half the step": (Numerics(step=DEFAULT_NUMERICS.step / 2), SPACING),
    "twice the samples": (DEFAULT_NUMERICS, SPACING / 2**0.5),
}
HINGES = {
    "soft table": Numerics(table_stiffness=1e6 / 0.05),
    "twice the damping": Numerics(dissipation=2.0 * DEFAULT_NUMERICS.dissipation),
}
"""Other worlds. The engine's table is a box 0.1 m thick with a modulus of 1e6 Pa."""
CHUNK = 4
"""Trials that a worker executes before it reports."""

Row = dict[str, Any]


@dataclass(frozen=True)
class Run:
    """One trial.

    Attributes:
        case: the grasp.
        label: an engine's name, `oracle`, or one of PROBES, FINER and HINGES.
        library: folder of the objects.
    """

    case: Case
    label: str
    library: str

    @property
    def key(self) -> str:
        """Tells runs apart in the journal."""
        case = self.case
        return f"{case.id} {self.label} {content_hash((case.X_OG, case.friction, case.mass))[:12]}"


def main() -> None:
    """Runs the study, or what is left of it."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--engine", action="append", choices=list(KNOWN), help="may be repeated")
    parser.add_argument("--contact", choices=get_args(ContactKind), help="as the pipeline decides")
    chosen = parser.add_mutually_exclusive_group()
    chosen.add_argument("--hard", action="store_true", help="the frozen hard cases")
    chosen.add_argument("--all", type=int, metavar="N", help="random grasps of each object")
    parser.add_argument("--converge", action="store_true", help="the oracle, more finely")
    parser.add_argument("-o", "--output", type=Path, default=Path("contact_oracle"))
    parser.add_argument("--workers", type=int, default=2)
    arguments = parser.parse_args()
    arguments.output.mkdir(parents=True, exist_ok=True)
    cases = load_cases() if arguments.all is None else random_cases(arguments.all)
    library = ""
    labels: list[str] = [ORACLE]
    if arguments.converge:
        labels += FINER
    else:
        library = str(build(arguments.output / "library", arguments.contact).resolve())
        engines = list(dict.fromkeys((*(arguments.engine or ENGINES), *CANARIES)))
        labels += [*HINGES, *engines]
        labels += PROBES if arguments.all is not None else []
    journal = Journal(arguments.output / "trials.jsonl")
    runs = [Run(case, label, library) for label in labels for case in cases]
    with ProcessPoolExecutor(arguments.workers, get_context("spawn")) as pool:
        journal.complete(pool, runs)
    rows = {(run.case.id, run.label): journal.rows[run.key] for run in runs}
    if arguments.converge:
        print_convergence(cases, list(FINER), rows)
    else:
        probes = list(PROBES) if arguments.all is not None else []
        print_report(cases, engines, Probes(probes, list(HINGES)), rows)


def random_cases(each: int) -> list[Case]:
    """Grasps with mixed friction and mass, so many of each object."""
    return [c for name in (*TUNED, *HELD_OUT) for c in islice(draw_cases(name, "all"), each)]


class Journal:
    """Trials that were executed, by key.

    Args:
        path: file with a row a line.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.rows: dict[str, Row] = {}
        for line in path.read_text().splitlines() if path.exists() else ():
            try:
                row = json.loads(line)
            except json.JSONDecodeError:  # the last line of an interrupted run, or an empty one
                continue
            self.rows[row["key"]] = row

    def complete(self, pool: ProcessPoolExecutor, runs: list[Run]) -> None:
        """Executes the runs that are missing, and writes them down as they come."""
        missing = [run for run in runs if run.key not in self.rows]
        chunks = [missing[i : i + CHUNK] for i in range(0, len(missing), CHUNK)]
        done = 0
        with self.path.open("a") as file:
            file.write("\n")  # after an interruption the last line may have no end
            for future in as_completed([pool.submit(execute, chunk) for chunk in chunks]):
                for row in future.result():
                    self.rows[row["key"]] = row
                    file.write(json.dumps(row) + "\n")
                    done += 1
                file.flush()
                print(f"\r{done} of {len(missing)} trials ", end="", flush=True)
        if missing:
            print()


def execute(runs: list[Run]) -> list[Row]:
    """Executes runs in a worker."""
    return [execute_one(run) for run in runs]


def execute_one(run: Run) -> Row:
    """Executes one run."""
    start = time.process_time()
    if run.label in KNOWN:
        row = run_engine(run.library, run.case, run.label)
    else:
        world = HINGES.get(run.label, DEFAULT_NUMERICS)
        numerics, spacing = FINER.get(run.label, (world, SPACING))
        found = judge(run.case, PROBES.get(run.label, 1.0), numerics, spacing)
        row = {
            "lifted": found.lifted,
            "executed": not found.fouled,
            "outcome": "lifted" if found.lifted else "lost",
            "slip": found.slip,
            "tilt": found.tilt,
        }
    return {"key": run.key, "cpu": time.process_time() - start, **row}


if __name__ == "__main__":
    main()
