"""A replay of the whole arm begins at home, ends with the target lifted, and plays in a loop."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from eye import VIEWS, in_view, messages

from burg_drake.core import Outcome, grasp_from_axes, transform_points
from burg_drake.motion import Plan, plan
from burg_drake.simulation import ArmTrial
from burg_drake.station import ENGINES, load_station
from burg_drake.visualization import open_meshcat, record_arm_trial
from tests.evaluation.composed import tabletop

X_OG = grasp_from_axes((1, 0, 0), (0, 0, -1), (0.0, 0.0, 0.18))
"""Across the narrow side of the household box, from above."""


def test_the_arm_is_recorded_from_home_on() -> None:
    scene, station = tabletop("box"), load_station("panda_tabletop")
    found = plan(scene, station, "box", X_OG, width=0.06)
    assert isinstance(found, Plan)
    meshcat = open_meshcat()
    whole = replace(ENGINES["screening"], whole_trial=True)
    trial = ArmTrial(scene, station, engine=whole, transfer=True, meshcat=meshcat)
    result = record_arm_trial(trial, "box", X_OG, found, meshcat)
    assert result.outcome is Outcome.LIFTED
    shortest = found.transfer.duration + found.approach.duration + found.lift.duration
    assert result.margins.end_time > shortest  # and the hand has closed and held
    assert np.isfinite(result.margins.tracking_error)
    assert meshcat.get_mutable_recording().autoplay()
    page = meshcat.StaticHtml()
    assert any(b"set_animation" in message for message in messages(page))
    (x, y), X_WS = scene.board.size, station.document.X_WS.matrix()
    board = transform_points(X_WS, [[0, 0, 0], [x, 0, 0], [x, y, 0], [0, y, 0]])
    hand = X_WS @ scene.X_SO("box") @ X_OG
    board = np.vstack([board, hand[:3, 3], hand[:3, 3] + (0.0, 0.0, 0.15)])
    for view in VIEWS:
        assert np.abs(in_view(page, board, view)).max() < 1.0, view
    assert meshcat.HasPath("/drake/visualizer/arm")
