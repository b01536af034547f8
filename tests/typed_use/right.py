"""What a user may write: type checkers accept all of it and know the types. It is not run."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import assert_type, reveal_type

import numpy as np
from pydrake.systems.framework import Diagram

import burg_drake as burg
from burg_drake.cameras import Intrinsics, load_intrinsics
from burg_drake.evaluation import read_grasps

reveal_type(burg.evaluate)
reveal_type(burg.HandTrial)
reveal_type(burg.GraspSet)

scene, station = burg.load_scene("tabletop_six"), burg.load_station(Path("stations/mine.yaml"))
assert_type(scene, burg.Scene)
assert_type(station, burg.Station)
assert_type(scene.library, burg.ObjectLibrary)
assert_type(scene.board, burg.scenes.Board)
assert_type(scene.instances, dict[str, burg.scenes.Instance])

built = burg.build_station_diagram(scene, station, robot="none", engine=burg.ENGINES["reference"])
assert_type(built, burg.StationDiagram)
diagram: Diagram = built.diagram

grasps = burg.sample_grasps(scene, station, 50, only=["mug"], settings=burg.SamplingSettings())
assert_type(grasps, burg.GraspSet)
close = grasps.select(grasps.width < 0.05).with_columns(mine=np.arange(3))

assert_type(burg.evaluate(scene, station, "runs/one"), burg.Run)
assert_type(burg.evaluate(["one", scene], "panda_tabletop", Path("runs/two")), burg.Campaign)
given: Mapping[str, burg.GraspSet] = {"mug": close}
outcomes = [burg.Outcome(text) for text in burg.reach(scene, station, given).column("outcome")]

result = burg.HandTrial(scene, station).run("mug", grasps.X_OG[0], friction=0.3)
assert_type(result, burg.TrialResult)
assert_type(result.margins, burg.simulation.Margins)

found = burg.plan(scene, station, "mug", grasps.X_OG[0], timing=burg.TimingSettings(speed=0.5))
assert_type(found, burg.Plan | burg.Reach)
if isinstance(found, burg.Plan):
    found.to_csv("plan.csv")

try:
    assert_type(read_grasps(scene, "network.npy"), burg.grasps.GivenGrasps)
    assert_type(load_intrinsics("camera.yaml"), Intrinsics)
except burg.errors.UnknownNameError as error:
    problem: burg.BurgError = error

mode: burg.runs.Mode = "hand"
success: burg.trials.Success = "held"


def tell(progress: burg.runs.Progress) -> None:
    print(progress.done, progress.total)


def of_scene(one: burg.Scene) -> Mapping[str, burg.GraspSet]:
    return {name: close for name in one.instances}


listener: burg.runs.Listener = tell
source: burg.runs.GraspsLike = of_scene
settings = burg.EvaluationSettings(mode=mode)
burg.evaluate(scene, station, "three", grasps=source, settings=settings, progress=listener)
assert_type(burg.HandTrial(scene, station).hand, burg.stations.FloatingHand)
assert_type(burg.arm.ArmSpan.of(burg.ArmReach(scene, station).kinematics, "mine").radius, float)
