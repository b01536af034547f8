"""What became of each scene of a run over many scenes: a line of JSON a change, `scenes.jsonl`.

Runs and journals are the record, and this is only told from them, so that a command that looks at
a thousand finished scenes need not open each. Lines that cannot be read, such as a torn last one,
count as not there; who deletes the file loses time, and the reasons of scenes that failed.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, Literal

from burg_drake.core import InvalidInputError
from burg_drake.core.files import open_regular

LEDGER_FILE = "scenes.jsonl"
LONGEST_LINE = 1 << 16
LedgerState = Literal["open", "done", "failed", "empty"]


@dataclass(frozen=True, kw_only=True)
class SceneState:
    """How far a scene is.

    Attributes:
        scene: its name in the run.
        state: `open` from when its grasps are known, `done` when all that is judged here is,
            `failed` if it cannot be judged, `empty` if there are no grasps for it.
        run: hash of its run.
        grasps: how many it has.
        mine: how many of them are judged here.
        sampling: CPU time of the sampling [s].
        size: of its journal when it was done [bytes].
        failed, interrupted: grasps that could not be simulated, and those of them whose worker was
            ended from outside.
        why: it failed.
        missing: what is said of instances with fewer grasps than asked; see `results.notes`.
    """

    scene: str
    state: LedgerState
    run: str = ""
    grasps: int = 0
    mine: int = 0
    sampling: float = 0.0
    size: int = 0
    failed: int = 0
    interrupted: int = 0
    why: str = ""
    missing: str = ""


KINDS = dict.fromkeys(("scene", "state", "run", "why", "missing"), str) | {"sampling": float}
"""Types of fields; the others are whole numbers."""


class Ledger:
    """The states of scenes, kept in a file."""

    def __init__(self, folder: Path) -> None:
        """Reads the file of a run, if it is there.

        Raises:
            InvalidInputError: it cannot be read.
        """
        self._path = folder / LEDGER_FILE
        self.states: dict[str, SceneState] = {}
        self._offset = 0
        self.refresh()

    def refresh(self) -> None:
        """Reads what others have appended since."""
        if not self._path.exists():
            self.states, self._offset = {}, 0
            return
        with open_regular(self._path) as stream:
            if os.fstat(stream.fileno()).st_size < self._offset:
                self.states, self._offset = {}, 0
            stream.seek(self._offset)
            while (line := stream.readline(LONGEST_LINE)).endswith(b"\n"):
                self._offset += len(line)
                state = _read(line)
                if state is not None:
                    self.states[state.scene] = state

    def note(self, state: SceneState) -> None:
        """Appends a state.

        Raises:
            InvalidInputError: the file cannot be written.
        """
        if self.states.get(state.scene) == state:
            return
        torn = self._path.exists() and not _is_whole(self._path)
        line = ("\n" if torn else "") + _line(state)
        try:
            with self._path.open("a", encoding="utf-8") as stream:
                stream.write(line)
        except OSError as error:
            raise InvalidInputError(f"cannot write {self._path}: {error.strerror}") from error
        self.states[state.scene] = state


def ledger_text(states: Iterable[SceneState]) -> str:
    """The text of a file with these states."""
    return "".join(_line(state) for state in states)


def _line(state: SceneState) -> str:
    """Fields at their default are left out."""
    plain = asdict(SceneState(scene="", state="open"))
    fields = {
        name: value
        for name, value in asdict(replace(state, why=state.why[:4000])).items()
        if value != plain[name] or name in ("scene", "state")
    }
    return json.dumps(fields, separators=(",", ":")) + "\n"


def _read(line: bytes) -> SceneState | None:
    try:
        stored = json.loads(line)
    except (ValueError, RecursionError):
        return None
    if not isinstance(stored, Mapping) or not isinstance(stored.get("scene"), str):
        return None
    fields: dict[str, Any] = dict(stored)
    if fields.get("state") not in ("open", "done", "failed", "empty"):
        return None
    if any(type(value) is not KINDS.get(name, int) for name, value in fields.items()):
        return None
    try:
        return SceneState(**fields)
    except TypeError:
        return None


def _is_whole(path: Path) -> bool:
    with open_regular(path) as stream:
        size = stream.seek(0, os.SEEK_END)
        stream.seek(max(0, size - 1))
        return size == 0 or stream.read(1) == b"\n"
