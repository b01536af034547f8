"""Pictures of trials, made ahead in a thread of their own: the renderer belongs to the thread that
made it. What somebody waits for comes first."""

from __future__ import annotations

import threading
from collections import deque

from burg_drake.core import BurgError
from burg_drake.experiment.pages.trial_pictures import TrialPictures
from burg_drake.experiment.pages.tried_runs import TriedRuns, in_blocks

GRASP_SIZE, SETUP_SIZE = (880, 660), (900, 592)
"""Width and height [pixel]."""


class PictureCache:
    """Holds the pictures; makes them from the moment on that somebody asks for one. `close` it.

    Pictures are called `grasp/NUMBER`, of a trial, and `above/BLOCK` and `front/BLOCK`.

    Args:
        runs: of the trials file.
    """

    def __init__(self, runs: TriedRuns) -> None:
        self._runs = runs
        self._trials = {trial.number: trial for trial in runs.sheet.trials}
        self._blocks = {block: trials[0] for block, trials in in_blocks(runs.sheet).items()}
        self._made: dict[str, bytes] = {}
        self._wanted: deque[str] = deque()
        self._changed = threading.Condition()
        self._closed, self._fault = False, ""
        self._thread = threading.Thread(target=self._work, name="pictures", daemon=True)

    @property
    def names(self) -> list[str]:
        """Of all pictures, in the order in which they are needed."""
        found, setup = [], set[int]()
        for number in sorted(self._trials):
            block = self._trials[number].block
            if block not in setup:
                setup.add(block)
                found += [f"above/{block}"]
            found.append(f"grasp/{number}")
        return found

    def close(self) -> None:
        """Ends the thread."""
        with self._changed:
            self._closed = True
            self._changed.notify_all()
        if self._thread.ident is not None:
            self._thread.join()

    def get(self, name: str, seconds: float) -> bytes | None:
        """A picture as JPEG; None if there is none of that name, or it takes longer.

        Raises:
            InvalidInputError: pictures cannot be made.
        """
        kind, _, number = name.partition("/")
        known = self._trials if kind == "grasp" else self._blocks
        if kind not in ("grasp", "above", "front") or not number.isdecimal():
            return None
        if len(number) > 9 or int(number) not in known:
            return None
        with self._changed:
            if not self._over and self._thread.ident is None:
                self._thread.start()
            if name not in self._made:
                self._wanted.append(name)
                self._changed.notify_all()
            self._changed.wait_for(lambda: name in self._made or self._over, seconds)
            return self._made.get(name)

    @property
    def fault(self) -> str:
        """Why there are no pictures; empty if there are."""
        return self._fault

    @property
    def _over(self) -> bool:
        return self._closed or bool(self._fault)

    def _work(self) -> None:
        try:
            pictures = TrialPictures(self._runs)
            ahead = deque(self.names)
            while (name := self._next(ahead)) is not None:
                if name not in self._made:
                    self._keep(self._make(pictures, name))
            del pictures  # the renderer ends in the thread that it began in
        except BurgError as error:
            with self._changed:
                self._fault = str(error)
                self._changed.notify_all()

    def _next(self, ahead: deque[str]) -> str | None:
        """The picture to be made next; waits until one is wanted. None at the end."""
        with self._changed:
            self._changed.wait_for(lambda: self._closed or self._wanted or ahead)
            if self._closed:
                return None
            return self._wanted.pop() if self._wanted else ahead.popleft()

    def _make(self, pictures: TrialPictures, name: str) -> dict[str, bytes]:
        kind, _, number = name.partition("/")
        if kind == "grasp":
            return {name: pictures.grasp(self._trials[int(number)], GRASP_SIZE)}
        above, front = pictures.setup(self._blocks[int(number)], SETUP_SIZE)
        return {f"above/{number}": above, f"front/{number}": front}

    def _keep(self, made: dict[str, bytes]) -> None:
        with self._changed:
            self._made |= made
            self._changed.notify_all()
