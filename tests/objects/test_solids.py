"""Unions against inclusion and exclusion; decimation against the sphere it came from."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from burg_drake.objects import decimate, is_closed, one_sided_hausdorff, unite_bodies


def _box(*corners: float) -> trimesh.Trimesh:
    low, high = np.array(corners[:3]), np.array(corners[3:])
    return trimesh.creation.box(high - low).apply_translation(0.5 * (low + high))


def _united(*parts: trimesh.Trimesh) -> tuple[trimesh.Trimesh, list[str]]:
    return unite_bodies(trimesh.util.concatenate(parts))


def test_overlap_counts_once() -> None:
    whole, said = _united(_box(0, 0, 0, 4, 1, 1), _box(3, 0, 0, 4, 1, 5))
    assert whole.volume == pytest.approx(4 + 5 - 1)
    assert is_closed(whole)
    assert said == [
        "united 2 bodies that overlap (they share 11 % of their volume, which now counts once)"
    ]


def test_bodies_that_lie_apart_or_touch_with_parts_of_their_faces_stay() -> None:
    for other in (_box(1.1, 0, 0, 2, 1, 1), _box(1, 0.2, 0.2, 2, 0.8, 0.8)):
        whole, said = _united(_box(0, 0, 0, 1, 1, 1), other)
        assert whole.volume == pytest.approx(1.0 + other.volume)
        assert said == []


def test_bodies_with_corners_in_common_become_one() -> None:
    """Or they would not be closed any more when their file's corners are merged."""
    whole, said = _united(_box(0, 0, 0, 1, 1, 1), _box(1, 0, 0, 2, 1, 1))
    assert whole.volume == pytest.approx(2.0)
    assert said == ["united 2 bodies that touch"]
    whole.merge_vertices()
    assert is_closed(whole)


def test_cavities_stay_and_what_lies_in_them_too() -> None:
    cavity = _box(1, 1, 1, 9, 9, 9)
    cavity.invert()
    shell, ball = _box(0, 0, 0, 10, 10, 10), _box(2, 2, 2, 4, 4, 4)
    whole, said = _united(shell, cavity, ball)
    assert whole.volume == pytest.approx(1000 - 512 + 8)
    assert said == []
    handle = _box(9.5, 4, 4, 12, 6, 6)
    whole, said = _united(shell, cavity, ball, handle)
    assert whole.volume == pytest.approx(1000 - 512 + 8 + 2 * 2 * 2)
    assert len(said) == 1


def test_a_body_inside_another_counts_once() -> None:
    whole, said = _united(_box(0, 0, 0, 4, 4, 4), _box(1, 1, 1, 2, 2, 2))
    assert whole.volume == pytest.approx(64.0)
    assert len(whole.faces) == 12
    assert len(said) == 1


def test_fine_spheres_become_coarser_and_stay_where_they_are() -> None:
    sphere = trimesh.creation.icosphere(subdivisions=6, radius=0.05)
    coarse, (said,) = decimate(sphere, 20_000)
    assert is_closed(coarse)
    assert len(coarse.faces) <= 20_000
    start, _, away = said.partition(" faces, at most ")
    assert start == f"reduced from {len(sphere.faces)} to {len(coarse.faces)}"
    stated = float(away.split()[0]) * 1e-3
    # independent of the code: by how much samples of the coarse one lie below the sphere's surface
    samples, _ = trimesh.sample.sample_surface(coarse, 20_000, seed=5)
    depth = 0.05 - np.linalg.norm(samples, axis=1).min()
    assert depth < 1.3 * stated + 1e-5
    assert stated < 1e-3
    assert coarse.volume == pytest.approx(sphere.volume, rel=0.01)


def test_flat_faces_are_decimated_without_deviation() -> None:
    box = _box(0, 0, 0, 0.1, 0.06, 0.03)
    for _ in range(6):
        box = box.subdivide()
    coarse, (said,) = decimate(box, 20_000)
    assert len(coarse.faces) < 200
    assert coarse.volume == pytest.approx(0.1 * 0.06 * 0.03, rel=1e-9)
    assert said.endswith("at most 0.001 mm off")


def test_surfaces_with_few_faces_stay() -> None:
    sphere = trimesh.creation.icosphere(subdivisions=3)
    assert decimate(sphere, 2000) == (sphere, [])


def test_what_is_too_rough_stays() -> None:
    sphere = trimesh.creation.icosphere(subdivisions=5, radius=0.05)
    rng = np.random.default_rng(0)
    rough = trimesh.Trimesh(
        sphere.vertices * rng.uniform(0.95, 1.05, (len(sphere.vertices), 1)), sphere.faces
    )
    same, said = decimate(rough, 5000)
    assert same is rough
    assert said == ["kept all 20480 faces, as the surface is too rough to reduce"]


def test_farthest_is_exact_on_a_box() -> None:
    box = _box(0, 0, 0, 1, 1, 1)
    points = np.array([[0.5, 0.5, 0.9], [0.5, 0.5, 0.5], [2.0, 2.0, 0.5], [1.0, 0.2, 0.3]])
    assert one_sided_hausdorff(points, box) == pytest.approx(np.sqrt(2.0), rel=1e-9)
    assert one_sided_hausdorff(points[[0, 3]], box) == pytest.approx(0.1, rel=1e-9)
