"""Stable poses and probabilities against closed forms."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from trimesh.poses import compute_stable_poses

from burg_drake.core import Array, rotation_angle, transform_points
from burg_drake.objects import PotentialLandscape, StablePose, resting_pose, stable_poses
from tests.thorough import thorough


def _poses(mesh: trimesh.Trimesh, p_OOcm: Array | None = None) -> tuple[StablePose, ...]:
    center = np.asarray(mesh.center_mass if p_OOcm is None else p_OOcm)
    return stable_poses(mesh, np.asarray(mesh.vertices), center)


def _solid_angle_of_rectangle(a: float, b: float, d: float) -> float:
    """Of a rectangle with sides a and b seen from d above its middle."""
    return 4.0 * np.arcsin(a * b / np.sqrt((a * a + 4 * d * d) * (b * b + 4 * d * d)))


@pytest.mark.thorough
def test_icosahedron() -> None:
    ico = trimesh.creation.icosahedron().apply_scale(0.05)
    facets = PotentialLandscape(np.asarray(ico.vertices), np.zeros(3)).minima()
    assert len(facets) == 20
    np.testing.assert_allclose([f.probability for f in facets], 1.0 / 20.0, rtol=1e-9)
    np.testing.assert_allclose([f.height for f in facets], 0.05 * 0.7946544722917661, rtol=1e-9)
    (only,) = _poses(ico)
    assert only.probability == 1.0


def test_box_has_three_classes_with_the_solid_angles_of_its_faces() -> None:
    """No face of this box topples, so that each is as probable as its solid angle."""
    a, b, c = 0.10, 0.08, 0.06
    poses = _poses(trimesh.creation.box((a, b, c)))
    expected = sorted(
        (
            2.0 * _solid_angle_of_rectangle(x, y, 0.5 * z) / (4.0 * np.pi)
            for x, y, z in ((a, b, c), (b, c, a), (a, c, b))
        ),
        reverse=True,
    )
    np.testing.assert_allclose([p.probability for p in poses], expected, atol=2e-6)
    heights = [p.X_SO.matrix()[2, 3] for p in poses]
    np.testing.assert_allclose(heights, [0.03, 0.04, 0.05], atol=1e-12)


def test_cylinder_stands_or_lies() -> None:
    r, h = 0.03, 0.1
    poses = _poses(trimesh.creation.cylinder(r, h, sections=64))
    cap = 0.5 * (1.0 - 0.5 * h / np.hypot(0.5 * h, r))
    assert [p.probability for p in poses] == pytest.approx([1 - 2 * cap, 2 * cap], abs=2e-3)
    lying, standing = (p.X_SO.matrix() for p in poses)
    assert abs(lying[2, 2]) < 1e-9
    assert abs(standing[2, 2]) == pytest.approx(1.0)


def test_sphere_is_one_class() -> None:
    for sphere in (trimesh.creation.icosphere(3, 0.02), trimesh.creation.uv_sphere(0.02)):
        assert len(_poses(sphere)) == 1


def test_cube_and_tetrahedron_are_one_class() -> None:
    assert len(_poses(trimesh.creation.box((0.05, 0.05, 0.05)))) == 1
    corners = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]) * 0.03
    assert len(_poses(trimesh.convex.convex_hull(corners))) == 1


def test_cone_stands_or_lies() -> None:
    cone = trimesh.creation.cone(0.04, 0.05, sections=64)
    poses = _poses(cone)
    assert len(poses) == 2
    standing = next(p for p in poses if abs(p.X_SO.matrix()[2, 2]) > 0.99)
    assert standing.X_SO.matrix()[2, 2] == pytest.approx(1.0)  # base down, never on the tip
    assert standing.X_SO.matrix()[2, 3] == pytest.approx(-cone.bounds[0, 2], abs=1e-9)


def test_weighted_cylinder_has_two_ends() -> None:
    cylinder = trimesh.creation.cylinder(0.03, 0.06, sections=64)
    poses = _poses(cylinder, np.array([0.0, 0.0, -0.01]))
    assert len(poses) == 3
    upright = [p for p in poses if p.X_SO.matrix()[2, 2] > 0.99]
    inverted = [p for p in poses if p.X_SO.matrix()[2, 2] < -0.99]
    assert upright[0].probability > inverted[0].probability


def test_a_roly_poly_rights_itself() -> None:
    """A half ball with a low centre of mass rests on its flat side, or upright on its round one,
    though no two facets of that are in the same plane."""
    ball = trimesh.creation.icosphere(4, 0.04)
    half = trimesh.convex.convex_hull(ball.vertices[ball.vertices[:, 2] < 1e-9])
    poses = stable_poses(half, np.asarray(half.vertices), np.array([0.0, 0.0, -0.03]))
    tilt = [p.X_SO.matrix()[2, 2] for p in poses]
    assert tilt == pytest.approx([1.0, -1.0], abs=2e-3)


def test_pencils_do_not_stand() -> None:
    poses = _poses(trimesh.creation.cylinder(0.004, 0.18, sections=6))
    assert len(poses) == 1
    assert abs(poses[0].X_SO.matrix()[2, 2]) < 1e-9


def test_probabilities_are_those_of_trimesh() -> None:
    """Another implementation, on random hulls whose facets are all well apart."""
    rng = np.random.default_rng(5)
    for _ in range(5):
        hull = trimesh.convex.convex_hull(rng.normal(size=(10, 3)) * [0.05, 0.04, 0.03])
        center = np.asarray(hull.center_mass)
        facets = PotentialLandscape(np.asarray(hull.vertices), center).minima(tilt_margin=0.0)
        X, probability = compute_stable_poses(hull, center_mass=center, n_samples=1)
        assert len(facets) == len(probability)
        np.testing.assert_allclose([f.probability for f in facets], probability, atol=1e-9)
        for facet, X_SO in zip(facets, X, strict=True):
            np.testing.assert_allclose(facet.down, -X_SO[2, :3], atol=1e-6)


def thirty_shapes() -> list[trimesh.Trimesh]:
    """A flat bar, boxes, tapered prisms and random hulls, of which many have equal poses."""
    rng = np.random.default_rng(0)
    shapes = [trimesh.creation.box((0.3, 0.022, 0.014))]
    shapes += [trimesh.creation.box(rng.uniform(0.03, 0.1, 3)) for _ in range(9)]
    for _ in range(10):
        (low, wide), taper = np.sort(rng.uniform(0.03, 0.08, 2)), rng.uniform(0.6, 1.0)
        outline = np.array([(-wide, 0), (wide, 0), (0.5 * wide, low), (-0.6 * wide, low)])
        ends = [np.insert(outline, 2, 0.0, 1), np.insert(taper * outline, 2, low + wide, 1)]
        shapes.append(trimesh.convex.convex_hull(np.vstack(ends)))
    for _ in range(10):
        shapes.append(trimesh.convex.convex_hull(rng.normal(size=(8, 3)) * [0.05, 0.04, 0.035]))
    return shapes


@pytest.mark.parametrize("every", [3, thorough(1)])
def test_probabilities_by_height_are_those_of_trimesh(every: int) -> None:
    """trimesh does not merge poses, so that it has each height at least as probably as we have.

    Symmetric poses are at one height, to rounding. What trimesh has at other heights are poses that
    topple from a tilt of a few degrees; their probability is all that ours may have more.
    """
    lost = []
    for mesh in thirty_shapes()[::every]:
        center = np.asarray(mesh.center_mass)
        X, probability = compute_stable_poses(mesh, center_mass=center, n_samples=1)
        theirs = X[:, 2, :3] @ center + X[:, 2, 3]
        ours = _poses(mesh)
        heights = [float(p.X_SO.matrix()[2] @ [*center, 1.0]) for p in ours]
        at = np.abs(theirs[:, None] - np.array(heights)) < 1e-6
        assert at.any(axis=0).all()
        unknown = probability[~at.any(axis=1)].sum()
        lost.append(unknown)
        for height in heights:
            here = sum(
                p.probability for p, h in zip(ours, heights, strict=True) if abs(h - height) < 1e-6
            )
            same = probability[np.abs(theirs - height) < 1e-6].sum()
            assert same - 1e-5 <= here <= same + unknown + 1e-5
    assert sum(share < 0.01 for share in lost) >= 2 * len(lost) // 3


def test_a_flat_bar_has_two_poses() -> None:
    """By the solid angles of its sides; its ends are too rare."""
    sizes = ((0.3, 0.022, 0.014), (0.3, 0.014, 0.022))
    shares = np.array([_solid_angle_of_rectangle(a, b, 0.5 * c) for a, b, c in sizes])
    poses = _poses(trimesh.creation.box((0.3, 0.022, 0.014)))
    expected = shares / shares.sum()
    assert [p.probability for p in poses] == pytest.approx(expected.tolist(), abs=2e-3)
    assert [p.X_SO.matrix()[2, 3] for p in poses] == pytest.approx([0.007, 0.011])


def test_poses_rest_on_the_plane_below_the_centre_of_mass() -> None:
    rng = np.random.default_rng(2)
    hull = trimesh.convex.convex_hull(rng.normal(size=(12, 3)) * 0.04 + [0.3, 0.2, 0.1])
    for pose in _poses(hull):
        X_SO = pose.X_SO.matrix()
        p_SQ = transform_points(X_SO, hull.vertices)
        assert p_SQ[:, 2].min() == pytest.approx(0.0, abs=1e-12)
        assert (p_SQ[:, 2] < 1e-9).sum() >= 3
        np.testing.assert_allclose(
            transform_points(X_SO, hull.center_mass[None])[0, :2], 0.0, atol=1e-12
        )


def test_turning_and_moving_the_mesh_changes_nothing() -> None:
    box = trimesh.creation.box((0.1, 0.07, 0.04))
    box.apply_translation([0.02, 0.0, 0.0])
    X = trimesh.transformations.rotation_matrix(2.0, [3, 1, -2], [0.1, 0.2, 0.3])
    before, after = _poses(box), _poses(box.copy().apply_transform(X))
    assert [p.probability for p in after] == pytest.approx([p.probability for p in before])
    for a, b in zip(before, after, strict=True):
        height = a.X_SO.matrix()[2] @ [*box.center_mass, 1.0]
        p_WOcm = X @ [*box.center_mass, 1.0]
        assert b.X_SO.matrix()[2] @ p_WOcm == pytest.approx(height)


def test_upright_is_not_turned() -> None:
    """An object that stands in its own frame keeps its axes, so that documents stay readable."""
    p_OOcm = np.array([0.1, 0.0, 0.05])
    X_SO = resting_pose(np.array([0.0, 0.0, -1.0]), 0.04, p_OOcm)
    np.testing.assert_allclose(X_SO[:3, :3], np.eye(3))
    np.testing.assert_allclose(X_SO[:3, 3], [-0.1, 0.0, -0.01])
    upside_down = resting_pose(np.array([0.0, 0.0, 1.0]), 0.04, p_OOcm)
    assert rotation_angle(upside_down[:3, :3]) == pytest.approx(np.pi)


def test_rare_poses_are_left_out() -> None:
    plate = trimesh.creation.box((0.2, 0.2, 0.02))
    edge = 4.0 * _solid_angle_of_rectangle(0.2, 0.02, 0.1) / (4.0 * np.pi)
    assert 0.01 < edge < 0.1
    poses = _poses(plate)
    assert [p.probability for p in poses] == pytest.approx([1.0])  # 5.7 degrees: it falls
    thicker = _poses(trimesh.creation.box((0.2, 0.2, 0.03)))
    assert len(thicker) == 2
    assert sum(p.probability for p in thicker) == pytest.approx(1.0)


LEANING = np.array(
    [
        (3.0 * np.cos(a) + 8.0 * level, 3.0 * np.sin(a), 8.0 * level)
        for level in (0.0, 1.0)
        for a in np.arange(6) * np.pi / 3.0
    ]
)
"""A hexagonal prism that leans so far that it stands on neither end [cm]."""


def test_how_a_face_is_cut_into_triangles_does_not_matter() -> None:
    """Qhull cuts the hexagons otherwise in every orientation; what lands on one topples as one."""
    corners = 0.01 * LEANING
    center = np.asarray(trimesh.convex.convex_hull(corners).center_mass)
    first = [m.probability for m in PotentialLandscape(corners, center).minima()]
    assert first[0] == pytest.approx(first[1], abs=1e-9)  # mirror images of each other
    assert first[2] == pytest.approx(first[3], abs=1e-9)
    rng = np.random.default_rng(1)
    for _ in range(8):
        R = trimesh.transformations.random_rotation_matrix(rng.random(3))[:3, :3]
        turned = np.round(corners @ R.T, 9)
        again = [m.probability for m in PotentialLandscape(turned, R @ center).minima()]
        assert again == pytest.approx(first, abs=1e-6)


def test_subdividing_the_mesh_changes_nothing() -> None:
    prism = trimesh.convex.convex_hull(0.01 * LEANING)
    for mesh in (trimesh.creation.box((0.1, 0.07, 0.04)), prism):
        before, after = _poses(mesh), _poses(mesh.subdivide().subdivide())
        assert [p.probability for p in after] == pytest.approx([p.probability for p in before])
        for a, b in zip(before, after, strict=True):
            np.testing.assert_allclose(abs(a.X_SO.matrix()), abs(b.X_SO.matrix()), atol=1e-6)


@pytest.mark.parametrize("sections", [24, thorough(32), thorough(64)])
def test_cans_lie_and_roll_however_finely_they_are_cut(sections: int) -> None:
    lying, upright = _poses(trimesh.creation.cylinder(0.03, 0.1, sections=sections))
    assert (lying.rolls, upright.rolls) == (True, False)


def test_what_rolls() -> None:
    (ball,) = _poses(trimesh.creation.icosphere(3, 0.02))
    assert ball.rolls
    (pencil,) = _poses(trimesh.creation.cylinder(0.004, 0.18, sections=6))
    assert not pencil.rolls
    assert not any(p.rolls for p in _poses(trimesh.creation.box((0.1, 0.08, 0.06))))
    # an egg rolls about its long axis; on its end it does not stand
    egg = trimesh.creation.icosphere(4, 0.02).apply_scale([1.0, 1.0, 1.4])
    (lying,) = _poses(egg)
    assert lying.rolls


def test_tall_boxes_that_hardly_stand_do_not_roll() -> None:
    """To fall over is not to roll on, though the pass is low."""
    for pose in _poses(trimesh.creation.box((0.03, 0.04, 0.2))):
        assert not pose.rolls


def test_dents_do_not_make_poses_of_their_own() -> None:
    """A box with faces bent outward by a degree, as scans have them."""
    box = trimesh.creation.box((0.1, 0.08, 0.06)).subdivide()
    bulge = 1.0 + 0.012 * (np.linalg.norm(box.vertices / [0.05, 0.04, 0.03], axis=1) < 1.2)
    bent = trimesh.convex.convex_hull(box.vertices * bulge[:, None])
    assert len(bent.facets) == 0  # no two triangles are in one plane any more
    poses, flat = _poses(bent), _poses(trimesh.creation.box((0.1, 0.08, 0.06)))
    assert len(poses) == 3
    assert [p.probability for p in poses] == pytest.approx([p.probability for p in flat], abs=0.02)
