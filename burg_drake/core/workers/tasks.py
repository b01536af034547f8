"""What a pool of workers is given: tasks, and the sessions that they belong to."""

from __future__ import annotations

import pickle
from collections.abc import Callable, Mapping
from concurrent.futures import Future
from dataclasses import dataclass, field
from typing import Any, Generic, TypeVar

from burg_drake.core.workers.limits import TimeLimit

Result = TypeVar("Result")


@dataclass(eq=False)
class Session:
    """What a worker builds once and hands to every task of the session.

    Attributes:
        key: names what is built; a worker that has it does not build it again, also for another
            session with this key.
        build: builds it; pickled by reference, hence an instance of an importable class or an
            importable function.
        limit: what building may take; any time if None.
        attempts: so many workers in a row that die while they build it end the session.
        error: why it cannot be built; its tasks fail then.
        false_starts: workers in a row that died while they built it.
        pickled: `build`.
    """

    key: str
    build: Callable[[], Any]
    limit: TimeLimit | None = None
    attempts: int = 2
    error: BaseException | None = field(default=None, init=False)
    false_starts: int = field(default=0, init=False)
    pickled: bytes = field(init=False, repr=False)

    def __post_init__(self) -> None:
        self.pickled = pickle.dumps(self.build)


@dataclass(frozen=True, eq=False)
class Task(Generic[Result]):
    """A call of a function in a worker.

    Attributes:
        function: importable; with a session, what that has built is its first argument.
        args: its arguments.
        kwargs: likewise.
        session: what has to be built before, if anything.
        limit: what it may take; any time if None.
        on_progress: called with each message of `report_progress`, in a thread of the pool.
        retries: how often it is tried again when its worker dies; as the pool says if None.
    """

    function: Callable[..., Result]
    args: tuple[Any, ...] = ()
    kwargs: Mapping[str, Any] = field(default_factory=dict)
    session: Session | None = None
    limit: TimeLimit | None = None
    on_progress: Callable[[Any], None] | None = None
    retries: int | None = None

    @property
    def session_key(self) -> str | None:
        """Key of its session, if it has one."""
        return None if self.session is None else self.session.key


class WorkerFuture(Future[Result]):
    """What will become of a task.

    Raises what the task raises, `WorkerDied` if it ends its workers, and `TaskCancelled` if nobody
    waited for it any more while it ran.
    """

    def __init__(self, end: Callable[[WorkerFuture[Any], bool], None]) -> None:
        """Made by a pool.

        Args:
            end: ends it: as it reports progress, or with its process.
        """
        super().__init__()
        self._end = end

    def interrupt(self) -> None:
        """Nobody waits for it any more: it ends when it next reports progress. Nothing if done."""
        if not self.cancel():
            self._end(self, False)

    def terminate(self) -> None:
        """Ends it at once, with the process that runs it. Nothing if done."""
        if not self.cancel():
            self._end(self, True)
