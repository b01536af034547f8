"""Agreement of engines with an oracle that shares no code with them (see `oracle`).

    python benchmarks/contact_oracle.py [--engine NAME ...] [--contact KIND]
        [--hard | --all N | --strangers] [--converge] [-o FOLDER] [--workers N]

The objects go through the pipeline as fine meshes, and touch as it decides, or as KIND says. Each
stands alone on the table; `burg.HandTrial` runs the same grasps as the oracle, with the same mass,
friction and pose. A verdict is whether the object is held at the end.

`--hard`, the default, takes the frozen grasps on which a method can be wrong (see `oracle.cases`);
`--all` takes N random antipodal grasps of each object with mixed friction and mass. Of these the
oracle judges 3 % less and 3 % more friction as well: where its verdict changes, the grasp is
marginal, and counts apart. `--strangers` takes the frozen grasps of objects that nothing was tuned
on, half of them hard (see `oracle.strangers`); the table is by kind of object. On the frozen hard
grasps two canaries run as well: engines that are known to be worse, which must show.

Where an engine disagrees, the oracle also judges the grasp over a table of 1/150 of the stiffness,
as that of Drake diagrams outside of trials, and with pads of twice the damping. Where its verdict
changes, the grasp hinges on what neither method knows of the world; the list says so.

`--converge` has the oracle judge the grasps at half the step and with twice as many samples, too:
of 72 hard cases no verdict changes, and of those of `--strangers` one at half the step.

FOLDER keeps the library and a journal (trials.jsonl): a run that was interrupted goes on where it
was. After a change of contact geometry or engine take a new folder.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from itertools import islice
from multiprocessing import get_context
from pathlib import Path
from typing import get_args

from contact_oracle_report import Probes, differs, print_report
from contact_oracle_trials import CANARIES, KNOWN, build, run_engine
from oracle.cases import MARGIN, STRANGER_CASES, Case, draw_cases, judge, load_cases
from oracle.catalogue import HELD_OUT, SPACING, TUNED
from oracle.strangers import STRANGERS
from oracle.trial import DEFAULT_NUMERICS, Numerics
from trial_journal import Row, TrialJournal

from burg_drake.core import content_hash
from burg_drake.objects import ContactKind

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
"""Other worlds. The compliant table of diagrams is a box 0.1 m thick with a modulus of 1e6 Pa; in
trials objects stand on feet instead."""
CHUNK = 4
"""Trials that a worker executes before it reports."""


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
        what: tuple[object, ...] = (case.X_OG, case.friction, case.mass)
        if self.label in KNOWN:
            what = (*what, Path(self.library).name)
        return f"{case.id} {self.label} {content_hash(what)[:12]}"


def main() -> None:
    """Runs the study, or what is left of it."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--engine", action="append", choices=list(KNOWN), help="may be repeated")
    parser.add_argument("--contact", choices=get_args(ContactKind), help="as the pipeline decides")
    chosen = parser.add_mutually_exclusive_group()
    chosen.add_argument("--hard", action="store_true", help="the frozen hard cases")
    chosen.add_argument("--strangers", action="store_true", help="those of other objects")
    chosen.add_argument("--all", type=counted, metavar="N", help="random grasps of each object")
    parser.add_argument("--converge", action="store_true", help="the oracle, more finely")
    parser.add_argument("-o", "--output", type=Path, default=Path("contact_oracle"))
    parser.add_argument("--workers", type=int, default=2)
    arguments = parser.parse_args()
    arguments.output.mkdir(parents=True, exist_ok=True)
    names, cases = chosen_cases(arguments)
    words = ["library", *(["strangers"] if arguments.strangers else [])]
    words += [arguments.contact] if arguments.contact is not None else []
    library = str(build(arguments.output / "_".join(words), names, arguments.contact).resolve())
    is_random = arguments.all is not None
    canaries = () if is_random or arguments.strangers else CANARIES
    engines = list(dict.fromkeys((*(arguments.engine or ENGINES), *canaries)))
    finer, probes = list(FINER) if arguments.converge else [], list(PROBES) if is_random else []
    runs = [
        Run(case, label, library) for label in (ORACLE, *engines, *finer, *probes) for case in cases
    ]
    journal = TrialJournal(arguments.output / "trials.jsonl")
    with ProcessPoolExecutor(arguments.workers, get_context("spawn")) as pool:
        journal.complete(pool, runs, chunked, execute)
        judged = {(run.case.id, run.label): journal.rows[run.key] for run in runs}
        open_cases = [c for c in cases if any(differs(c, e, judged) for e in (*engines, *finer))]
        hinges = [Run(case, label, library) for label in HINGES for case in open_cases]
        journal.complete(pool, hinges, chunked, execute)
    rows = {(run.case.id, run.label): journal.rows[run.key] for run in (*runs, *hinges)}
    print_report(cases, [*engines, *finer], Probes(probes, list(HINGES)), rows)


def chosen_cases(arguments: argparse.Namespace) -> tuple[Sequence[str], list[Case]]:
    """Names of objects, and the grasps of them that were asked for."""
    if arguments.strangers:
        return tuple(STRANGERS), load_cases(STRANGER_CASES)
    if arguments.all is not None:
        return (*TUNED, *HELD_OUT), random_cases(arguments.all)
    return (*TUNED, *HELD_OUT), load_cases()


def counted(text: str) -> int:
    """A number of grasps from the command line.

    Raises:
        argparse.ArgumentTypeError: it is not 1 or more.
    """
    if not text.isdecimal() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"{text!r} is not a number from 1 on")
    return int(text)


def random_cases(each: int) -> list[Case]:
    """Grasps with mixed friction and mass, so many of each object."""
    return [c for name in (*TUNED, *HELD_OUT) for c in islice(draw_cases(name, "all"), each)]


def chunked(runs: Sequence[Run]) -> list[list[Run]]:
    """What a worker executes before it reports."""
    return [list(runs[i : i + CHUNK]) for i in range(0, len(runs), CHUNK)]


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
