"""What gets beyond the edge of the board is sent back."""

from __future__ import annotations

import numpy as np
import pytest
from pydrake.multibody.math import SpatialVelocity
from trial_world import make_station

from burg_drake.core import Array
from burg_drake.scene import ObjectShapes
from burg_drake.simulation import RELAXING_ENGINE, BoardEdgeGuard, drop_onto_scene, relax
from burg_drake.station import build_station_diagram

EDGE = 0.05
"""Of the block [m]."""
MARGIN = 0.03
WIDTH = 0.6
"""Of the board [m]."""
FARTHEST = WIDTH - MARGIN - EDGE / 2
"""x in S up to which the block is let go [m]."""


def velocity_after(
    make_scene, x: float, y: float, v_S: tuple[float, float, float], *, locked: bool = False
) -> Array:
    """The velocity (3,) in S of the centre of mass of a block that turns and moves so."""
    scene, station = make_scene(("block", x, y, 0.0)), make_station()
    built = build_station_diagram(scene, station, robot="none")
    R_WS = station.document.X_WS.matrix()[:3, :3]
    context = built.plant.GetMyMutableContextFromRoot(built.diagram.CreateDefaultContext())
    block = built.plant.get_body(built.free["block"])
    turning = np.array([3.0, 2.0, 1.0])
    V_WOcm = SpatialVelocity(turning, R_WS @ v_S)
    p_OcmO = -block.default_com()
    built.plant.SetFreeBodySpatialVelocity(context, block, V_WOcm.Shift(p_OcmO))
    if locked:
        block.Lock(context)
    herd = BoardEdgeGuard(built, ObjectShapes(scene.library), margin=MARGIN, share=1.0)
    herd.push_back(context, [block.index()])
    V_WO = built.plant.EvalBodySpatialVelocityInWorld(context, block)
    assert V_WO.rotational() == pytest.approx(np.zeros(3) if locked else turning)
    return R_WS.T @ V_WO.Shift(-p_OcmO).translational()


@pytest.mark.parametrize("x", [0.3, FARTHEST + 0.0005])
def test_what_is_on_the_board_is_let_go(make_scene, x: float) -> None:
    assert velocity_after(make_scene, x, 0.2, (0.5, 0.1, -0.5)) == pytest.approx([0.5, 0.1, -0.5])


def test_what_leaves_turns_round_and_what_comes_back_does_so_by_itself(make_scene) -> None:
    y = MARGIN + EDGE / 2 - 0.02
    resting, leaving, coming = (
        velocity_after(make_scene, 0.3, y, (0.1, v, 0.0)) for v in (0.0, -0.4, 2.0)
    )
    assert resting[1] > 0.1
    assert leaving == pytest.approx(resting) and coming[1] == pytest.approx(2.0)
    assert resting[[0, 2]] == pytest.approx([0.1, 0.0], abs=1e-12)


def test_what_is_locked_stays(make_scene) -> None:
    still = velocity_after(make_scene, -0.2, 0.2, (0.0, 0.0, 0.0), locked=True)
    assert still == pytest.approx(np.zeros(3))


@pytest.mark.parametrize("beyond", [0.01, 0.05])
def test_what_lands_too_far_out_slides_back_and_not_much_further(make_scene, beyond: float) -> None:
    scene = make_scene(("block", FARTHEST + beyond, 0.2, 0.0))
    landed = drop_onto_scene(scene, make_station(), ["block"], ObjectShapes(scene.library), MARGIN)
    x, y, _ = landed.X_SO("block")[:3, 3]
    assert FARTHEST - 0.02 < x < FARTHEST + 0.002
    assert y == pytest.approx(0.2, abs=0.01)


def test_what_relaxes_beyond_the_edge_comes_back(make_scene) -> None:
    scene, station = make_scene(("block", WIDTH - EDGE / 2 + 0.02, 0.2, 0.0)), make_station()
    built = build_station_diagram(scene, station, robot="none", engine=RELAXING_ENGINE)
    herd = BoardEdgeGuard(built, ObjectShapes(scene.library), margin=0.003, share=1.0)
    relaxed = relax(built, ["block"], 1.0, before_window=herd.push_back)
    X_SO = np.linalg.inv(station.document.X_WS.matrix()) @ relaxed.X_WO["block"]
    assert WIDTH - 0.02 < X_SO[0, 3] + EDGE / 2 < WIDTH
