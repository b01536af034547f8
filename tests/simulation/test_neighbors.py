"""Which objects take part in a trial."""

from __future__ import annotations

import numpy as np
import pytest

from burg_drake.core.frames import make_pose, rotation_from_rpy
from burg_drake.simulation.neighbors import MARGIN, Prism, bounding_prism, taking_part

LOWER, UPPER = np.array([-0.05, -0.02, 0.0]), np.array([0.05, 0.02, 0.1])
HAND = (np.array([-0.01, -0.01, -0.1]), np.array([0.01, 0.01, 0.02]))


def at(x: float, y: float, z: float = 0.0, yaw: float = 0.0) -> Prism:
    return bounding_prism(LOWER, UPPER, make_pose(rotation_from_rpy((0, 0, yaw)), (x, y, z)))


def above(x: float, y: float) -> Prism:
    return bounding_prism(*HAND, make_pose(rotation_from_rpy((np.pi, 0, 0)), (x, y, 0.1)))


@pytest.mark.parametrize("gap", [MARGIN - 1e-6, MARGIN + 1e-6])
def test_gap_between_parallel_faces(gap: float) -> None:
    objects = {"target": at(0, 0), "other": at(0, 0.04 + gap)}
    assert ("other" in taking_part(objects, "target", above(0, 0), 0.3)) == (gap < MARGIN)


def test_diagonal_object_is_not_bounded_by_its_axis_aligned_box() -> None:
    """Turned by 45 degrees the outlines run in parallel, 0.06 m apart; axis-aligned they would
    overlap."""
    shift = 0.1 / np.sqrt(2)
    objects = {"target": at(0, 0, yaw=np.pi / 4), "other": at(shift, -shift, yaw=np.pi / 4)}
    assert taking_part(objects, "target", above(0, 0), 0.3) == {"target"}


def test_neighbours_of_neighbours_and_what_hangs_above() -> None:
    objects = {
        "target": at(0, 0),
        "near": at(0, 0.06),
        "behind": at(0, 0.12),
        "far": at(0, 0.25),
        "above": at(0, 0, z=0.35),
        "out of the way": at(0, 0, z=0.6),
    }
    part = taking_part(objects, "target", above(0, 0), 0.3)
    assert part == {"target", "near", "behind", "above"}


def test_choice_does_not_change_when_the_world_is_turned() -> None:
    rng = np.random.default_rng(0)
    for _ in range(50):
        places = [
            make_pose(
                rotation_from_rpy((0, 0, rng.uniform(0, 6))), (*rng.uniform(-0.15, 0.15, 2), 0)
            )
            for _ in range(6)
        ]
        X_WG = make_pose(rotation_from_rpy(rng.uniform(-3, 3, 3)), (0, 0, 0.1))
        turn = make_pose(rotation_from_rpy((0, 0, rng.uniform(0, 6))), (0.3, 0.2, 0))
        parts = [
            taking_part(
                {str(i): bounding_prism(LOWER, UPPER, X @ p) for i, p in enumerate(places)},
                "0",
                bounding_prism(*HAND, X @ X_WG),
                0.3,
            )
            for X in (np.eye(4), turn)
        ]
        assert parts[0] == parts[1]
