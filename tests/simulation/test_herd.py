"""What gets beyond the edge of the board is sent back."""

from __future__ import annotations

import numpy as np
import pytest
from pydrake.multibody.math import SpatialVelocity
from trial_world import make_station

from burg_drake.core.frames import Array
from burg_drake.scene.object_shapes import ObjectShapes
from burg_drake.scene.scene import Board
from burg_drake.simulation.herd import Herd
from burg_drake.station.diagram import build_station_diagram

EDGE = 0.05
"""Of the block [m]."""
MARGIN = 0.01
BOARD = Board(size=(0.6, 0.4))


def gained(make_scene, x: float, y: float, v_S: tuple[float, float, float]) -> Array:
    """The velocity (3,) in S that a block gains which turns and moves on the board."""
    scene, station = make_scene(("block", x, y, 0.0)), make_station()
    built = build_station_diagram(scene, station, robot="none")
    R_WS = station.document.X_WS.matrix()[:3, :3]
    context = built.plant.GetMyMutableContextFromRoot(built.diagram.CreateDefaultContext())
    block = built.plant.get_body(built.free["block"])
    before = SpatialVelocity(np.array([0.1, 0.2, 0.3]), R_WS @ v_S)
    built.plant.SetFreeBodySpatialVelocity(context, block, before)

    Herd(built, ObjectShapes(scene.library), MARGIN).drive(context, [block.index()])

    after = built.plant.EvalBodySpatialVelocityInWorld(context, block)
    assert after.rotational() == pytest.approx(before.rotational())
    return R_WS.T @ (after.translational() - before.translational())


@pytest.mark.parametrize("beyond", [-0.1, 0.0005])
def test_what_is_on_the_board_is_let_go(make_scene, beyond: float) -> None:
    x = MARGIN + EDGE / 2 - beyond
    assert gained(make_scene, x, 0.2, (-0.5, 0.0, -0.5)) == pytest.approx(np.zeros(3), abs=1e-12)


@pytest.mark.parametrize("beyond", [0.005, 0.02])
def test_what_slides_back_comes_to_rest_within_the_margin(make_scene, beyond: float) -> None:
    """At a coefficient of friction of 1 it stops where it may be."""
    x = BOARD.size[0] - MARGIN - EDGE / 2 + beyond
    gain = gained(make_scene, x, 0.2, (0.0, 0.0, -0.5))
    assert gain[1:] == pytest.approx([0.0, 0.0], abs=1e-12)
    assert gain[0] ** 2 / (2.0 * 9.81) == pytest.approx(beyond, rel=0.03) and gain[0] < 0.0


def test_what_leaves_turns_round_and_what_comes_back_does_so_by_itself(make_scene) -> None:
    y = MARGIN + EDGE / 2 - 0.02
    leaving = gained(make_scene, 0.3, y, (0.0, -0.4, 0.0))
    assert leaving[1] == pytest.approx(gained(make_scene, 0.3, y, (0.0, 0.0, 0.0))[1] + 0.4)
    assert gained(make_scene, 0.3, y, (0.0, 2.0, 0.0)) == pytest.approx(np.zeros(3), abs=1e-12)


def test_far_away_is_no_reason_to_hurry(make_scene) -> None:
    assert np.linalg.norm(gained(make_scene, -1.0, -1.0, (0.0, 0.0, 0.0))) == pytest.approx(1.0)
