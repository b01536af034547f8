"""Weights, standoffs, tests and diversity: what each option changes, and what it leaves alone."""

from __future__ import annotations

from itertools import islice

import numpy as np
import pytest
from sampled import box, closing, contacts, grasp, lumpy, tube
from scipy.spatial.distance import pdist
from scipy.stats import chisquare

from burg_drake.core import InvalidInputError, pregrasp
from burg_drake.geometry import Surface
from burg_drake.grasping import SamplingEffort, antipodal_sampling

# --- weights of faces -----------------------------------------------------------------------------


def test_points_have_the_density_of_the_weights():
    mesh, n = lumpy(), 200_000
    weights = np.random.default_rng(0).choice([0.0, 0.5, 1.0, 4.0], len(mesh.faces))
    p, face = Surface.of(mesh, weights).draw(n, np.random.default_rng(1))
    expected = mesh.area_faces * weights
    expected *= n / expected.sum()
    counts = np.bincount(face, minlength=len(mesh.faces))
    drawn = weights > 0.0
    assert expected[drawn].min() > 10 and not counts[~drawn].any()
    assert chisquare(counts[drawn], expected[drawn]).pvalue > 1e-3
    height = np.einsum("ij,ij->i", p - mesh.triangles[face, 0], mesh.face_normals[face])
    assert np.abs(height).max() < 1e-9


def test_without_weights_points_have_the_density_of_the_area():
    mesh, n = lumpy(), 200_000
    _, face = Surface.of(mesh).draw(n, np.random.default_rng(2))
    counts = np.bincount(face, minlength=len(mesh.faces))
    assert chisquare(counts, n * mesh.area_faces / mesh.area).pvalue > 1e-3


def test_equal_weights_are_none_and_their_unit_does_not_matter():
    mesh = lumpy()
    plain = grasp(mesh, n=100)
    for value in (1.0, 4.0, 2.0**1000):
        np.testing.assert_array_equal(
            grasp(mesh, n=100, weights=np.full(len(mesh.faces), value)).id, plain.id
        )
    uneven = np.linspace(0, 1, len(mesh.faces))
    weighted = grasp(mesh, n=100, weights=uneven)
    np.testing.assert_array_equal(grasp(mesh, n=100, weights=8.0 * uneven).id, weighted.id)
    assert not set(weighted.id) & set(plain.id)
    assert plain.provenance["weights"] is None and weighted.provenance["weights"]


def test_one_side_of_a_box_is_enough():
    mesh = box(0.04, 0.05, 0.06)
    grasps = grasp(mesh, n=300, weights=(mesh.face_normals[:, 1] < -0.5).astype(float))
    assert len(grasps) == 300
    assert (np.abs(closing(grasps)[:, 1]) > 0.9).all()
    near, far = contacts(grasps)
    np.testing.assert_allclose(near[:, 1], -0.025, atol=1e-7)
    np.testing.assert_allclose(far[:, 1], 0.025, atol=1e-7)


def test_weights_count_the_faces_that_the_mesh_has():
    """Those without area, which are left out, have weights, too."""
    mesh = box(0.04, 0.05, 0.06)
    up = np.abs(mesh.face_normals[:, 2]) > 0.5
    mesh.faces = np.concatenate([[[0, 0, 1]], mesh.faces])
    grasps = grasp(mesh, n=200, weights=np.r_[100.0, up])
    assert (np.abs(closing(grasps)[:, 2]) > 0.9).all()


@pytest.mark.parametrize(
    ("weights", "message"),
    [
        (np.ones(11), r"weights have shape \(11,\); the mesh has 12 faces, give \(12,\)"),
        (np.ones((12, 1)), r"weights have shape \(12, 1\); the mesh has 12 faces, give \(12,\)"),
        (np.r_[np.ones(5), -1.0, np.ones(6)], "weight of face 5 is -1; give finite weights from 0"),
        (np.r_[np.nan, np.ones(11)], "weight of face 0 is nan; give finite weights from 0"),
        (np.r_[np.ones(11), np.inf], "weight of face 11 is inf; give finite weights from 0"),
        (np.zeros(12), "every face has weight 0; give some of them more"),
        (["many"] * 12, "weights of faces have to be numbers: .*"),
    ],
)
def test_weights_that_do_not_fit(weights, message):
    with pytest.raises(InvalidInputError, match=f"^{message}$"):
        grasp(box(0.04, 0.05, 0.06), weights=weights)


def test_weight_on_faces_without_area_alone():
    mesh = box(0.04, 0.05, 0.06)
    mesh.faces = np.concatenate([[[0, 0, 1]], mesh.faces])
    with pytest.raises(InvalidInputError, match="every face with area has weight 0"):
        grasp(mesh, weights=np.r_[1.0, np.zeros(12)])


# --- standoffs ------------------------------------------------------------------------------------


def test_every_grasp_is_given_with_each_standoff():
    """In the frame of the hand the middle of the contacts lies ahead of G by the standoff."""
    standoffs = (0.0, 0.004, -0.006)
    plain = grasp(lumpy(), n=100, approaches=2)
    grasps = grasp(lumpy(), n=300, approaches=2, standoffs=standoffs)
    X = grasps.X_OG.reshape(100, 3, 4, 4)
    np.testing.assert_array_equal(X[:, 0], plain.X_OG)
    for k, distance in enumerate(standoffs):
        np.testing.assert_allclose(X[:, k], pregrasp(plain.X_OG, distance), atol=1e-12)
        ahead = np.linalg.inv(X[:, k]) @ plain.X_OG[:, :, 3:]
        np.testing.assert_allclose(ahead[:, :3, 0], [[0, 0, distance]] * 100, atol=1e-12)
    np.testing.assert_array_equal(grasps.width, np.repeat(plain.width, 3))
    np.testing.assert_array_equal(grasps.score, np.repeat(plain.score, 3))
    assert grasps.provenance["standoffs"] == list(standoffs)
    few = grasp(lumpy(), n=7, approaches=2, standoffs=standoffs)
    np.testing.assert_array_equal(few.id, grasps.id[:7])


@pytest.mark.parametrize("distance", [-0.0091, 0.0096, 0.02, np.nan])
def test_a_standoff_off_the_pads(distance):
    mm = f"{1e3 * distance:g}"
    message = f"standoff {mm} mm puts the contacts outside the finger pads; give -9 to 9.5 mm"
    with pytest.raises(InvalidInputError, match=f"^{message}$"):
        grasp(lumpy(), standoffs=(0.0, distance))


def test_longer_pads_allow_more():
    assert len(grasp(lumpy(), n=10, standoffs=(0.03,), pad=(-0.03, 0.03))) == 10
    with pytest.raises(InvalidInputError, match="standoffs is empty"):
        grasp(lumpy(), standoffs=())


# --- a test that grasps have to pass --------------------------------------------------------------


def front(X_OG: np.ndarray) -> np.ndarray:
    return X_OG[:, 0, 3] > 0.005


def test_accepted_grasps_are_those_of_the_same_stream_that_pass():
    free = grasp(lumpy(), n=6000)
    chosen = grasp(lumpy(), n=500, accept=front)
    np.testing.assert_array_equal(chosen.id, free.select(front(free.X_OG)).id[:500])
    np.testing.assert_array_equal(grasp(lumpy(), n=40, accept=front).id, chosen.id[:40])
    assert chosen.provenance["tried"] > 500 and chosen.provenance["tested"]


def test_a_test_that_nothing_passes_ends_soon():
    grasps = grasp(lumpy(), n=10, accept=lambda X: np.zeros(len(X), bool))
    assert len(grasps) == 0
    assert SamplingEffort.min_tests <= grasps.provenance["tried"] < 2 * SamplingEffort.min_tests
    assert grasps.provenance["rays"] < SamplingEffort.min_rays


@pytest.mark.thorough
def test_what_one_grasp_in_300_passes_is_found():
    def rare(X_OG: np.ndarray) -> np.ndarray:
        return (1e6 * X_OG[:, 0, 3]).astype(int) % 300 == 0

    grasps = grasp(lumpy(), n=200, accept=rare)
    assert len(grasps) == 200 and rare(grasps.X_OG).all()


@pytest.mark.parametrize("n", [20, 50])
def test_the_effort_is_bounded_by_the_grasps_that_are_wanted(n: int, monkeypatch):
    """One in 300 passes, where 20 tries for each grasp that is wanted are allowed."""
    monkeypatch.setattr(antipodal_sampling.SamplingEffort, "min_tests", 1000)
    monkeypatch.setattr(antipodal_sampling.SamplingEffort, "tests_per_wanted", 20)
    seen = 0

    def rare(X_OG: np.ndarray) -> np.ndarray:
        nonlocal seen
        seen += len(X_OG)
        return (1e6 * X_OG[:, 0, 3]).astype(int) % 300 == 0

    few = grasp(lumpy(), n=n, accept=rare)
    tried = few.provenance["tried"]
    assert len(few) < n and 1000 + 20 * n <= tried <= seen
    assert seen < 1000 + 20 * n + 2000  # and what is left of a block


def test_grasps_do_not_depend_on_how_many_are_tested_together(monkeypatch):
    def upper(X_OG: np.ndarray) -> np.ndarray:
        sizes.append(len(X_OG))
        return X_OG[:, 2, 3] > 0.0

    sizes: list[int] = []
    together = grasp(lumpy(), n=900, accept=upper)
    largest = max(sizes)
    monkeypatch.setattr(antipodal_sampling, "islice", lambda blocks, n: islice(blocks, 1))
    one_by_one = grasp(lumpy(), n=900, accept=upper)
    assert max(sizes[-3:]) < largest
    assert np.array_equal(together.X_OG, one_by_one.X_OG)
    assert together.provenance == one_by_one.provenance


def test_a_test_that_does_not_answer_for_each_grasp():
    with pytest.raises(InvalidInputError, match=r"accept returned an array of shape \(3,\) for "):
        grasp(lumpy(), accept=lambda X: np.ones(3, bool))


# --- diversity ------------------------------------------------------------------------------------


def test_diverse_grasps_are_chosen_from_as_many_more():
    n, times = 100, 5
    pool, diverse = grasp(tube(), n=times * n), grasp(tube(), n=n, diverse=times)
    assert len(diverse) == n == len(set(diverse.id)) and set(diverse.id) <= set(pool.id)
    plain = pool.select(slice(0, n))

    def closest(grasps):
        return pdist(grasps.X_OG[:, :3, 3]).min()

    assert closest(diverse) > 3.0 * closest(plain)
    np.testing.assert_array_equal(grasp(tube(), n=n, diverse=times).id, diverse.id)
    assert diverse.provenance["diverse"] == times


def test_diverse_grasps_pass_the_test():
    grasps = grasp(lumpy(), n=50, diverse=4, accept=front)
    assert len(grasps) == 50 and front(grasps.X_OG).all()


@pytest.mark.thorough
def test_where_there_are_few_the_diverse_are_these():
    """Two of 20,000, and so few more that sampling ends."""
    edge = np.sort(grasp(lumpy(), n=SamplingEffort.min_tests).X_OG[:, 0, 3])[-2]

    def outermost(X_OG: np.ndarray) -> np.ndarray:
        return X_OG[:, 0, 3] >= edge

    few = grasp(lumpy(), n=1000, accept=outermost)
    assert 2 <= len(few) < 30
    diverse = grasp(lumpy(), n=1000, accept=outermost, diverse=2)
    assert set(diverse.id) == set(few.id)


def test_less_than_once_as_many():
    with pytest.raises(InvalidInputError, match="diverse is 0"):
        grasp(lumpy(), diverse=0)
