"""Walls of open surfaces: closed forms of volume and extents."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from burg_drake.objects import default_wall, is_closed, separate_faces, thicken_sheet, unite_bodies


def _grid(height: np.ndarray, step: float) -> trimesh.Trimesh:
    """A height field over a square grid."""
    n = len(height)
    x, y = np.meshgrid(step * np.arange(n), step * np.arange(n), indexing="ij")
    i = np.arange(n * n).reshape(n, n)
    a, b, c, d = (k.ravel() for k in (i[:-1, :-1], i[1:, :-1], i[1:, 1:], i[:-1, 1:]))
    faces = np.vstack([np.column_stack([a, b, c]), np.column_stack([a, c, d])])
    vertices = np.column_stack([x.ravel(), y.ravel(), height.ravel()])
    return trimesh.Trimesh(vertices, faces, process=False)


def _joined(*quads: list[list[float]]) -> trimesh.Trimesh:
    parts = [trimesh.Trimesh(q, [[0, 1, 2], [0, 2, 3]], process=False) for q in quads]
    mesh = trimesh.util.concatenate(parts)
    mesh.merge_vertices()
    return mesh


def test_a_square_sheet_becomes_a_slab_centred_on_it() -> None:
    slab = thicken_sheet(_grid(np.zeros((9, 9)), 0.025), 0.002)
    assert slab is not None and is_closed(slab)
    assert slab.volume == pytest.approx(0.2 * 0.2 * 0.002, rel=1e-9)
    np.testing.assert_allclose(slab.bounds, [[0, 0, -0.001], [0.2, 0.2, 0.001]], atol=1e-12)


@pytest.mark.parametrize("inverted", [False, True])
def test_a_hemisphere_becomes_a_bowl(inverted: bool) -> None:
    sphere = trimesh.creation.icosphere(subdivisions=5, radius=0.05)
    sphere.update_faces(sphere.triangles_center[:, 2] < 0.0)
    sphere.remove_unreferenced_vertices()
    if inverted:
        sphere.invert()
    bowl = thicken_sheet(sphere, 0.004)
    assert bowl is not None and is_closed(bowl)
    # the mesh's rim zigzags about the equator, hence the area of the mesh rather than 2 pi r^2
    expected = sphere.area * 0.004 * (1.0 + 0.004**2 / (12.0 * 0.05**2))
    assert bowl.volume == pytest.approx(expected, rel=2e-3)
    radii = np.linalg.norm(bowl.vertices, axis=1)
    assert radii.min() == pytest.approx(0.048, rel=2e-3)
    assert radii.max() == pytest.approx(0.052, rel=2e-3)


def test_a_bent_sheet_keeps_its_thickness_at_the_bend() -> None:
    """Two squares at a right angle: each side's planes are parallel to the sheet's."""
    a = 0.1
    angle = _joined(
        [[0, 0, 0], [a, 0, 0], [a, a, 0], [0, a, 0]], [[0, 0, 0], [0, a, 0], [0, a, a], [0, 0, a]]
    )
    bent = thicken_sheet(angle, 0.002)
    assert bent is not None and is_closed(bent)
    assert bent.volume == pytest.approx(2.0 * a * a * 0.002, rel=1e-9)
    np.testing.assert_allclose(bent.bounds, [[-0.001, 0, -0.001], [a, a, a]], atol=1e-12)


def test_three_sheets_on_one_edge_become_walls_that_overlap_there() -> None:
    a, t = 0.1, 0.002
    tee = _joined(
        [[0, 0, 0], [a, 0, 0], [a, a, 0], [0, a, 0]],
        [[0, 0, 0], [0, a, 0], [-a, a, 0], [-a, 0, 0]],
        [[0, 0, 0], [0, 0, a], [0, a, a], [0, a, 0]],
    )
    walls = thicken_sheet(tee, t)
    assert walls is not None and is_closed(walls)
    # half of the upright wall's foot lies in each of the two others
    whole, said = unite_bodies(walls)
    assert whole.volume == pytest.approx((3.0 * a * t - t * t / 2.0) * a, rel=1e-9)
    assert said == [
        "united 3 bodies that overlap (they share 0.33 % of their volume, which now counts once)"
    ]


def test_rough_sheets_become_walls() -> None:
    rng = np.random.default_rng(2)
    sheet = _grid(rng.normal(0.0, 5e-4, (40, 40)), 0.002)
    rough = thicken_sheet(sheet, 0.003)
    assert rough is not None and is_closed(rough)
    assert rough.volume == pytest.approx(sheet.area * 0.003, rel=0.05)


def test_a_crumpled_sheet_is_left_alone() -> None:
    sheet = _grid(np.random.default_rng(2).normal(0.0, 0.02, (30, 30)), 0.002)
    assert thicken_sheet(sheet, 0.01) is None


def _strip(twists: int) -> trimesh.Trimesh:
    """A closed band, twisted by as many half turns."""
    n = 60
    angle = 2.0 * np.pi * np.arange(n) / n
    vertices = []
    for side in (-0.02, 0.02):
        radius = 0.08 + side * np.cos(0.5 * twists * angle)
        vertices.append(
            [radius * np.cos(angle), radius * np.sin(angle), side * np.sin(0.5 * twists * angle)]
        )
    points = np.array(vertices).transpose(0, 2, 1).reshape(-1, 3)
    faces = []
    for i in range(n):
        a, b = i, n + i
        c, d = (i + 1, n + i + 1) if i + 1 < n else ((0, n) if twists % 2 == 0 else (n, 0))
        faces += [[a, c, b], [b, c, d]]
    return trimesh.Trimesh(points, faces, process=False)


def test_a_band_becomes_a_wall_unless_it_has_only_one_side() -> None:
    band = thicken_sheet(_strip(2), 0.002)
    assert band is not None and band.volume == pytest.approx(_strip(2).area * 0.002, rel=0.02)
    assert thicken_sheet(_strip(1), 0.002) is None


def test_fans_that_share_a_vertex_are_separated() -> None:
    bow = trimesh.Trimesh(
        [[0, 0, 0], [1, 1, 0], [1, -1, 0], [-1, 1, 0], [-1, -1, 0]],
        [[0, 2, 1], [0, 3, 4]],
        process=False,
    )
    apart = separate_faces(bow)
    assert len(apart.vertices) == 6
    np.testing.assert_array_equal(apart.triangles, bow.triangles)


def test_the_default_is_thin_for_small_things() -> None:
    assert default_wall(trimesh.creation.box((0.3, 0.2, 0.1))) == 0.002
    assert default_wall(trimesh.creation.box((0.003, 0.004, 0.012))) == pytest.approx(0.02 * 0.013)
