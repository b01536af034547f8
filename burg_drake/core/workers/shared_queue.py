"""Work that waits for whichever worker is free."""

from __future__ import annotations

import itertools
from collections import deque
from collections.abc import Iterable, Iterator

from burg_drake.core.workers.worker_process import Batch


class SharedQueue:
    """Work of any session, by session."""

    def __init__(self) -> None:
        self._batches: dict[str | None, deque[Batch]] = {}

    def put(self, batch: Batch) -> None:
        """Adds work at the end."""
        self._batches.setdefault(batch[0].task.session_key, deque()).append(batch)

    def take(self, sessions: Iterable[str]) -> Batch | None:
        """Takes the oldest work of one of these sessions, the first that has any."""
        for key in sessions:
            if key in self._batches:
                return self._take(key)
        return None

    def take_oldest(self) -> Batch | None:
        """Takes the oldest work of all."""
        if not self._batches:
            return None
        return self._take(min(self._batches, key=lambda key: self._batches[key][0][0].number))

    def clear(self) -> list[Batch]:
        """Takes all."""
        batches = list(self)
        self._batches.clear()
        return batches

    def __iter__(self) -> Iterator[Batch]:
        return itertools.chain.from_iterable(self._batches.values())

    def __bool__(self) -> bool:
        return bool(self._batches)

    def _take(self, key: str | None) -> Batch:
        batch = self._batches[key].popleft()
        if not self._batches[key]:
            del self._batches[key]
        return batch
