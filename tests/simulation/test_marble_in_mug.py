"""A marble dropped into the built mug lies on its inner floor: what is hollow stays hollow.

Floor and wall are measured on the surface meshes, which Drake never sees.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator

from burg_drake.core import Pose
from burg_drake.objects import load_library
from burg_drake.scene import Instance, Scene, SceneDocument
from burg_drake.simulation import settle
from burg_drake.station import build_station_diagram, load_station

LIBRARY = load_library("household")
MUG_AT, BESIDE = (0.3, 0.2), 0.012
"""Where the mug stands, and how far from its axis the marble falls [m]."""


def inner_floor() -> float:
    """Height of the surface that a vertical line on the mug's axis meets first from above [m]."""
    hits, _, _ = LIBRARY.surface("mug").ray.intersects_location([[0, 0, 1.0]], [[0, 0, -1.0]])
    return float(hits[:, 2].max())


def inner_radius(z: float) -> float:
    """Distance from the axis to the wall at height z [m]."""
    directions = [[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0]]
    hits, _, _ = LIBRARY.surface("mug").ray.intersects_location([[0, 0, z]] * 4, directions)
    return float(np.linalg.norm(hits[:, :2], axis=1).min())


def test_the_marble_lies_on_the_inner_floor() -> None:
    lower, upper = LIBRARY.surface("marble").bounds
    radius, middle = float(upper[0] - lower[0]) / 2.0, (lower + upper) / 2.0
    rim = LIBRARY.entry("mug").upper[2]
    x, y = MUG_AT
    above = (x + BESIDE - middle[0], y - middle[1], rim + 0.01 - lower[2])
    instances = (
        Instance(object="mug", X_SO=Pose((x, y, 0.0))),
        Instance(object="marble", X_SO=Pose(above)),
    )
    document = SceneDocument(name="marble", library="household", instances=instances)
    scene = Scene(document, LIBRARY, Path("marble.yaml"))
    built = build_station_diagram(scene, load_station("panda_tabletop"), robot="none")
    simulator = Simulator(built.diagram)
    settle(simulator, built.plant, built.free.values(), 0.8)
    context = built.plant.GetMyContextFromRoot(simulator.get_context())
    X_WO, X_WM = (
        built.plant.EvalBodyPoseInWorld(context, built.plant.get_body(built.free[name]))
        for name in ("mug", "marble")
    )
    p_OQ = X_WO.inverse() @ (X_WM @ middle)  # centre of the marble in the mug
    floor = inner_floor()
    assert 0.0 < floor < 0.2 * rim
    assert p_OQ[2] == pytest.approx(floor + radius, abs=1e-3)
    assert np.hypot(*p_OQ[:2]) < inner_radius(floor + radius) - radius + 1e-3
