"""The stations that the package installs: each arm reaches its board as the station is meant to."""

from __future__ import annotations

import numpy as np
import pytest

from burg_drake.core import builtin_names, grasp_from_axes
from burg_drake.motion import ArmReach, ReachabilitySettings, empty_scene, map_reachability
from burg_drake.station import load_station
from tests.thorough import thorough

LIKE_ANOTHER = {"panda_bin", "panda_offset", "panda_pedestal"}
WITH_ARM = [
    thorough(name) if name in LIKE_ANOTHER else name
    for name in builtin_names("stations")
    if load_station(name).document.arm is not None
]
COARSE = ReachabilitySettings(
    spacing=0.12, heights=(0.05,), tilts_deg=(0.0, 45.0), headings=(1, 4), yaws=2
)
FROM_ABOVE = {"panda_bin": 0.8, "panda_shelf": 0.75}
"""Share of the board that has to be reached straight down; all of it where nothing is said. Walls
are in the way of the open hand beside them."""


@pytest.mark.parametrize("name", WITH_ARM)
def test_the_board_is_reached(name: str) -> None:
    reachability = map_reachability(empty_scene(), load_station(name), settings=COARSE)
    assert reachability.covered_from_above[0] >= FROM_ABOVE.get(name, 1.0)
    assert reachability.covered[0] > 0.9


@pytest.mark.parametrize("name", WITH_ARM)
def test_grasps_from_above_can_be_done(name: str) -> None:
    """Approach and lift included, closing along the sheet's width 5 cm above it: over its middle
    and inside each corner by 5 cm, or by as much as the hand is wide where there are walls. Not
    nearer to the arm than 30 cm, as it cannot lift from there; and under the shelf's roof there is
    no room to lift."""
    scene, station = empty_scene(), load_station(name)
    assert station.document.arm is not None
    x, y = scene.board.size
    inside = 0.13 if name in ("panda_bin", "panda_shelf") else 0.05
    places = [(a, b) for a in (inside, x - inside) for b in (inside, y - inside)]
    places += [(x / 2, y / 2), (x / 2, 0.1)]
    X_WS, X_WA = station.document.X_WS.matrix(), station.document.arm.X_WA.matrix()
    X_WG = np.array(
        [X_WS @ grasp_from_axes((1, 0, 0), (0, 0, -1), (*place, 0.05)) for place in places]
    )
    far = np.hypot(*(X_WG[:, :2, 3] - X_WA[:2, 3]).T) > 0.3
    roofed = [name == "panda_shelf" and b > 0.17 for _, b in places]
    X_WG = X_WG[far & ~np.array(roofed)]
    assert len(X_WG) >= 3
    found = ArmReach(scene, station).check_all([""] * len(X_WG), X_WG)
    assert [f"{f.outcome} {f.blocker}" for f in found if f.outcome is not None] == []


def test_the_back_of_the_shelf_is_reached_from_the_front_alone() -> None:
    """15 cm above the sheet the roof keeps the hand from pointing down, not from tilting."""
    settings = ReachabilitySettings(
        spacing=0.07, heights=(0.15,), tilts_deg=(0.0, 60.0), headings=(1, 8), yaws=4
    )
    reachability = map_reachability(empty_scene(), load_station("panda_shelf"), settings=settings)
    back = reachability.y > 0.28  # of S: the depth of the compartment
    assert reachability.share_from_above[0, back].max() == 0.0
    tilted = reachability.reached[0, back][..., reachability.tilt > 0.5]
    assert tilted.any(axis=-1).mean() > 0.9
    towards = (-reachability.R_WG[reachability.tilt > 0.5, :, 2])[:, 0]  # > 0: hand from the back
    assert not tilted[..., towards > 0.1].any()
