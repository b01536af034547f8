"""What an object shows of itself from below, against closed forms and against rays."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from scipy.spatial import Delaunay

from burg_drake.core import InvalidInputError, transform_points
from burg_drake.printout import (
    BT601_LUMA_WEIGHTS,
    SheetGrid,
    SheetLayer,
    height_map,
    lowest_surface,
    luma_at,
    visible_layers,
)
from burg_drake.scene import load_scene

GRID = SheetGrid((0.2, 0.1), 1e-3)


def project(mesh: trimesh.Trimesh, grid: SheetGrid = GRID) -> tuple[SheetLayer, np.ndarray]:
    """The layer, and its heights on the whole grid."""
    layer = lowest_surface(grid, np.asarray(mesh.vertices), mesh.faces)
    height = np.full(grid.shape, np.inf)
    height[layer.window] = layer.height
    return layer, height


def centres(grid: SheetGrid) -> tuple[np.ndarray, np.ndarray]:
    rows, columns = grid.shape
    x = (np.arange(columns) + 0.5) * grid.resolution
    y = grid.size[1] - (np.arange(rows) + 0.5) * grid.resolution
    return np.broadcast_to(x, grid.shape), np.broadcast_to(y[:, None], grid.shape)


def box(lower: tuple[float, ...], upper: tuple[float, ...]) -> trimesh.Trimesh:
    return trimesh.creation.box(bounds=[lower, upper])


def test_the_lower_part_is_seen_below_the_lid() -> None:
    """A box with an overhanging lid, given lid first and box first: the order does not matter."""
    lid = box((0.04, 0.02, 0.05), (0.14, 0.08, 0.06))
    body = box((0.06, 0.03, 0.0), (0.12, 0.07, 0.05))
    x, y = centres(GRID)
    under_lid = (x > 0.04) & (x < 0.14) & (y > 0.02) & (y < 0.08)
    under_body = (x > 0.06) & (x < 0.12) & (y > 0.03) & (y < 0.07)
    expected = np.where(under_body, 0.0, np.where(under_lid, 0.05, np.inf))
    for parts in ([lid, body], [body, lid]):
        _, height = project(trimesh.util.concatenate(parts))
        np.testing.assert_allclose(height, expected, atol=1e-7)
    assert luma_at(0.0) < luma_at(0.05) < 1.0


def test_a_slanted_plane_and_a_ball() -> None:
    x, y = centres(GRID)
    plane = trimesh.Trimesh(
        [[0, 0, 0.01], [0.2, 0, 0.05], [0.2, 0.1, 0.08], [0, 0.1, 0.04]], [[0, 1, 2], [0, 2, 3]]
    )
    _, height = project(plane)
    np.testing.assert_allclose(height, 0.01 + 0.2 * x + 0.3 * y, atol=1e-7)
    radius = 0.03
    ball = trimesh.creation.icosphere(subdivisions=5, radius=radius)
    ball.apply_translation([0.09, 0.05, radius])
    _, height = project(ball)
    r2 = (x - 0.09) ** 2 + (y - 0.05) ** 2
    inside = r2 < (radius - 1e-3) ** 2
    expected = radius - np.sqrt(radius**2 - np.minimum(r2, radius**2))
    assert np.abs(height - expected)[inside].max() < 1e-4  # facets, steep at the rim
    assert np.isinf(height[r2 > radius**2]).all()


def test_what_is_beside_the_sheet_is_left_out() -> None:
    layer, height = project(box((-0.05, 0.05, 0.0), (0.01, 0.2, 0.01)))
    x, y = centres(GRID)
    np.testing.assert_array_equal(np.isfinite(height), (x < 0.01) & (y > 0.05))
    assert layer.row == layer.column == 0
    gone, height = project(box((300.0, 0.0, 0.0), (301.0, 0.1, 0.1)))
    assert not gone.covered.any() and np.isinf(height).all()


def test_no_cracks_between_triangles() -> None:
    """Triangles with corners anywhere that fill a rectangle cover all of its pixels."""
    rng = np.random.default_rng(1)
    points = np.concatenate(
        [[[0, 0], [0.2, 0], [0.2, 0.1], [0, 0.1]], rng.uniform(0, 1, (400, 2)) * [0.2, 0.1]]
    )
    faces = Delaunay(points).simplices
    mesh = trimesh.Trimesh(np.column_stack([points, np.zeros(len(points))]), faces, process=False)
    _, height = project(mesh)
    assert (height == 0.0).all()


@pytest.mark.parametrize("name", ["mug", "bowl", "scissors"])
def test_library_objects_against_rays_from_below(name: str) -> None:
    scene = load_scene("tabletop_twelve")
    grid = SheetGrid(scene.board.size, 1e-3)
    surface = scene.library.surface(scene.instance(name).object)
    p_SV = transform_points(scene.X_SO(name), surface.vertices)
    mesh = trimesh.Trimesh(p_SV, surface.faces, process=False)
    layer, height = project(mesh, grid)
    rng = np.random.default_rng(0)
    rows, columns = layer.height.shape
    pixels = np.stack([rng.integers(0, columns, 300), rng.integers(0, rows, 300)], axis=1)
    pixels += [layer.column, layer.row]
    x, y = centres(grid)
    at = pixels[:, 1], pixels[:, 0]
    starts = np.stack([x[at], y[at], np.full(300, -1.0)], axis=1)
    hits, rays, _ = mesh.ray.intersects_location(starts, np.tile([0.0, 0.0, 1.0], (300, 1)))
    expected = np.full(300, np.inf)
    np.minimum.at(expected, rays, hits[:, 2])
    assert 60 < np.isfinite(expected).sum() < 300
    np.testing.assert_allclose(height[at], expected, atol=1e-5)


def test_of_two_objects_the_lower_one_is_seen() -> None:
    low, high = (
        box((0.02, 0.02, 0.0), (0.08, 0.08, 0.02)),
        box((0.05, 0.0, 0.03), (0.15, 0.1, 0.05)),
    )
    layers = [project(mesh)[0] for mesh in (high, low)]
    seen = [layer.covered.sum() for layer in visible_layers(layers)]
    assert seen == [100 * 100 - 30 * 60, 60 * 60]


def test_the_height_map_of_a_scene() -> None:
    scene = load_scene("tabletop_six")
    made = height_map(scene, 1e-3)
    assert made.image.shape == (420, 594, 3) and made.height.shape == made.instance.shape
    assert made.names == tuple(scene.instances)
    bare = made.instance < 0
    np.testing.assert_array_equal(bare, np.isnan(made.height))
    assert (made.image[bare] == 255).all()
    column, row = np.rint(
        SheetGrid(scene.board.size, 1e-3).pixels(scene.X_SO("bowl")[:3, 3])
    ).astype(int)
    assert made.names[made.instance[row, column]] == "bowl"
    # The mug's handle is off the sheet, its floor on it: lighter, by luma as OpenCV computes grey.
    mug = made.instance == made.names.index("mug")
    luma = made.image[mug] @ BT601_LUMA_WEIGHTS / 255
    handle = made.height[mug] > 0.015
    assert 100 < handle.sum() < 0.3 * mug.sum()
    assert luma[handle].min() > luma[made.height[mug] < 1e-3].max() + 0.05
    np.testing.assert_allclose(luma, luma_at(made.height[mug]), atol=3 / 255)


@pytest.mark.parametrize("resolution", [0.0, -1e-3, float("nan"), 1e-6])
def test_a_resolution_that_cannot_be(resolution: float) -> None:
    with pytest.raises(InvalidInputError, match="does not suit a board of 594 x 420 mm"):
        height_map(load_scene("tabletop_six"), resolution)
