"""Openings closed flat, and what hangs on closed surfaces."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from burg_drake.objects import RepairedMesh, close_openings, is_closed, repair


def _without(mesh: trimesh.Trimesh, drop: np.ndarray) -> trimesh.Trimesh:
    part = mesh.copy()
    part.update_faces(~drop)
    part.remove_unreferenced_vertices()
    return part


def _closed(mesh: trimesh.Trimesh) -> RepairedMesh:
    result = repair(mesh)
    assert close_openings(result, "close", None) is None
    return result


@pytest.mark.parametrize("inverted", [False, True])
@pytest.mark.parametrize("subdivisions", [0, 2])
def test_a_box_without_a_lid(inverted: bool, subdivisions: int) -> None:
    box = trimesh.creation.box((0.1, 0.06, 0.04))
    for _ in range(subdivisions):
        box = box.subdivide()
    open_box = _without(box, box.triangles_center[:, 2] > 0.0199)
    if inverted:
        open_box.invert()
    result = _closed(open_box)
    assert is_closed(result.mesh)
    assert result.mesh.volume == pytest.approx(0.1 * 0.06 * 0.04, rel=1e-9)
    assert result.sentences[-1] == (
        "closed 1 openings with flat caps (largest opening 117 mm wide); openings='wall'"
        " makes the surface a wall instead"
    )


def test_a_tube_gets_two_caps() -> None:
    cylinder = trimesh.creation.cylinder(0.03, 0.1)
    result = _closed(_without(cylinder, np.abs(cylinder.face_normals[:, 2]) > 0.5))
    assert is_closed(result.mesh)
    assert result.mesh.volume == pytest.approx(cylinder.volume, rel=1e-9)


def test_a_pipe_cut_across_gets_a_ring() -> None:
    pipe = trimesh.creation.annulus(0.03, 0.04, 0.1)
    result = _closed(_without(pipe, pipe.triangles_center[:, 2] > 0.0499))
    assert is_closed(result.mesh)
    assert result.mesh.volume == pytest.approx(pipe.volume, rel=1e-9)


def test_a_rim_that_zigzags_gets_a_foot_to_stand_on() -> None:
    """As scans end that lack their underside: the cap is at the height of the lowest point."""
    sphere = trimesh.creation.icosphere(subdivisions=4, radius=0.05)
    z = sphere.triangles_center[:, 2]
    ragged = z + np.random.default_rng(0).uniform(-0.003, 0.003, len(z)) < -0.02
    scan = _without(sphere, ragged)
    result = _closed(scan)
    assert is_closed(result.mesh)
    low = result.mesh.vertices[:, 2].min()
    assert low == pytest.approx(scan.vertices[:, 2].min(), abs=1e-3)
    height = 0.05 + 0.02
    cap = np.pi * height**2 * (3 * 0.05 - height) / 3.0
    assert result.mesh.volume == pytest.approx(cap, rel=0.08)


@pytest.mark.parametrize(("subdivisions", "kept"), [(2, False), (0, True)])
def test_small_fins_are_dropped_and_large_ones_become_walls(subdivisions: int, kept: bool) -> None:
    """A triangle of one side on an edge of a box: 15 or 60 mm of a box with a diagonal of 123."""
    box = trimesh.creation.box((0.1, 0.06, 0.04))
    for _ in range(subdivisions):
        box = box.subdivide()
    a, b = box.edges[0]
    tip = box.vertices[[a, b]].mean(axis=0) * (2.0 if kept else 1.1)
    faces = np.vstack([box.faces, [[a, b, len(box.vertices)]]])
    result = repair(trimesh.Trimesh(np.vstack([box.vertices, tip]), faces, process=False))
    wall = close_openings(result, "wall", 0.002)
    assert is_closed(result.mesh)
    if kept:
        area = trimesh.Trimesh([*box.vertices[[a, b]], tip], [[0, 1, 2]]).area
        assert wall == 0.002
        # the fin goes straight out from the edge, so that its wall's foot meets the box there only
        assert result.mesh.volume - box.volume == pytest.approx(area * 0.002, rel=1e-6)
    else:
        assert result.mesh.volume == pytest.approx(box.volume, rel=1e-12)
        assert result.sentences == ["dropped 1 faces without thickness"]


def test_bodies_that_touch_along_an_edge_are_closed() -> None:
    box = trimesh.creation.box((0.1, 0.1, 0.1))
    pair = trimesh.util.concatenate([box, box.copy().apply_translation([0.1, 0.1, 0.0])])
    pair.merge_vertices()
    result = repair(pair)
    assert not is_closed(result.mesh)
    close_openings(result, "wall", None)
    assert is_closed(result.mesh)
    assert result.mesh.volume == pytest.approx(2e-3)
    assert result.sentences[-1] == "separated bodies that touch along an edge"
