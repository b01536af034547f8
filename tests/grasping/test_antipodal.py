"""Antipodal sampling against closed forms, symmetry, and a re-check from the mesh alone."""

from __future__ import annotations

import time

import numpy as np
import pytest
import trimesh
from scipy.stats import ks_2samp, kstest
from trimesh import creation

from burg_drake.core.errors import InvalidInputError, MeshError
from burg_drake.core.frames import check_pose, swap_fingers
from burg_drake.core.grasps import GraspSet
from burg_drake.grasping.antipodal import FINGER_CLEARANCE, MIN_WIDTH, sample_antipodal
from burg_drake.grasping.approach import ApproachCone

MU = 0.24
CONE = np.arctan(MU)
WIDEST = 0.08 - 2.0 * FINGER_CLEARANCE


def box(x: float, y: float, z: float, center=(0.0, 0.0, 0.0)) -> trimesh.Trimesh:
    mesh = creation.box(extents=(x, y, z))
    mesh.apply_translation(center)
    return mesh


def tube() -> trimesh.Trimesh:
    """A cup's wall: outer diameter 70 mm, wall 5 mm, 90 mm high, open at both ends."""
    return creation.annulus(r_min=0.030, r_max=0.035, height=0.09, sections=256)


def lumpy() -> trimesh.Trimesh:
    """An irregular closed surface of about 50 mm, 1280 faces, concave in places."""
    mesh = creation.icosphere(subdivisions=3, radius=0.028)
    x, y, z = mesh.vertices.T / 0.028
    bumps = 1.0 + 0.12 * np.sin(4 * x) + 0.1 * np.cos(5 * y + 1) * np.sin(3 * z)
    mesh.vertices *= bumps[:, None]
    return mesh


def grasp(mesh, n=2000, seed=0, **parameters) -> GraspSet:
    return sample_antipodal(mesh, n, np.random.default_rng(seed), **parameters)


def closing(grasps: GraspSet) -> np.ndarray:
    return grasps.X_OG[:, :3, 0]


def center(grasps: GraspSet) -> np.ndarray:
    return grasps.X_OG[:, :3, 3]


def contacts(grasps: GraspSet) -> tuple[np.ndarray, np.ndarray]:
    half = 0.5 * grasps.width[:, None] * closing(grasps)
    return center(grasps) - half, center(grasps) + half


# --- closed forms ---------------------------------------------------------------------------------


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


# --- what the fingers can get at ------------------------------------------------------------------


def test_a_tube_is_grasped_by_its_wall_and_across_but_never_from_inside():
    grasps = grasp(tube(), n=4000)
    side = np.abs(closing(grasps)[:, 2]) < 0.5
    radii = np.sort([np.hypot(p[side, 0], p[side, 1]) for p in contacts(grasps)], axis=0)
    wall = (np.abs(radii[0] - 0.030) < 1e-4) & (np.abs(radii[1] - 0.035) < 1e-4)
    across = (np.abs(radii - 0.035) < 1e-4).all(axis=0)
    assert (wall | across).all()
    assert wall.sum() > 100 and across.sum() > 100


@pytest.mark.parametrize(
    ("opening", "widths"),
    [((0.0, 0.08), {0.032}), ((0.0, 0.03), {0.010}), ((0.0, 0.012), set())],
)
def test_a_finger_must_reach_its_contact_from_the_open_position(opening, widths):
    """Two plates of 10 mm, 12 mm apart: an open finger fits between them or it does not."""
    parts = [box(0.01, 0.2, 0.2, (x, 0, 0)) for x in (-0.011, 0.011)]
    grasps = grasp(trimesh.util.concatenate(parts), n=1000, opening=opening)
    inner = np.abs(center(grasps)[:, 1:]).max(axis=1) < 0.09  # tilted fingers clear the rims
    across = grasps.width * np.abs(closing(grasps)[:, 0])
    assert set(np.round(across[inner], 6).tolist()) == widths


@pytest.mark.parametrize("start", [0.01, 0.02], ids=["overlapping", "touching"])
def test_contacts_do_not_lie_inside_of_material(start):
    """Two boxes that were never merged; the inner faces are no surface for a finger."""
    parts = [box(0.02, 0.2, 0.2, (0.01, 0, 0)), box(0.04, 0.2, 0.2, (start + 0.02, 0, 0))]
    grasps = grasp(trimesh.util.concatenate(parts), n=500)
    assert len(grasps) == 500
    across = grasps.width * np.abs(closing(grasps)[:, 0])
    np.testing.assert_allclose(across, start + 0.04, atol=1e-7)


@pytest.mark.parametrize(
    "mesh", [tube(), lumpy(), box(0.03, 0.05, 0.07)], ids=["tube", "lumpy", "box"]
)
@pytest.mark.parametrize("opening", [(0.0, 0.08), (0.0, 0.03), (0.02, 0.05), (0.05, 0.06)])
def test_the_opening_is_respected(mesh, opening):
    widths = grasp(mesh, n=1000, opening=opening).width
    assert (widths >= opening[0]).all()
    assert (widths <= opening[1] - 2.0 * FINGER_CLEARANCE).all()


# --- the mesh as only witness ---------------------------------------------------------------------


def test_contacts_and_normals_hold_against_the_mesh():
    """Finds the faces under both contacts by brute force and measures all angles again."""
    mesh = lumpy()
    grasps = grasp(mesh, n=300)
    a, b, c = np.swapaxes(mesh.triangles, 0, 1)
    worst, unique = np.zeros(len(grasps)), np.ones(len(grasps), bool)
    for p, sign in zip(contacts(grasps), (-1.0, 1.0), strict=True):
        angle = np.arccos(np.clip(sign * closing(grasps) @ mesh.face_normals.T, -1.0, 1.0))
        for i, q in enumerate(p):
            inside = np.abs(np.einsum("ij,ij->i", q - a, mesh.face_normals)) < 1e-7
            for u, v in ((a, b), (b, c), (c, a)):
                edge = np.einsum("ij,ij->i", np.cross(v - u, q - u), mesh.face_normals)
                inside &= edge > -1e-9
            assert inside.any()
            worst[i] = max(worst[i], angle[i, inside].min())
            unique[i] &= inside.sum() == 1  # else on an edge, within rounding
    assert worst.max() <= CONE + 1e-6
    assert unique.mean() > 0.95
    expected = 1.0 - np.tan(worst[unique]) / MU
    np.testing.assert_allclose(grasps.score[unique], expected, atol=1e-6)
    assert grasps.score.min() >= 0.0 and grasps.score.max() <= 1.0


@pytest.mark.parametrize("mesh", [tube(), lumpy()], ids=["tube", "lumpy"])
def test_just_outside_of_both_contacts_is_air(mesh):
    grasps = grasp(mesh, n=300)
    p1, p2 = contacts(grasps)
    for p, outward in ((p1, -closing(grasps)), (p2, closing(grasps))):
        assert not mesh.contains(p + 2e-5 * outward).any()
        assert mesh.contains(p - 2e-5 * outward).all()


# --- invariance -----------------------------------------------------------------------------------


def statistics(grasps: GraspSet) -> dict[str, np.ndarray]:
    """Numbers that do not depend on how the object lies or which finger is which."""
    return {
        "width": grasps.width,
        "score": grasps.score,
        "closing": np.abs(closing(grasps)[:, 2]),
        "approach": grasps.X_OG[:, 2, 2],
        "height": center(grasps)[:, 2],
        "radius": np.hypot(*center(grasps)[:, :2].T),
    }


def assert_same_distribution(a: GraspSet, b: GraspSet) -> None:
    every_third = slice(None, None, 3)  # one ray may give two grasps, which are not independent
    one, two = statistics(a.select(every_third)), statistics(b.select(every_third))
    for name, values in one.items():
        assert ks_2samp(values, two[name]).pvalue > 1e-4, name


def test_a_turned_and_moved_object_has_the_turned_and_moved_grasps():
    mesh = tube()
    X_NO = trimesh.transformations.rotation_matrix(1.1, [1, 2, -0.5])
    X_NO[:3, 3] = [5.0, -7.0, 0.5]
    turned = grasp(mesh.copy().apply_transform(X_NO), n=12000, seed=1)
    back = GraspSet.create(
        np.linalg.inv(X_NO) @ turned.X_OG, object="", width=turned.width, score=turned.score
    )
    assert_same_distribution(grasp(mesh, n=12000, seed=2), back)


def test_another_triangulation_of_the_same_surface_changes_nothing():
    mesh = tube()
    upper = np.flatnonzero(mesh.triangles_center[:, 2] > -0.01)
    finer = mesh.subdivide(face_index=upper).subdivide(face_index=upper[:200])
    assert len(finer.faces) > 2 * len(mesh.faces)
    assert_same_distribution(grasp(mesh, n=12000, seed=3), grasp(finer, n=12000, seed=4))


def test_faces_given_twice_and_faces_without_area_change_no_grasp():
    mesh = box(0.03, 0.05, 0.07)
    doubled = trimesh.Trimesh(mesh.vertices, np.tile(mesh.faces, (2, 1)), process=False)
    assert_same_distribution(grasp(mesh, seed=5), grasp(doubled, seed=6))
    degenerate = np.concatenate([mesh.faces, [[0, 0, 1], [2, 2, 2]]])
    slivers = trimesh.Trimesh(mesh.vertices, degenerate, process=False)
    np.testing.assert_array_equal(grasp(slivers, seed=7).X_OG, grasp(mesh, seed=7).X_OG)


# --- seeds, order, conventions --------------------------------------------------------------------


def test_the_same_seed_gives_the_same_grasps_and_a_larger_n_only_adds():
    mesh = lumpy()
    few, many = grasp(mesh, n=50, seed=8), grasp(mesh, n=9000, seed=8)
    np.testing.assert_array_equal(few.id, many.id[:50])
    np.testing.assert_array_equal(grasp(mesh, n=9000, seed=8).id, many.id)
    assert len(set(many.id.tolist())) == 9000
    assert not set(grasp(mesh, n=50, seed=9).id.tolist()) & set(few.id.tolist())


def test_the_first_grasps_are_not_special():
    """Near and far pairs of one ray come in the ray's turn: a short prefix has both kinds."""
    grasps = grasp(tube(), n=8000, seed=10)
    assert_same_distribution(grasps.select(slice(0, 2000)), grasps.select(slice(2000, None)))


def test_the_provenance_is_enough_to_sample_again():
    mesh = lumpy()
    rng = np.random.default_rng(11)
    rng.random(17)
    grasps = sample_antipodal(mesh, 40, rng, friction=0.4, opening=(0.01, 0.07), object="lump")
    p = grasps.provenance
    again = np.random.default_rng()
    again.bit_generator.state = p["rng"]
    repeated = sample_antipodal(
        mesh, p["n"], again, friction=p["friction"], opening=tuple(p["opening"]), object="lump"
    )
    np.testing.assert_array_equal(repeated.id, grasps.id)
    assert repeated.provenance == p
    assert set(grasps.object) == {"lump"}
    moved = mesh.copy()
    moved.vertices[0] *= 1.0001
    assert grasp(moved, n=1).provenance["mesh"] != grasp(mesh, n=1).provenance["mesh"]


def test_of_two_equal_poses_the_canonical_one_is_given():
    grasps = grasp(lumpy(), n=1000)
    check_pose(grasps.X_OG, "X_OG")

    def leading(X):
        x = X[:, :3, 0]
        return x[np.arange(len(x)), np.abs(x).argmax(axis=1)]

    assert (leading(grasps.X_OG) > 0.0).all()
    assert (leading(swap_fingers(grasps.X_OG)) < 0.0).all()


def test_approaches_are_evenly_spaced_about_each_pair():
    grasps = grasp(lumpy(), n=400, approaches=4)
    X = grasps.X_OG.reshape(100, 4, 4, 4)
    for column in (0, 3):
        np.testing.assert_allclose(
            X[:, :, :3, column], X[:, :1, :3, column].repeat(4, 1), atol=1e-12
        )
    z = X[:, :, :3, 2]
    turn = np.cross(z, np.roll(z, -1, axis=1))
    np.testing.assert_allclose(turn, X[:, :, :3, 0], atol=1e-12)
    assert len(np.unique(grasps.width)) == 100


# --- where the hand comes from --------------------------------------------------------------------

DOWN = (0.0, 0.0, -1.0)


def cone(degrees: float, axis=DOWN) -> ApproachCone:
    return ApproachCone(axis, np.deg2rad(degrees))


def from_axis(grasps: GraspSet, axis=DOWN) -> np.ndarray:
    """Angle between approach and axis [deg]."""
    cosine = grasps.X_OG[:, :3, 2] @ np.array(axis) / np.linalg.norm(axis)
    return np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)))


def rank_among_allowed(grasps: GraspSet, degrees: float, axis=DOWN) -> np.ndarray:
    """Share of the allowed turns below the approach's own, by trying 3600 turns one by one."""
    x, z = closing(grasps)[:, None], grasps.X_OG[:, None, :3, 2]
    turn = np.deg2rad(np.arange(0.05, 360.0, 0.1))[:, None]
    tried = np.cos(turn) * z + np.sin(turn) * np.cross(x, z)
    allowed = tried @ axis >= np.cos(np.deg2rad(degrees)) * np.linalg.norm(axis)
    ahead = allowed.cumprod(axis=1).sum(axis=1)  # one interval: on from here, and back from here
    behind = allowed[:, ::-1].cumprod(axis=1).sum(axis=1)
    whole = allowed.all(axis=1)
    np.testing.assert_array_equal((ahead + behind)[~whole], allowed.sum(axis=1)[~whole])
    return (behind / np.maximum(ahead + behind, 1))[~whole]


@pytest.mark.parametrize(
    ("degrees", "axis"), [(45.0, DOWN), (45.0, (1.0, -2.0, 0.5)), (90.0, DOWN), (130.0, DOWN)]
)
def test_approaches_to_a_sphere_are_uniform_in_the_cone(degrees, axis):
    """Lines through a sphere have all directions alike, so their component along the axis is
    uniform, up to the sine of the cone's angle, from where on no approach is left."""
    n = 3000
    sphere = creation.icosphere(subdivisions=5, radius=0.03)
    grasps = grasp(sphere, n=n, friction=0.01, approach_cone=cone(degrees, axis))
    check_pose(grasps.X_OG, "X_OG")
    assert len(grasps) == n
    assert degrees - 2.0 < from_axis(grasps, axis).max() <= degrees + 1e-6
    along = np.abs(closing(grasps) @ axis) / np.linalg.norm(axis)
    largest = np.sin(np.deg2rad(min(degrees, 90.0)))
    assert along.max() <= largest + 1e-9
    assert kstest(along / largest, "uniform").pvalue > 1e-3
    rank = rank_among_allowed(grasps.select(slice(0, 1000)), degrees, axis)
    assert len(rank) > 500
    assert kstest(rank, "uniform").pvalue > 1e-3


def test_a_box_on_a_table_is_not_grasped_by_its_top_and_bottom():
    cube = box(0.04, 0.04, 0.04)
    vertical = {
        degrees: np.abs(closing(grasp(cube, n=3000, approach_cone=cone(degrees)))[:, 2]) > 0.5
        for degrees in (60.0, 75.0, 90.0, 180.0)
    }
    assert not vertical[60.0].any() and not vertical[75.0].any()  # the lines tilt by 13.5 degrees
    for degrees in (90.0, 180.0):
        assert len(vertical[degrees]) == 3000
        assert vertical[degrees].mean() == pytest.approx(1 / 3, abs=0.04)


def test_a_plate_that_lies_has_no_grasp_from_above():
    start = time.process_time()
    assert len(grasp(box(0.3, 0.4, 0.05), n=100, approach_cone=cone(75.0))) == 0
    assert time.process_time() - start < 5.0
    steeper = grasp(box(0.3, 0.4, 0.05), n=100, approach_cone=cone(80.0))
    assert len(steeper) == 100  # closing lines that tilt by 10 degrees or more
    assert np.abs(closing(steeper)[:, 2]).max() <= np.cos(np.deg2rad(10.0))


def test_a_cone_of_all_directions_leaves_out_nothing():
    free, everywhere = grasp(lumpy(), n=12000), grasp(lumpy(), n=12000, approach_cone=cone(180.0))
    for column in (0, 3):  # the same pairs of contacts
        np.testing.assert_array_equal(everywhere.X_OG[..., column], free.X_OG[..., column])
    assert_same_distribution(free, everywhere)


def test_a_cone_selects_among_the_pairs_of_the_same_seed():
    free, above = grasp(lumpy(), n=4000), grasp(lumpy(), n=500, approach_cone=cone(50.0))
    rows = {tuple(row): i for i, row in enumerate(free.X_OG[:, :3, 3])}
    index = [rows[tuple(row)] for row in above.X_OG[:, :3, 3]]
    assert index == sorted(index)
    possible = np.abs(closing(free)[: index[-1] + 1, 2]) <= np.sin(np.deg2rad(50.0))
    assert np.flatnonzero(possible).tolist() == index
    repeated = grasp(lumpy(), n=9000, approach_cone=cone(50.0))
    np.testing.assert_array_equal(repeated.id[:500], above.id)


def test_several_approaches_share_the_cone_evenly():
    grasps = grasp(lumpy(), n=600, approaches=3, approach_cone=cone(50.0))
    assert from_axis(grasps).max() <= 50.0 + 1e-6
    rank = rank_among_allowed(grasps, 50.0).reshape(-1, 3)
    wide = np.abs(closing(grasps)[::3, 2]) < 0.6  # where 0.1 degrees are little
    gaps = np.diff(np.sort(rank[wide], axis=1), axis=1)
    np.testing.assert_allclose(gaps, 1 / 3, atol=5e-3)
    assert kstest(rank[:, 0], "uniform").pvalue > 1e-3


def test_the_provenance_tells_the_cone():
    assert grasp(lumpy(), n=1).provenance["approach_cone"] is None
    above = grasp(lumpy(), n=5, approach_cone=cone(60.0, np.array([0, 1, -1])))
    told = above.provenance["approach_cone"]
    assert told == {"axis": [0.0, 1.0, -1.0], "angle": np.deg2rad(60.0)}
    again = grasp(lumpy(), n=5, approach_cone=ApproachCone(tuple(told["axis"]), told["angle"]))
    np.testing.assert_array_equal(again.id, above.id)


@pytest.mark.parametrize("axis", [(0.0, 0.0, 0.0), (0.0, 1.0), (0.0, 0.0, np.nan)])
def test_an_axis_that_is_no_direction(axis):
    with pytest.raises(InvalidInputError, match=r"^axis of the approach cone is \(0.0, .*; give a"):
        ApproachCone(axis, 1.0)


@pytest.mark.parametrize("angle", [0.0, -1.0, 3.2, np.nan])
def test_an_angle_that_makes_no_cone(angle):
    with pytest.raises(InvalidInputError, match=f"^angle of the approach cone is {angle}; give it"):
        ApproachCone(DOWN, angle)


# --- nothing to grasp -----------------------------------------------------------------------------


def sheet(double: bool = False) -> trimesh.Trimesh:
    vertices = np.array([[0, 0, 0], [0.05, 0, 0], [0.05, 0.05, 0], [0, 0.05, 0]], float)
    faces = [[0, 1, 2], [0, 2, 3]]
    faces += [[2, 1, 0], [3, 2, 0]] if double else []
    return trimesh.Trimesh(vertices, faces, process=False)


def open_corner() -> trimesh.Trimesh:
    """The three faces of a cube of 50 mm that meet in one corner."""
    mesh = box(0.05, 0.05, 0.05)
    return trimesh.Trimesh(mesh.vertices, mesh.faces[mesh.face_normals.sum(axis=1) > 0.5])


@pytest.mark.parametrize(
    "mesh",
    [
        sheet(),
        sheet(double=True),
        box(0.1, 0.1, 0.5 * MIN_WIDTH),
        creation.icosphere(subdivisions=5, radius=0.05),
        box(0.079, 0.1, 0.1),
        open_corner(),
    ],
    ids=["sheet", "two-sided sheet", "foil", "large sphere", "just too large", "open corner"],
)
def test_an_object_without_grasps_ends_soon_with_an_empty_set(mesh):
    start = time.process_time()
    grasps = grasp(mesh, n=100_000)
    assert len(grasps) == 0
    assert grasps.X_OG.shape == (0, 4, 4)
    assert time.process_time() - start < 5.0


def test_a_rare_grasp_is_found():
    """A knob of 20 mm on a plate of 1 m: one surface point in 1,900 lies on its sides."""
    knob = box(0.02, 0.02, 0.02, (0.1, 0.2, 0.06))
    mesh = trimesh.util.concatenate([box(1.0, 1.0, 0.1), knob])
    grasps = grasp(mesh, n=100)
    assert len(grasps) == 100
    np.testing.assert_allclose(center(grasps), [[0.1, 0.2, 0.06]] * 100, atol=0.01 + 1e-6)


def test_none_wanted_none_sampled():
    assert len(grasp(lumpy(), n=0)) == 0


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ({"n": -1}, "n is -1; give the number of grasps, 0 or more"),
        ({"friction": 0.0}, "friction is 0.0; antipodal grasps need a number above 0"),
        ({"friction": np.nan}, "friction is nan; antipodal grasps need a number above 0"),
        (
            {"opening": (0.08, 0.0)},
            r"opening is \(0.08, 0.0\); give the smallest and largest finger distance \[m\]",
        ),
        ({"approaches": 0}, "approaches is 0; give 1 or more per contact pair"),
    ],
)
def test_parameters_out_of_range(parameters, message):
    with pytest.raises(InvalidInputError, match=f"^{message}$"):
        grasp(lumpy(), **parameters)


def test_unusable_meshes():
    inverted = lumpy()
    inverted.invert()
    broken = lumpy()
    broken.vertices[3, 1] = np.nan
    cases = {
        "no faces with area": trimesh.Trimesh(),
        "not finite": broken,
        r"wound inside out; turn its faces with mesh.invert\(\)": inverted,
    }
    for message, mesh in cases.items():
        with pytest.raises(MeshError, match=message):
            grasp(mesh)


# --- speed ----------------------------------------------------------------------------------------


def test_a_mesh_of_a_scan_s_size_is_sampled_at_2000_a_second_by_a_wide_margin():
    mesh = creation.icosphere(subdivisions=5, radius=0.03)  # 20,480 faces
    grasp(mesh, n=1)
    start = time.process_time()
    grasp(mesh, n=10_000)
    assert 10_000 / (time.process_time() - start) > 10_000
