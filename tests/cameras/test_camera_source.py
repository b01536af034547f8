"""Frames of a source in a Drake diagram."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator

from burg_drake.cameras import (
    CameraLost,
    CameraSource,
    Frame,
    FrameSource,
    Image,
    open_source,
    write_image,
)
from burg_drake.core import InvalidInputError


def picture(number: int) -> Image:
    image = np.full((24, 32, 3), 10 * number, dtype=np.uint8)
    image[:, :4, 0] = 255
    return image


class Recorded(FrameSource):
    """What a camera gave, one item a read: a number stands for its picture, with depth."""

    def __init__(self, *items: int | Exception | None) -> None:
        self.name, self.live, self.size, self._items = "recorded", True, (32, 24), list(items)

    def read(self) -> Frame | None:
        item = self._items.pop(0) if self._items else None
        if isinstance(item, Exception):
            raise item
        if item is None:
            return None
        depth = np.full((24, 32), 0.1 * item)
        depth[0, 0] = np.nan
        return Frame(picture(item), depth, float(item), self.name)

    def close(self) -> None:
        self._items = []


def test_a_frame_at_each_update(tmp_path: Path) -> None:
    for number in range(3):
        write_image(tmp_path / f"{number}.png", picture(number))
    with open_source(tmp_path) as source:
        system = CameraSource(source, fps=10.0)
        assert not system.HasOutputPort("depth_image")
        simulator = Simulator(system)
        context = simulator.get_context()
        for moment, number, valid in (
            (0.0, 0, 1),
            (0.05, 0, 1),
            (0.15, 1, 1),
            (0.25, 2, 1),
            (1, 2, 0),
        ):
            simulator.AdvanceTo(moment)
            image = system.GetOutputPort("color_image").Eval(context).data
            assert np.array_equal(image[..., :3], picture(number))
            assert (image[..., 3] == 255).all()
            assert system.GetOutputPort("valid").Eval(context) == [valid]
            assert system.GetOutputPort("frame_time").Eval(context) == [number]


def test_depth_and_a_camera_that_is_lost_for_a_while() -> None:
    lost = CameraLost("camera 0 gives no images")
    system = CameraSource(Recorded(1, lost, InvalidInputError("broken"), 3), fps=10.0)
    simulator = Simulator(system)
    context = simulator.get_context()
    for moment, number, valid in ((0.0, 1, 1), (0.15, 1, 0), (0.25, 3, 1), (0.35, 3, 0)):
        simulator.AdvanceTo(moment)
        depth = system.GetOutputPort("depth_image").Eval(context).data[..., 0]
        assert np.isinf(depth[0, 0]) and np.allclose(depth[1:], 0.1 * number)
        image = system.GetOutputPort("color_image").Eval(context).data
        assert np.array_equal(image[..., :3], picture(number))
        assert system.GetOutputPort("valid").Eval(context) == [valid]


def test_a_source_without_frames_is_refused() -> None:
    with pytest.raises(InvalidInputError, match="recorded has no frames"):
        CameraSource(Recorded())
