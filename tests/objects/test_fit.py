"""Fits against closed forms."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from burg_drake.core import MeshError, make_pose, rotation_from_rpy
from burg_drake.objects import measure_fit, surface_distance, surface_overlap, union_mesh

RADIUS = 0.03


def ball() -> trimesh.Trimesh:
    return trimesh.creation.icosphere(subdivisions=4, radius=RADIUS)


def box(size: tuple[float, float, float], at: tuple[float, ...] = (0, 0, 0)) -> trimesh.Trimesh:
    return trimesh.creation.box(size).apply_translation(at)


def test_sphere_in_a_cube() -> None:
    """Farthest are the cube's corners: sqrt(3) r - r; volumes are as 6 to pi."""
    sphere = ball()
    fit = measure_fit(sphere, [box((2 * RADIUS,) * 3)], 4 / 3 * np.pi * RADIUS**3)
    assert fit.volume_ratio == pytest.approx(6 / np.pi, rel=1e-3)
    assert fit.hausdorff == pytest.approx((np.sqrt(3) - 1) * RADIUS, abs=1e-4)


def test_sphere_around_a_cube_is_measured_from_the_sphere() -> None:
    """Nothing of the cube's surface is far from the sphere, but the sphere's poles are from it."""
    edge = 2 * RADIUS / np.sqrt(3)
    distance = surface_distance(box((edge,) * 3), ball())
    assert distance == pytest.approx(RADIUS - edge / 2, abs=1e-4)
    assert surface_distance(ball(), box((edge,) * 3)) == pytest.approx(distance, abs=1e-12)


@pytest.mark.parametrize("shift", [(0.004, 0.0, 0.0), (0.003, -0.004, 0.0)])
def test_shifted_box(shift: tuple[float, ...]) -> None:
    """The corners of the one that leave the other are as far away as the shift."""
    fit = measure_fit(box((0.1, 0.06, 0.03)), [box((0.1, 0.06, 0.03), shift)], 0.1 * 0.06 * 0.03)
    assert fit.hausdorff == pytest.approx(np.hypot(*shift[:2]), abs=2e-6)
    assert fit.volume_ratio == pytest.approx(1.0, abs=3e-4)


def test_hull_of_an_l() -> None:
    """Two legs of length 1 and width 0.5: the hull adds a triangle that cuts the corner; the middle
    of its slope, (0.75, 0.75), is 0.25 from both legs."""
    legs = [box((1.0, 0.5, 0.3), (0.5, 0.25, 0)), box((0.5, 1.0, 0.3), (0.25, 0.5, 0))]
    surface = union_mesh(legs)
    fit = measure_fit(surface, [surface.convex_hull], 0.75 * 0.3)
    assert fit.volume_ratio == pytest.approx((0.75 + 0.125) / 0.75, rel=1e-4)
    assert fit.hausdorff == pytest.approx(0.25, abs=2e-3)


def test_overlaps_count_once_and_shared_faces_are_no_surface() -> None:
    """Three overlapping or touching boxes are one long box; a gap of rounding between two of them
    does not count."""
    parts = [
        box((0.02, 0.02, 0.02), (-0.015, 0, 0)),
        box((0.02, 0.02, 0.02), (0, 0, 0)),
        box((0.02 - 1e-7, 0.02, 0.02), (0.02, 0, 0)),
    ]
    whole = box((0.055, 0.02, 0.02), (0.0025, 0, 0))
    fit = measure_fit(whole, parts, whole.volume)
    assert fit.volume_ratio == pytest.approx(1.0, abs=1e-3)
    assert fit.hausdorff < 5e-6


@pytest.mark.parametrize(("gap", "expected"), [(4e-4, 2e-4), (4e-3, 8e-3)])
def test_narrow_slits_between_parts_do_not_count(gap: float, expected: float) -> None:
    """Through the middle of a cube of 20 mm: a narrow one is missed by half its width where it
    comes to the surface; of a wide one, its middle is as far from the surface as a half is wide."""
    half = (0.02 - gap) / 2
    at = (half + gap) / 2
    parts = [box((half, 0.02, 0.02), (x, 0, 0)) for x in (-at, at)]
    fit = measure_fit(box((0.02, 0.02, 0.02)), parts, 0.02**3)
    assert fit.hausdorff == pytest.approx(expected, rel=0.05)


def test_moves_with_the_object() -> None:
    X = make_pose(rotation_from_rpy((0.3, -1.0, 2.0)), (0.1, 0.2, -0.3))
    one, other = ball(), box((0.07, 0.06, 0.05))
    here = surface_distance(one, other)
    there = surface_distance(one.copy().apply_transform(X), other.copy().apply_transform(X))
    assert there == pytest.approx(here, abs=1e-9)


def test_large_triangles_are_measured_exactly() -> None:
    """A needle's tip over the middle of a plate of few, large triangles."""
    plate = box((1.0, 1.0, 0.01))
    needle = trimesh.creation.cone(0.002, 0.0123, sections=8).apply_translation((0.1, 0.2, 0.005))
    both = trimesh.util.concatenate([plate, needle])
    assert surface_distance(plate, both) == pytest.approx(0.0123, abs=1e-9)


def test_fans_of_thin_triangles_are_measured_exactly() -> None:
    """Prisms in one cylinder differ by the height of their sides' arcs, though the nearest samples
    in the fans of their ends lie in other triangles."""
    one, other = (trimesh.creation.cylinder(0.1, 0.3, sections=n) for n in (96, 192))
    expected = 0.1 * (1.0 - np.cos(np.pi / 96))
    assert surface_distance(one, other) == pytest.approx(expected, rel=1e-2)


def test_no_or_open_parts_are_refused() -> None:
    with pytest.raises(MeshError, match="no parts"):
        measure_fit(ball(), [], 1.0)
    holey = trimesh.Trimesh(ball().vertices, ball().faces[1:], process=False)
    with pytest.raises(MeshError, match=r"part 1 is not a closed surface"):
        measure_fit(ball(), [ball(), holey], 1.0)


@pytest.mark.parametrize("depth", [0.0012, 0.004])
def test_balls_overlap_by_what_they_are_short_of_two_radii(depth: float) -> None:
    direction = np.array([2.0, -3.0, 6.0]) / 7.0
    other = ball().apply_translation((2 * RADIUS - depth) * direction)
    assert surface_overlap(ball(), other, 1e-3) == pytest.approx(depth, abs=1e-4)
    assert surface_overlap(ball(), other, 0.005) == 0.0


def test_bars_that_cross_without_a_corner_in_each_other() -> None:
    one = box((0.2, 0.02, 0.02))
    other = box((0.02, 0.2, 0.02), at=(0.01, 0.0, 0.02 - 0.0015))
    X = make_pose(rotation_from_rpy((0.3, -0.2, 1.0)), (0.1, 0.2, 0.3))
    for bars in (
        (one, other),
        (other, one),
        [bar.copy().apply_transform(X) for bar in (one, other)],
    ):
        assert surface_overlap(*bars, 1e-3) == pytest.approx(0.0015, abs=1e-6)


def test_nothing_is_inside_a_hollow_or_an_open_surface() -> None:
    marble, hole = ball(), box((0.08,) * 3)
    hole.invert()
    shell = trimesh.util.concatenate([box((0.1,) * 3), hole])
    assert surface_overlap(marble, shell, 1e-3) == 0.0
    assert surface_overlap(marble, box((0.1,) * 3), 1e-3) > 0.019
    sunk = marble.copy().apply_translation((0.04 - RADIUS + 0.002, 0.0, 0.0))
    assert surface_overlap(sunk, shell, 1e-3) == pytest.approx(0.002, abs=1e-4)
    lid_off = box((0.1,) * 3)
    lid_off.update_faces(np.arange(len(lid_off.faces)) > 0)
    assert surface_overlap(marble, lid_off, 1e-3) == 0.0
