"""CPU time of images with labels, 640 x 480 pixels, beside Drake's own three renderings.

    python benchmarks/rendering.py [SCENE] [--station S] [--views N]

Places the camera on a circle above the board and renders each view: colours by Drake's renderer,
depth and labels by rays, as `burg.render` does; then depth and labels by Drake's renderer as well,
in the same process, and says on how many pixels the two differ. Published for the peer
(BURG-Toolkit on PyBullet, colour, depth and labels): 77 to 82 ms.
"""

from __future__ import annotations

import argparse
import os
import time
from collections.abc import Callable
from typing import Any

import numpy as np
from pydrake.geometry import QueryObject
from pydrake.math import RigidTransform

import burg_drake as burg
from burg_drake.core import make_pose
from burg_drake.dataset import SceneRenderer, View, label_instances, station_view
from burg_drake.station import build_station_diagram, render_cameras

os.environ["LP_NUM_THREADS"] = "0"  # one thread in Mesa's renderer, as in workers
PEER = 0.080
"""The peer's time for colour, depth and labels [s]."""


def main() -> None:
    """Runs the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scene", nargs="?", default="tabletop_six")
    parser.add_argument("--station", default="panda_tabletop")
    parser.add_argument("--views", type=int, default=24)
    arguments = parser.parse_args()
    scene, station = burg.load_scene(arguments.scene), burg.load_station(arguments.station)
    start = time.process_time()
    renderer = SceneRenderer(scene, station)
    first = station_view(station, next(iter(station.document.cameras)))
    renderer.images(first)
    print(f"scene and first image: {time.process_time() - start:.2f} s")
    views = [around(first, scene.board.size, k / arguments.views) for k in range(arguments.views)]
    rows: dict[str, list[float]] = {}
    for view in views:
        timed(
            rows, "depth and labels by rays", lambda v=view: renderer.images(v, ("depth", "labels"))
        )
        timed(
            rows, "and normals", lambda v=view: renderer.images(v, ("depth", "labels", "normals"))
        )
        timed(rows, "colour, depth, labels", lambda v=view: renderer.images(v))
        images = renderer.images(view)
        timed(
            rows,
            "silhouettes, boxes, visibility",
            lambda v=view, i=images: label_instances(renderer, v, i),
        )
    drake = Drake(scene, station)
    for view in views:
        timed(rows, "Drake: colour", lambda v=view: drake.color(v))
        timed(rows, "Drake: depth and labels", lambda v=view: drake.depth_and_labels(v))
    for name, seconds in rows.items():
        median, mean = 1e3 * np.median(seconds), 1e3 * np.mean(seconds)
        print(f"{name:32} median {median:6.1f} ms  mean {mean:6.1f} ms")
    ours = float(np.median(rows["colour, depth, labels"]))
    print(f"colour, depth, labels: {PEER / ours:.1f} times as fast as the published peer")
    differing = [drake.differing_labels(v, renderer.images(v, ("labels",)).labels) for v in views]
    pixels = first.intrinsics.width * first.intrinsics.height
    print(f"labels that differ from Drake's: {sum(differing)} of {pixels * len(views):,} pixels")


def timed(rows: dict[str, list[float]], name: str, run: Callable[[], Any]) -> None:
    """Takes down the CPU time of a call [s]."""
    start = time.process_time()
    run()
    rows.setdefault(name, []).append(time.process_time() - start)


def around(first: View, size: tuple[float, float], share: float) -> View:
    """A view from a circle of 0.7 m above the board, which it looks at."""
    angle = 2.0 * np.pi * share
    middle = np.array([size[0] / 2, size[1] / 2, 0.05])
    p_SC = middle + 0.7 * np.array([0.7 * np.cos(angle), 0.7 * np.sin(angle), 0.714])
    z = (middle - p_SC) / np.linalg.norm(middle - p_SC)
    x = np.cross(z, (0.0, 0.0, 1.0))
    x /= np.linalg.norm(x)
    R_SC = np.column_stack([x, np.cross(z, x), z])
    return View(camera="circle", intrinsics=first.intrinsics, X_SC=make_pose(R_SC, p_SC))


class Drake:
    """Drake's renderer alone."""

    def __init__(self, scene: burg.Scene, station: burg.Station) -> None:
        self.station = station
        self.built = build_station_diagram(scene, station, robot="none", cameras=True)
        self._context = self.built.diagram.CreateDefaultContext()
        scene_graph = self.built.scene_graph
        context = scene_graph.GetMyContextFromRoot(self._context)
        self._query: QueryObject = scene_graph.get_query_output_port().Eval(context)
        self._world = scene_graph.world_frame_id()
        name = next(iter(station.document.cameras))
        self._color, self._depth = render_cameras(station.camera(name))

    def _X_WC(self, view: View) -> RigidTransform:
        return RigidTransform(self.station.document.X_WS.matrix() @ view.X_SC)

    def color(self, view: View) -> Any:
        """Colours."""
        return self._query.RenderColorImage(self._color, self._world, self._X_WC(view))

    def depth_and_labels(self, view: View) -> Any:
        """Depth and labels."""
        X_WC = self._X_WC(view)
        self._query.RenderDepthImage(self._depth, self._world, X_WC)
        return self._query.RenderLabelImage(self._color, self._world, X_WC).data[..., 0]

    def differing_labels(self, view: View, labels: Any) -> int:
        """Pixels whose object is another one."""
        bodies, theirs = self.depth_and_labels(view), np.zeros_like(labels)
        for number, name in enumerate(self.built.free, 1):
            theirs[bodies == int(self.built.free[name])] = number
        return int(np.count_nonzero(theirs != labels))


if __name__ == "__main__":
    main()
