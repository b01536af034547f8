"""Rows between postures: the hand goes straight, whatever is looked at between them."""

import numpy as np
import pytest

from burg_drake.core import grasp_from_axes
from burg_drake.motion import (
    ClosedFormFiller,
    DenseRows,
    HandPath,
    PandaIk,
    panda_forward,
    straighten_rows,
)
from burg_drake.station import GraspMotion

LOWER = np.array([-2.8973, -1.7628, -2.8973, -3.0718, -2.8973, -0.0175, -2.8973])
UPPER = np.array([2.8973, 1.7628, 2.8973, -0.0698, 2.8973, 3.7525, 2.8973])
IK = PandaIk(np.eye(4), LOWER, UPPER)
PATH = HandPath.of(np.eye(4), np.eye(3), GraspMotion())
LAYERS = np.array([-0.1, -0.05, 0.0, 0.05, 0.1])
START = -1.0
X_AG = grasp_from_axes((0.0, 1.0, 0.0), (0.3, 0.1, -1.0), (0.5, 0.1, 0.3))


def corners(change: float) -> np.ndarray:
    """(1, 5, 7) postures with a redundant joint that changes along the way."""
    q = [IK.solve(PATH.X_AH(X_AG, LAYERS[:1]), np.array([START])).q[0]]
    for k, layer in enumerate(LAYERS[1:], start=1):
        X = PATH.X_AH(X_AG, np.array([layer]))
        found = IK.solve(X, np.array([START + change * k])).q
        q.append(found[np.abs(found - q[-1]).max(axis=1).argmin()])
    return np.array([q])


def rows(tolerance: float, change: float) -> DenseRows:
    return filled(corners(change), tolerance)


def filled(q: np.ndarray, tolerance: float) -> DenseRows:
    filler = ClosedFormFiller(PATH, X_AG[None], q, LAYERS, IK)
    return straighten_rows(filler, np.linspace(0.0, 4.0, 9), np.array([tolerance]))


@pytest.mark.parametrize("change", [0.0, 0.1])
@pytest.mark.parametrize("tolerance", [1e-3, 5e-5])
def test_the_hand_goes_straight(tolerance: float, change: float) -> None:
    found = rows(tolerance, change)
    assert not found.broken.any() and (np.diff(found.layer) > 0.0).all()
    for s in np.linspace(0.0, 1.0, 9):
        q = found.q[:-1] + s * np.diff(found.q, axis=0)
        layer = found.layer[:-1] + s * np.diff(found.layer)
        wanted = PATH.X_AH(X_AG, np.interp(layer, np.arange(5.0), LAYERS))
        p = panda_forward(q)[:, :3, 3] - wanted[:, :3, 3]
        assert np.linalg.norm(p, axis=1).max() <= 1.1 * tolerance


def test_rows_are_on_the_way_exactly() -> None:
    found = rows(5e-5, 0.1)
    wanted = PATH.X_AH(X_AG, np.interp(found.layer, np.arange(5.0), LAYERS))
    np.testing.assert_allclose(panda_forward(found.q), wanted, atol=1e-9)


def test_less_tolerance_takes_more_rows() -> None:
    counts = [len(rows(tolerance, 0.1).q) for tolerance in (1e-3, 2e-4, 2e-5)]
    assert counts[0] < counts[1] < counts[2]


def test_a_jump_between_branches_is_broken() -> None:
    (q,) = corners(0.0)
    X = PATH.X_AH(X_AG, LAYERS[3:])
    found = IK.solve(X, np.array([START]))
    other = found.branch[(found.pose == 0) & (np.abs(found.q - q[3]).max(axis=1) > 0.6)][0]
    for k in range(2):
        q[3 + k] = found.q[(found.pose == k) & (found.branch == other)][0]
    jumping = filled(q[None], 1e-3)
    assert jumping.broken.any()
    assert (jumping.layer[jumping.broken] > 2.0).all()
