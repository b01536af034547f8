"""`burg-drake evaluate --rejudge contested`: another engine settles contested verdicts."""

from __future__ import annotations

import argparse
from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING

from burg_drake.apps.options import Parser
from burg_drake.core import InvalidInputError

if TYPE_CHECKING:
    from burg_drake.evaluation.store import Run
    from burg_drake.evaluation.workers import Executor
    from burg_drake.station.document import Engine

REJUDGE = ("contested",)


def add_rejudge_contested(parser: Parser) -> None:
    """Adds --rejudge."""
    parser.add_argument(
        "--rejudge",
        choices=REJUDGE,
        help="when all grasps are judged, have the preset that --engine names execute again those"
        " whose verdict is contested, and take its verdict; all grasps are judged first with the"
        " engine of the run, or with a new run with standard",
    )


def require_one_scene(arguments: argparse.Namespace) -> None:
    """Refuses --rejudge for a run over many scenes, or for a shard.

    Raises:
        InvalidInputError: it is given.
    """
    if arguments.rejudge is not None:
        raise InvalidInputError(
            "--rejudge settles the run of one scene; give one scene, and its run as -o"
        )


def first_engine(arguments: argparse.Namespace, folder: str) -> Engine | str:
    """The engine that judges all grasps: with --rejudge that of the run in the folder, and standard
    of a new one.

    Raises:
        InvalidInputError: that is the one which is to judge again.
    """
    from burg_drake.evaluation.store import RUN_FILE, load_run
    from burg_drake.station.document import DEFAULT_ENGINE, ENGINES

    chosen: str = arguments.engine
    if arguments.rejudge is None:
        return chosen
    exists = (Path(folder) / RUN_FILE).exists()
    engine = load_run(folder).document.engine if exists else ENGINES[DEFAULT_ENGINE]
    if engine == ENGINES[chosen]:
        others = ", ".join(name for name in ENGINES if ENGINES[name] != engine)
        raise InvalidInputError(
            f"--rejudge needs another engine than {engine.name!r}, which judges all grasps; give"
            f" --engine with one of {others}"
        )
    return engine


def settle(run: Run, arguments: argparse.Namespace, executor: Executor | None) -> Run:
    """Judges contested grasps again, if that is asked for, and says what came of it."""
    if arguments.rejudge is None:
        return run
    from burg_drake.evaluation import judge_again

    return judge_again(
        run,
        engine=arguments.engine,
        executor=executor,
        workers=arguments.workers,
        progress=not arguments.quiet,
    )


def settled_line(run: Run) -> str:
    """How many verdicts another engine has settled, and how many of them changed; empty if none."""
    again = [v for v in run.verdicts.values() if v.judged_again]
    if not again:
        return ""
    engines = ", ".join(sorted({v.judged_again for v in again}))
    changed = Counter(
        f"{v.outcome_before} to {v.outcome}" for v in again if v.outcome_before != v.outcome
    )
    many = "" if len(again) == 1 else "s"
    text = f"settled {len(again)} contested grasp{many} by {engines}; changed {changed.total()}"
    details = ", ".join(f"{n} from {what}" for what, n in changed.most_common())
    return f"{text} ({details})" if details else text
