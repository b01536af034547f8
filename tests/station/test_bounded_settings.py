"""Settings with which nothing would ever end, or fit into memory."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import pytest

from burg_drake.core import InvalidInputError, Pose
from burg_drake.scene import Board
from burg_drake.simulation import TrialSettings
from burg_drake.station import Arm, ArmControl, Camera, Engine, load_hand


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (
            lambda: TrialSettings(hold_time=1e9),
            "hold_time of a trial .* must be 0 to 30",
        ),
        (lambda: TrialSettings(poll=1e-300), "poll of a trial is 1e-300"),
        (lambda: Engine(name="slow", time_step=1e-300), "time_step of engine 'slow' is 1e-300"),
        (lambda: replace(load_hand("panda_hand"), closing_speed=1e-9), "takes 4e\\+07 s to close"),
        (lambda: Arm(home=(0.0,), velocity=(1e-300,)), "velocity limits must be 0.001 or more"),
        (
            lambda: ArmControl(kp=(1e300,)),
            r"kp .* must be one number, or one for each joint, from 0.001 to 1e",
        ),
        (
            lambda: Camera(X_WC=Pose(), width=10**9),
            "width of a camera is 1e.09; it must be 1 to",
        ),
        (lambda: Camera(X_WC=Pose(), focal=(math.nan, 600.0)), "must be 1 to 1e\\+06"),
        (lambda: Camera(X_WC=Pose(), focal=(600.0, math.nan)), "must be 1 to 1e\\+06"),
        (lambda: Board(size=(1e9, 0.4)), "at most 100 m"),
    ],
)
def test_they_are_refused(make: Callable[[], object], said: str) -> None:
    with pytest.raises(InvalidInputError, match=said):
        make()
