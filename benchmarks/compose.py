"""How fast a session answers: status while an object is dragged, steps, undo.

    python benchmarks/compose.py [--objects 20] [--moves 200]

Prints, in CPU time of one core, medians and the slowest twentieth of each. The journal is written
to the disk that holds the working directory.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from collections.abc import Callable
from typing import Any

import numpy as np

from burg_drake.compose import AddObject, ComposeSession, SetBoard, Turn, board_size
from burg_drake.scene import Board
from burg_drake.station import load_station


def main() -> None:
    """Composes a scene, drags each object through the others, and prints what that takes."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--objects", type=int, default=20)
    parser.add_argument("--moves", type=int, default=200)
    parser.add_argument("--station", default="panda_tabletop")
    arguments = parser.parse_args()
    rng = np.random.default_rng(0)
    with tempfile.TemporaryDirectory(dir=".") as folder:
        start = time.process_time()
        station = load_station(arguments.station)
        session = ComposeSession.open("household", station, folder=folder)
        print(f"open: {time.process_time() - start:.2f} s")
        session.do(SetBoard(Board(size=board_size("A1"))))
        objects = sorted(session.view.library.objects)
        adding = [
            _timed(lambda i=i: session.do(AddObject(objects[i % len(objects)])))
            for i in range(arguments.objects)
        ]
        _tell("add an object", adding)
        names = list(session.view.instances)
        turning = [_timed(lambda n=n: session.do(Turn((n,), 30.0))) for n in names]
        _tell("turn an object", turning)
        dragging: list[float] = []
        states: dict[str, int] = {}
        for i in range(arguments.moves):
            name = names[i % len(names)]
            drag = session.drag([name])
            offset = (*rng.uniform(-0.2, 0.2, 2), 0.0)
            dragging.append(_timed(lambda d=drag, o=offset: d.move_by(o)))
            for status in session.view.status.values():
                states[status] = states.get(status, 0) + 1
            drag.cancel()
        _tell(f"status of {len(names)} objects after a drag's move", dragging)
        undoing = [_timed(session.undo) for _ in range(arguments.objects)]
        _tell("undo", undoing)
        print(f"statuses during drags: {states}")
        session.close()


def _timed(action: Callable[[], Any]) -> float:
    start = time.process_time()
    action()
    return time.process_time() - start


def _tell(what: str, times: list[float]) -> None:
    median, slow = np.percentile(times, [50, 95])
    print(f"{what}: {median * 1e3:.1f} ms, slowest twentieth from {slow * 1e3:.1f} ms")


if __name__ == "__main__":
    main()
