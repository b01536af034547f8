"""The generator of the household library, and the library that ships.

Oracles are written out here: edge counting and Euler's formula for closed surfaces, the solid angle
for what is inside, half spaces for convex pieces, and textbook volumes.
"""

from __future__ import annotations

from dataclasses import FrozenInstanceError

import numpy as np
import pytest
import trimesh
from scipy import ndimage
from scipy.spatial import ConvexHull

from burg_drake.objects import load_library
from tests.thorough import thorough

pytest.importorskip("manifold3d")

from tools.household import Shape, household_shapes

NAMES = (
    "mug",
    "bowl",
    "bottle",
    "can",
    "box",
    "banana",
    "screwdriver",
    "scissors",
    "marble",
    "airplane",
)
HOLES = {"mug": 1, "scissors": 2}  # rings that a finger goes through; 0 for all others
MOST_PIECES = {"mug": 25, "bowl": 48, "scissors": 25, "airplane": 15, "banana": 8}  # others 8
MOST_VOLUME = {"bowl": 1.20}  # pieces together over the mesh; others 1.06
LEAST_COVERED = {"bowl": 0.94}  # share of the mesh's volume within pieces; others 0.97
OPENING = 0.08  # of the Panda's gripper [m]

SHAPES = {shape.name: shape for shape in household_shapes()}


@pytest.fixture(params=NAMES)
def shape(request: pytest.FixtureRequest) -> Shape:
    return SHAPES[request.param]


def inside_mesh(mesh: trimesh.Trimesh, points: np.ndarray) -> np.ndarray:
    """(N,) whether points (N, 3) are inside, by the solid angle that the surface fills."""
    turns = np.empty(len(points))
    triangles = np.asarray(mesh.triangles)
    for i, point in enumerate(points):
        a, b, c = (triangles - point).transpose(1, 0, 2)
        la, lb, lc = (np.linalg.norm(v, axis=1) for v in (a, b, c))
        top = np.einsum("ij,ij->i", a, np.cross(b, c))
        dots = [np.einsum("ij,ij->i", u, v) for u, v in ((a, b), (a, c), (b, c))]
        below = la * lb * lc + dots[0] * lc + dots[1] * lb + dots[2] * la
        turns[i] = np.arctan2(top, below).sum() / (2.0 * np.pi)
    return np.abs(turns) > 0.5


def outside_pieces(pieces: tuple[trimesh.Trimesh, ...], points: np.ndarray) -> np.ndarray:
    """(N,) depth outside the nearest piece's planes [m]; negative inside some piece."""
    depth = []
    for piece in pieces:
        normals, origins = piece.face_normals, piece.triangles[:, 0]
        heights = points @ normals.T - np.einsum("ij,ij->i", normals, origins)
        depth.append(heights.max(axis=1))
    return np.min(depth, axis=0)


def enclosed_gaps(solid: np.ndarray) -> list[int]:
    """Cell counts of the empty regions of a (H, W) picture that do not reach its border."""
    labels, count = ndimage.label(~np.pad(solid, 1))
    border = labels[0, 0]
    return [int((labels == k).sum()) for k in range(1, count + 1) if k != border]


def test_all_ten_have_different_names_and_cannot_be_changed():
    assert tuple(SHAPES) == NAMES
    with pytest.raises(FrozenInstanceError):
        SHAPES["mug"].mass = 1.0  # type: ignore[misc]


def test_surface_is_closed_wound_outward_and_has_the_right_number_of_holes(shape):
    faces = np.asarray(shape.mesh.faces)
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    forward = {tuple(edge) for edge in edges.tolist()}
    assert len(forward) == len(edges), "an edge is used twice in one direction"
    assert forward == {(b, a) for a, b in forward}, "an edge has no partner"
    vertices = np.unique(faces)
    assert len(vertices) == len(shape.mesh.vertices)
    euler = len(vertices) - len(edges) // 2 + len(faces)
    assert euler == 2 - 2 * HOLES.get(shape.name, 0)
    a, b, c = np.asarray(shape.mesh.triangles).transpose(1, 0, 2)
    assert np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6.0 > 1e-6
    assert 1000 <= len(faces) <= 6000


def test_pieces_are_few_convex_and_closed(shape):
    assert len(shape.pieces) <= MOST_PIECES.get(shape.name, 8)
    assert sum(len(piece.faces) for piece in shape.pieces) <= 1600
    for piece in shape.pieces:
        heights = piece.vertices @ piece.face_normals.T
        heights -= np.einsum("ij,ij->i", piece.face_normals, piece.triangles[:, 0])
        assert heights.max() < 1e-6, "a vertex lies before a face"
        assert piece.is_watertight
        assert piece.volume > 0.0


def test_pieces_together_are_the_mesh(shape):
    together = shape.pieces[0]
    if len(shape.pieces) > 1:
        together = trimesh.boolean.union(list(shape.pieces), engine="manifold")
    common = trimesh.boolean.intersection([together, shape.mesh], engine="manifold")
    assert common.volume >= LEAST_COVERED.get(shape.name, 0.97) * shape.mesh.volume
    assert together.volume <= MOST_VOLUME.get(shape.name, 1.06) * shape.mesh.volume
    points, _ = trimesh.sample.sample_surface(shape.mesh, 3000, seed=1)
    assert outside_pieces(shape.pieces, points).max() < 0.0015
    corners = np.vstack([piece.vertices for piece in shape.pieces])
    lower, upper = shape.mesh.bounds
    assert np.abs(corners.min(axis=0) - lower).max() < 0.0015
    assert np.abs(corners.max(axis=0) - upper).max() < 0.0015


@pytest.mark.parametrize(
    ("name", "radius", "floor"), [("mug", 0.0365, 0.006), ("bowl", 0.050, 0.0042)]
)
def test_vessels_are_hollow(name, radius, floor):
    shape = SHAPES[name]
    heights = np.array([0.020, 0.030, 0.040]) + floor
    turn = np.linspace(0.0, 2.0 * np.pi, 9)
    circle = 0.9 * radius * np.column_stack([np.cos(turn), np.sin(turn)])
    spots = np.vstack([[(0.0, 0.0)], circle])
    points = np.array([(x, y, z) for x, y in spots for z in heights])
    assert not inside_mesh(shape.mesh, points).any()
    assert outside_pieces(shape.pieces, points).min() > 0.0005
    base = np.array([(0.0, 0.0, 0.5 * floor)])
    assert inside_mesh(shape.mesh, base).all()
    assert outside_pieces(shape.pieces, base).max() < 0.0


@pytest.mark.parametrize(
    ("name", "axis", "level", "count"), [thorough("scissors", 2, 0.0057, 2), ("mug", 1, 0.0, 1)]
)
def test_fingers_fit_through_the_handles(name, axis, level, count):
    shape, cell = SHAPES[name], 0.0035
    lower, upper = np.delete(shape.mesh.bounds, axis, axis=1)
    u, v = (np.arange(a, b + cell, cell) for a, b in zip(lower, upper, strict=True))
    grid = np.stack(np.meshgrid(u, v, indexing="ij"), axis=-1).reshape(-1, 2)
    points = np.insert(grid, axis, level, axis=1)
    for solid in (inside_mesh(shape.mesh, points), outside_pieces(shape.pieces, points) < 1e-6):
        gaps = enclosed_gaps(solid.reshape(len(u), len(v)))
        assert len(gaps) == count
        assert min(gaps) * cell**2 > np.pi * 0.009**2, "no room for a finger of 18 mm"


def test_volumes_follow_the_textbook():
    polygon = np.sin(2.0 * np.pi / 64) / (2.0 * np.pi / 64)
    can = np.pi * (0.0335**2 * 0.096 + 0.034**2 * 0.006 - 0.032**2 * 0.0024)
    assert SHAPES["can"].mesh.volume == pytest.approx(polygon * can, rel=2e-3)
    ball = 4.0 / 3.0 * np.pi * 0.015**3
    assert 0.98 * ball < SHAPES["marble"].mesh.volume < ball
    carton = 0.060 * 0.158 * 0.210
    edges = (1.0 - np.pi / 4.0) * 0.002**2 * 4.0 * (0.060 + 0.158 + 0.210)
    assert SHAPES["box"].mesh.volume == pytest.approx(carton - edges, rel=1e-4)


def test_sizes_are_those_of_the_things():
    sizes = {name: np.round(1000.0 * SHAPES[name].mesh.extents).tolist() for name in NAMES}
    assert sizes["box"] == [60, 158, 210]
    assert sizes["can"] == [68, 68, 102]
    assert sizes["bowl"] == [160, 160, 55]
    assert sizes["marble"] == [30, 30, 30]
    assert sizes["mug"][1:] == [81, 81]


def test_density_is_that_of_a_thing(shape):
    # from a full carton to steel and plastic together [kg/m3]
    assert 150.0 < shape.mass / shape.mesh.volume < 3000.0


def test_a_gripper_can_span_every_object_somewhere(shape):
    points, index = trimesh.sample.sample_surface(shape.mesh, 30, seed=2)
    depths = np.linspace(0.1, 1.0, 10) * OPENING
    inward = points[:, None] - depths[:, None] * shape.mesh.face_normals[index][:, None]
    inside = inside_mesh(shape.mesh, inward.reshape(-1, 3)).reshape(len(points), len(depths))
    assert (~inside.all(axis=1)).mean() > 0.2, "thicker than the opening nearly everywhere"


def test_rests_on_the_ground_as_it_is(shape):
    if shape.name == "marble":
        pytest.skip("a ball rests anywhere")
    corners = np.vstack([piece.vertices for piece in shape.pieces])
    assert corners[:, 2].min() == pytest.approx(0.0, abs=1e-9)
    tolerance = 7e-4 if shape.name in ("banana", "screwdriver") else 1e-9
    assert shape.mesh.bounds[0, 2] == pytest.approx(0.0, abs=tolerance)
    centre = shape.mesh.center_mass[:2]
    feet = corners[corners[:, 2] < 1e-6][:, :2]
    around = np.sort(np.arctan2(*(feet - centre).T))
    gaps = np.diff(np.append(around, around[0] + 2.0 * np.pi))
    assert gaps.max() < np.pi, "the centre of mass is not above the feet"


def test_colours_belong_to_faces(shape):
    colours = np.unique(shape.mesh.visual.face_colors, axis=0)
    assert 1 <= len(colours) <= 6
    assert shape.mesh.visual.kind == "face"
    main = np.round(255.0 * np.array(shape.rgba))
    assert (colours == main).all(axis=1).any()


def test_generation_is_repeatable():
    again = {shape.name: shape for shape in household_shapes()}

    def data(shape: Shape) -> list[bytes]:
        arrays = [shape.mesh.visual.face_colors]
        for mesh in (shape.mesh, *shape.pieces):
            arrays += [mesh.vertices, mesh.faces]
        return [np.ascontiguousarray(array).tobytes() for array in arrays]

    for name, shape in SHAPES.items():
        assert data(shape) == data(again[name]), name


def test_shipped_library_is_what_the_generator_makes(shape):
    entry = load_library("household").entry(shape.name)
    assert entry.mass == shape.mass
    assert len(entry.pieces) == len(shape.pieces)
    assert entry.mass_properties.volume == pytest.approx(shape.mesh.volume, rel=1e-4)
    assert np.allclose([entry.lower, entry.upper], shape.mesh.bounds, atol=1e-6)


def test_shipped_library_shows_the_colours():
    library = load_library("household")
    for name, shape in SHAPES.items():
        path = library.path(library.entry(name).mesh)
        lines = path.with_suffix(".mtl").read_text().splitlines()
        shown = {tuple(float(v) for v in line.split()[1:]) for line in lines if line[:2] == "Kd"}
        rows = np.unique(shape.mesh.visual.face_colors[:, :3], axis=0) / 255.0
        wanted = {tuple(np.round(row, 4).tolist()) for row in rows}
        if len(wanted) == 1:
            wanted = {shape.rgba[:3]}
        assert shown == wanted, name


def test_the_lying_bottle_rests_on_a_face() -> None:
    """Its centre of mass is 5 mm or more within the corners that touch, and not above a ridge."""
    library = load_library("household")
    entry = library.entry("bottle")
    X_SO = entry.X_SO(0)
    assert abs(X_SO[2, 2]) < 0.1  # it lies
    pieces = [trimesh.load_mesh(library.root / piece, process=False) for piece in entry.pieces]
    p_S = np.vstack([piece.vertices for piece in pieces]) @ X_SO[:3, :3].T + X_SO[:3, 3]
    corners = p_S[p_S[:, 2] < p_S[:, 2].min() + 1e-4, :2]
    center = (X_SO[:3, :3] @ entry.mass_properties.center_of_mass + X_SO[:3, 3])[:2]
    assert -(ConvexHull(corners).equations @ [*center, 1.0]).max() > 5e-3
