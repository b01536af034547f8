"""Frames in words, against what the projects themselves say of theirs."""

from __future__ import annotations

import numpy as np
import pytest

from burg_drake.core import make_pose, rot_z
from burg_drake.formats import (
    GRASP_FORMATS,
    PANDA_GRIPPER,
    axis_along,
    convention_of,
    group_by_convention,
    origin_in_words,
)


@pytest.mark.parametrize(
    ("name", "approach", "closing", "frame"),
    [
        ("burg_drake", "+z", "x", "object"),
        ("acronym", "+z", "x", "object"),
        ("isaac_grasp", "+z", "y", "object"),
        ("graspnet", "+x", "y", "camera"),
        ("vgn", "+z", "y", "world"),
        ("burg", "-z", "x", "world"),
    ],
)
def test_axes_are_as_documented(name: str, approach: str, closing: str, frame: str) -> None:
    found = convention_of(GRASP_FORMATS[name], PANDA_GRIPPER)
    assert (found.approach, found.closing) == (approach, closing)
    assert GRASP_FORMATS[name].frame == frame


def test_origins() -> None:
    """The base of the Franka hand is 103.4 mm before its tool centre point."""
    assert convention_of(GRASP_FORMATS["acronym"], PANDA_GRIPPER).origin == "H, 103.4 mm behind G"
    assert convention_of(GRASP_FORMATS["burg_drake"], PANDA_GRIPPER).origin == "G"


@pytest.mark.parametrize(
    ("p_GF", "words"),
    [
        ((0.0, 0.0, 0.0), "G"),
        ((0.0, 0.0, -0.02), "20 mm behind G"),
        ((0.0, 0.0, 0.0095), "finger tips, 9.5 mm ahead of G"),
        ((0.003, 0.0, 0.01), "10 mm ahead of G, 3 mm along x of G"),
        ((0.0, -0.0125, 0.0), "12.5 mm along -y of G"),
        ((1e-9, 0.0, -1e-9), "G"),
    ],
)
def test_origin_in_words(p_GF: tuple[float, float, float], words: str) -> None:
    assert origin_in_words(np.array(p_GF), PANDA_GRIPPER) == words


def test_an_axis_that_is_off() -> None:
    X_GF = make_pose(rot_z(np.deg2rad(90.0 + 7.0)))
    assert axis_along(X_GF, (1.0, 0.0, 0.0)) == "-y, 7 deg off"
    assert axis_along(X_GF, (0.0, 0.0, 1.0)) == "+z"


def test_formats_of_one_convention_are_put_together() -> None:
    groups = group_by_convention(GRASP_FORMATS.values(), PANDA_GRIPPER)
    assert sorted(f.name for group in groups for f in group) == sorted(GRASP_FORMATS)
    together = {frozenset(f.name for f in group) for group in groups}
    assert any({"acronym", "graspgen"} <= group for group in together)
    assert frozenset({"isaac_grasp"}) in together
    assert frozenset({"burg_drake"}) in together  # the same origin as burg, but not its axes
