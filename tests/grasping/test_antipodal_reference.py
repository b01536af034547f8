"""Sampled sets against an exhaustive reference: quadrature over all faces and the friction cone,
with rays cast by brute force in double precision, that has nothing of the sampler in it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
import trimesh
from sampled import box, center, closing, contacts, grasp
from trimesh import creation

from burg_drake.core import GraspSet
from burg_drake.grasping import ContactPairSettings
from tests.thorough import thorough

POINTS = 4000  # on all faces together, alike on each
RINGS, AZIMUTHS = 3, 6  # of lines through each point
N = 20_000
SAMPLING_ERROR = 1.95 / np.sqrt(N)  # of a distribution function, exceeded by one set in 1,000
QUADRATURE_ERROR = 0.012  # against 60,000 grasps the reference is within it


@dataclass
class Reference:
    """Antipodal pairs, each with the share of the sampled ones that it stands for."""

    p1: np.ndarray
    p2: np.ndarray
    needed: np.ndarray
    share: np.ndarray


def hits(triangles: np.ndarray, origins: np.ndarray, directions: np.ndarray) -> np.ndarray:
    """(N, F) distances along N rays, inf for none (Moeller and Trumbore, 1997)."""
    a, e1, e2 = triangles[:, 0], *(triangles[:, k] - triangles[:, 0] for k in (1, 2))
    p = np.cross(directions[:, None], e2)
    s = origins[:, None] - a
    q = np.cross(s, e1)
    with np.errstate(divide="ignore", invalid="ignore"):
        inverse = 1.0 / np.einsum("fj,nfj->nf", e1, p)
        u = np.einsum("nfj,nfj->nf", s, p) * inverse
        v = np.einsum("nj,nfj->nf", directions, q) * inverse
        t = np.einsum("fj,nfj->nf", e2, q) * inverse
        return np.where((u >= 0) & (v >= 0) & (u + v <= 1) & (t > 1e-7), t, np.inf)


def spread(count: int, *steps: float) -> np.ndarray:
    """(steps, count) numbers from 0 to 1, evenly spread (an additive recurrence, not random)."""
    return np.outer(steps, np.arange(1, count + 1)) % 1.0


def quadrature(triangles: np.ndarray, weights: np.ndarray) -> tuple[np.ndarray, ...]:
    """Points all over each face, their faces and their shares."""
    face = np.repeat(np.arange(len(triangles)), POINTS // len(triangles))
    u, v = spread(len(face), 0.7548777, 0.5698403)
    u, v = np.where(u + v > 1, (1 - u, 1 - v), (u, v))[..., None]
    a, b, c = (triangles[face, k] for k in range(3))
    mass = trimesh.triangles.area(triangles) * weights
    return a + u * (b - a) + v * (c - a), face, mass[face]


def lines(normals: np.ndarray, friction: float) -> np.ndarray:
    """(N, K, 3) directions about the inward normals, one in each of K patches of equal solid angle,
    at another place of the patches for each point."""
    ring, azimuth = (x.ravel() for x in np.meshgrid(range(RINGS), range(AZIMUTHS)))
    within = spread(len(normals), 2**0.5, 3**0.5)[..., None]
    cosine = 1.0 - (ring + within[0]) / RINGS * (1.0 - 1.0 / np.hypot(1.0, friction))
    turn = 2 * np.pi * (azimuth + within[1]) / AZIMUTHS
    seed = np.where(np.abs(normals[:, :1]) < 0.7, [[1.0, 0, 0]], [[0, 1.0, 0]])
    e1 = np.cross(normals, seed)
    e1 /= np.linalg.norm(e1, axis=1, keepdims=True)
    e2 = np.cross(normals, e1)
    side = np.cos(turn)[..., None] * e1[:, None] + np.sin(turn)[..., None] * e2[:, None]
    return -cosine[..., None] * normals[:, None] + np.sqrt(1.0 - cosine**2)[..., None] * side


def exhaustive(mesh, friction, opening, weights=None) -> Reference:
    triangles, normals = np.asarray(mesh.triangles), np.asarray(mesh.face_normals)
    p, face, share = quadrature(triangles, np.ones(len(triangles)) if weights is None else weights)
    d = lines(normals[face], friction)
    K = d.shape[1]
    p, face, share, d = (
        np.repeat(p, K, 0),
        np.repeat(face, K),
        np.repeat(share, K),
        d.reshape(-1, 3),
    )
    distance = hits(triangles, p, d)
    ray, other = np.nonzero(np.isfinite(distance))
    width = distance[ray, other]
    p, d, share, face = p[ray], d[ray], share[ray], face[ray]
    angle1 = np.arccos(np.clip(-np.einsum("ij,ij->i", normals[face], d), -1, 1))
    angle2 = np.arccos(np.clip(np.einsum("ij,ij->i", normals[other], d), -1, 1))
    needed = np.tan(np.maximum(angle1, angle2))
    low, high = (
        max(opening[0], ContactPairSettings.min_width),
        opening[1] - 2 * ContactPairSettings.finger_clearance,
    )
    ok = (np.maximum(angle1, angle2) <= np.arctan(friction)) & (width >= low) & (width <= high)
    p, d, width, share, needed = p[ok], d[ok], width[ok], share[ok], needed[ok]
    p2 = p + width[:, None] * d
    travel = (opening[1] - width) / 2
    ok = path_free(triangles, normals, p, -d, travel)
    ok &= path_free(triangles, normals, p2, d, travel)
    return Reference(p[ok], p2[ok], needed[ok], share[ok] / share[ok].sum())


def path_free(triangles, normals, p, outward, travel) -> np.ndarray:
    distance = hits(triangles, p, outward)
    first = distance.argmin(axis=1)
    nearest = distance[np.arange(len(p)), first]
    behind = np.einsum("ij,ij->i", normals[first], outward) > 0
    return np.isinf(nearest) | ((nearest > travel) & ~behind)


def canonical(direction: np.ndarray) -> np.ndarray:
    leading = np.take_along_axis(direction, np.abs(direction).argmax(1)[:, None], axis=1)
    return direction * np.sign(leading)


def facets(mesh, p: np.ndarray) -> np.ndarray:
    """Number of the plane that each point of a surface lies on."""
    planes = np.unique(
        np.round(
            np.c_[
                mesh.face_normals, np.einsum("ij,ij->i", mesh.face_normals, mesh.triangles[:, 0])
            ],
            6,
        ),
        axis=0,
    )
    return np.abs(p @ planes[:, :3].T - planes[:, 3]).argmin(axis=1)


def pair_shares(mesh, p1, p2, share) -> dict[tuple[int, int], float]:
    """Share of each unordered pair of planes."""
    pairs = np.sort(np.stack([facets(mesh, p1), facets(mesh, p2)], axis=1), axis=1)
    found, index = np.unique(pairs, axis=0, return_inverse=True)
    return dict(zip(map(tuple, found.tolist()), np.bincount(index.ravel(), share), strict=True))


def assert_agrees(mesh, grasps: GraspSet, reference: Reference, friction: float) -> None:
    """The same pairs of planes with the same shares, and the same distributions of all figures."""
    sampled = pair_shares(mesh, *contacts(grasps), np.full(len(grasps), 1 / len(grasps)))
    expected = pair_shares(mesh, reference.p1, reference.p2, reference.share)
    assert {pair for pair, share in expected.items() if share > 0.005} <= set(sampled)
    for pair in set(sampled) | set(expected):
        difference = abs(sampled.get(pair, 0.0) - expected.get(pair, 0.0))
        assert difference < SAMPLING_ERROR + QUADRATURE_ERROR, pair
    direction = canonical(reference.p2 - reference.p1)
    width = np.linalg.norm(direction, axis=1)
    middle = (reference.p1 + reference.p2) / 2
    compared = {
        "width": (grasps.width, width),
        "score": (grasps.score, 1 - reference.needed / friction),
        **{f"middle {k}": (center(grasps)[:, k], middle[:, k]) for k in range(3)},
        **{f"closing {k}": (closing(grasps)[:, k], direction[:, k] / width) for k in range(3)},
    }
    for name, (values, expected_values) in compared.items():
        step = largest_step(values, expected_values, reference.share)
        assert step < SAMPLING_ERROR + QUADRATURE_ERROR, name


def largest_step(values, expected, share) -> float:
    """Largest difference of two distribution functions between the steps of the expected one."""
    order = np.argsort(expected)
    known, total = expected[order], np.cumsum(share[order])
    at = np.linspace(known[0], known[-1], 101)[1:-1]
    at = at + 1e-6 * (known[-1] - known[0])  # not on the values that axis-aligned faces repeat
    reference = np.r_[0.0, total][np.searchsorted(known, at)]
    return float(np.abs(np.searchsorted(np.sort(values), at) / len(values) - reference).max())


def wedge() -> trimesh.Trimesh:
    """A block whose faces are not parallel."""
    corners = np.array([[0, 0, 0], [50, 4, 0], [46, 40, 2], [-2, 36, 0]], float)
    top = np.array([[4, 3, 30], [43, 2, 27], [44, 33, 33], [2, 30, 29]], float)
    return trimesh.convex.convex_hull(1e-3 * np.r_[corners, top])


def channel() -> trimesh.Trimesh:
    """A U of 40 x 30 x 30 mm with walls of 6 mm and a floor of 8 mm, open at both ends."""
    outline = np.array([[0, 0], [40, 0], [40, 30], [34, 30], [34, 8], [6, 8], [6, 30], [0, 30]])
    vertices = 1e-3 * np.r_[np.c_[outline, np.zeros(8)], np.c_[outline, np.full(8, 30.0)]]
    sides = [[i, (i + 1) % 8, 8 + (i + 1) % 8, 8 + i] for i in range(8)]
    ends = [[0, 1, 4, 5], [1, 2, 3, 4], [5, 6, 7, 0]]
    quads = [*sides, *([a + 8 for a in q] for q in ends), *(q[::-1] for q in ends)]
    faces = [t for a, b, c, d in quads for t in ([a, b, c], [a, c, d])]
    return trimesh.Trimesh(vertices, faces, process=False)


def uneven(mesh) -> np.ndarray:
    """Weights of the faces from 0 to 3."""
    return np.arange(len(mesh.faces)) % 4.0


@pytest.mark.parametrize(
    ("mesh", "friction", "opening", "weighted"),
    [
        thorough(box(0.03, 0.05, 0.04), 0.4, (0.0, 0.08), False),
        (wedge(), 0.5, (0.031, 0.045), True),
        thorough(channel(), 0.4, (0.0, 0.03), True),
        thorough(creation.icosahedron().apply_scale(0.02), 0.6, (0.0, 0.08), True),
    ],
    ids=["box", "weighted wedge", "weighted channel", "weighted icosahedron"],
)
def test_sampled_sets_are_distributed_as_an_exhaustive_reference(mesh, friction, opening, weighted):
    assert mesh.is_watertight and mesh.volume > 0.0
    weights = uneven(mesh) if weighted else None
    reference = exhaustive(mesh, friction, opening, weights)
    grasps = grasp(mesh, n=N, friction=friction, opening=opening, weights=weights)
    assert len(grasps) == N
    assert_agrees(mesh, grasps, reference, friction)


def test_the_reference_tells_wrong_distributions_apart():
    mesh = channel()
    reference = exhaustive(mesh, 0.4, (0.0, 0.08))
    for wrong in (
        grasp(mesh, n=N, friction=0.36),
        grasp(mesh, n=N, friction=0.4, opening=(0.0, 0.03)),
        grasp(mesh, n=N, friction=0.4, weights=uneven(mesh)),
    ):
        with pytest.raises(AssertionError):
            assert_agrees(mesh, wrong, reference, 0.4)
