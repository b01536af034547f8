"""The main loop of a worker process: build a judge once, then judge what comes."""

from __future__ import annotations

import logging
import os
from collections.abc import Callable
from dataclasses import dataclass
from multiprocessing.connection import Connection

from burg_drake.core.errors import BurgError, SimulationError
from burg_drake.core.outcome import Stage
from burg_drake.evaluation.candidates import Candidate
from burg_drake.evaluation.judge import (
    Judge,
    Screened,
    Verdict,
    judge_grasp,
    one_line,
    screen_grasps,
)


@dataclass(frozen=True)
class Screening:
    """Work for a worker: the next screen of many grasps.

    Attributes:
        grasps: with the answers of the screens before, the same ones for all.
    """

    grasps: tuple[tuple[Candidate, Screened], ...]


@dataclass(frozen=True)
class Task:
    """Work for a worker: all that is left to ask about a few grasps.

    Attributes:
        grasps: to be judged in this order; each with the answers of screens that are known.
        last_try: of a single grasp that has ended another worker before.
    """

    grasps: tuple[tuple[Candidate, Screened], ...]
    last_try: bool = False


@dataclass(frozen=True)
class Ready:
    """The judge is built.

    Attributes:
        batches: how many grasps to screen at a time, by screen.
    """

    batches: tuple[int, ...]


@dataclass(frozen=True)
class Unable:
    """The judge cannot be built; no other worker could."""

    error: BurgError


@dataclass(frozen=True)
class Screens:
    """A screening is done.

    Attributes:
        screened: all answers so far, in the order of the grasps.
    """

    screened: tuple[Screened, ...]


@dataclass(frozen=True)
class Begins:
    """A stage begins."""

    stage: Stage


@dataclass(frozen=True)
class Judged:
    """The next grasp of the task is judged."""

    verdict: Verdict


@dataclass(frozen=True)
class Dying:
    """Last words."""

    reason: str


Message = Ready | Unable | Screens | Begins | Judged | Dying


def main(handle: int) -> None:
    """Runs a worker until the parent closes the pipe.

    Args:
        handle: file descriptor of this end of the pipe.
    """
    # A filter, because importing pydrake sets the logger's level back.
    logging.getLogger("drake").addFilter(lambda record: record.levelno >= logging.WARNING)
    connection = Connection(handle)
    try:
        _serve(connection)
    except (EOFError, BrokenPipeError, ConnectionResetError):
        pass  # the parent is gone, and nobody is left to tell
    except SystemExit as error:  # DRAKE_DEMAND ends this way
        connection.send(Dying(one_line(error)))
    # Destructors of large diagrams take time and nothing is left to be written.
    os._exit(0)


def _serve(connection: Connection) -> None:
    make_judge: Callable[[], Judge] = connection.recv()
    try:
        judge = make_judge()
    except BurgError as error:
        connection.send(Unable(error))
        return
    except Exception as error:
        connection.send(Unable(SimulationError(f"cannot build the simulation: {one_line(error)}")))
        return
    connection.send(Ready(tuple(screen.batch for screen in judge.screens)))
    while (work := connection.recv()) is not None:
        if isinstance(work, Screening):
            connection.send(Screens(tuple(screen_grasps(judge, work.grasps))))
            continue
        for candidate, screened in work.grasps:
            verdict = judge_grasp(judge, candidate, lambda s: connection.send(Begins(s)), screened)
            connection.send(Judged(verdict))
