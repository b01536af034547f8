"""Grasp glyphs: shape by closed form, and where they end up in Meshcat."""

from __future__ import annotations

import math

import numpy as np
import pytest
import trimesh
from recording import RecordingMeshcat

from burg_drake.core import InvalidInputError, Outcome, grasp_from_axes, make_pose, transform_points
from burg_drake.visualization import (
    BAR_RADIUS,
    FINGER_LENGTH,
    STEM_LENGTH,
    draw_grasps,
    grasp_path,
    grasp_triangles,
    group_by_number,
    group_by_outcome,
    open_meshcat,
    single_group,
)

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


def test_triangles_have_the_place_and_colour_of_their_group(recorder: RecordingMeshcat) -> None:
    """As many glyphs as members, at their places, glowing in the linear light of the colour."""
    n = 5
    X_WG = make_pose(p_AB=np.arange(3 * n).reshape(n, 3))
    values = np.array([0.1, 0.9, 0.1, math.nan, 0.5])
    found = group_by_number(values, (0.0, 1.0))
    draw_grasps(recorder, X_WG, np.full(n, WIDTH), found.groups)  # type: ignore[arg-type]
    assert len(found.groups) == 4
    for group in found.groups:
        vertices, _ = recorder.triangles[grasp_path(group.key)]
        assert vertices.shape[1] == 24 * len(group.members)  # four bars of six corners
        middles = vertices.T.reshape(len(group.members), 24, 3).mean(axis=1)
        offset = glyph(np.eye(4)).vertices.mean(axis=0)
        assert middles == pytest.approx(X_WG[group.members, :3, 3] + offset)
        material = f"{grasp_path(group.key)}/<object>"
        for channel, value in zip("rgb", group.rgba, strict=False):
            light = recorder.properties[material, f"material.emissive.{channel}"]
            shown = 12.92 * light if light < 0.0031308 else 1.055 * light ** (1 / 2.4) - 0.055
            assert shown == pytest.approx(value, abs=1e-3)
        assert recorder.properties[material, "material.toneMapped"] is False


def test_drawing_again_replaces() -> None:
    meshcat = open_meshcat()
    poses, widths = np.tile(np.eye(4), (4, 1, 1)), np.full(4, WIDTH)
    verdicts = [Outcome.LIFTED, Outcome.SLIPPED, Outcome.LIFTED, None]
    draw_grasps(meshcat, poses, widths, group_by_outcome(verdicts))
    for name in ("lifted", "slipped", "not_judged"):
        assert meshcat.HasPath(f"/drake/grasps/{name}")
    draw_grasps(meshcat, poses[:1], widths[:1], single_group(1))
    assert not meshcat.HasPath("/drake/grasps/lifted")
    assert meshcat.HasPath("/drake/grasps/all")


@pytest.mark.parametrize("widths", [[0.01], [0.01, math.nan]])
def test_widths_that_cannot_be_drawn(widths: list[float]) -> None:
    with pytest.raises(InvalidInputError, match="for 2 grasps; give"):
        draw_grasps(open_meshcat(), np.tile(np.eye(4), (2, 1, 1)), widths, single_group(2))
