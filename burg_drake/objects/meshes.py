"""Meshes from files or memory: loaded, scaled to metres, checked and repaired.

Every change is one sentence in `SurfaceMesh.repairs`; what cannot be used is one `MeshError`. glTF
files are y-up by their specification and are turned to z-up (x, y, z) -> (x, -z, y), as Drake and
the usual modelling tools do; the frames of all other formats are kept as they are.
"""

from __future__ import annotations

import logging
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from scipy.spatial import QhullError

from burg_drake.core.content import content_hash
from burg_drake.core.errors import MeshError
from burg_drake.core.frames import make_pose
from burg_drake.objects.hulls import convex_hull
from burg_drake.objects.obj_file import face_palette
from burg_drake.objects.repair import repair, signed_volume

FORMATS = (".obj", ".ply", ".stl", ".glb", ".gltf")

MAX_EXTENT = 2.5
"""Largest plausible extent of a thing on a table [m]; above it the unit is taken to be wrong."""

MIN_EXTENT = 1e-3
"""Smallest plausible largest extent [m]."""

USUAL_EXTENT = (0.01, 1.0)
"""Largest extents of nearly all things on a table [m], to tell a mesh's unit by."""

UNITS = {"millimetres": 1e-3, "centimetres": 1e-2, "metres": 1.0}
"""Units that meshes come in [m]."""

FLAT = 1e-6
"""A mesh is flat when its hull's volume, or the volume that its closed surface encloses, is below
this share of its largest extent cubed (a sheet of paper has 5e-4)."""

R_ZUP_YUP = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
"""Turns glTF's y-up to z-up."""

NO_COLOUR = (204, 204, 204, 255)
"""Colour of parts without one, beside parts that have one."""

REFERRING = (".obj", ".gltf")
"""Mesh formats that refer to other files, such as materials and textures."""

REFERRED = (".mtl", ".png", ".jpg", ".jpeg", ".bin")
"""What they refer to."""


@dataclass(frozen=True, eq=False)
class SurfaceMesh:
    """A checked surface in metres, in the object frame O.

    Attributes:
        surface: geometry for physics: vertices merged, winding outward.
        visual: geometry for display, with texture coordinates where the source has a texture and
            with face colours where it has a few.
        repairs: what was changed, one sentence each.
        closed: whether the surface is watertight with consistent winding.
        rgba: main colour of the source, if it has one and neither texture nor a few face colours.
    """

    surface: trimesh.Trimesh
    visual: trimesh.Trimesh
    repairs: tuple[str, ...]
    closed: bool
    rgba: tuple[float, float, float, float] | None = None


def load_mesh(mesh: str | Path | trimesh.Trimesh, scale: float = 1.0) -> SurfaceMesh:
    """Loads, checks and repairs a mesh.

    Args:
        mesh: file (.obj, .ply, .stl, .glb, .gltf; a scene of several bodies becomes one mesh), or
            a mesh in memory.
        scale: factor from the mesh's unit to metres.

    Raises:
        MeshError: file missing or unreadable, no faces, NaN vertices, flat, or a size that tells
            of a wrong unit.
    """
    name = mesh_name(mesh)
    if not (np.isfinite(scale) and scale > 0.0):
        raise MeshError(f"{name}: scale is {scale:g}; give the unit in metres, such as 0.001")
    repairs: list[str] = []
    if isinstance(mesh, trimesh.Trimesh):
        raw = mesh.copy()
    else:
        raw = _read(Path(mesh))
        if Path(mesh).suffix.lower() in (".glb", ".gltf"):
            raw.apply_transform(make_pose(R_ZUP_YUP))
            repairs.append("turned from glTF's y-up to z-up")
    _check_numbers(raw, name)
    if scale != 1.0:
        raw.apply_scale(scale)
        repairs.append(f"scaled by {scale:g}")
    _check_size(raw, name, scale)
    repaired = repair(raw)
    surface = repaired.mesh
    closed = bool(len(surface.faces) and surface.is_watertight and surface.is_winding_consistent)
    _check_volume(surface, closed, name)
    pictured = texture_image(raw) is not None or face_palette(raw) is not None
    visual = raw if pictured else surface
    if pictured and repaired.inverted:
        visual.invert()
    if not closed:
        repaired.sentences.append("left open: the volume is taken from the convex pieces")
    sentences = (*repairs, *repaired.sentences)
    return SurfaceMesh(surface, visual, sentences, closed, None if pictured else source_rgba(raw))


def mesh_name(mesh: str | Path | trimesh.Trimesh) -> str:
    """How messages call a mesh."""
    return "mesh in memory" if isinstance(mesh, trimesh.Trimesh) else str(mesh)


def mesh_hash(mesh: str | Path | trimesh.Trimesh) -> str:
    """Content hash of a mesh in memory, or of a file and the textures beside it.

    Raises:
        MeshError: the file cannot be read.
    """
    if isinstance(mesh, trimesh.Trimesh):
        image = texture_image(mesh)
        look: list[Any] = [face_palette(mesh), source_rgba(mesh)]
        if image is not None:
            look += [np.asarray(mesh.visual.uv), np.asarray(image)]
        return content_hash(np.asarray(mesh.vertices), np.asarray(mesh.faces), look)
    path = Path(mesh)
    _check_file(path)
    try:
        return content_hash(path, *((p.name, p) for p in _companions(path)))
    except OSError as error:
        raise MeshError(f"{path}: cannot read the mesh: {error.strerror or error}") from error


def texture_image(mesh: trimesh.Trimesh):  # type: ignore[no-untyped-def]
    """The colour image (PIL) of a textured mesh, or None."""
    visual = mesh.visual
    if visual.kind != "texture" or visual.uv is None or len(visual.uv) != len(mesh.vertices):
        return None
    material = visual.material
    return getattr(material, "image", None) or getattr(material, "baseColorTexture", None)


def source_rgba(mesh: trimesh.Trimesh) -> tuple[float, float, float, float] | None:
    """Main colour of a coloured mesh without a texture (mean over faces or vertices), or None."""
    visual = mesh.visual
    if visual is None or not visual.defined:
        return None
    if visual.kind == "texture":
        colour = getattr(visual.material, "main_color", None)
    else:
        colour = np.asarray(visual.face_colors, dtype=float).mean(axis=0)
    if colour is None:
        return None
    r, g, b, a = (np.round(np.asarray(colour, dtype=float) / 255.0, 4)).tolist()
    return r, g, b, a


def _companions(path: Path) -> list[Path]:
    """Files in the mesh's folder that its text names, and that those name in turn."""
    if path.suffix.lower() not in REFERRING:
        return []
    beside = {p.name: p for p in path.parent.iterdir() if p.suffix.lower() in REFERRED}
    found: list[Path] = []
    queue = [path]
    while queue:
        text = queue.pop().read_bytes()
        named = [p for name, p in sorted(beside.items()) if name.encode() in text and p != path]
        fresh = [p for p in named if p not in found]
        found += fresh
        queue += [p for p in fresh if p.suffix.lower() == ".mtl"]
    return sorted(found)


def _check_file(path: Path) -> None:
    if path.suffix.lower() not in FORMATS:
        raise MeshError(f"{path}: {path.suffix or 'no suffix'} is not one of {', '.join(FORMATS)}")
    if not path.is_file():
        raise MeshError(f"{path}: the mesh file does not exist")
    if path.stat().st_size == 0:
        raise MeshError(f"{path}: the mesh file is empty")


def _read(path: Path) -> trimesh.Trimesh:
    _check_file(path)
    log = logging.getLogger("trimesh")
    if not log.handlers:  # or remarks on materials would go to standard error
        log.addHandler(logging.NullHandler())
    try:
        scene = trimesh.load_scene(path, process=False)
        parts = [g for g in scene.dump() if isinstance(g, trimesh.Trimesh) and len(g.faces)]
        mesh = _joined(parts) if parts else None
    except Exception as error:  # the readers raise whatever their parsing stumbles over
        reason = str(error).strip().splitlines() or [type(error).__name__]
        if isinstance(error, ImportError):  # of a package that guesses the encoding of a text
            reason = ["its contents are neither text nor a known binary form"]
        raise MeshError(f"{path}: not a readable {path.suffix} mesh: {reason[0]}") from error
    if mesh is None:
        raise MeshError(f"{path}: the mesh file has no triangles")
    return mesh


def _joined(parts: list[trimesh.Trimesh]) -> trimesh.Trimesh:
    """One mesh of several: textures are packed into one, and where there is a part without a
    texture, each part gets its main colour."""
    if len(parts) == 1:
        return parts[0]
    if any(texture_image(part) is None for part in parts):
        colours = [_main_colour(part) for part in parts]
        if any(colour is not None for colour in colours):
            for part, colour in zip(parts, colours, strict=True):
                visual = trimesh.visual.ColorVisuals(part)
                visual.face_colors = NO_COLOUR if colour is None else colour
                part.visual = visual
    return trimesh.util.concatenate(parts)


def _main_colour(part: trimesh.Trimesh) -> Any:
    """(4,) or (F, 4) colours of a mesh as bytes, or None."""
    if not part.visual.defined:
        return None
    if part.visual.kind != "texture":
        return part.visual.face_colors
    image = texture_image(part)
    if image is not None:
        return np.append(np.asarray(image.convert("RGB")).mean(axis=(0, 1)), 255).astype(np.uint8)
    return part.visual.material.main_color


def _check_numbers(mesh: trimesh.Trimesh, name: str) -> None:
    if len(mesh.faces) == 0:
        raise MeshError(f"{name}: the mesh has no triangles")
    bad = int((~np.isfinite(mesh.vertices)).any(axis=1).sum())
    if bad:
        raise MeshError(f"{name}: {bad} of {len(mesh.vertices)} vertices are NaN or infinite")


def _check_size(mesh: trimesh.Trimesh, name: str, scale: float) -> None:
    extent = float(np.ptp(mesh.vertices[mesh.faces].reshape(-1, 3), axis=0).max())
    if extent == 0.0:
        raise MeshError(f"{name}: all vertices are at one point")
    if not MIN_EXTENT <= extent <= MAX_EXTENT:
        raise MeshError(
            f"{name}: largest extent is {_length(extent)}, but lengths are in metres;"
            f" {_scale_hint(extent / scale)}"
        )


def _scale_hint(extent: float) -> str:
    """Which scales would make something of a mesh with this largest extent in its own unit."""
    fits: dict[str, float] = {}
    for low, high in (USUAL_EXTENT, (MIN_EXTENT, MAX_EXTENT)):
        fits = fits or {u: s for u, s in UNITS.items() if low <= s * extent <= high}
    if not fits:
        scale = 10.0 ** (-1.0 - np.ceil(np.log10(extent)))  # 10 to 100 mm
        return f"try scale={scale:g} (--scale {scale:g})"
    return "looks like " + ", or ".join(
        f"{unit}: scale={scale:g} (--scale {scale:g}) makes it {_length(scale * extent)}"
        for unit, scale in fits.items()
    )


def _length(metres: float) -> str:
    return f"{metres:.4g} m" if metres > 1.0 else f"{1000.0 * metres:.4g} mm"


def _check_volume(surface: trimesh.Trimesh, closed: bool, name: str) -> None:
    extent = surface.extents if len(surface.faces) else np.zeros(3)
    limit = FLAT * extent.max() ** 3
    try:
        hull = float(convex_hull(surface.vertices).volume) if len(surface.faces) else 0.0
    except QhullError:
        hull = 0.0
    if hull <= limit:
        size = " x ".join(f"{1000 * e:.3g}" for e in extent)
        raise MeshError(f"{name}: the mesh is flat ({size} mm); an object needs a volume")
    if closed and abs(signed_volume(surface)) <= limit:
        raise MeshError(
            f"{name}: the closed surface encloses no volume (a sheet without thickness?)"
        )
