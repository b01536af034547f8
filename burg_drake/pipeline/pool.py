"""Builds objects in this process, or several at a time in worker processes."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from burg_drake.core import SimulationError
from burg_drake.core.workers import serve, work_through
from burg_drake.pipeline.keys import StageKeys
from burg_drake.pipeline.source import ObjectSource
from burg_drake.pipeline.stages import Built, build_object


@dataclass(frozen=True)
class BuildTask:
    """An object to build.

    Attributes:
        source: what to build.
        keys: its stage keys.
        root: the library's folder.
        folder: where to build; made when the work begins.
        confirm: simulate the stable poses.
    """

    source: ObjectSource
    keys: StageKeys
    root: Path
    folder: Path
    confirm: bool


Outcome = Built | BaseException


def build_all(work: Sequence[BuildTask], workers: int) -> Iterator[tuple[BuildTask, Outcome]]:
    """Builds objects; see `core.crew.work_through`."""
    return work_through(work, workers, __name__, attempt)


def attempt(item: BuildTask) -> Outcome:
    """Builds one object; one broken mesh is one failure, whatever it broke."""
    try:
        item.folder.mkdir()
        return build_object(item.source, item.keys, item.root, item.folder, item.confirm)
    except Exception as error:
        return error
    except SystemExit as error:  # DRAKE_DEMAND ends this way
        return SimulationError(f"Drake gave up: {error}")


def main(handle: int) -> None:
    """Runs a worker; `handle` is the file descriptor of its end of the pipe."""
    serve(handle, attempt)
