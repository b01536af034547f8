"""The cost of checking a scene while it is composed: after one object was moved, added or removed,
and of the way to contact; beside a check that begins anew.

    python benchmarks/scene_check.py [LIBRARY ...] [--objects N ...] [--edits N] [--station NAME]

LIBRARY is `household` or a library's folder, of scans for example (`burg-drake library build`).
Objects stand in random stable poses, turned at random, at random places of a grid that they hardly
fill, and one after the other goes to another such place. Prints milliseconds of CPU time, median
and largest. `first` is the first check, which reads all models; `anew` builds all each time.
"""

from __future__ import annotations

import argparse
import math
import statistics
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path

import numpy as np

from burg_drake.core import Pose, make_pose, rot_z
from burg_drake.objects import ObjectLibrary, load_library
from burg_drake.scene import Board, Instance, Scene, SceneDocument
from burg_drake.station import SceneCheck, check_scene, load_station

SPACING = 0.15
"""Of the grid [m]."""
COLUMNS = ("first", "move", "add", "remove", "travel", "anew")


@dataclass
class Times:
    """CPU times [ms] of one number of objects."""

    of: dict[str, list[float]] = field(default_factory=lambda: {name: [] for name in COLUMNS})

    def measure(self, name: str, work: Callable[[], object]) -> None:
        """Runs `work`, and counts it under a name."""
        start = time.process_time()
        work()
        self.of[name].append(1e3 * (time.process_time() - start))


class Composing:
    """A scene of objects at random.

    Args:
        library: where they come from.
        count: how many there are.
        rng: source of randomness.
    """

    def __init__(self, library: ObjectLibrary, count: int, rng: np.random.Generator) -> None:
        self._library, self._rng = library, rng
        self._kinds = [name for name, entry in library.objects.items() if not entry.is_fixed]
        self._side = math.ceil(math.sqrt(1.5 * count))
        size = SPACING * (self._side + 1)
        self._document = SceneDocument(
            name="benchmark", library=str(library.root), board=Board(size=(size, size))
        )
        for k in range(count):
            self.add(self._kinds[k % len(self._kinds)])

    @property
    def scene(self) -> Scene:
        """As it is now."""
        return Scene(self._document, self._library, Path("benchmark.yaml"))

    def name(self) -> str:
        """Of some instance."""
        return str(self._rng.choice([one.name for one in self._document.instances]))

    def kind(self) -> str:
        """Some object of the library."""
        return str(self._rng.choice(self._kinds))

    def direction(self) -> tuple[float, float, float]:
        """Some direction along the table."""
        angle = self._rng.uniform(-np.pi, np.pi)
        return math.cos(angle), math.sin(angle), 0.0

    def add(self, kind: str) -> None:
        """Puts an object somewhere."""
        taken = {one.name for one in self._document.instances}
        name = next(f"{kind}_{k}" for k in range(len(taken) + 1) if f"{kind}_{k}" not in taken)
        one = Instance(name=name, object=kind, X_SO=self._pose(kind))
        self._set((*self._document.instances, one))

    def move(self, name: str) -> None:
        """Puts an instance elsewhere."""
        self._set(
            replace(one, X_SO=self._pose(one.object)) if one.name == name else one
            for one in self._document.instances
        )

    def remove(self, name: str) -> None:
        """Takes an instance away."""
        self._set(one for one in self._document.instances if one.name != name)

    def _set(self, instances: Iterable[Instance]) -> None:
        self._document = replace(self._document, instances=tuple(instances))

    def _pose(self, kind: str) -> Pose:
        x, y = SPACING * (1.0 + self._rng.integers(self._side, size=2))
        stable = int(self._rng.integers(len(self._library.entry(kind).stable_poses)))
        turn = make_pose(rot_z(self._rng.uniform(-np.pi, np.pi)), (x, y, 0.0))
        return Pose.from_matrix(turn @ self._library.entry(kind).X_SO(stable))


def main() -> None:
    """Runs the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("libraries", nargs="*", default=["household"], metavar="LIBRARY")
    parser.add_argument("--objects", type=int, nargs="*", default=[6, 20, 50])
    parser.add_argument("--edits", type=int, default=30)
    parser.add_argument("--station", default="panda_tabletop")
    args = parser.parse_args()
    for reference in args.libraries:
        library = load_library(reference)
        print(f"{library.name} on {args.station}, CPU time [ms]: median (largest)")
        print(f"{'objects':>7} {'overlaps':>8}", *(f"{name:>16}" for name in COLUMNS), " anew/move")
        for count in args.objects:
            _print(count, *_measure(library, count, args.edits, args.station))


def _measure(
    library: ObjectLibrary, count: int, edits: int, station_name: str
) -> tuple[Times, int]:
    station = load_station(station_name)
    composing, times = Composing(library, count, np.random.default_rng(count)), Times()
    check = SceneCheck(station, library)
    times.measure("first", lambda: check.issues(composing.scene))
    for _ in range(edits):
        composing.move(composing.name())
        times.measure("move", lambda: check.issues(composing.scene))
    for _ in range(edits):
        composing.add(composing.kind())
        times.measure("add", lambda: check.issues(composing.scene))
        composing.remove(composing.name())
        times.measure("remove", lambda: check.issues(composing.scene))
    for _ in range(edits):
        slide = partial(check.travel, composing.scene, [composing.name()], composing.direction())
        times.measure("travel", partial(slide, limit=1.0))
    for _ in range(3):
        times.measure("anew", lambda: check_scene(composing.scene, station))
    return times, sum(issue.kind == "overlap" for issue in check.issues(composing.scene))


def _print(count: int, times: Times, overlaps: int) -> None:
    median = {name: statistics.median(values) for name, values in times.of.items()}
    cells = (f"{median[name]:.1f} ({max(times.of[name]):.1f})" for name in COLUMNS)
    ratio = median["anew"] / median["move"]
    print(f"{count:>7} {overlaps:>8}", *(f"{cell:>16}" for cell in cells), f"{ratio:>9.0f}x")


if __name__ == "__main__":
    main()
