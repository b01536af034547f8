"""How the hand goes to a grasp and away from it."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from burg_drake.core import DocumentError, resolve_reference
from burg_drake.station import GraspMotion, load_station


def test_the_usual_motion_is_that_of_the_paper() -> None:
    motion = load_station("panda_tabletop").document.motion
    assert motion == GraspMotion(standoff=0.10, retreat=0.0, lift_height=0.30)
    assert motion.shortest == 0.30 and motion.direction_W.tolist() == [0.0, 0.0, 1.0]


def with_motion(tmp_path: Path, text: str) -> Path:
    station = tmp_path / "own.yaml"
    built_in = resolve_reference("panda_tabletop", "stations").read_text()
    station.write_text(f"{built_in}\nmotion: {text}\n")
    return station


def test_a_station_states_its_usual_motion(tmp_path: Path) -> None:
    text = "{retreat: 0.05, lift_height: 0.2, least_lift: 0.02, lift_direction: [0, 3, 4]}"
    own, usual = load_station(with_motion(tmp_path, text)), load_station("panda_tabletop")
    assert own.document.motion.shortest == 0.02 and own.document.motion.standoff == 0.10
    assert own.document.motion.direction_W == pytest.approx([0.0, 0.6, 0.8])
    # Who asks says how the hand shall move: the station is the same one.
    assert own.content == usual.content != replace(usual, hand_model=own.path).content


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("{lift_height: 0.1, least_lift: 0.2}", "least_lift is 0.2 m, more than"),
        ("{lift_height: 9}", "lift_height is 9; it must be 0 to 2"),
        ("{lift_height: 0}", "retreat and lift together may be as short as 0 mm"),
        ("{lift_direction: [0, 0, 0]}", r"lift_direction \[0.0, 0.0, 0.0\] has length 0"),
        ("{lift: 0.1}", "'lift'"),
    ],
)
def test_motions_that_cannot_be_are_refused(tmp_path: Path, text: str, told: str) -> None:
    with pytest.raises(DocumentError, match=told):
        load_station(with_motion(tmp_path, text))


def test_a_direction_may_be_an_array() -> None:
    motion = GraspMotion(lift_direction=np.array([0, 1, 1]))  # type: ignore[arg-type]
    assert motion == GraspMotion(lift_direction=(0.0, 1.0, 1.0)) and len({motion}) == 1
