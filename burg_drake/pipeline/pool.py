"""Builds objects in this process, or several at a time in worker processes."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from burg_drake.core import SimulationError
from burg_drake.core.workers import map_unordered
from burg_drake.objects.meshes import check_size
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


def build_all(
    work: Sequence[BuildTask], workers: int
) -> Iterator[tuple[BuildTask, Built | BaseException]]:
    """Builds objects, each with what came of it; see `core.workers.map_unordered`. The sizes of all
    meshes are checked first: a wrong unit is told before anything takes long."""
    return map_unordered(build, work, workers, check=check_task_size)


def check_task_size(item: BuildTask) -> None:
    """Refuses an object that is too small or too large for a table.

    Raises:
        MeshError: the file cannot be read, or its size tells of a wrong unit.
    """
    check_size(item.source.mesh, item.source.scale)


def build(item: BuildTask) -> Built:
    """Builds one object.

    Raises:
        SimulationError: Drake ended by a failed condition.
        Exception: a broken mesh is one failure, whatever it breaks.
    """
    item.folder.mkdir()
    try:
        return build_object(item.source, item.keys, item.root, item.folder, item.confirm)
    except SystemExit as error:  # DRAKE_DEMAND ends this way
        raise SimulationError(f"Drake failed: {error}") from error
