"""What a run asks, and that a station has to have what it takes."""

from __future__ import annotations

from pathlib import Path

import pytest

from burg_drake.core import InvalidInputError
from burg_drake.evaluation import EvaluationSettings, evaluate, mode_for, reach
from burg_drake.station import Station, load_station


@pytest.fixture(scope="module")
def bare() -> Station:
    """A station without an arm."""
    return load_station("wsg_tabletop")


def test_the_usual_mode_asks_as_much_as_the_station_can_tell(bare: Station) -> None:
    assert mode_for(load_station("panda_tabletop")) == "reach"
    assert mode_for(bare) == "hand"
    assert mode_for(load_station("panda_tabletop"), "hand") == "hand"


def test_what_needs_an_arm_is_refused_without_one(bare: Station, tmp_path: Path, scene) -> None:
    message = r"^mode 'arm' needs an arm, which station 'wsg_tabletop' lacks; give mode 'hand'$"
    with pytest.raises(InvalidInputError, match=message):
        evaluate(scene, bare, tmp_path / "run", settings=EvaluationSettings(mode="arm"))
    with pytest.raises(InvalidInputError, match="station 'wsg_tabletop' has no arm"):
        reach(scene, bare, {})
    with pytest.raises(InvalidInputError, match=r"^mode is 'leg'; give hand, reach or arm$"):
        evaluate(scene, bare, tmp_path / "run", settings=EvaluationSettings(mode="leg"))  # type: ignore[arg-type]
    assert not (tmp_path / "run").exists()
