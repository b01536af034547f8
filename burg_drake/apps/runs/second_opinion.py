"""`burg-drake evaluate --rejudge contested`: another engine settles contested verdicts."""

from __future__ import annotations

import argparse
from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from burg_drake.apps.options import Parser
from burg_drake.core import InvalidInputError
from burg_drake.core.grasps import CONTESTED

if TYPE_CHECKING:
    from burg_drake.core.grasps import Mode
    from burg_drake.evaluation.records import Columns
    from burg_drake.evaluation.store import Campaign, Run
    from burg_drake.evaluation.workers import Executor
    from burg_drake.station.document import Engine

REJUDGE = ("contested",)
SETTLED_COLUMNS = ("judged_again", "outcome_before", "outcome", "confidence")
"""Columns that `settled_line` reads."""


def add_rejudge_contested(parser: Parser) -> None:
    """Adds --rejudge."""
    parser.add_argument(
        "--rejudge",
        choices=REJUDGE,
        help="afterwards, evaluate contested grasps again with the preset of --engine",
    )


def first_engine(arguments: argparse.Namespace, folder: str, mode: Mode) -> Engine | str:
    """The engine that judges all grasps: with --rejudge that of the run in the folder, and standard
    of a new one.

    Raises:
        InvalidInputError: a shard is asked for; and see `require_second_engine`, also for other
            errors.
    """
    from burg_drake.evaluation import require_second_engine
    from burg_drake.evaluation.store import RUN_FILE, is_campaign, open_results
    from burg_drake.station.document import DEFAULT_ENGINE, ENGINES

    chosen: str = arguments.engine
    if arguments.rejudge is None:
        return chosen
    exists = is_campaign(folder) or (Path(folder) / RUN_FILE).exists()
    engine = open_results(folder).document.engine if exists else ENGINES[DEFAULT_ENGINE]
    if arguments.shard is not None:
        raise InvalidInputError(
            "--rejudge settles a whole run; merge the shards first (burg-drake merge), or leave"
            " --shard out"
        )
    require_second_engine(chosen, engine, mode)
    return engine


Judged = TypeVar("Judged", "Run", "Campaign")


def settle(run: Judged, arguments: argparse.Namespace, executor: Executor | None) -> Judged:
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


def settled_line(columns: Columns) -> str:
    """How many verdicts another engine has settled, and how many of them changed.

    Args:
        columns: `SETTLED_COLUMNS` of a run.
    """
    import numpy as np

    engine, before, outcome, confidence = (columns[name] for name in SETTLED_COLUMNS)
    again = np.flatnonzero(engine != "")
    if not len(again):
        known = np.isfinite(confidence).any()
        return "no verdict is contested" if known else "no verdict has a confidence to go by"
    engines = ", ".join(sorted(set(engine[again].tolist())))
    changed = Counter(
        f"{was} to {now}"
        for was, now in zip(before[again].tolist(), outcome[again].tolist(), strict=True)
        if was != now
    )
    many = "" if len(again) == 1 else "s"
    text = f"settled {len(again)} contested grasp{many} by {engines}; changed {changed.total()}"
    details = ", ".join(f"{n} from {what}" for what, n in changed.most_common())
    text += f" ({details})" if details else ""
    close = int((confidence[again] < CONTESTED).sum())
    return f"{text}; close for it, too: {close}" if close else text
