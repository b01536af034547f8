"""`burg-drake evaluate --rejudge contested`: another engine settles contested verdicts."""

from __future__ import annotations

import argparse
from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING

from burg_drake.apps.options import Parser
from burg_drake.core import InvalidInputError
from burg_drake.core.grasps import CONTESTED

if TYPE_CHECKING:
    from burg_drake.core.grasps import Mode
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
    """Refuses --rejudge for a run over many scenes.

    Raises:
        InvalidInputError: it is given.
    """
    if arguments.rejudge is not None:
        raise InvalidInputError(
            "--rejudge settles the run of one scene; give one scene, and its run as -o"
        )


def first_engine(arguments: argparse.Namespace, folder: str, mode: Mode) -> Engine | str:
    """The engine that judges all grasps: with --rejudge that of the run in the folder, and standard
    of a new one.

    Raises:
        InvalidInputError: a shard is asked for; and see `require_second_engine`, also for other
            errors.
    """
    from burg_drake.evaluation import require_second_engine
    from burg_drake.evaluation.store import RUN_FILE, load_run
    from burg_drake.station.document import DEFAULT_ENGINE, ENGINES

    chosen: str = arguments.engine
    if arguments.rejudge is None:
        return chosen
    exists = (Path(folder) / RUN_FILE).exists()
    engine = load_run(folder).document.engine if exists else ENGINES[DEFAULT_ENGINE]
    if arguments.shard is not None:
        raise InvalidInputError(
            "--rejudge settles a whole run; merge the shards first (burg-drake merge), or leave"
            " --shard out"
        )
    require_second_engine(chosen, engine, mode)
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
    """How many verdicts another engine has settled, and how many of them changed."""
    again = [v for v in run.verdicts.values() if v.judged_again]
    if not again:
        known = any(v.confidence is not None for v in run.verdicts.values())
        return "no verdict is contested" if known else "no verdict has a confidence to go by"
    engines = ", ".join(sorted({v.judged_again for v in again}))
    changed = Counter(
        f"{v.outcome_before} to {v.outcome}" for v in again if v.outcome_before != v.outcome
    )
    many = "" if len(again) == 1 else "s"
    text = f"settled {len(again)} contested grasp{many} by {engines}; changed {changed.total()}"
    details = ", ".join(f"{n} from {what}" for what, n in changed.most_common())
    text += f" ({details})" if details else ""
    close = sum(v.confidence is not None and v.confidence < CONTESTED for v in again)
    return f"{text}; close for it, too: {close}" if close else text
