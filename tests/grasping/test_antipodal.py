"""Antipodal sampling: what fingers can get at, symmetry, seeds, and a re-check from the mesh."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from sampled import (
    assert_same_distribution,
    box,
    center,
    closing,
    contacts,
    grasp,
    lumpy,
    tube,
)
from trimesh import creation

from burg_drake.core import GraspSet, InvalidInputError, MeshError, check_pose, swap_fingers
from burg_drake.grasping import (
    AntipodalSettings,
    ContactPairSettings,
    SamplingEffort,
    sample_antipodal,
)

MU = 0.24
CONE = np.arctan(MU)


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
    widths = grasp(mesh, n=300, opening=opening).width
    assert (widths >= opening[0]).all()
    assert (widths <= opening[1] - 2.0 * ContactPairSettings.finger_clearance).all()


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
    grasps = sample_antipodal(
        mesh, 40, rng, AntipodalSettings(friction=0.4, opening=(0.01, 0.07)), object="lump"
    )
    p = grasps.provenance
    again = np.random.default_rng()
    again.bit_generator.state = p["rng"]
    repeated = sample_antipodal(
        mesh,
        p["n"],
        again,
        AntipodalSettings(friction=p["friction"], opening=tuple(p["opening"])),
        object="lump",
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
    np.testing.assert_array_equal(grasps.canonical().id, grasps.id)


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
        box(0.1, 0.1, 0.5 * ContactPairSettings.min_width),
        creation.icosphere(subdivisions=5, radius=0.05),
        box(0.079, 0.1, 0.1),
        open_corner(),
    ],
    ids=["sheet", "two-sided sheet", "foil", "large sphere", "just too large", "open corner"],
)
def test_an_object_without_grasps_ends_soon_with_an_empty_set(mesh):
    grasps = grasp(mesh, n=100_000)
    assert len(grasps) == 0
    assert grasps.X_OG.shape == (0, 4, 4)
    assert grasps.provenance["rays"] == SamplingEffort.min_rays


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
        "no face of the mesh has an area": trimesh.Trimesh(),
        "not finite": broken,
        r"inside out; flip its faces with mesh.invert\(\)": inverted,
    }
    for message, mesh in cases.items():
        with pytest.raises(MeshError, match=message):
            grasp(mesh)
