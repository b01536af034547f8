"""What it costs to tell what an arm reaches, and how many grasps are left, while composing.

    python benchmarks/insight.py [--station panda_tabletop] [--scene tabletop_six] [-n 50]

Prints CPU seconds of this process, with an empty cache of its own at the start: for the layer of
what the arm grasps from above on sheets of A3, A2 and A0; for the counts of a scene, the first time
and after moves of its first object, by the hand alone, by the fast screen of the arm and by Drake's
checker; for each rule that scenes are accepted by; and for top views of a photo of 12 megapixels.
"""

from __future__ import annotations

import argparse
import os
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

import burg_drake as burg
from burg_drake.cameras import Intrinsics, board_picture, visible_from
from burg_drake.core import make_pose
from burg_drake.evaluation import clear_grasp_counts, count_grasps, within_reach
from burg_drake.motion import reach_from_above, reach_without_objects
from burg_drake.scene import Board, Scene
from burg_drake.station import Station
from tests.cameras.synthetic import FINE, board_image

SHEETS = {"A3": (0.420, 0.297), "A2": (0.594, 0.420), "A0": (1.189, 0.841)}
STEP = 0.002
"""How far the first object is moved from one count to the next [m]."""
PHOTO = Intrinsics(width=4000, height=3000, focal=(3000.0, 3000.0), center=(1999.5, 1499.5))
MODES: dict[str, dict[str, Any]] = {
    "hand alone": {"reach": False},
    "fast screen of the arm": {"exact": False},
    "Drake's checker": {},
}


def main() -> None:
    """Runs the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--station", default="panda_tabletop")
    parser.add_argument("--scene", default="tabletop_six")
    parser.add_argument("-n", type=int, default=50, help="grasps per object")
    given = parser.parse_args()
    scene, station = burg.load_scene(given.scene), burg.load_station(given.station)
    with tempfile.TemporaryDirectory() as cache:
        os.environ["BURG_DRAKE_CACHE"] = cache
        layers(station)
        counts(scene, station, given.n)
        rules(scene, station)
    photograph(scene.board)


def layers(station: Station) -> None:
    """What the arm grasps from above."""
    timed("the arm made ready over an empty board", reach_without_objects, station)
    for name, size in SHEETS.items():
        layer = timed(f"layer on {name}", reach_from_above, station, Board(size=size))
        print(f"    {layer.share.size} points, {layer.covered:.0%} covered")
        timed(f"layer on {name} from the cache", reach_from_above, station, Board(size=size))


def counts(scene: Scene, station: Station, n: int) -> None:
    """Clear and reachable grasps."""
    turn = 0
    for when in ("first time", "after a move", "after another move"):
        for name, options in MODES.items():
            at, turn = moved(scene, turn), turn + 1
            found = timed(
                *(f"counts, {when}, {name}", count_grasps, at, station),
                grasps_per_object=n,
                **options,
            )
            good = sum(count.good for count in found.values())
            print(f"    {good} of {sum(count.sampled for count in found.values())}")


def rules(scene: Scene, station: Station) -> None:
    """What scenes are accepted by, where a scene like it was seen before."""
    within_reach(scene, station)
    at = moved(scene, 1)
    timed("rule: within reach", within_reach, at, station)
    timed("rule: clear grasps", clear_grasp_counts, at, station)
    for camera in station.document.cameras:
        timed(f"rule: visible from {camera}", visible_from, at, station, camera)


def photograph(board: Board) -> None:
    """The top view of a photo, with and without intrinsics."""
    down = np.diag([1.0, -1.0, -1.0])
    image = board_image(board, PHOTO, make_pose(down, (0.3, 0.2, 0.7)), samples=FINE)
    for name, intrinsics in (("with", PHOTO), ("without", None)):
        picture = timed(f"top view, {name} intrinsics", board_picture, image, board, intrinsics)
        print(f"    markers off by {1e3 * picture.error:.3f} mm")


def moved(scene: Scene, steps: int) -> Scene:
    """The scene with its first object elsewhere."""
    first, *rest = scene.document.instances
    x, y, z = first.X_SO.translation
    pose = replace(first.X_SO, translation=(x + STEP * steps, y, z))
    instances = (replace(first, X_SO=pose), *rest)
    return replace(scene, document=replace(scene.document, instances=instances))


def timed(what: str, call: Callable[..., Any], *args: Any, **options: Any) -> Any:
    """What a call returns; prints its time."""
    start = time.process_time()
    found = call(*args, **options)
    print(f"{time.process_time() - start:7.2f} s  {what}", flush=True)
    return found


if __name__ == "__main__":
    main()
