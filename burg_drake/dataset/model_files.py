"""Visual meshes of a library as PLY files, and their symmetries."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from numpy.typing import NDArray

from burg_drake.core import Array, Bytes, Indices, make_pose
from burg_drake.objects import ObjectLibrary, SymmetrySearch


@dataclass(frozen=True, eq=False)
class VisualModel:
    """Visual mesh of an object.

    Attributes:
        vertices: (V, 3) vertices in the object frame O [m].
        normals: (V, 3) unit vectors, outward.
        faces: (F, 3) vertices of each triangle.
        colors: (V, 3) vertex colours; None with a texture.
        uv: (V, 2) texture coordinates, v upward; None without a texture.
        image: the texture (PIL image), or None.
    """

    vertices: Array
    normals: Array
    faces: Indices
    colors: Bytes | None = None
    uv: Array | None = None
    image: Any = None


def visual_model(library: ObjectLibrary, name: str) -> VisualModel:
    """Visual mesh of a library's object. With several textured materials, each part gets the main
    colour of its material instead of a texture.

    Raises:
        UnknownNameError: no such object, or its mesh file is missing.
        MeshError: the mesh file is damaged.
    """
    path = library.path(library.entry(name).mesh)
    try:
        parts = list(trimesh.load_scene(path, process=False).geometry.values())
        vertices = [np.asarray(part.vertices, dtype=float) for part in parts]
        normals = np.concatenate([np.asarray(part.vertex_normals, float) for part in parts])
        starts = np.cumsum([0, *map(len, vertices[:-1])])
        faces = [np.asarray(part.faces) + s for part, s in zip(parts, starts, strict=True)]
    except Exception as error:  # the reader raises whatever it stumbles over
        raise library.damaged(path) from error
    model = VisualModel(np.concatenate(vertices), normals, np.concatenate(faces))
    image = getattr(_part_material(parts[0]), "image", None) if len(parts) == 1 else None
    if image is not None:
        return replace(model, uv=np.asarray(parts[0].visual.uv, dtype=float)[:, :2], image=image)
    colors = [np.tile(_main_color(part), (len(part.vertices), 1)) for part in parts]
    return replace(model, colors=np.concatenate(colors))


def uncolored_model(surface: trimesh.Trimesh) -> VisualModel:
    """Visual mesh of a surface without colours."""
    return VisualModel(
        np.asarray(surface.vertices), np.asarray(surface.vertex_normals), np.asarray(surface.faces)
    )


def write_ply(model: VisualModel, path: Path, *, unit: float) -> None:
    """Writes an ASCII PLY file, and its texture, if any, beside it as PNG.

    Args:
        model: the mesh.
        path: path of the file.
        unit: unit of the file's coordinates [m].
    """
    columns = [(model.vertices / unit).round(9), model.normals]
    forms = ["%.7g"] * 3 + ["%.5g"] * 3
    header = ["ply", "format ascii 1.0"]
    names = [f"float {axis}" for axis in ("x", "y", "z", "nx", "ny", "nz")]
    if model.image is not None and model.uv is not None:
        texture = path.with_suffix(".png")
        model.image.convert("RGB").save(texture)
        header.append(f"comment TextureFile {texture.name}")
        columns.append(model.uv)
        forms += ["%.7g"] * 2
        names += ["float texture_u", "float texture_v"]
    elif model.colors is not None:
        columns.append(model.colors.astype(float))
        forms += ["%d"] * 3
        names += ["uchar red", "uchar green", "uchar blue"]
    header.append(f"element vertex {len(model.vertices)}")
    header += [f"property {name}" for name in names]
    header += [f"element face {len(model.faces)}", "property list uchar int vertex_indices"]
    rows = _format_rows(np.hstack(columns) + 0.0, forms) + _format_rows(
        model.faces, ["3 %d", "%d", "%d"]
    )
    path.write_text("\n".join([*header, "end_header"]) + "\n" + rows, encoding="ascii")


def _format_rows(values: NDArray[Any], forms: list[str]) -> str:
    return (f"{' '.join(forms)}\n" * len(values)) % tuple(values.reshape(-1).tolist())


def _part_material(part: trimesh.Trimesh) -> Any:
    return getattr(part.visual, "material", None)


def _main_color(part: trimesh.Trimesh) -> Bytes:
    """Main colour (3,) of a part."""
    material = _part_material(part)
    rgba = part.visual.main_color if material is None else material.main_color
    return np.asarray(rgba, np.uint8)[:3]


def find_symmetries(model: VisualModel, diameter: float) -> dict[str, Any]:
    """Symmetries of an object under the keys of `models_info.json`; empty if there are none.

    Args:
        model: visual mesh of the object. Symmetries have to preserve colours. A model with a
            texture has none, as the texture is not analysed.
        diameter: diameter of the model [m].

    Returns:
        `symmetries_continuous`: axes, each with a point on it in millimetres, and
        `symmetries_discrete`: 4 x 4 matrices, row by row, in millimetres. A key without symmetries
        is left out. A sphere gets three axes, as BOP can only represent axes.
    """
    max_deviation = 0.01  # Distance of a turned surface from itself, per diameter (BOP allows 0.1).
    if model.image is not None:
        return {}
    mesh = trimesh.Trimesh(model.vertices, model.faces, process=False)
    p_OC, tolerance = np.asarray(mesh.centroid), max_deviation * diameter
    found = SymmetrySearch(mesh, p_OC, tolerance, covered=1.0).find()
    parts = [SymmetrySearch(part, p_OC, tolerance, covered=1.0) for part in _colored_parts(model)]
    axes = list(np.eye(3)) if found.sphere else [] if found.axis is None else [found.axis]
    axes = [axis for axis in axes if all(part.turns_about(axis) for part in parts)]
    turns = [R for R in found.rotations[1:] if all(part.fits(R) for part in parts)]
    info: dict[str, Any] = {}
    if axes:
        info["symmetries_continuous"] = [
            {"axis": _rounded_values(axis), "offset": _rounded_values(1e3 * p_OC)} for axis in axes
        ]
    if turns:
        motions = [make_pose(R, 1e3 * (p_OC - R @ p_OC)) for R in turns]
        info["symmetries_discrete"] = [_rounded_values(X.reshape(-1)) for X in motions]
    return info


def _colored_parts(model: VisualModel) -> list[trimesh.Trimesh]:
    """Surfaces of the model by colour, if it has several."""
    if model.colors is None:
        return []
    _, color = np.unique(model.colors[model.faces[:, 0]], axis=0, return_inverse=True)
    color = color.reshape(-1)
    if color.max() == 0:
        return []
    return [
        trimesh.Trimesh(model.vertices, model.faces[color == k], process=False)
        for k in range(int(color.max()) + 1)
    ]


def _rounded_values(values: Array) -> list[float]:
    return [float(x) for x in np.asarray(values).round(9) + 0.0]
