"""The estimator of a camera's pose over a board as a system of Drake."""

from __future__ import annotations

import numpy as np
from pydrake.common.value import AbstractValue
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.systems.framework import BasicVector, Context, InputPort, LeafSystem
from pydrake.systems.sensors import ImageDepth32F, ImageRgba8U

from burg_drake.cameras.optics import Intrinsics
from burg_drake.cameras.pose import BoardEstimate, BoardPose
from burg_drake.core import Array
from burg_drake.scene.document import Board


class BoardPoseEstimator(LeafSystem):
    """Estimates where a camera is over a board.

    A pure function of the images at its inputs: no state, no update, no lag. A picture is looked at
    once, however many outputs are read, and the next one as soon as it is at the input.

    Input ports:
        color_image: `ImageRgba8U`, of the size of the intrinsics; one without pixels, as of a
            source that has none yet, gives an estimate that is not valid.
        depth_image: `ImageDepth32F` [m] of the same camera, to measure the print's size; may be
            left unconnected.

    Output ports:
        X_SC: `RigidTransform`, camera's optical frame in the scene frame; identity while not valid.
        valid: 1.0 if the pose can be used, else 0.0.
        reprojection_error: [pixels]; NaN while not valid.
        covariance: (36,) row by row, see `BoardEstimate.covariance`; NaN while not valid.
        estimate: all of it, as `BoardEstimate`.

    Args:
        board: the board.
        intrinsics: of the camera.
        scale: size of the print against the document along x and y.
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
        self.DeclareVectorOutputPort("valid", 1, self._calc_valid, images)
        self.DeclareVectorOutputPort("reprojection_error", 1, self._calc_error, images)
        self.DeclareVectorOutputPort("covariance", 36, self._calc_covariance, images)

    def _calc_estimate(self, context: Context, output: AbstractValue) -> None:
        image = self._color.Eval(context).data
        if image.size == 0:
            output.set_value(BoardEstimate(reason="no image yet"))
            return
        output.set_value(self.board_pose.estimate(image, depth=_depth(self._depth, context)))

    def _calc_X_SC(self, context: Context, output: AbstractValue) -> None:
        estimate = self._estimate.Eval(context)
        output.set_value(rigid_transform(estimate.X_SC) if estimate.valid else RigidTransform())

    def _calc_valid(self, context: Context, output: BasicVector) -> None:
        output.SetFromVector([float(self._estimate.Eval(context).valid)])

    def _calc_error(self, context: Context, output: BasicVector) -> None:
        output.SetFromVector([self._estimate.Eval(context).reprojection_error])

    def _calc_covariance(self, context: Context, output: BasicVector) -> None:
        output.SetFromVector(self._estimate.Eval(context).covariance.ravel())


def rigid_transform(X_AB: Array) -> RigidTransform:
    """Drake's transform of a pose (4, 4), rounding errors of its rotation removed."""
    return RigidTransform(RotationMatrix.ProjectToRotationMatrix(X_AB[:3, :3]), X_AB[:3, 3])


def _depth(port: InputPort, context: Context) -> np.ndarray | None:
    """Depth image (H, W), if there is one."""
    if not port.HasValue(context):
        return None
    image = port.Eval(context).data
    return image[..., 0] if image.size else None
