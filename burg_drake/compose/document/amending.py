"""Which step a further one may take the place of: a number that is typed digit by digit is one."""

from __future__ import annotations

import time

from burg_drake.compose.document.history import History, HistoryStep

AMENDING = 3.0
"""A step is amended no later than that after it was taken [s]."""


class Amending:
    """The last step, as long as it may be amended."""

    def __init__(self) -> None:
        self._field = ""
        self._step: HistoryStep | None = None
        self._end = 0.0

    def allows(self, field: str, history: History) -> bool:
        """Whether the last step is of the same field, recent, and nothing has happened since."""
        return (
            bool(field)
            and field == self._field
            and history.steps[-1] is self._step
            and history.position == len(history.steps) - 1
            and time.monotonic() < self._end
        )

    def begin(self, field: str, step: HistoryStep) -> None:
        """A step of a field is taken; of none if that is empty."""
        self._field = field
        self._step = step
        self._end = time.monotonic() + AMENDING

    def end(self) -> None:
        """What comes next is a step of its own."""
        self._field = ""
