"""Wrench spaces against qhull, a general optimiser, and closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import minimize
from scipy.spatial import ConvexHull

from burg_drake.core import Array
from burg_drake.grasping import (
    ANY_FORCE,
    ANY_WRENCH,
    Contacts,
    WrenchSpace,
    epsilon_bracket,
    force_along,
    hull_volume,
    triangulated_ball,
    wrench_reaches,
)


def random_contacts(n: int, seed: int = 0, spread: float = 0.2) -> Contacts:
    """Opposite patches whose normals are some degrees off the line between them."""
    rng = np.random.default_rng(seed)
    p1 = np.array([0.02, 0.0, 0.0]) + rng.uniform(-0.01, 0.01, (n, 3))
    p2 = np.array([-0.02, 0.0, 0.0]) + rng.uniform(-0.01, 0.01, (n, 3))
    line = (p2 - p1) / np.linalg.norm(p2 - p1, axis=1, keepdims=True)
    normal = np.stack([line, -line], axis=1) + rng.uniform(-spread, spread, (n, 2, 3))
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    one = np.ones((n, 2))
    return Contacts(
        np.ones(n, bool),
        np.stack([p1, p2], axis=1),
        normal,
        one,
        rng.uniform(0.002, 0.02, (n, 2)),
        one,
    )


def random_space(n: int, seed: int = 0, friction: float = 0.6) -> WrenchSpace:
    com = np.array([0.001, -0.004, 0.006])
    y = np.tile([0.0, 1.0, 0.0], (n, 1))
    return WrenchSpace.of(random_contacts(n, seed), friction, com, 0.05, y)


def symmetric_space(friction: float, radius: float, width: float, length: float) -> WrenchSpace:
    p = np.array([[[0.5 * width, 0, 0], [-0.5 * width, 0, 0]]])
    normal, one = np.array([[[-1.0, 0, 0], [1, 0, 0]]]), np.ones((1, 2))
    contacts = Contacts(np.ones(1, bool), p, normal, one, radius * one, one)
    return WrenchSpace.of(contacts, friction, np.zeros(3), length, np.array([[0, 1.0, 0]]))


def hull(space: WrenchSpace, i: int, vertices: Array) -> ConvexHull:
    sets = [space.basis[i, k][:, 0] + vertices @ space.basis[i, k][:, 1:].T for k in (0, 1)]
    return ConvexHull(np.concatenate(sets))


@pytest.mark.parametrize("subdivisions", [0, 1])
def test_facets_in_closed_form_are_those_of_qhull(subdivisions: int) -> None:
    space, polytope = random_space(6), triangulated_ball(subdivisions)
    volume = hull_volume(space, polytope)
    lower, _ = epsilon_bracket(space, subdivisions)
    for i in range(6):
        expected = hull(space, i, polytope.vertices)
        assert volume[i] == pytest.approx(expected.volume, rel=1e-9)
        assert lower[i] == pytest.approx(-expected.equations[:, -1].max(), rel=1e-9)


def test_symmetric_grasps_have_the_same_facets_too() -> None:
    """Many facets lie in one plane here, which a rounding could count twice, or not at all."""
    space, polytope = symmetric_space(0.5, 0.008, 0.04, 0.05), triangulated_ball(1)
    expected = hull(space, 0, polytope.vertices)
    assert hull_volume(space, polytope)[0] == pytest.approx(expected.volume, rel=1e-9)
    assert epsilon_bracket(space, 1)[0][0] == pytest.approx(-expected.equations[:, -1].max())


def test_volume_is_within_its_stated_error() -> None:
    space = random_space(4, seed=1)
    fine = hull_volume(space, triangulated_ball(3, of_volume=True))
    np.testing.assert_allclose(
        hull_volume(space, triangulated_ball(1, of_volume=True)), fine, rtol=0.025
    )
    inscribed = hull_volume(space, triangulated_ball(2))
    assert (inscribed < fine).all() and (inscribed > 0.9 * fine).all()


def smallest_support(basis: Array, rows: int, direction: Array | None = None) -> float:
    """Least support of a wrench space over directions whose first rows have unit length, or unit
    product with a direction, by a general optimiser from many starts."""
    c, A = basis[:, :, 0], basis[:, :, 1:]

    def supports(u: Array) -> Array:
        return np.array([c[k] @ u + np.linalg.norm(A[k].T @ u) for k in (0, 1)])

    def supports_gradient(u: Array) -> Array:
        turned = np.array([A[k] @ (A[k].T @ u) / np.linalg.norm(A[k].T @ u) for k in (0, 1)])
        return np.column_stack([-(c + turned), np.ones(2)])

    def size(u: Array) -> float:
        return float(u[:rows] @ u[:rows] if direction is None else u[:3] @ direction)

    def size_gradient(u: Array) -> Array:
        slope = 2.0 * u[:rows] if direction is None else direction
        return np.pad(slope, (0, 7 - len(slope)))

    rng, best = np.random.default_rng(0), np.inf
    for _ in range(8):
        u = rng.normal(size=6)
        found = minimize(
            lambda x: x[6],
            np.append(u, supports(u).max()),
            jac=lambda x: np.eye(7)[6],
            method="SLSQP",
            options={"maxiter": 300, "ftol": 1e-13},
            constraints=[
                {
                    "type": "eq",
                    "fun": lambda x: size(x[:6]) - 1.0,
                    "jac": lambda x: size_gradient(x[:6]),
                },
                {
                    "type": "ineq",
                    "fun": lambda x: x[6] - supports(x[:6]),
                    "jac": lambda x: supports_gradient(x[:6]),
                },
            ],
        ).x[:6]
        if abs(size(found) - 1.0) < 1e-6:
            best = min(best, supports(found).max())
    return best


def test_reaches_are_those_of_a_general_optimiser() -> None:
    space = random_space(2, seed=2)
    up = np.tile([0.0, 0.6, 0.8], (2, 1))
    found = wrench_reaches(space, [ANY_WRENCH, ANY_FORCE, force_along(up)])
    for i, basis in enumerate(space.basis):
        assert found[0][i] == pytest.approx(smallest_support(basis, 6), rel=1e-3)
        assert found[1][i] == pytest.approx(smallest_support(basis, 3), rel=1e-3)
        assert found[2][i] == pytest.approx(smallest_support(basis, 0, up[i]), rel=1e-3)


def test_epsilon_is_between_its_bounds() -> None:
    lower, upper = epsilon_bracket(random_space(20, seed=3), 2)
    assert (lower < upper).all()
    assert np.median(upper / lower) < 1.03


def test_torsion_limits_a_centred_grasp() -> None:
    """A pure turn about the closing line is the shortest way out: mu r / length."""
    (found,) = wrench_reaches(symmetric_space(0.5, 0.006, 0.04, 0.05), [ANY_WRENCH])
    assert found[0] == pytest.approx(0.5 * 0.006 / 0.05, rel=1e-6)


def test_lever_limits_a_narrow_grasp() -> None:
    """Turning about one contact that rests, the other slides by q and the middle moves by a, half
    of mu q: of all such twists of unit length, a^2 + q^2 / 4 + (length q / width)^2 = 1."""
    mu, width, length = 0.5, 0.01, 0.05
    (found,) = wrench_reaches(symmetric_space(mu, 0.02, width, length), [ANY_WRENCH])
    assert found[0] == pytest.approx(mu / np.sqrt(1 + mu**2 + 4 * (length / width) ** 2), rel=1e-4)


def test_batches_do_not_matter() -> None:
    space, polytope = random_space(40, seed=4), triangulated_ball(1)
    goals = [ANY_WRENCH, ANY_FORCE]
    together = [*wrench_reaches(space, goals), hull_volume(space, polytope)]
    for i in (0, 7, 39):
        single = space.select(slice(i, i + 1))
        alone = [*wrench_reaches(single, goals), hull_volume(single, polytope)]
        np.testing.assert_array_equal([v[0] for v in alone], [v[i] for v in together])


def test_no_grasps() -> None:
    none = random_space(2).select(slice(0, 0))
    assert all(len(v) == 0 for v in wrench_reaches(none, [ANY_WRENCH, ANY_FORCE]))
    assert len(hull_volume(none, triangulated_ball(1))) == 0
