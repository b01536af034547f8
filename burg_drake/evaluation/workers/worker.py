"""The main loop of a worker process: build a judge when told to, then judge what comes."""

from __future__ import annotations

import logging
import os
import pickle
from collections.abc import Callable
from dataclasses import dataclass
from multiprocessing.connection import Connection

from burg_drake.core import BurgError, SimulationError
from burg_drake.core.grasps import Stage, Verdict
from burg_drake.evaluation.candidates import Candidate
from burg_drake.evaluation.stages import Judge, ScreenAnswers, judge_grasp, one_line, screen_grasps
from burg_drake.evaluation.workers.limits import (
    WorkerLimits,
    let_time_limits_end_this_process,
    time_limit,
)


@dataclass(frozen=True)
class Build:
    """Work for a worker: to build a judge.

    Attributes:
        key: names the judge from then on.
        recipe: builds it, pickled.
        drop: judges that are not needed any more.
        limits: what it may take, and each piece of work from then on.
    """

    key: str
    recipe: bytes
    drop: tuple[str, ...]
    limits: WorkerLimits


@dataclass(frozen=True)
class Screening:
    """Work for a worker: the next screen of many grasps.

    Attributes:
        key: of the judge.
        grasps: with the answers of the screens before, the same ones for all.
    """

    key: str
    grasps: tuple[tuple[Candidate, ScreenAnswers], ...]


@dataclass(frozen=True)
class JudgingTask:
    """Work for a worker: all that is left to ask about a few grasps.

    Attributes:
        key: of the judge.
        grasps: to be judged in this order; each with the answers of screens that are known.
        last_try: of a single grasp that has ended another worker before.
    """

    key: str
    grasps: tuple[tuple[Candidate, ScreenAnswers], ...]
    last_try: bool = False


@dataclass(frozen=True)
class Ready:
    """The judge is built.

    Attributes:
        batches: how many grasps to screen at a time, by screen.
    """

    batches: tuple[int, ...]


@dataclass(frozen=True)
class JudgeUnavailable:
    """The judge cannot be built; no other worker could."""

    error: BurgError


@dataclass(frozen=True)
class Screens:
    """A screening is done.

    Attributes:
        screened: all answers so far, in the order of the grasps.
    """

    screened: tuple[ScreenAnswers, ...]


@dataclass(frozen=True)
class Begins:
    """A stage begins."""

    stage: Stage


@dataclass(frozen=True)
class Judged:
    """The next grasp of the task is judged."""

    verdict: Verdict


@dataclass(frozen=True)
class WorkerEnding:
    """Last words."""

    reason: str


Message = Ready | JudgeUnavailable | Screens | Begins | Judged | WorkerEnding


def main(handle: int) -> None:
    """Runs a worker until the parent closes the pipe.

    Args:
        handle: file descriptor of this end of the pipe.
    """
    # A filter, because importing pydrake sets the logger's level back.
    logging.getLogger("drake").addFilter(lambda record: record.levelno >= logging.WARNING)
    let_time_limits_end_this_process()
    connection = Connection(handle)
    try:
        _serve(connection)
    except (EOFError, BrokenPipeError, ConnectionResetError):
        pass  # the parent is gone, and nobody is left to tell
    except SystemExit as error:  # DRAKE_DEMAND ends this way
        connection.send(WorkerEnding(one_line(error)))
    # Destructors of large diagrams take time and nothing is left to be written.
    os._exit(0)


def _serve(connection: Connection) -> None:
    judges: dict[str, Judge] = {}
    limits = WorkerLimits()
    while (work := connection.recv()) is not None:
        if isinstance(work, Build):
            limits = work.limits
            for key in work.drop:
                judges.pop(key, None)
            with time_limit(limits.build, limits.wall):
                built = _build(work.recipe)
            if isinstance(built, JudgeUnavailable):
                connection.send(built)
            else:
                judges[work.key] = built
                connection.send(Ready(tuple(screen.batch for screen in built.screens)))
            continue
        judge = judges[work.key]
        if isinstance(work, Screening):
            with time_limit(limits.cpu, limits.wall):
                screened = screen_grasps(judge, work.grasps)
            connection.send(Screens(tuple(screened)))
            continue
        for candidate, answers in work.grasps:
            with time_limit(limits.cpu, limits.wall):
                verdict = judge_grasp(
                    judge, candidate, lambda s: connection.send(Begins(s)), answers
                )
            connection.send(Judged(verdict))


def _build(recipe: bytes) -> Judge | JudgeUnavailable:
    try:
        make_judge: Callable[[], Judge] = pickle.loads(recipe)
        return make_judge()
    except BurgError as error:
        return JudgeUnavailable(error)
    except Exception as error:
        return JudgeUnavailable(SimulationError(f"cannot build the simulation: {one_line(error)}"))
