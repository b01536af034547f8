"""Verdicts are the same to the last bit without a cache, with an empty one, with a full one."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from burg_drake.core import grasp_from_axes
from burg_drake.motion import ArmReach, arm_shape
from burg_drake.scene import Scene, load_scene
from burg_drake.station import instance_pose, load_station

KINDS = {"distances", "postures", "roadmap", "robot"}


def few_objects() -> Scene:
    whole = load_scene("tabletop_six")
    two = tuple(i for i in whole.document.instances if i.object in ("bottle", "mug"))
    return replace(whole, document=replace(whole.document, instances=two))


def grasps(scene: Scene, count: int) -> tuple[list[str], np.ndarray]:
    """From above, into instances of the scene and beside them."""
    station = load_station("panda_tabletop")
    rng = np.random.default_rng(0)
    names = [list(scene.instances)[k % len(scene.instances)] for k in range(count)]
    X_OG = [
        grasp_from_axes((np.cos(a), np.sin(a), 0.0), (0.0, 0.0, -1.0), (0.0, 0.0, z))
        for a, z in rng.uniform((0.0, 0.02), (np.pi, 0.12), (count, 2))
    ]
    X_WO = [instance_pose(scene, station, name) for name in names]
    return names, np.array(X_WO) @ np.array(X_OG)


def test_verdicts_do_not_depend_on_the_cache(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    scene = few_objects()
    names, X_WG = grasps(scene, 24)
    found = []
    for place in ("off", str(tmp_path), str(tmp_path)):
        monkeypatch.setenv("BURG_DRAKE_CACHE", place)
        arm_shape._kept.clear()
        reach = ArmReach(scene, "panda_tabletop")
        lower, upper = reach.kinematics.lower, reach.kinematics.upper
        q = np.random.default_rng(1).uniform(lower, upper, (500, 7))
        verdicts = reach.check_all(names, X_WG)
        bits = [
            reach._proximity.bounds(q).lower.tobytes(),
            reach._tree.roadmap.distance.tobytes(),
        ]
        for verdict in verdicts:
            bits += [verdict.outcome, verdict.blocker, np.array(verdict.clearance).tobytes()]
            if way := verdict.path:
                bits += [x.tobytes() for x in (way.transfer, way.approach, way.lift)]
        found.append(bits)
    assert sum(verdict.path is not None for verdict in verdicts) > 2
    assert found[0] == found[1] == found[2]
    assert {path.name.split("-")[0] for path in tmp_path.iterdir()} == KINDS
    assert not caplog.messages
