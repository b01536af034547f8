"""Motions of real grasps, with the target in the hand, in a diagram of a simulation: Drake's own
filters, no collision checker, nothing of the reach check."""

from __future__ import annotations

import importlib.util
import sys
from dataclasses import replace
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from burg_drake.core import Pose, rng_from
from burg_drake.grasping import AntipodalSettings, sample_antipodal
from burg_drake.motion import ArmPath, ArmReach
from burg_drake.scene import Scene, load_scene
from burg_drake.station import Obstacle, Station, load_station

SOURCE = Path(__file__).resolve().parents[2] / "benchmarks" / "reach_audit.py"
STEP = 0.03
"""Of the audit here; the benchmark has 5 mm [m]."""
TARGETS = ("mug", "bottle", "bowl")

Motion = tuple[str, ArmPath, float]
"""Target, motion, width."""


@pytest.fixture(scope="module")
def reach_audit() -> ModuleType:
    spec = importlib.util.spec_from_file_location("reach_audit", SOURCE)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def scene() -> Scene:
    whole = load_scene("tabletop_six")
    few = tuple(i for i in whole.document.instances if i.object in TARGETS)
    return replace(whole, document=replace(whole.document, instances=few))


@pytest.fixture(scope="module")
def station() -> Station:
    return load_station("panda_bin")


@pytest.fixture(scope="module")
def motions(scene: Scene, station: Station) -> list[Motion]:
    """One of each of some objects, among them a mug and a bowl that fingers reach into."""
    reach = ArmReach(scene, station)
    found = []
    for name in TARGETS:
        mesh = scene.library.surface(scene.instance(name).object)
        sampled = sample_antipodal(
            mesh, 300, rng_from("audit", name), AntipodalSettings(friction=0.5)
        )
        X_WG = reach.diagram.X_WO(name) @ sampled.X_OG
        above = np.flatnonzero(X_WG[:, 2, 2] < -0.5)[:6]
        verdicts = reach.check_all([name] * len(above), X_WG[above], sampled.width[above])
        pairs = zip(verdicts, sampled.width[above].tolist(), strict=True)
        found += [(name, v.path, width) for v, width in pairs if v.path is not None][:1]
    return found


def test_motions_are_free(
    reach_audit: ModuleType, scene: Scene, station: Station, motions: list[Motion]
) -> None:
    assert len(motions) >= 3
    audit = reach_audit.Audit(scene, station)
    for name, arm_path, width in motions:
        assert not audit.faults(name, arm_path, width, step=STEP), name


def test_what_is_put_in_the_way_is_found(
    reach_audit: ModuleType, scene: Scene, station: Station, motions: list[Motion]
) -> None:
    """By the hand on its way down, and by the target on its way up: a plate over each target that
    hand and target go through."""
    name, arm_path, width = motions[0]
    x, y, _ = arm_path.X_WG[:3, 3]
    plate = Obstacle(X_WB=Pose((float(x), float(y), 0.3)), size=(0.2, 0.2, 0.01))
    background = {**station.document.background, "plate": plate}
    other = replace(station, document=replace(station.document, background=background))
    faults = reach_audit.Audit(scene, other).faults(name, arm_path, width, step=STEP)
    met = {(fault.part, *fault.bodies) for fault in faults}
    assert ("approach", "panda_hand", "plate") in met
    assert ("lift", name, "plate") in met


def test_a_target_pushed_down_is_found(
    reach_audit: ModuleType, scene: Scene, station: Station, motions: list[Motion]
) -> None:
    """The lift runs backwards: the target is taken 30 cm down instead of up."""
    name, arm_path, width = motions[0]
    down = replace(arm_path, lift=arm_path.lift[::-1])
    faults = reach_audit.Audit(scene, station).faults(name, down, width, step=STEP)
    assert {fault.part for fault in faults} == {"lift"}
    met = {fault.bodies for fault in faults}
    assert (name, "table") in met
    assert not any(name in bodies and "panda_hand" in bodies for bodies in met)
