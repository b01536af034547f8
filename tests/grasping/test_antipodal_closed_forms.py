"""Antipodal sampling against closed forms: boxes, plates, spheres, cylinders, coins."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from sampled import box, center, closing, grasp
from scipy.stats import kstest
from trimesh import creation

MU = 0.24
CONE = np.arctan(MU)


def test_a_box_is_grasped_across_parallel_faces():
    extents = np.array([0.04, 0.06, 0.20])
    grasps = grasp(box(*extents))
    axis = np.abs(closing(grasps)).argmax(axis=1)
    cosine = np.abs(closing(grasps)).max(axis=1)
    assert len(grasps) == 2000
    assert (cosine >= np.cos(CONE)).all()
    assert set(axis) == {0, 1}  # the long one is wider than the hand
    np.testing.assert_allclose(grasps.width, extents[axis] / cosine, atol=1e-7)
    np.testing.assert_allclose(np.abs(center(grasps))[range(2000), axis], 0.0, atol=1e-7)
    needed = np.tan(np.arccos(cosine))
    np.testing.assert_allclose(grasps.score, 1.0 - needed / MU, atol=1e-6)


def test_a_box_that_is_too_large_in_two_extents_is_grasped_across_the_third():
    grasps = grasp(box(0.3, 0.05, 0.4), n=500)
    assert len(grasps) == 500
    assert (np.abs(closing(grasps)).argmax(axis=1) == 1).all()


def test_pairs_of_faces_are_grasped_in_proportion_to_their_areas():
    """With little friction lines tilt by at most 1.2 degrees, and few get past an edge."""
    extents, n = np.array([0.04, 0.05, 0.07]), 20_000
    grasps = grasp(box(*extents), n=n, friction=0.02)
    across = np.abs(closing(grasps)).argmax(axis=1)
    area = extents.prod() / extents
    # A direction of the cone's mean tilt, 2/3 of the largest, loses its shift over a face's side.
    edge, sine = [], 2.0 / 3.0 * np.sin(np.arctan(0.02)) * 2.0 / np.pi
    for k in range(3):
        others = np.delete(extents, k)
        edge.append(np.prod(1.0 - sine * extents[k] / others))
    expected = area * edge / (area * edge).sum()
    shares = np.bincount(across, minlength=3) / n
    np.testing.assert_allclose(shares, expected, atol=3.3 * np.sqrt(0.25 / n))


def test_on_a_large_plate_every_distribution_is_known():
    """Edges do not count on a plate of 2 m x 1 m x 20 mm: the cap is uniform, so is the rest."""
    n = 5000
    grasps = grasp(box(2.0, 1.0, 0.02), n=n, friction=0.5)
    cosine = np.abs(closing(grasps)[:, 2])
    lowest = 1.0 / np.hypot(1.0, 0.5)
    x, z = closing(grasps), grasps.X_OG[:, :3, 2]
    ahead = np.cross([0.0, 1.0, 0.0], x)  # perpendicular to the closing axis, near the x axis
    about = np.arctan2(
        np.einsum("ij,ij->i", np.cross(ahead, z), x), np.einsum("ij,ij->i", ahead, z)
    )
    uniform = {
        "cap": (cosine - lowest) / (1.0 - lowest),
        "azimuth": (np.arctan2(x[:, 1], x[:, 0]) + np.pi) / (2 * np.pi),
        "place x": center(grasps)[:, 0] / 2.0 + 0.5,
        "place y": center(grasps)[:, 1] + 0.5,
        "approach": (about + np.pi) / (2 * np.pi),
    }
    for name, values in uniform.items():
        assert kstest(values, "uniform").pvalue > 1e-3, name


def test_lines_through_a_sphere_pass_near_its_center():
    radius = 0.03
    grasps = grasp(creation.icosphere(subdivisions=5, radius=radius))
    distance = np.linalg.norm(np.cross(center(grasps), closing(grasps)), axis=1)
    facet = 0.02  # angle between a facet's normal and the radius at most [rad]
    assert distance.max() <= radius * np.sin(CONE + facet)
    assert distance.max() > 0.95 * radius * np.sin(CONE)  # the cone is used to its edge
    chord = 2.0 * np.sqrt(radius**2 - distance**2)
    np.testing.assert_allclose(grasps.width, chord, atol=1e-4)
    np.testing.assert_allclose(np.linalg.norm(center(grasps), axis=1), distance, atol=1e-4)


def test_lines_through_a_sphere_have_known_distributions():
    """Uniform in the cone: the cosine of the tilt; and all directions alike. A line that is tilted
    by a passes the center at R sin a and is 2 R cos a long."""
    radius, friction = 0.03, 1.0
    mesh = creation.icosphere(subdivisions=6, radius=radius)  # facets within 0.01 rad of the radius
    grasps = grasp(mesh, n=4000, friction=friction)
    cosine = grasps.width / (2.0 * radius)
    lowest = 1.0 / np.hypot(1.0, friction)
    assert kstest((cosine - lowest) / (1.0 - lowest), "uniform").pvalue > 1e-3
    np.testing.assert_allclose(grasps.score, 1.0 - np.tan(np.arccos(cosine)) / friction, atol=0.05)
    for axis in ((0, 0, 1), (0.6, 0, 0.8), (1, 0, 0)):
        assert kstest(np.abs(closing(grasps) @ axis), "uniform").pvalue > 1e-3


def coins(gap: float) -> trimesh.Trimesh:
    """Two coins of 24 mm, 2 mm thick, one above the other."""
    parts = [creation.cylinder(radius=0.012, height=0.002, sections=2048) for _ in range(2)]
    parts[1].apply_translation((0.0, 0.0, 0.002 + gap))
    return trimesh.util.concatenate(parts)


def test_two_coins_are_grasped_one_by_one_where_a_finger_fits_between():
    """Each of the four sides has its coin's thickness, the outer two also the whole stack; the rims
    are wider than the hand. Tilted by less than 0.6 degrees, lines move sideways by 0.2 mm."""
    n = 12_000
    grasps = grasp(coins(0.010), n=n, friction=0.01, opening=(0.0, 0.02))
    assert (np.abs(closing(grasps)[:, 2]) > 0.99).all()
    kinds, counts = np.unique(np.round(grasps.width, 5), return_counts=True)
    np.testing.assert_allclose(kinds, [0.002, 0.014], atol=2e-5)
    assert counts[0] / n == pytest.approx(2 / 3, abs=0.02)
    lower = (center(grasps)[:, 2] < 0.001) & (grasps.width < 0.003)
    assert lower.sum() / counts[0] == pytest.approx(1 / 2, abs=0.02)


@pytest.mark.parametrize("gap", [0.010, 0.0005])
def test_two_coins_are_grasped_as_one_where_no_finger_fits_between(gap):
    """An open finger of the wide hand starts 39 mm away from its contact with a coin."""
    grasps = grasp(coins(gap), n=4000, friction=0.01)
    flat = np.abs(closing(grasps)[:, 2]) > 0.99
    inner = np.hypot(*center(grasps)[:, :2].T) < 0.0115  # tilted fingers clear the other coin's rim
    np.testing.assert_allclose(grasps.width[flat & inner], 0.004 + gap, atol=1e-5)
    np.testing.assert_allclose(grasps.width[~flat], 0.024, atol=1e-4)
    # Two faces of pi R^2 and two rims of 2 pi R t, of which lines of 24 mm leave out a twentieth.
    share = 0.012 / (0.012 + 0.95 * 2 * 0.002)
    assert flat.mean() == pytest.approx(share, abs=0.025)


def test_a_standing_cylinder():
    radius, height = 0.03, 0.3
    grasps = grasp(creation.cylinder(radius=radius, height=height, sections=512), n=4000)
    x = closing(grasps)
    horizontal = np.hypot(x[:, 0], x[:, 1])
    cosine = np.cos(np.arctan(MU * (1.0 - grasps.score)))
    np.testing.assert_allclose(grasps.width, 2 * radius * cosine / horizontal**2, rtol=0.01)
    assert np.abs(x[:, 2]).max() <= np.sin(CONE) + 1e-6  # the ends are too far apart
    azimuth = np.arctan2(x[:, 1], x[:, 0]) % np.pi / np.pi
    assert kstest(azimuth, "uniform").pvalue > 1e-3
    away = np.abs(center(grasps)[:, 2]) < 0.4 * height
    assert kstest(center(grasps)[away, 2] / (0.8 * height) + 0.5, "uniform").pvalue > 1e-3


def test_a_regular_tetrahedron_has_none_until_friction_reaches_its_corners():
    """Faces meet at 70.5 degrees, so that a line makes at least 35.3 degrees with one normal."""
    corners = 0.03 * np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]])
    mesh = trimesh.convex.convex_hull(corners)
    assert len(grasp(mesh, n=10, friction=np.tan(np.deg2rad(35.0)))) == 0
    assert len(grasp(mesh, n=10, friction=np.tan(np.deg2rad(40.0)))) == 10
