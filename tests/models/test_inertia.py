"""Mass properties of links that are written into model files."""

from __future__ import annotations

import itertools

import pytest

from tools.panda_model.collision import LEFT_FINGER_SHAPES
from tools.robot_model.inertia import box_inertia
from tools.robot_model.shapes import Box
from tools.wsg_model.collision import FINGER_SHAPES


@pytest.mark.parametrize("boxes", [LEFT_FINGER_SHAPES, FINGER_SHAPES], ids=["panda", "wsg"])
def test_inertia_is_the_same_in_any_order_of_the_sums(boxes: tuple[Box, ...]) -> None:
    """Processors and releases of numpy sum in different orders; the files stay the same."""
    texts = {repr(box_inertia(order, 0.05)) for order in itertools.permutations(boxes)}
    assert len(texts) == 1
