"""Rules that scenes are accepted by."""

from __future__ import annotations

from dataclasses import replace

import pytest

from burg_drake.core import InvalidInputError, Pose
from burg_drake.evaluation import clear_grasp_counts, within_reach
from burg_drake.station import Station, load_station
from tests.evaluation.composed import composed

PAIR = composed(("near", "can", 0.1, 0.05, 0.0), ("far", "can", 0.5, 0.37, 0.0))


@pytest.fixture(scope="module")
def panda() -> Station:
    return load_station("panda_tabletop")


def test_what_the_arm_does_not_get_to(panda: Station) -> None:
    """Both at first; then the arm stands aside, 0.5 m from one can and 0.99 m from the other."""
    assert within_reach(PAIR, panda) == ()
    arm = panda.document.arm
    assert arm is not None
    aside = replace(arm, X_WA=Pose((-0.2, 0.3, 0.0)))
    moved = replace(panda, document=replace(panda.document, arm=aside))
    assert within_reach(PAIR, moved) == ("far",)


@pytest.mark.thorough
def test_others_do_not_matter_to_reach(panda: Station) -> None:
    """A can between four boxes is within reach, though none of its grasps is clear."""
    walls = (
        ("a", "box", 0.23, 0.2, 0.0),
        ("b", "box", 0.37, 0.2, 0.0),
        ("c", "box", 0.3, 0.31, 90.0),
        ("d", "box", 0.3, 0.09, 90.0),
    )
    hidden = composed(("can", "can", 0.3, 0.2, 0.0), *walls)
    assert within_reach(hidden, panda) == ()
    counts = clear_grasp_counts(hidden, panda, grasps_per_object=12)
    assert counts["can"] < 4
    assert list(counts) == ["can", "a", "b", "c", "d"]
    assert clear_grasp_counts(PAIR, panda, grasps_per_object=12) == {"near": 12, "far": 12}


def test_a_station_without_an_arm() -> None:
    with pytest.raises(InvalidInputError, match="has no arm; add an 'arm:' section"):
        within_reach(PAIR, load_station("wsg_tabletop"))
