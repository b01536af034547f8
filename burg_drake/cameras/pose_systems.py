"""Drake systems that estimate and filter the camera's pose over the board."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from pydrake.common.value import AbstractValue
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.systems.framework import BasicVector, Context, InputPort, LeafSystem, State
from pydrake.systems.sensors import ImageDepth32F, ImageRgba8U

from burg_drake.cameras.intrinsics import Intrinsics
from burg_drake.cameras.pose.board_estimate import BoardEstimate
from burg_drake.cameras.pose.board_pose import BoardPose
from burg_drake.cameras.pose.edge_measurement import perturbed_pose, pose_difference
from burg_drake.core import Array, InvalidInputError
from burg_drake.scene import Board


class BoardPoseEstimator(LeafSystem):
    """Estimates where a camera is over a board.

    A pure function of the input images: no state, no update, no lag. Each image is processed once,
    however many outputs are read.

    Input ports:
        color_image: `ImageRgba8U`, of the size of the intrinsics; an empty image, as of a source
            without frames yet, gives an invalid estimate.
        depth_image: `ImageDepth32F` [m] of the same camera, to measure the print's size; may be
            left unconnected.

    Output ports:
        X_SC: `RigidTransform`, camera's optical frame in the scene frame; identity while not valid.
        valid: 1.0 if the pose can be used, else 0.0.
        reprojection_error: [pixels]; NaN while not valid.
        covariance: (36,) row by row, see `BoardEstimate.covariance`; NaN while not valid.
        estimate: the whole `BoardEstimate`.

    Args:
        board: the board.
        intrinsics: of the camera.
        scale: size of the print relative to the document along x and y.
    """

    def __init__(
        self, board: Board, intrinsics: Intrinsics, scale: tuple[float, float] = (1.0, 1.0)
    ) -> None:
        super().__init__()
        self.board_pose = BoardPose(board, intrinsics, scale)
        self._color = self.DeclareAbstractInputPort(
            "color_image", AbstractValue.Make(ImageRgba8U())
        )
        self._depth = self.DeclareAbstractInputPort(
            "depth_image", AbstractValue.Make(ImageDepth32F())
        )
        images = {self.input_port_ticket(port.get_index()) for port in (self._color, self._depth)}
        self._estimate = self.DeclareAbstractOutputPort(
            "estimate", lambda: AbstractValue.Make(BoardEstimate()), self._calc_estimate, images
        )
        self.DeclareAbstractOutputPort(
            "X_SC", lambda: AbstractValue.Make(RigidTransform()), self._calc_X_SC, images
        )
        for name, size in (("valid", 1), ("reprojection_error", 1), ("covariance", 36)):
            self.DeclareVectorOutputPort(
                name,
                size,
                lambda context, output, name=name: output.SetFromVector(
                    np.ravel(getattr(self._estimate.Eval(context), name)).astype(float)
                ),
                images,
            )

    def _calc_estimate(self, context: Context, output: AbstractValue) -> None:
        image = self._color.Eval(context).data
        if image.size == 0:
            output.set_value(BoardEstimate(reason="no image yet"))
            return
        depth = evaluate_optional(self._depth, context)
        known = None if depth is None or not depth.data.size else depth.data[..., 0]
        output.set_value(self.board_pose.estimate(image, depth=known))

    def _calc_X_SC(self, context: Context, output: AbstractValue) -> None:
        estimate = self._estimate.Eval(context)
        output.set_value(rigid_transform(estimate.X_SC) if estimate.valid else RigidTransform())


def rigid_transform(X_AB: Array) -> RigidTransform:
    """Drake's transform of a pose (4, 4), rounding errors of its rotation removed."""
    return RigidTransform(RotationMatrix.ProjectToRotationMatrix(X_AB[:3, :3]), X_AB[:3, 3])


def evaluate_optional(port: InputPort, context: Context) -> Any:
    """The value at a port that may be left unconnected; None if it is."""
    return port.Eval(context) if port.HasValue(context) else None


@dataclass(frozen=True, eq=False)
class Track:
    """State of a pose filter.

    Attributes:
        X_SC: (4, 4) filtered pose; None before the first estimate.
        information: (6, 6) sum of the estimates' inverse covariances, faded by age.
        covariance: (6, 6) of `X_SC`.
        rejected_in_a_row: consecutive estimates that were rejected.
        age: updates since the last accepted estimate.
    """

    X_SC: Array | None = None
    information: Array = field(default_factory=lambda: np.zeros((6, 6)))
    covariance: Array = field(default_factory=lambda: np.full((6, 6), np.nan))
    rejected_in_a_row: int = 0
    age: int = 0


class PoseFilter(LeafSystem):
    """Mean of the latest poses, weighted by covariance; it restarts when the camera moves.

    A Kalman filter for a camera that stands still, in the information form: with every update the
    old information fades, so that at rest the errors are those of a mean of `window` estimates,
    lower by the square root of `window`. An estimate farther from the filtered pose than noise
    explains (a chi-square of 33.1) is rejected; the filter restarts from the `patience`-th rejected
    estimate in a row. So the output lags behind a moved camera by less than `patience` updates;
    moves smaller than the noise are followed within about `window` updates.

    Input ports:
        estimate: `BoardEstimate`, from `BoardPoseEstimator`.

    Output ports:
        X_SC: `RigidTransform`, the filtered pose; identity while not valid.
        valid: 1.0 from the first valid estimate on, until more than `hold` updates have passed
            without an accepted estimate; else 0.0.
        covariance: (36,) of the filtered pose row by row, see `BoardEstimate.covariance`, provided
            that errors of estimates are independent; NaN while not valid.

    Args:
        period: time between updates [s].
        offset: of the updates from whole periods [s], below `period`; `period / 1000` if not
            given. Systems updated at the same time see each other's previous state, so without an
            offset a filter behind a held image is one image late.
        window: number of estimates in an equivalent plain mean.
        patience: consecutive rejected estimates after which the filter restarts.
        hold: updates without an accepted estimate for which the last pose stays valid.
    """

    def __init__(
        self,
        period: float,
        window: float = 8.0,
        patience: int = 2,
        hold: int = 5,
        offset: float | None = None,
    ) -> None:
        super().__init__()
        if period <= 0.0 or window < 1.0 or patience < 1 or hold < 0:
            raise InvalidInputError(
                "a pose filter takes a period above 0 [s], a window and patience of at least 1, and"
                " hold of at least 0"
            )
        offset = 1e-3 * period if offset is None else offset
        if not 0.0 <= offset < period:
            raise InvalidInputError(
                f"offset of a pose filter is {offset:g} s; give 0 or more, and less than its"
                f" period of {period:g} s"
            )
        # The variance of an exponential mean with this factor is 1 / window of one estimate's.
        self._decay = (window - 1.0) / (window + 1.0)
        self._patience, self._hold = patience, hold
        self._input = self.DeclareAbstractInputPort("estimate", AbstractValue.Make(BoardEstimate()))
        self._state = self.DeclareAbstractState(AbstractValue.Make(Track()))
        self.DeclarePeriodicUnrestrictedUpdateEvent(period, offset, self._update)
        state = {self.abstract_state_ticket(self._state)}
        self.DeclareAbstractOutputPort(
            "X_SC", lambda: AbstractValue.Make(RigidTransform()), self._calc_X_SC, state
        )
        self.DeclareVectorOutputPort("valid", 1, self._calc_valid, state)
        self.DeclareVectorOutputPort("covariance", 36, self._calc_covariance, state)

    def update(self, track: Track, estimate: BoardEstimate) -> Track:
        """The filter's state after a new estimate."""
        aged = replace(track, age=track.age + 1)
        if not estimate.valid:
            return aged
        R = estimate.covariance
        seen = np.asarray(np.linalg.inv(R))
        restarted = Track(estimate.X_SC, seen, R)
        if track.X_SC is None or not self._valid(track):
            return restarted
        step = pose_difference(track.X_SC, estimate.X_SC)
        # Chi-square of 6 degrees of freedom that 1 in 100,000 samples exceeds.
        if step @ np.linalg.solve(track.covariance + R, step) > 33.1:
            rejected = track.rejected_in_a_row + 1
            return (
                restarted
                if rejected >= self._patience
                else replace(aged, rejected_in_a_row=rejected)
            )
        information = self._decay * track.information + seen
        gain = np.asarray(np.linalg.solve(information, seen))
        rest = np.eye(6) - gain
        covariance = rest @ track.covariance @ rest.T + gain @ R @ gain.T
        return Track(perturbed_pose(track.X_SC, gain @ step), information, covariance)

    def _update(self, context: Context, state: State) -> None:
        track = self.update(self._track(context), self._input.Eval(context))
        state.get_mutable_abstract_state(int(self._state)).set_value(track)

    def _track(self, context: Context) -> Track:
        track = context.get_abstract_state(int(self._state)).get_value()
        assert isinstance(track, Track)
        return track

    def _valid(self, track: Track) -> bool:
        return track.X_SC is not None and track.age <= self._hold

    def _calc_X_SC(self, context: Context, output: AbstractValue) -> None:
        track = self._track(context)
        if track.X_SC is None or not self._valid(track):
            output.set_value(RigidTransform())
        else:
            output.set_value(rigid_transform(track.X_SC))

    def _calc_valid(self, context: Context, output: BasicVector) -> None:
        output.SetFromVector([float(self._valid(self._track(context)))])

    def _calc_covariance(self, context: Context, output: BasicVector) -> None:
        track = self._track(context)
        known = track.covariance if self._valid(track) else np.full((6, 6), np.nan)
        output.SetFromVector(known.ravel())
