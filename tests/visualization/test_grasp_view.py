"""Grasp glyphs: shape by closed form, and where they end up in Meshcat."""

from __future__ import annotations

import math

import numpy as np
import pytest
import trimesh

from burg_drake.core.errors import InvalidInputError
from burg_drake.core.frames import grasp_from_axes, make_pose, transform_points
from burg_drake.core.outcome import Outcome
from burg_drake.station.hand import load_hand
from burg_drake.visualization.grasp_view import (
    BAR_RADIUS,
    FINGER_LENGTH,
    STEM_LENGTH,
    draw_grasps,
    grasp_triangles,
)
from burg_drake.visualization.scene_view import open_meshcat

WIDTH = 0.05


def glyph(X_WG: np.ndarray, width: float = WIDTH) -> trimesh.Trimesh:
    vertices, faces = grasp_triangles(X_WG[None], np.array([width]))
    return trimesh.Trimesh(vertices.T, faces.T, process=False)


def test_bounds_in_the_grasp_frame() -> None:
    lower, upper = glyph(np.eye(4)).bounds
    assert lower == pytest.approx([-WIDTH / 2, 0, -FINGER_LENGTH - STEM_LENGTH], abs=BAR_RADIUS)
    assert upper == pytest.approx([WIDTH / 2, 0, 0], abs=BAR_RADIUS)


def test_closed_bars_of_known_volume() -> None:
    mesh = glyph(np.eye(4))
    assert mesh.is_watertight and mesh.is_winding_consistent
    triangle = 3 * math.sqrt(3) / 4 * BAR_RADIUS**2
    length = 2 * FINGER_LENGTH + WIDTH + STEM_LENGTH
    assert mesh.volume == pytest.approx(triangle * length)


def test_many_glyphs_are_each_where_its_grasp_is() -> None:
    X_WG = np.stack(
        [
            make_pose(p_AB=(0.1, 0.2, 0.3)),
            grasp_from_axes((0, 1, 0), (0, 0, -1), (0.4, 0.0, 0.1)),
        ]
    )
    widths = np.array([0.03, 0.07])
    vertices, faces = grasp_triangles(X_WG, widths)
    assert faces.max() == vertices.shape[1] - 1
    per_glyph = vertices.T.reshape(2, -1, 3)
    for X, width, found in zip(X_WG, widths, per_glyph, strict=True):
        assert found == pytest.approx(transform_points(X, glyph(np.eye(4), width).vertices))


def test_one_object_an_outcome() -> None:
    meshcat, hand = open_meshcat(), load_hand("panda_hand")
    poses = np.tile(np.eye(4), (4, 1, 1))
    verdicts = [Outcome.LIFTED, Outcome.SLIPPED, Outcome.LIFTED, None]
    counts = draw_grasps(meshcat, poses, hand, verdicts, [0.02, math.nan, 0.03, 0.04])
    assert counts == {Outcome.LIFTED: 2, Outcome.SLIPPED: 1, None: 1}
    for name in ("lifted", "slipped", "not_judged"):
        assert meshcat.HasPath(f"/drake/grasps/{name}")
    draw_grasps(meshcat, poses[:1], hand)
    assert not meshcat.HasPath("/drake/grasps/lifted")
    assert meshcat.HasPath("/drake/grasps/not_judged")
    with pytest.raises(InvalidInputError, match="1 outcomes for 4 grasps"):
        draw_grasps(meshcat, poses, hand, [None])
