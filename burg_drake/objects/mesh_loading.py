"""Loading of an object's mesh: scaled to metres, checked, repaired and closed."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import trimesh
from scipy.spatial import QhullError

from burg_drake.core import Array, MeshError, make_pose
from burg_drake.geometry import convex_hull
from burg_drake.objects.closed_surfaces import decimate, is_closed, unite_bodies
from burg_drake.objects.mesh_file import (
    check_triangles,
    make_opaque,
    mesh_name,
    read_mesh,
    source_rgba,
    texture_image,
)
from burg_drake.objects.mesh_repair import (
    MAX_SELF_OVERLAP,
    RepairedMesh,
    repair,
    self_overlap,
    signed_volume,
)
from burg_drake.objects.model_files import face_palette
from burg_drake.objects.open_surfaces import Openings, close_openings
from burg_drake.objects.units import check_extent

MIN_VOLUME_SHARE = 1e-6
"""Volume over extent cubed below which a mesh is flat; a sheet of paper has 5e-4."""

R_ZUP_YUP = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
"""Rotation from glTF's y-up to z-up."""


@dataclass(frozen=True, kw_only=True)
class Preparation:
    """Preparation of surfaces that are open or very fine.

    Attributes:
        wall_thickness: thickness of the wall that an open surface becomes [m]; if None, 2 mm, or 2
            % of the mesh's diagonal if that is less. A perfectly flat surface becomes a wall only
            if a thickness is given.
        openings: how to close a surface whose openings are too wide to be small holes: as a `wall`
            centred on it (a towel, a bowl that is a single sheet), or with flat caps over its
            openings (`close`: a scan that lacks its underside).
        max_faces: closed surfaces with more faces are decimated, as more faces do not improve
            contact, mass and resting poses; scans with the usual 16 thousand stay as they are. A
            wall, with its two sides, may have twice as many.
    """

    wall_thickness: float | None = None
    openings: Openings = "wall"
    max_faces: int = 20_000

    def __post_init__(self) -> None:
        thickness = self.wall_thickness
        if thickness is not None and not 0.0 < thickness < float("inf"):
            raise MeshError(f"wall_thickness is {thickness:g} m; it must be above 0")
        if self.openings not in ("wall", "close"):
            raise MeshError(f"openings is {self.openings!r}; it must be 'wall' or 'close'")


@dataclass(frozen=True, eq=False)
class SurfaceMesh:
    """A checked surface in metres, in the object frame O.

    Attributes:
        surface: geometry for physics: vertices merged, winding outward.
        visual: geometry for display: the surface, or, if the source has a texture or a few face
            colours, its own triangles with these (neither thickened nor decimated).
        repairs: what was changed, one sentence each.
        closed: whether the surface is watertight with consistent winding.
        rgba: main colour of the source, if it has one and neither texture nor a few face colours.
        wall: thickness of the wall that an open surface became [m]; None for other surfaces.
    """

    surface: trimesh.Trimesh
    visual: trimesh.Trimesh
    repairs: tuple[str, ...]
    closed: bool
    rgba: tuple[float, float, float, float] | None = None
    wall: float | None = None


def load_mesh(
    mesh: str | Path | trimesh.Trimesh, scale: float = 1.0, preparation: Preparation = Preparation()
) -> SurfaceMesh:
    """Loads, checks and repairs a mesh.

    Args:
        mesh: file (one of `MESH_FORMATS`; a scene of several bodies becomes one mesh), or a mesh in
            memory.
        scale: factor from the mesh's unit to metres, such as `unit_scale("mm")`.
        preparation: how to prepare an open or very fine surface.

    Raises:
        MeshError: file missing or unreadable, no faces, NaN vertices, flat, or a size that suggests
            a wrong unit.
    """
    name = mesh_name(mesh)
    if not (np.isfinite(scale) and scale > 0.0):
        raise MeshError(
            f"{name}: scale is {scale:g}; give the size of the mesh's unit in metres, such as 0.001"
        )
    sentences: list[str] = []
    if isinstance(mesh, trimesh.Trimesh):
        raw = mesh.copy()
    else:
        raw = _read_mesh_z_up(Path(mesh))
        if Path(mesh).suffix.lower() in (".glb", ".gltf"):
            sentences.append("turned from glTF's y-up to z-up")
    _check_coordinates(raw, name)
    if (alpha := make_opaque(raw)) is not None:
        sentences.append(
            f"made colours opaque, as some had an alpha of {alpha:.2g}; set rgba in an"
            " objects.yaml for a translucent object"
        )
    if scale != 1.0:
        raw.apply_scale(scale)
        sentences.append(f"scaled by {scale:g}")
    check_extent(_max_extent(raw), name, scale)
    repaired, wall = _close_surface(raw, name, preparation)
    surface = repaired.mesh
    pictured = texture_image(raw) is not None or face_palette(raw) is not None
    if pictured and repaired.inverted:
        raw.invert()
    return SurfaceMesh(
        surface,
        raw if pictured else surface,
        (*sentences, *repaired.sentences),
        is_closed(surface),
        None if pictured else source_rgba(raw),
        wall,
    )


def check_size(mesh: str | Path | trimesh.Trimesh, scale: float) -> None:
    """Checks only the size of a mesh, in a small part of the time of `load_mesh`.

    Args:
        mesh: file, or a mesh in memory.
        scale: factor from the mesh's unit to metres.

    Raises:
        MeshError: the file cannot be read, or its size suggests a wrong unit.
    """
    raw = mesh if isinstance(mesh, trimesh.Trimesh) else read_mesh(Path(mesh))
    _check_coordinates(raw, mesh_name(mesh))
    check_extent(scale * _max_extent(raw), mesh_name(mesh), scale)


def read_piece(file: Path, scale: float) -> trimesh.Trimesh:
    """Reads a convex piece of an object [m] from a mesh file in the object's own frame and unit.

    Raises:
        MeshError: the file cannot be read.
    """
    piece = _read_mesh_z_up(file)
    piece.merge_vertices(merge_tex=True, merge_norm=True)
    return piece.apply_scale(scale)


def _read_mesh_z_up(file: Path) -> trimesh.Trimesh:
    """Reads a mesh file with z up; glTF, with y up, is rotated."""
    mesh = read_mesh(file)
    if file.suffix.lower() in (".glb", ".gltf"):
        mesh.apply_transform(make_pose(R_ZUP_YUP))
    return mesh


def _max_extent(mesh: trimesh.Trimesh) -> float:
    """Largest extent of its faces along an axis."""
    return float(np.ptp(mesh.vertices[mesh.faces].reshape(-1, 3), axis=0).max())


def _close_surface(
    raw: trimesh.Trimesh, name: str, preparation: Preparation
) -> tuple[RepairedMesh, float | None]:
    """The repaired and closed surface, and the thickness of the wall if it became one."""
    check_triangles(len(raw.faces), name)
    repaired = repair(raw)
    if preparation.openings == "wall" and not is_closed(repaired.mesh):
        check_triangles(len(repaired.mesh.faces), name, wall=True)
    if preparation.wall_thickness is None or not len(repaired.mesh.faces):
        _check_hull(repaired.mesh, name)
    wall = close_openings(repaired, preparation.openings, preparation.wall_thickness)
    surface = repaired.mesh
    _check_hull(surface, name)
    if not is_closed(surface):
        return repaired, wall
    if abs(signed_volume(surface)) <= MIN_VOLUME_SHARE * surface.extents.max() ** 3:
        raise MeshError(
            f"{name}: the closed surface encloses no volume (is it a sheet without"
            " thickness?); give only one side of it, as an open surface, and it becomes"
            " a wall"
        )
    surface, joined = unite_bodies(surface)
    surface, coarser = decimate(surface, preparation.max_faces * (1 if wall is None else 2))
    repaired.mesh = surface
    repaired.sentences += joined + coarser
    overlap_share = self_overlap(surface)
    if overlap_share > MAX_SELF_OVERLAP:
        repaired.sentences.append(
            f"the surface passes through itself: about {100.0 * overlap_share:.2g} % of its"
            " volume counts twice or is inside out, so mass properties may be that far"
            " off"
        )
    return repaired, wall


def _check_coordinates(mesh: trimesh.Trimesh, name: str) -> None:
    faces, count = np.asarray(mesh.faces), len(mesh.vertices)
    if len(faces) == 0:
        raise MeshError(f"{name}: the mesh has no triangles")
    wrong = np.nonzero(((faces < 0) | (faces >= count)).any(axis=1))[0]
    if len(wrong):
        raise MeshError(
            f"{name}: {len(wrong)} of {len(faces)} triangles refer to vertices that do not exist,"
            f" such as {faces[wrong[0]].tolist()} of {count} vertices (counted from 0)"
        )
    bad = int((~np.isfinite(mesh.vertices)).any(axis=1).sum())
    if bad:
        raise MeshError(f"{name}: {bad} of {len(mesh.vertices)} vertices are NaN or infinite")


def _check_hull(surface: trimesh.Trimesh, name: str) -> None:
    extent = surface.extents if len(surface.faces) else np.zeros(3)
    limit = MIN_VOLUME_SHARE * extent.max() ** 3
    points = np.asarray(surface.vertices)
    # a quick test with few points, which mostly suffices
    if _hull_volume(_extreme_points(points)) <= limit and _hull_volume(points) <= limit:
        size = " x ".join(f"{1000 * e:.3g}" for e in extent)
        cure = "wall_thickness makes it a wall"
        if is_closed(surface):
            cure = "give only one of its two sides, as an open surface, with wall_thickness"
        raise MeshError(
            f"{name}: the mesh is flat ({size} mm), but an object needs a volume: {cure}"
        )


def _extreme_points(points: Array) -> Array:
    """The points (N, 3) that are farthest along the principal axes and the axes of O."""
    if not len(points):
        return points
    centred = points - points.mean(axis=0)
    axes = np.vstack([np.linalg.eigh(centred.T @ centred)[1].T, np.eye(3)])
    along = centred @ axes.T
    return np.asarray(points[np.unique([along.argmin(axis=0), along.argmax(axis=0)])])


def _hull_volume(points: Array) -> float:
    """Volume of the convex hull of points (N, 3) [m^3]; 0 if they lie in a plane."""
    try:
        return float(convex_hull(points).volume) if len(points) else 0.0
    except QhullError:
        return 0.0
