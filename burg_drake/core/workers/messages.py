"""What a pool and its workers send each other."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from burg_drake.core.workers.limits import TimeLimit


@dataclass(frozen=True)
class OpenSession:
    """To a worker: build what a session needs.

    Attributes:
        key: names it from then on.
        build: builds it, pickled.
        drop: keys of what is not needed any more.
        limit: what it may take.
    """

    key: str
    build: bytes
    drop: tuple[str, ...]
    limit: TimeLimit | None


@dataclass(frozen=True)
class Call:
    """A task for a worker.

    Attributes:
        number: of the task.
        work: function, arguments and keyword arguments, pickled.
        session: key of what is the first argument, if any.
        limit: what it may take.
    """

    number: int
    work: bytes
    session: str | None
    limit: TimeLimit | None


@dataclass(frozen=True)
class Calls:
    """To a worker: tasks to do one after the other.

    Attributes:
        calls: the tasks.
        opening: what to build before, if anything; if it cannot be built, they are not done.
    """

    calls: tuple[Call, ...]
    opening: OpenSession | None = None


@dataclass(frozen=True)
class Interrupt:
    """To a worker: nobody waits for a task any more."""

    number: int


@dataclass(frozen=True)
class SessionOpened:
    """From a worker: a session is built, or cannot be, which no other worker could either.

    Attributes:
        error: why it cannot be built.
        where: the error's traceback.
    """

    error: BaseException | None = None
    where: str = ""


@dataclass(frozen=True)
class ProgressMessage:
    """From a worker: what its task reports."""

    number: int
    message: Any


@dataclass(frozen=True)
class Done:
    """From a worker: a task has a result, or has raised an error.

    Attributes:
        number: of the task.
        result: what it returned.
        error: what it raised.
        where: the error's traceback.
    """

    number: int
    result: Any
    error: BaseException | None = None
    where: str = ""


@dataclass(frozen=True)
class Ending:
    """From a worker: it is about to end.

    Attributes:
        reason: why.
    """

    reason: str


Message = SessionOpened | ProgressMessage | Done | Ending
