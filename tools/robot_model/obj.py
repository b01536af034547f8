"""Wavefront OBJ files with normals, one file a link, one material a part."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Part:
    """A surface of one material.

    Attributes:
        material: key of MATERIALS.
        vertices: (V, 3) points in the link frame [m].
        normals: (V, 3) unit normals, one a vertex.
        faces: (F, 3) vertex indices, counter-clockwise from outside.
    """

    material: str
    vertices: np.ndarray
    normals: np.ndarray
    faces: np.ndarray


@dataclass(frozen=True)
class Material:
    """Diffuse and specular colour (0 to 1) and Phong exponent."""

    diffuse: tuple[float, float, float]
    specular: float
    exponent: float


MATERIALS: dict[str, Material] = {
    "shell": Material((0.93, 0.94, 0.95), 0.35, 60.0),
    "cap": Material((0.70, 0.72, 0.74), 0.30, 40.0),
    "dark": Material((0.16, 0.17, 0.18), 0.25, 30.0),
    "metal": Material((0.55, 0.56, 0.58), 0.50, 80.0),
    "rubber": Material((0.07, 0.07, 0.08), 0.10, 10.0),
}
"""Colours of the parts."""


def obj_text(parts: Iterable[Part], material_file: str) -> str:
    """OBJ text of the parts; positions to 0.01 mm, normals to 0.001."""
    lines = [f"mtllib {material_file}"]
    offset = 1
    for part in parts:
        lines.append(f"usemtl {part.material}")
        lines.extend(f"v {_short(v, 5)}" for v in part.vertices)
        lines.extend(f"vn {_short(n, 3)}" for n in part.normals)
        lines.extend(
            "f " + " ".join(f"{i}//{i}" for i in face) for face in (part.faces + offset).tolist()
        )
        offset += len(part.vertices)
    return "\n".join(lines) + "\n"


def mtl_text() -> str:
    """MTL text of all materials."""
    lines = []
    for name, material in MATERIALS.items():
        diffuse = " ".join(f"{c:g}" for c in material.diffuse)
        specular = " ".join([f"{material.specular:g}"] * 3)
        lines += [
            f"newmtl {name}",
            f"Ka {diffuse}",
            f"Kd {diffuse}",
            f"Ks {specular}",
            f"Ns {material.exponent:g}",
            "d 1",
            "illum 2",
            "",
        ]
    return "\n".join(lines)


def _short(values: np.ndarray, digits: int) -> str:
    """Rounded numbers without trailing zeros."""
    return " ".join(f"{value:.15g}" for value in np.round(values, digits) + 0.0)
