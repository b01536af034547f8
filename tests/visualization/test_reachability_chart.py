"""The map as a picture: cells where the sheet has them, colours as the key has them."""

from __future__ import annotations

from xml.etree import ElementTree

import numpy as np
import pytest

from burg_drake.motion import ReachabilityMap
from burg_drake.scene import load_scene
from burg_drake.visualization import (
    CHART_TITLE_HEIGHT,
    CHART_WIDTH,
    VIRIDIS_COLORS,
    object_outlines,
    reachability_chart,
    reachability_key,
)


def one_corner() -> ReachabilityMap:
    """Only the cell at the sheet's right upper corner is reached."""
    reached = np.zeros((1, 2, 4, 1), dtype=bool)
    reached[0, 1, 3] = True
    return ReachabilityMap(
        x=np.array([0.05, 0.15, 0.25, 0.35]),
        y=np.array([0.05, 0.15]),
        heights=np.array([0.05]),
        tilt=np.zeros(1),
        R_WG=np.eye(3)[None],
        reached=reached,
        cell=(0.1, 0.1),
    )


def test_cells_lie_as_the_sheet_is_read() -> None:
    triangle = np.array([[0.0, 0.0], [0.4, 0.0], [0.0, 0.2]])
    svg = ElementTree.fromstring(reachability_chart(one_corner(), 0, {"a<b": triangle}))
    cells = [rect.attrib for rect in svg.iter("rect")]
    assert len(cells) == 8
    (bright,) = (c for c in cells if c["fill"] == VIRIDIS_COLORS[-1])
    assert (float(bright["x"]), float(bright["y"])) == pytest.approx(
        (0.75 * CHART_WIDTH, CHART_TITLE_HEIGHT)
    )
    assert {c["fill"] for c in cells} == {VIRIDIS_COLORS[0], VIRIDIS_COLORS[-1]}
    (path,) = svg.iter("path")
    foot = CHART_TITLE_HEIGHT + CHART_WIDTH / 2
    assert (
        path.attrib["d"]
        == f"M0.0 {foot:.1f}L{CHART_WIDTH:.1f} {foot:.1f}L0.0 {CHART_TITLE_HEIGHT:.1f}Z"
    )
    assert [text.text for text in svg.iter("text")] == ["5 cm above the board", "a<b"]
    assert svg.attrib["viewBox"] == f"0 0 {CHART_WIDTH} {foot:.1f}"


def test_the_key_goes_from_none_to_all() -> None:
    key = ElementTree.fromstring(reachability_key())
    fills = [rect.attrib["fill"] for rect in key.iter("rect")]
    assert len(set(fills)) == len(fills) == 10
    assert "".join(key.itertext()).split() == ["none", "all", "orientations"]


def test_outlines_are_those_of_the_objects() -> None:
    scene = load_scene("tabletop_six")
    found = object_outlines(scene)
    assert list(found) == list(scene.instances)
    middle = found["bowl"].mean(axis=0)
    np.testing.assert_allclose(middle, [0.305, 0.31], atol=2e-3)
    np.testing.assert_allclose(np.linalg.norm(found["bowl"] - middle, axis=1), 0.08, atol=3e-3)
