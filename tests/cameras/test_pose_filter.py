"""The filter lowers noise as it says, and follows a moved camera as soon as it says."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from pydrake.common.value import AbstractValue
from pydrake.systems.analysis import Simulator
from scipy.spatial.transform import Rotation

from burg_drake.cameras import BoardEstimate, PoseFilter, Track
from burg_drake.core import InvalidInputError
from tests.cameras.board_views import error, view
from tests.thorough import thorough

TRUTH = view((0.29, 0.2), 0.75, 25.0, 40.0, 15.0)
MOVED = view((0.30, 0.2), 0.75, 25.0, 40.0, 15.0)  # 10 mm
_ROOT = np.random.default_rng(7).normal(size=(6, 6)) * np.array([[2e-4] * 3 + [1e-4] * 3]).T
COVARIANCE = _ROOT @ _ROOT.T


def noisy(truth: np.ndarray, rng: np.random.Generator) -> BoardEstimate:
    off = rng.multivariate_normal(np.zeros(6), COVARIANCE)
    X_SC = truth.copy()
    X_SC[:3, :3] = Rotation.from_rotvec(off[:3]).as_matrix() @ truth[:3, :3]
    X_SC[:3, 3] += off[3:]
    return BoardEstimate(X_SC=X_SC, valid=True, covariance=COVARIANCE)


@pytest.mark.parametrize("window", [thorough(1.0), 16.0])
def test_noise_falls_with_the_square_root_of_the_window(window: float) -> None:
    rng = np.random.default_rng(1)
    pose_filter = PoseFilter(0.1, window=window)
    track, errors, normalised = Track(), [], []
    for k in range(1500):
        track = pose_filter.update(track, noisy(TRUTH, rng))
        assert track.X_SC is not None
        if k > 10 * window:
            errors.append(error(track.X_SC, TRUTH))
            normalised.append(errors[-1] @ np.linalg.solve(track.covariance, errors[-1]))
    ratio = np.std(errors, axis=0) / np.sqrt(np.diag(COVARIANCE))
    assert ratio * np.sqrt(window) == pytest.approx(1.0, abs=0.25)
    assert np.mean(normalised) == pytest.approx(6.0, abs=1.0)  # its covariance is right


def test_a_moved_camera_is_followed_with_the_second_estimate() -> None:
    rng = np.random.default_rng(2)
    pose_filter, track = PoseFilter(0.1), Track()
    for _ in range(20):
        track = pose_filter.update(track, noisy(TRUTH, rng))
    track = pose_filter.update(track, noisy(MOVED, rng))
    assert track.X_SC is not None and np.linalg.norm(error(track.X_SC, TRUTH)[3:]) < 1e-3
    track = pose_filter.update(track, noisy(MOVED, rng))
    assert track.X_SC is not None and np.linalg.norm(error(track.X_SC, MOVED)[3:]) < 1e-3


def test_a_single_outlier_leaves_no_trace() -> None:
    rng = np.random.default_rng(3)
    pose_filter, tracks = PoseFilter(0.1), [Track()]
    for _ in range(20):
        tracks.append(pose_filter.update(tracks[-1], noisy(TRUTH, rng)))
    tracks.append(pose_filter.update(tracks[-1], noisy(MOVED, rng)))
    assert tracks[-1].X_SC is tracks[-2].X_SC
    for _ in range(5):
        tracks.append(pose_filter.update(tracks[-1], noisy(TRUTH, rng)))
    assert tracks[-1].rejected_in_a_row == 0
    steps = [np.linalg.norm(error(b.X_SC, a.X_SC)[3:]) for a, b in pairwise(tracks[2:])]
    assert max(steps) < 1e-3


def test_in_a_simulation_it_holds_for_a_while() -> None:
    pose_filter = PoseFilter(0.1, hold=3)
    simulator = Simulator(pose_filter)
    context = simulator.get_mutable_context()
    port = pose_filter.GetInputPort("estimate")
    seen = noisy(TRUTH, np.random.default_rng(4))
    port.FixValue(context, AbstractValue.Make(seen))
    assert pose_filter.GetOutputPort("valid").Eval(context) == [0.0]
    assert pose_filter.GetOutputPort("X_SC").Eval(context).IsExactlyIdentity()
    assert np.isnan(pose_filter.GetOutputPort("covariance").Eval(context)).all()
    simulator.AdvanceTo(0.05)
    assert pose_filter.GetOutputPort("valid").Eval(context) == [1.0]
    X_SC = pose_filter.GetOutputPort("X_SC").Eval(context).GetAsMatrix4()
    assert np.allclose(X_SC, seen.X_SC, atol=1e-12)
    covariance = pose_filter.GetOutputPort("covariance").Eval(context)
    assert np.allclose(covariance.reshape(6, 6), COVARIANCE)
    port.FixValue(context, AbstractValue.Make(BoardEstimate(reason="no marker")))
    valid = []
    for k in range(1, 6):
        simulator.AdvanceTo(0.1 * k + 0.05)
        valid.append(float(pose_filter.GetOutputPort("valid").Eval(context)[0]))
    assert valid == [1.0, 1.0, 1.0, 0.0, 0.0]


def test_bad_settings() -> None:
    for settings in ({"period": 0.0}, {"period": 0.1, "window": 0.5}, {"period": 0.1, "hold": -1}):
        with pytest.raises(InvalidInputError, match="a pose filter takes"):
            PoseFilter(**settings)
