"""Writes the OBJ files of a library: visual meshes with normals, and convex pieces.

Drake shows an OBJ only when it has normals, and takes its colour or texture from the MTL file that
the OBJ names. The text is the same for the same mesh, byte for byte.
"""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import trimesh
from numpy.typing import ArrayLike, NDArray

from burg_drake.core import Array
from burg_drake.core.files import atomic_write
from burg_drake.core.terminal import Rgba

CREASE_ANGLE = np.deg2rad(35.0)
"""Faces that meet at more than this angle are shaded with an edge between them [rad]."""

MAX_COLOURS = 16
"""A mesh with more face colours than this is a scan or a picture, not a few materials."""


DEFAULT_RGBA: Rgba = (0.8, 0.8, 0.78, 1.0)
"""Colour of a mesh that comes without one; Drake's renderer would choose orange."""


def face_palette(mesh: trimesh.Trimesh) -> tuple[NDArray[np.uint8], NDArray[np.int64]] | None:
    """The colours of a mesh whose faces have a few.

    Returns:
        (C, 4) colours as bytes and (F,) index of each face's one; None where the faces have no
        colours of their own, or only one, or more than `MAX_COLOURS`.
    """
    if mesh.visual is None or mesh.visual.kind != "face":
        return None
    colours, index = np.unique(mesh.visual.face_colors, axis=0, return_inverse=True)
    return (colours, index.reshape(-1)) if 1 < len(colours) <= MAX_COLOURS else None


def write_visual(
    mesh: trimesh.Trimesh, path: Path, *, rgba: Rgba | None = None, image: object | None = None
) -> None:
    """Writes `path` (.obj) with normals, and an .mtl and .png beside it where needed.

    Args:
        mesh: surface in metres; with texture coordinates if `image` is given.
        path: the OBJ file.
        rgba: colour, if there is no image; without either, the mesh's `face_palette` is used, and
            without that `DEFAULT_RGBA`.
        image: texture (PIL image).
    """
    palette = face_palette(mesh) if rgba is None and image is None else None
    groups = np.zeros(len(mesh.faces), dtype=np.int64)
    materials: dict[str, Rgba] = {"surface": rgba or DEFAULT_RGBA}
    if image is not None:
        materials = {"surface": (1.0, 1.0, 1.0, 1.0)}
    elif palette is not None:
        materials = {f"colour_{i}": _rgba(row) for i, row in enumerate(palette[0])}
        groups = palette[1]
    texture = "" if image is None else f"map_Kd {path.stem}.png\n"
    if image is not None:
        data = io.BytesIO()
        image.convert("RGB").save(data, format="PNG")  # type: ignore[attr-defined]
        atomic_write(path.with_suffix(".png"), data.getvalue())
    atomic_write(path.with_suffix(".mtl"), _mtl(materials, texture))
    normals = corner_normals(mesh)
    unique, index = np.unique(np.round(normals.reshape(-1, 3), 5), axis=0, return_inverse=True)
    columns = [mesh.faces + 1, index.reshape(-1, 3) + 1]
    text = [f"mtllib {path.stem}.mtl\n"]
    text += [_rows("v", mesh.vertices, "%.9g"), _rows("vn", unique + 0.0, "%.5g")]
    form = " ".join(["%d//%d"] * 3)
    if image is not None:
        text.append(_rows("vt", np.asarray(mesh.visual.uv)[:, :2], "%.7g"))
        columns.insert(1, mesh.faces + 1)
        form = " ".join(["%d/%d/%d"] * 3)
    corners = np.stack(columns, axis=2).reshape(len(mesh.faces), -1)
    for k, name in enumerate(materials):
        text.append(f"usemtl {name}\n")
        text.append(_rows("f", corners[groups == k], form))
    atomic_write(path, "".join(text))


def _rgba(row: NDArray[np.uint8]) -> Rgba:
    r, g, b, a = np.round(row / 255.0, 4).tolist()
    return r, g, b, a


def _mtl(materials: dict[str, Rgba], texture: str) -> str:
    return "\n".join(
        f"newmtl {name}\nKd {r:g} {g:g} {b:g}\nd {a:g}\n{texture}"
        for name, (r, g, b, a) in materials.items()
    )


def write_piece(mesh: trimesh.Trimesh, path: Path) -> None:
    """Writes a convex piece (.obj): vertices and faces only."""
    atomic_write(path, _rows("v", mesh.vertices, "%.9g") + _rows("f", mesh.faces + 1, "%d"))


def corner_normals(mesh: trimesh.Trimesh, crease: float = CREASE_ANGLE) -> Array:
    """Normals at the corners of each face, smooth across edges flatter than `crease`.

    Args:
        mesh: F faces; vertices merged.
        crease: [rad].

    Returns:
        (F, 3, 3) unit vectors, by face and corner: the mean, weighted by area, of the normals of
        the faces around the corner's vertex that are within `crease` of the face's own.
    """
    vertices, place = np.unique(np.asarray(mesh.vertices), axis=0, return_inverse=True)
    faces = place.reshape(-1)[mesh.faces]
    t = mesh.triangles
    area = np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0])
    length = np.linalg.norm(area, axis=1, keepdims=True)
    unit = np.divide(area, length, out=np.tile([0.0, 0.0, 1.0], (len(area), 1)), where=length > 0)
    order = np.argsort(faces.reshape(-1), kind="stable")
    degree = np.bincount(faces.reshape(-1), minlength=len(vertices))
    start = np.concatenate([[0], np.cumsum(degree)[:-1]])
    around = degree[faces.reshape(-1)]
    corner = np.repeat(np.arange(faces.size), around)
    offset = np.arange(len(corner)) - np.repeat(np.cumsum(around) - around, around)
    neighbour = order[start[faces.reshape(-1)[corner]] + offset] // 3
    smooth = (unit[corner // 3] * unit[neighbour]).sum(axis=1) >= np.cos(crease)
    total = np.zeros((faces.size, 3))
    for k in range(3):
        total[:, k] = np.bincount(
            corner[smooth], weights=area[neighbour[smooth], k], minlength=faces.size
        )
    size = np.linalg.norm(total, axis=1, keepdims=True)
    own = np.repeat(unit, 3, axis=0)
    mean: Array = np.divide(total, size, out=own, where=size > 0).reshape(-1, 3, 3)
    return mean


def _rows(tag: str, values: ArrayLike | NDArray[np.int64], form: str) -> str:
    array = np.asarray(values)
    row = f"{tag} {form if ' ' in form else ' '.join([form] * array.shape[1])}\n"
    return (row * len(array)) % tuple(array.reshape(-1).tolist())
