"""Broken meshes as they come from scanners, CAD and downloads, and how each is repaired.

The table names what is broken, and holds the exact sentences of the repair and the right volume.
Those that cannot be repaired are in `test_unusable_meshes`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest
import trimesh

from burg_drake.objects import Preparation, load_mesh

SIZE = np.array([0.1, 0.06, 0.04])
VOLUME = float(SIZE.prod())
BALL = 4.0 / 3.0 * np.pi * 0.05**3

WALL = "; mm; set the thickness with wall_thickness, or close it with caps by openings='close'"
CAPS = "; openings='wall' makes the surface a wall instead"


DEFAULT = Preparation()


def _raw(vertices: np.ndarray, faces: np.ndarray) -> trimesh.Trimesh:
    return trimesh.Trimesh(np.array(vertices), np.array(faces), process=False, validate=False)


def _box(subdivisions: int = 2) -> trimesh.Trimesh:
    box = trimesh.creation.box(SIZE)
    for _ in range(subdivisions):
        box = box.subdivide()
    return _raw(box.vertices, box.faces)


def _ball(subdivisions: int = 3, radius: float = 0.05) -> trimesh.Trimesh:
    ball = trimesh.creation.icosphere(subdivisions=subdivisions, radius=radius)
    return _raw(ball.vertices, ball.faces)


def _both(*parts: trimesh.Trimesh) -> trimesh.Trimesh:
    return trimesh.util.concatenate(parts)


def _inverted(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    return _raw(mesh.vertices, mesh.faces[:, ::-1])


def _moved(mesh: trimesh.Trimesh, x: float, y: float = 0.0, z: float = 0.0) -> trimesh.Trimesh:
    return _raw(mesh.vertices + np.array([x, y, z]), mesh.faces)


def _glued(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    mesh.merge_vertices()
    return mesh


def _soup() -> trimesh.Trimesh:
    box = _box()
    return _raw(box.triangles.reshape(-1, 3), np.arange(3 * len(box.faces)).reshape(-1, 3))


def _mixed() -> trimesh.Trimesh:
    faces = np.array(_box().faces)
    faces[::4] = faces[::4, ::-1]
    return _raw(_box().vertices, faces)


def _holed() -> trimesh.Trimesh:
    """A box with the faces around one vertex missing, in the middle of its top."""
    box = _box(4)
    hub = int(np.argmin(np.linalg.norm(box.vertices - [0.0, 0.0, 0.02], axis=1)))
    holed = _raw(box.vertices, box.faces[~(box.faces == hub).any(axis=1)])
    holed.remove_unreferenced_vertices()
    return holed


def _lidless() -> trimesh.Trimesh:
    box = _box()
    sides = _raw(box.vertices, box.faces[box.triangles_center[:, 2] < 0.0199])
    sides.remove_unreferenced_vertices()
    return sides


def _finned() -> trimesh.Trimesh:
    """A triangle of one side on an edge of a box."""
    box = _box()
    a, b = box.edges[0]
    vertices = np.vstack([box.vertices, 1.1 * box.vertices[[a, b]].mean(axis=0)])
    return _raw(vertices, np.vstack([box.faces, [[a, b, len(box.vertices)]]]))


def _dented() -> trimesh.Trimesh:
    """A box with the middle of its top pushed out through its bottom."""
    box = _box(3)
    vertices = np.array(box.vertices)
    vertices[np.linalg.norm(vertices - [0.0, 0.0, 0.02], axis=1) < 0.012, 2] = -0.04
    return _raw(vertices, box.faces)


def _moebius() -> trimesh.Trimesh:
    n = 40
    angle = 2.0 * np.pi * np.arange(n) / n
    rows = []
    for side in (-0.02, 0.02):
        radius = 0.08 + side * np.cos(0.5 * angle)
        rows.append(
            np.column_stack(
                [radius * np.cos(angle), radius * np.sin(angle), side * np.sin(0.5 * angle)]
            )
        )
    i = np.arange(n)
    c = np.append(i[1:], n)
    d = np.append(n + i[1:], 0)
    faces = np.vstack([np.column_stack([i, c, n + i]), np.column_stack([n + i, c, d])])
    return _raw(np.vstack(rows), faces)


@dataclass(frozen=True)
class Repairable:
    """A mesh that becomes an object: its sentences, its volume [m^3], and what was asked for."""

    mesh: Callable[[], trimesh.Trimesh]
    sentences: tuple[str, ...]
    volume: float | None
    rel: float = 1e-6
    preparation: Preparation = DEFAULT


REPAIRABLE = {
    "nothing broken": Repairable(_box, (), VOLUME),
    "inverted normals": Repairable(
        lambda: _inverted(_box()),
        ("turned the surface inside out so that normals point outward",),
        VOLUME,
    ),
    "mixed winding": Repairable(_mixed, ("turned 48 faces to a consistent winding",), VOLUME),
    "vertices of its own for each face": Repairable(
        _soup, ("merged 478 duplicate vertices",), VOLUME
    ),
    "duplicate faces": Repairable(
        lambda: _raw(_box().vertices, np.vstack([_box().faces, _box().faces[:7]])),
        ("dropped 7 duplicate faces",),
        VOLUME,
    ),
    "degenerate faces": Repairable(
        lambda: _raw(_box().vertices, np.vstack([_box().faces, [[3, 3, 5], [4, 9, 9]]])),
        ("dropped 2 degenerate faces",),
        VOLUME,
    ),
    "vertices that no face uses": Repairable(
        lambda: _raw(np.vstack([_box().vertices, [[9.0, 9.0, 9.0]] * 3]), _box().faces),
        ("dropped 3 vertices that no face uses",),
        VOLUME,
    ),
    "small hole": Repairable(_holed, ("filled 1 small holes",), VOLUME),
    "large opening, as a wall": Repairable(
        _lidless,
        (
            (
                "made the open surface (largest opening 117 mm wide) a wall of 2 mm; set the"
                " thickness with wall_thickness, or close it with caps by openings='close'"
            ),
        ),
        # outside and inside of the bottom and the sides, 1 mm from the sheet either way
        0.102 * 0.062 * 0.041 - 0.098 * 0.058 * 0.039,
    ),
    "large opening, capped": Repairable(
        _lidless,
        (f"closed 1 openings with flat caps (largest opening 117 mm wide){CAPS}",),
        VOLUME,
        preparation=Preparation(openings="close"),
    ),
    "perfectly flat, as a wall": Repairable(
        lambda: _raw([[0, 0, 0], [0.2, 0, 0], [0.2, 0.1, 0], [0, 0.1, 0]], [[0, 1, 2], [0, 2, 3]]),
        (
            (
                "made the open surface (largest opening 224 mm wide) a wall of 3 mm; set the"
                " thickness with wall_thickness, or close it with caps by openings='close'"
            ),
        ),
        0.2 * 0.1 * 0.003,
        preparation=Preparation(wall_thickness=0.003),
    ),
    "one side only": Repairable(
        _moebius,
        (
            "turned 40 faces to a consistent winding",
            (
                "the surface stays open (largest opening 191 mm wide), as it has only one"
                " side (a Moebius strip); the volume is that of the convex pieces"
            ),
        ),
        None,
    ),
    "specks": Repairable(
        lambda: _both(_box(), _moved(_ball(1, 2e-4), 0.0, 0.0, 0.1)),
        ("dropped 1 tiny separate parts (80 faces)",),
        VOLUME,
    ),
    "fin": Repairable(_finned, ("dropped 1 faces without thickness",), VOLUME),
    "overlapping bodies": Repairable(
        lambda: _both(_box(), _moved(_box(), 0.05)),
        ("united 2 bodies that overlap (they share 25 % of their volume, which now counts once)",),
        1.5 * VOLUME,
    ),
    "bodies with a face in common": Repairable(
        lambda: _both(_box(), _moved(_box(), SIZE[0])), ("united 2 bodies that touch",), 2 * VOLUME
    ),
    "cavity": Repairable(
        lambda: _both(_ball(), _inverted(_ball(3, 0.03))), (), BALL * (1 - 0.6**3), 0.02
    ),
    "inside-out body with a cavity": Repairable(
        lambda: _both(_inverted(_ball()), _ball(3, 0.03)),
        ("turned the surface inside out so that normals point outward",),
        BALL * (1 - 0.6**3),
        0.02,
    ),
    "passes through itself": Repairable(
        _dented,
        (
            (
                "the surface passes through itself: about 0.68 % of its volume counts twice"
                " or is inside out, so mass properties may be that far off"
            ),
        ),
        None,
    ),
    "bodies that touch along an edge": Repairable(
        lambda: _glued(_both(_box(), _moved(_box(), SIZE[0], SIZE[1]))),
        ("separated bodies that touch along an edge",),
        2.0 * VOLUME,
    ),
    "finer than contact needs": Repairable(
        lambda: _box(6),
        ("reduced from 49152 to 12 faces, at most 0.001 mm off",),
        VOLUME,
    ),
}


@pytest.mark.parametrize("kind", REPAIRABLE)
def test_repairs(kind: str) -> None:
    case = REPAIRABLE[kind]
    mesh = load_mesh(case.mesh(), preparation=case.preparation)
    assert mesh.repairs == case.sentences
    assert mesh.closed == (kind != "one side only")
    if case.volume is not None:
        assert mesh.surface.volume == pytest.approx(case.volume, rel=case.rel)
