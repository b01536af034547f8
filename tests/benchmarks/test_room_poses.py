"""Poses in pictures of the room, which shares no code with the estimator."""

from __future__ import annotations

import pytest
from room_board import MOST_ERROR, negative, view

pytestmark = pytest.mark.thorough  # another board is found in the room by `test_room`


@pytest.mark.parametrize(
    ("row", "mm"),
    [
        ("overexposed 2", 1.0),
        ("room", 1.5),
        ("motion 4 px", 1.0),
        ("bulge 2 mm", 1.0),
        ("55 % covered", 1.0),
        ("glued 2 mm", 12.0),
        ("99 % along x", 8.0),
        ("principal point", 1.0),
    ],
)
def test_poses_are_found_and_errors_are_what_the_covariance_says(row: str, mm: float) -> None:
    for k in range(3):
        ours, _ = view(row, "640x480", 3, k)
        assert ours.valid, ours.reason
        assert ours.position < mm
        assert ours.most < MOST_ERROR


def test_another_board_gives_no_pose() -> None:
    other = negative("ids shifted by 20", "640x480", 3, 0)
    assert not other.valid
    assert "another board" in other.reason
