from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from pydrake.common.value import AbstractValue
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.systems.framework import Context
from pydrake.systems.sensors import ImageRgba8U

import burg_drake as burg
from burg_drake.cameras import (
    BoardEstimate,
    CheckedImage,
    CheckedScene,
    Intrinsics,
    Placement,
    PlacementCheck,
    SceneOverlay,
)
from burg_drake.core import InvalidInputError

INTRINSICS = Intrinsics(width=320, height=240, focal=(300.0, 300.0), center=(159.5, 119.5))
X_SC = RigidTransform(RollPitchYaw(np.deg2rad([-140.0, 0.0, 0.0])), [0.3, -0.3, 0.6])


@pytest.fixture(scope="module")
def system() -> SceneOverlay:
    return SceneOverlay(burg.load_scene("tabletop_six"), INTRINSICS)


def image(width: int = 320, height: int = 240, value: int = 128) -> ImageRgba8U:
    result = ImageRgba8U(width, height)
    result.mutable_data[:] = value
    return result


@pytest.fixture
def context(system: SceneOverlay) -> Context:
    context = system.CreateDefaultContext()
    system.GetInputPort("color_image").FixValue(context, image())
    system.GetInputPort("X_SC").FixValue(context, X_SC)
    return context


def output(system: SceneOverlay, context: Context) -> np.ndarray:
    return np.array(system.GetOutputPort("overlay_image").Eval(context).data)


def test_output_is_the_overlay_of_the_inputs(system: SceneOverlay, context: Context) -> None:
    result = output(system, context)
    plain = np.full((240, 320, 3), 128, np.uint8)
    np.testing.assert_array_equal(result[..., :3], system._overlay.draw(plain, X_SC.GetAsMatrix4()))
    assert (result[..., 3] == 255).all() and (result[..., :3] != plain).any()


def test_follows_its_inputs_at_once(system: SceneOverlay, context: Context) -> None:
    first = output(system, context)
    nearer = RigidTransform(X_SC.rotation(), X_SC.translation() - np.array([0.0, 0.0, 0.1]))
    system.GetInputPort("X_SC").FixValue(context, nearer)
    second = output(system, context)
    system.GetInputPort("color_image").FixValue(context, image(value=50))
    third = output(system, context)
    assert (first != second).any() and (third[0, 0, :3] == 50).all()


def test_computes_once_for_the_same_inputs(
    system: SceneOverlay, context: Context, monkeypatch: pytest.MonkeyPatch
) -> None:
    calls: list[int] = []
    draw = system._overlay.draw

    def counted(*args: Any, **options: Any) -> NDArray[np.uint8]:
        calls.append(1)
        return draw(*args, **options)

    monkeypatch.setattr(system._overlay, "draw", counted)
    for time in (0.0, 0.0, 1.0):
        context.SetTime(time)
        output(system, context)
    assert len(calls) == 1
    system.GetInputPort("X_SC").FixValue(context, RigidTransform(X_SC))
    output(system, context)
    assert len(calls) == 2


def test_plain_image_with_the_reason_where_the_pose_is_not_valid(
    system: SceneOverlay, context: Context
) -> None:
    valid = system.GetInputPort("valid")
    valid.FixValue(context, [0.0])
    unknown = output(system, context)
    reason = BoardEstimate(reason="none of the board's markers is in view")
    system.GetInputPort("estimate").FixValue(context, AbstractValue.Make(reason))
    known = output(system, context)
    plain = np.full((240, 320, 3), 128, np.uint8)
    np.testing.assert_array_equal(known[..., :3], system._overlay.notice(plain, reason.reason))
    assert (known != unknown).any() and (known[60:, :, :3] == 128).all()
    valid.FixValue(context, [1.0])
    assert (output(system, context)[60:, :, :3] != 128).any()


def test_estimate_alone_says_whether_the_pose_is_valid(
    system: SceneOverlay, context: Context
) -> None:
    port = system.GetInputPort("estimate")
    port.FixValue(context, AbstractValue.Make(BoardEstimate(reason="no marker")))
    assert (output(system, context)[60:, :, :3] == 128).all()
    port.FixValue(context, AbstractValue.Make(BoardEstimate(valid=True)))
    assert (output(system, context)[60:, :, :3] != 128).any()


def test_placement_is_drawn(system: SceneOverlay, context: Context) -> None:
    before = output(system, context)
    scene = system._overlay.scene
    bowl = Placement(
        object="bowl",
        status="measured",
        target=scene.instance("bowl").X_SO,
        reference=(0.0, 0.0, 0.0),
        displacement=(0.02, 0.01),
    )
    check = PlacementCheck(
        scene=CheckedScene(name=scene.name, content=scene.content),
        method="silhouette",
        image=CheckedImage(content=""),
        intrinsics=INTRINSICS,
        instances={"bowl": bowl},
    )
    system.GetInputPort("placement").FixValue(context, AbstractValue.Make(check))
    after = output(system, context)
    np.testing.assert_array_equal(
        after[..., :3],
        system._overlay.draw(
            np.full((240, 320, 3), 128, np.uint8), X_SC.GetAsMatrix4(), placement=check
        ),
    )
    assert (before != after).any()
    system.GetInputPort("placement").FixValue(context, AbstractValue.Make(bowl))
    with pytest.raises(InvalidInputError, match="port placement takes a PlacementCheck"):
        output(system, context)


def test_refuses_images_of_another_size(system: SceneOverlay, context: Context) -> None:
    system.GetInputPort("color_image").FixValue(context, image(640, 480))
    with pytest.raises(InvalidInputError, match=r"640 x 480 pixels.*320 x 240"):
        output(system, context)


def test_tells_what_is_not_connected(system: SceneOverlay) -> None:
    context = system.CreateDefaultContext()
    with pytest.raises(InvalidInputError, match="input port color_image has no value"):
        output(system, context)
    system.GetInputPort("color_image").FixValue(context, image())
    with pytest.raises(InvalidInputError, match="input port X_SC has no value"):
        output(system, context)
