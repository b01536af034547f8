"""The estimator in a diagram: outputs follow the input at once, and are computed once an image."""

from __future__ import annotations

import numpy as np
import pytest
from pydrake.common.value import AbstractValue
from pydrake.systems.framework import Context, DiagramBuilder
from pydrake.systems.primitives import ZeroOrderHold
from pydrake.systems.sensors import ImageDepth32F, ImageRgba8U

from burg_drake.cameras import BoardPose, BoardPoseEstimator
from burg_drake.core import InvalidInputError
from burg_drake.scene import Board
from tests.cameras.board_views import SMALL, error, view
from tests.cameras.synthetic import board_depth, board_image

BOARD = Board(size=(0.3, 0.21))
ONE = view((0.15, 0.1), 0.4, 25.0, 200.0, 100.0)
OTHER = view((0.14, 0.11), 0.45, 10.0, 20.0, -40.0)


@pytest.fixture(scope="module")
def images() -> list[np.ndarray]:
    return [board_image(BOARD, SMALL, X_SC) for X_SC in (ONE, OTHER)]


def drake_image(image: np.ndarray) -> ImageRgba8U:
    rgba = ImageRgba8U(image.shape[1], image.shape[0])
    rgba.mutable_data[:, :, :3] = image
    rgba.mutable_data[:, :, 3] = 255
    return rgba


class Counted(BoardPose):
    """Counts how often it looks at an image."""

    looks = 0

    def estimate(self, *args, **kwargs):  # type: ignore[no-untyped-def]
        self.looks += 1
        return super().estimate(*args, **kwargs)


def read(system: BoardPoseEstimator, context: Context) -> tuple:
    return tuple(
        system.GetOutputPort(name).Eval(context)
        for name in ("X_SC", "valid", "reprojection_error", "covariance", "estimate")
    )


def test_all_outputs_are_of_the_image_that_is_at_the_input(images: list[np.ndarray]) -> None:
    system = BoardPoseEstimator(BOARD, SMALL)
    system.board_pose = Counted(BOARD, SMALL)
    context = system.CreateDefaultContext()
    for k, (image, truth) in enumerate([*zip(images, (ONE, OTHER), strict=True), (images[0], ONE)]):
        system.GetInputPort("color_image").FixValue(context, AbstractValue.Make(drake_image(image)))
        for _ in range(2):
            X_SC, valid, reprojection, covariance, estimate = read(system, context)
        assert system.board_pose.looks == k + 1  # five outputs, twice: one look an image
        assert np.abs(error(X_SC.GetAsMatrix4(), truth)).max() < 3e-4
        assert valid == [1.0] and estimate.valid
        assert reprojection == [estimate.reprojection_error]
        assert np.array_equal(covariance.reshape(6, 6), estimate.covariance)
        context.SetTime(float(k))  # time is no prerequisite
        read(system, context)
        assert system.board_pose.looks == k + 1
    assert context.num_total_states() == 0


def test_no_image_and_nothing_in_sight() -> None:
    system = BoardPoseEstimator(BOARD, SMALL)
    context = system.CreateDefaultContext()
    for image, reason in (
        (ImageRgba8U(), "no image yet"),
        (drake_image(np.full((240, 320, 3), 90)), "no marker of the board in sight"),
    ):
        system.GetInputPort("color_image").FixValue(context, AbstractValue.Make(image))
        X_SC, valid, reprojection, covariance, estimate = read(system, context)
        assert X_SC.IsExactlyIdentity()
        assert valid == [0.0] and np.isnan(reprojection).all() and np.isnan(covariance).all()
        assert estimate.reason == reason


def test_depth_measures_the_print() -> None:
    system = BoardPoseEstimator(BOARD, SMALL)
    context = system.CreateDefaultContext()
    image = board_image(BOARD, SMALL, ONE, scale=(1.05, 1.05))
    system.GetInputPort("color_image").FixValue(context, AbstractValue.Make(drake_image(image)))
    estimate = system.GetOutputPort("estimate")
    assert np.isnan(estimate.Eval(context).scale)
    depth = ImageDepth32F(320, 240)
    depth.mutable_data[:, :, 0] = board_depth(SMALL, ONE)
    system.GetInputPort("depth_image").FixValue(context, AbstractValue.Make(depth))
    assert estimate.Eval(context).scale == pytest.approx(1.05, abs=0.001)
    assert "printed at 1.05 of its size" in estimate.Eval(context).reason
    # Its distances would be false by as much: whoever takes the pose from the ports gets none.
    assert system.GetOutputPort("valid").Eval(context) == [0.0]
    assert system.GetOutputPort("X_SC").Eval(context).IsExactlyIdentity()


def test_an_image_of_another_size_is_refused() -> None:
    system = BoardPoseEstimator(BOARD, SMALL)
    context = system.CreateDefaultContext()
    image = drake_image(np.zeros((480, 640, 3)))
    system.GetInputPort("color_image").FixValue(context, AbstractValue.Make(image))
    with pytest.raises(InvalidInputError, match=r"640 x 480.*320"):
        system.GetOutputPort("valid").Eval(context)


def test_in_a_diagram_there_is_no_lag(images: list[np.ndarray]) -> None:
    builder = DiagramBuilder()
    hold = builder.AddSystem(ZeroOrderHold(0.1, AbstractValue.Make(ImageRgba8U())))
    estimator = builder.AddSystem(BoardPoseEstimator(BOARD, SMALL))
    builder.Connect(hold.get_output_port(), estimator.GetInputPort("color_image"))
    builder.ExportOutput(estimator.GetOutputPort("X_SC"), "X_SC")
    diagram = builder.Build()
    context = diagram.CreateDefaultContext()
    for image, truth in zip(images, (ONE, OTHER), strict=True):
        state = hold.GetMyMutableContextFromRoot(context).get_mutable_abstract_state(0)
        state.set_value(drake_image(image))
        X_SC = diagram.GetOutputPort("X_SC").Eval(context)
        assert np.abs(error(X_SC.GetAsMatrix4(), truth)).max() < 3e-4
