"""Heaps: what ends where it may not is dropped once more."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from burg_drake.core import Pose
from burg_drake.generation import settle_heap
from burg_drake.objects import ObjectLibrary
from burg_drake.scene import Board, Instance, ObjectShapes, Scene, SceneDocument
from burg_drake.simulation import measure_drift
from burg_drake.station import SceneCheck, Station

BESIDE = -3.0
"""x in S of what hangs beside the table [m]."""


def test_what_falls_off_the_table_is_dropped_once_more(
    household: ObjectLibrary, tabletop: Station
) -> None:
    placed = {"box": (0.2, 0.15, 0.05), "can": (BESIDE, 0.15, 0.05)}
    instances = tuple(Instance(object=name, X_SO=Pose(p)) for name, p in placed.items())
    document = SceneDocument(
        name="heap", library="household", board=Board(size=(0.42, 0.297)), instances=instances
    )
    scene = Scene(document, household, Path("heap.yaml"))
    check = SceneCheck(tabletop, household)
    assert {i.instance for i in check.issues(scene) if i.kind == "out_of_bounds"} == {"can"}

    settled = settle_heap(scene, tabletop, check, ObjectShapes(household), np.random.default_rng(0))

    assert settled.drops >= 1 and settled.faulty == ()
    assert list(settled.scene.instances) == ["box", "can"]
    assert settled.scene.X_SO("can")[0, 3] > 0.0
    assert not [issue for issue in check.issues(settled.scene) if issue.is_error]
    for moved in measure_drift(settled.scene, tabletop, duration=1.0).values():
        assert moved.distance < 1e-4 and moved.angle < np.deg2rad(0.02)
