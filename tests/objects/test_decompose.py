"""Convex pieces."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from burg_drake.core import MeshError
from burg_drake.objects import (
    Decomposition,
    DecompositionFailed,
    check_given_pieces,
    convex_decomposition,
    convex_pieces,
    join_parts,
    run_coacd,
)


def _bar(size: tuple[float, float, float], at: tuple[float, float, float]) -> trimesh.Trimesh:
    return trimesh.creation.box(size).apply_translation(at)


def _corner() -> trimesh.Trimesh:
    """An L: two bars of 0.10 x 0.02 x 0.02 m that share a cube."""
    outline = np.array([[0, 0], [10, 0], [10, 2], [2, 2], [2, 10], [0, 10]]) * 0.01
    rim = np.arange(6)
    cap = [[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 5]]
    top = np.column_stack([outline, np.full(6, 0.02)])
    bottom = np.column_stack([outline, np.zeros(6)])
    sides = np.vstack(
        [
            np.column_stack([rim, np.roll(rim, -1), np.roll(rim, -1) + 6]),
            np.column_stack([rim, np.roll(rim, -1) + 6, rim + 6]),
        ]
    )
    faces = np.vstack([np.array(cap)[:, ::-1], np.array(cap) + 6, sides])
    return trimesh.Trimesh(np.vstack([bottom, top]), faces, process=False)


CORNER_VOLUME = (0.1 + 0.08) * 0.02 * 0.02


def test_convex_things_are_their_hull() -> None:
    sphere = trimesh.creation.icosphere(subdivisions=4, radius=0.03)
    pieces = convex_pieces(sphere, closed=True)
    assert len(pieces.meshes) == 1
    assert len(pieces.meshes[0].vertices) <= Decomposition().max_vertices
    assert pieces.seconds == 0.0


@pytest.fixture(scope="module")
def corner_pieces() -> convex_decomposition.ConvexPieces:
    return convex_pieces(_corner(), closed=True)


def test_a_corner_is_two_bars(corner_pieces: convex_decomposition.ConvexPieces) -> None:
    assert _corner().volume == pytest.approx(CORNER_VOLUME)
    assert len(corner_pieces.meshes) == 2
    total = sum(p.volume for p in corner_pieces.meshes)
    assert total == pytest.approx(CORNER_VOLUME, rel=0.05)


def test_pieces_are_convex_and_wound_outward(
    corner_pieces: convex_decomposition.ConvexPieces,
) -> None:
    for piece in corner_pieces.meshes:
        assert piece.is_volume
        assert piece.volume == pytest.approx(piece.convex_hull.volume, rel=1e-9)


def test_the_notch_stays_free(corner_pieces: convex_decomposition.ConvexPieces) -> None:
    for piece in corner_pieces.meshes:
        assert not piece.contains([[0.06, 0.06, 0.01]])[0]


def test_the_same_mesh_gives_the_same_pieces(
    corner_pieces: convex_decomposition.ConvexPieces,
) -> None:
    again = convex_pieces(_corner(), closed=True)
    for a, b in zip(corner_pieces.meshes, again.meshes, strict=True):
        np.testing.assert_array_equal(a.vertices, b.vertices)
        np.testing.assert_array_equal(a.faces, b.faces)


def test_open_surfaces_become_walls(monkeypatch: pytest.MonkeyPatch) -> None:
    """A box without a lid stays open."""
    monkeypatch.setitem(convex_decomposition.COACD_REMESHING, "preprocess_resolution", 15)
    box = trimesh.creation.box((0.1, 0.08, 0.06))
    box.update_faces(box.triangles_center[:, 2] < 0.029)
    pieces = convex_pieces(box, closed=False, parameters=Decomposition(threshold=0.3)).meshes
    assert all(p.is_volume for p in pieces)
    assert 0.0 < sum(p.volume for p in pieces) < 0.8 * box.convex_hull.volume
    assert not any(p.contains([[0.0, 0.0, 0.02]])[0] for p in pieces)


def test_joining_undoes_a_needless_cut() -> None:
    parts = [np.asarray(_bar((0.02, 0.02, 0.02), (0.02 * i, 0, 0)).vertices) for i in range(5)]
    joined = join_parts(parts, 0.001)
    assert len(joined) == 1
    np.testing.assert_allclose(np.ptp(joined[0], axis=0), [0.1, 0.02, 0.02])


def test_joining_keeps_to_its_budget() -> None:
    bars = [_bar((0.1, 0.02, 0.02), (0.05, 0.01, 0.0)), _bar((0.02, 0.08, 0.02), (0.01, 0.06, 0.0))]
    parts = [np.asarray(b.vertices) for b in bars]
    assert len(join_parts(parts, 0.01)) == 2
    assert len(join_parts(parts, 5.0)) == 1


def test_given_pieces_are_taken_as_they_are() -> None:
    piece = _bar((0.02, 0.02, 0.02), (0, 0, 0))
    (taken,) = check_given_pieces([piece]).meshes
    np.testing.assert_array_equal(taken.vertices, piece.vertices)


def test_given_pieces_that_are_none() -> None:
    inverted = _bar((0.02, 0.02, 0.02), (0, 0, 0))
    inverted.invert()
    with pytest.raises(MeshError, match="piece 1 is not convex: its hull has 1"):
        check_given_pieces([_bar((0.02, 0.02, 0.02), (0, 0, 0)), _corner()])
    with pytest.raises(MeshError, match="piece 0 is not a closed surface"):
        check_given_pieces([inverted])
    with pytest.raises(MeshError, match="pieces is empty"):
        check_given_pieces([])


def test_a_crash_of_the_library_is_an_error() -> None:
    """An empty mesh aborts CoACD's process, not this one."""
    with pytest.raises(DecompositionFailed, match="ended with code"):
        run_coacd(np.zeros((0, 3)), np.zeros((0, 3), dtype=int), {"threshold": 0.05}, 60.0)


def test_too_long_is_an_error() -> None:
    with pytest.raises(
        MeshError,
        match=r"longer than 0.01 s.*threshold above 0.05",
    ):
        convex_pieces(_corner(), closed=True, parameters=Decomposition(timeout=0.01))
