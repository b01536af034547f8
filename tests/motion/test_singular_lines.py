"""Grasps whose straight segments pass near postures with the upper arm upright or a folded wrist,
where the redundant joint is a poor parameter.

Each has been proven by `benchmarks/reach_prover.py`, which shares no inverse kinematics, no search
and no collision checker with the reach check.
"""

import importlib.util
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from burg_drake.core import grasp_from_axes
from burg_drake.motion import ArmKinematics, ArmReach
from burg_drake.scene import load_scene
from burg_drake.station import load_station

pytestmark = pytest.mark.thorough

SOURCE = Path(__file__).resolve().parents[2] / "benchmarks" / "reach_audit.py"
GRASPS = [
    ("bottle", (0.607, 0.793, -0.042), (0.793, -0.609, -0.033), (0.310, 0.092, 0.168), 0.016),
    ("bottle", (0.637, 0.768, 0.074), (0.720, -0.626, 0.300), (0.310, 0.092, 0.171), 0.015),
    ("mug", (-0.841, 0.529, -0.112), (0.260, 0.215, -0.941), (0.343, 0.188, 0.072), 0.004),
]
"""Target, closing and approach direction, place [m], width [m]."""


def test_they_are_reached_and_nothing_collides() -> None:
    spec = importlib.util.spec_from_file_location("reach_audit", SOURCE)
    assert spec is not None and spec.loader is not None
    reach_audit = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = reach_audit
    spec.loader.exec_module(reach_audit)
    whole, station = load_scene("tabletop_twelve"), load_station("panda_shelf")
    two = tuple(i for i in whole.document.instances if i.object in ("bottle", "mug"))
    scene = replace(whole, document=replace(whole.document, instances=two))
    reach, audit = ArmReach(scene, station), reach_audit.Audit(scene, station)
    X_WG = np.array([grasp_from_axes(x, z, p) for _, x, z, p, _ in GRASPS])
    names, widths = [name for name, *_ in GRASPS], np.array([width for *_, width in GRASPS])
    arm = ArmKinematics.of(reach.diagram)
    for name, width, found in zip(names, widths, reach.check_all(names, X_WG, widths), strict=True):
        assert found.outcome is None, (name, found)
        motion = found.path
        assert motion is not None
        assert not audit.faults(name, motion, float(width), step=0.03)
        p = arm.forward(motion.lift)[0][:, :3, 3]  # the arm stands at the origin of the world
        np.testing.assert_allclose(p[-1] - p[0], (0.0, 0.0, 0.3), atol=1e-6)
        assert np.abs(np.diff(motion.lift, axis=0)).max() < 0.35
