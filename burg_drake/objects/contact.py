"""Contact geometry of an object in simulation: a primitive, convex pieces, or a mesh."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import trimesh
from scipy.spatial import cKDTree

from burg_drake.core import Array, MeshError, count_with_noun
from burg_drake.geometry import triangle_distances
from burg_drake.objects.closed_surfaces import coarser_surfaces, decimate
from burg_drake.objects.library import ContactGeometry, ContactKind, Fit, ObjectLibrary
from burg_drake.objects.model_files import write_piece
from burg_drake.objects.primitives import fit_primitive, nearest_primitive
from burg_drake.objects.shape_fit import surface_distance, union_mesh
from burg_drake.objects.symmetry import spread_samples

MAX_CONTACT_DISTANCE = 2.5e-4
"""Metres between the object's surface and the contact surface, either way."""

MAX_NORMAL_ANGLE = float(np.deg2rad(10.0))
"""Radians from which a normal counts as turned; 3/4 of the friction cone for friction 0.24."""

MAX_TURNED_SHARE = 0.05
"""Share of the area whose normals may be turned, for example next to moved edges."""


AVERAGING_RADIUS = 2e-3  # Metres; less than half a pad. Faces of scans vary within it.
RESULT_SAMPLES = 20_000  # Points on the contact surface.
OBJECT_SAMPLES = 60_000  # Points on the object's surface.
NEAREST_FACES = 8  # Faces compared for each point.
AVERAGED_NORMALS = 24  # Points whose normals are averaged.


def contact_surface(surface: trimesh.Trimesh, closed: bool) -> tuple[trimesh.Trimesh, Fit]:
    """The coarsest surface within `MAX_CONTACT_DISTANCE` and `MAX_TURNED_SHARE`.

    Args:
        surface: surface of the object [m].
        closed: whether the surface is watertight, wound outward.

    Returns:
        The surface, closed and wound outward, and its fit.

    Raises:
        MeshError: there is no such surface; the message says why.
    """
    max_faces = 10_000  # More faces cost more in simulation than they gain.
    decimals = 7  # Decimals of coordinates in metres.
    max_mean_to_bound = 0.8  # Mean distance of a surface worth checking, over the bound.
    min_height = 1e-6  # Metres; Drake finds no normal of a face with a smaller height.
    if not closed:
        raise MeshError("its surface is not closed")
    normals = SurfaceNormals(surface)
    for rung in reversed(coarser_surfaces(surface, max_mean_to_bound * MAX_CONTACT_DISTANCE)):
        if len(rung.faces) > max_faces:
            break
        mesh = trimesh.Trimesh(np.round(rung.vertices, decimals), rung.faces, process=False)
        if min_face_height(mesh) < min_height or normals.turned_share(mesh) > MAX_TURNED_SHARE:
            continue
        distance = surface_distance(mesh, surface, MAX_CONTACT_DISTANCE)
        if distance <= MAX_CONTACT_DISTANCE:
            return mesh, Fit(volume_ratio=float(mesh.volume / surface.volume), hausdorff=distance)
    raise MeshError(
        f"its surface cannot be reduced to {max_faces} faces without being more than "
        f"{1e3 * MAX_CONTACT_DISTANCE:g} mm or {np.rad2deg(MAX_NORMAL_ANGLE):g} degrees off"
    )


class SurfaceNormals:
    """The normals of a surface, local and averaged over the neighbourhood.

    Args:
        surface: surface [m].
    """

    def __init__(self, surface: trimesh.Trimesh) -> None:
        self.triangles = np.asarray(surface.triangles)
        self.normals = np.asarray(surface.face_normals)
        self.samples, self.sample_faces = spread_samples(surface, OBJECT_SAMPLES)
        self.candidate_faces = np.concatenate([self.sample_faces, np.arange(len(self.triangles))])
        self.point_tree = cKDTree(np.vstack([self.samples, self.triangles.mean(axis=1)]))
        self.sample_tree = cKDTree(self.samples)
        alike = AVERAGING_RADIUS * self.normals[self.sample_faces]
        self.oriented_tree = cKDTree(np.hstack([self.samples, alike]))

    def turned_share(self, mesh: trimesh.Trimesh) -> float:
        """Share of a mesh's area whose normals differ by more than `MAX_NORMAL_ANGLE` from both the
        nearest and the averaged normals of the surface."""
        points, face = spread_samples(mesh, RESULT_SAMPLES)
        normals = np.asarray(mesh.face_normals)[face]
        own = self._nearest_normals(points, normals)
        mean = self._mean_normals(points, own)
        cosine = np.maximum((own * normals).sum(axis=1), (mean * normals).sum(axis=1))
        return float((cosine < np.cos(MAX_NORMAL_ANGLE)).mean())

    def _nearest_normals(self, points: Array, normals: Array) -> Array:
        """Normals (N, 3) of the surface at the nearest points. Within `MAX_CONTACT_DISTANCE`,
        points that face the same way are preferred, as the other side of a thin wall may be
        nearer."""
        _, near = self.point_tree.query(points, min(NEAREST_FACES, len(self.candidate_faces)))
        _, alike = self.oriented_tree.query(
            np.hstack([points, AVERAGING_RADIUS * normals]), NEAREST_FACES
        )
        which = np.hstack([self.candidate_faces[near], self.sample_faces[alike]])
        apart = triangle_distances(points[:, None], self.triangles[which])
        facing = (self.normals[which] * normals[:, None]).sum(axis=2) > 0.0
        near_and_facing = facing & (apart <= MAX_CONTACT_DISTANCE)
        apart -= np.where(near_and_facing, MAX_CONTACT_DISTANCE, 0.0)
        return np.asarray(self.normals[which[np.arange(len(points)), apart.argmin(axis=1)]])

    def _mean_normals(self, points: Array, own: Array) -> Array:
        """Mean surface normals (N, 3) around points, of the parts that face the same way as
        `own`."""
        distance, around = self.sample_tree.query(
            points, AVERAGED_NORMALS, distance_upper_bound=AVERAGING_RADIUS
        )
        within = np.isfinite(distance)
        others = self.normals[self.sample_faces[np.where(within, around, 0)]]
        facing = within & ((others * own[:, None]).sum(axis=2) > 0.0)
        mean = (others * facing[..., None]).sum(axis=1)
        length = np.linalg.norm(mean, axis=1, keepdims=True)
        return np.asarray(mean / np.maximum(length, 1e-300))


def max_excess(mesh: trimesh.Trimesh, pieces: Sequence[trimesh.Trimesh]) -> float:
    """Largest distance by which a surface stands out of the union of convex pieces [m]."""
    points = np.vstack([mesh.vertices, spread_samples(mesh, RESULT_SAMPLES)[0]])
    height = np.full(len(points), np.inf)
    for piece in pieces:
        planes = np.asarray(piece.face_normals)
        offset = (planes * piece.triangles[:, 0]).sum(axis=1)
        for some in np.array_split(np.arange(len(points)), max(1, len(planes) // 100)):
            above = (points[some] @ planes.T - offset).max(axis=1)
            height[some] = np.minimum(height[some], above)
    return max(0.0, float(height.max()))


def min_face_height(mesh: trimesh.Trimesh) -> float:
    """Smallest height of a face over its longest edge [m]."""
    t = np.asarray(mesh.triangles)
    longest = np.linalg.norm(t - np.roll(t, 1, axis=1), axis=2).max(axis=1)
    return float((2.0 * mesh.area_faces / np.maximum(longest, 1e-300)).min())


CONTACT_FILE = "contact.obj"
"""File name of the mesh of kinds `surface` and `mesh`, in the object's folder."""

CONTACT_MESH_FACES = 2000
"""Target number of faces of a contact mesh of kind `mesh`."""


MESH_REPAIR_HINT = "make the mesh watertight and smooth it"
"""Advice that gives most objects a surface that the pads can touch."""


def contact_geometry(
    kind: ContactKind | None,
    surface: trimesh.Trimesh,
    closed: bool,
    pieces: Sequence[trimesh.Trimesh],
    folder: Path,
) -> ContactGeometry:
    """Chooses the contact geometry of an object.

    Args:
        kind: the kind that the user asked for. None: a primitive if one fits, else the surface if
            it is closed and can be decimated, else the pieces.
        surface: surface of the object [m].
        closed: whether the surface is watertight, so that its volume can be trusted.
        pieces: the object's convex pieces; at least one for the kind `surface`.
        folder: the object's folder; the mesh of kinds `surface` and `mesh` is written into it.

    Returns:
        The contact geometry, whose mesh is relative to `folder`.

    Raises:
        MeshError: the object is not near any primitive, not closed, or cannot be decimated, and
            `kind` needs it.
    """
    if kind == "mesh":
        return _write_contact_mesh(surface, closed, folder)
    if kind in ("pieces", "compliant_pieces"):
        return ContactGeometry(kind=kind)
    if kind != "surface":
        volume = float(surface.volume) if closed else float(union_mesh(pieces).volume)
        found = fit_primitive(surface, volume)
        if found is not None:
            primitive, fit = found
            return ContactGeometry(kind="primitive", primitive=primitive, fit=fit)
        if kind == "primitive":
            raise MeshError(_primitive_error_message(surface, volume))
    try:
        mesh, fit = contact_surface(surface, closed)
    except MeshError as error:
        if kind == "surface":
            raise MeshError(
                f"contact 'surface': {error}; {MESH_REPAIR_HINT}, or choose 'pieces'"
            ) from error
        return ContactGeometry(reason=str(error))
    write_piece(mesh, folder / CONTACT_FILE)
    excess = max_excess(mesh, pieces)
    return ContactGeometry(kind="surface", mesh=CONTACT_FILE, fit=fit, excess=excess)


def contact_fallback_message(contact: ContactGeometry, pieces: int) -> str:
    """Message for an object whose pads touch pieces although these were not asked for, else empty.

    Args:
        contact: contact geometry of the object.
        pieces: number of convex pieces.
    """
    if not contact.reason:
        return ""
    return (
        f"finger pads touch {count_with_noun(pieces, 'convex piece')}, because {contact.reason};"
        f" {MESH_REPAIR_HINT}, or accept that by 'contact: pieces' in an objects.yaml"
    )


def describe_pad_contact(library: ObjectLibrary, name: str) -> str:
    """Names the shape that gripper pads touch, such as `a cylinder, at most 0.2 mm from the mesh`.

    Raises:
        UnknownNameError: no such object, or the file of its surface is missing.
        MeshError: the file of its surface is damaged.
    """
    entry = library.entry(name)
    contact = entry.contact
    if contact.primitive is not None:
        what = f"a {contact.primitive.shape}"
    elif contact.mesh:
        what = f"a surface with {len(library.mesh(contact.mesh).faces)} faces"
    else:
        return count_with_noun(len(entry.pieces), "convex piece")
    if contact.fit is None:
        return what
    return f"{what}, at most {1e3 * contact.fit.hausdorff:.2g} mm from the mesh"


def _write_contact_mesh(surface: trimesh.Trimesh, closed: bool, folder: Path) -> ContactGeometry:
    if not closed:
        raise MeshError(
            "contact 'mesh' needs a closed surface; repair the mesh, or choose 'pieces'"
        )
    mesh, _ = decimate(surface, CONTACT_MESH_FACES)
    write_piece(mesh, folder / CONTACT_FILE)
    fit = Fit(
        volume_ratio=float(mesh.volume / surface.volume), hausdorff=surface_distance(surface, mesh)
    )
    return ContactGeometry(kind="mesh", mesh=CONTACT_FILE, fit=fit)


def _primitive_error_message(surface: trimesh.Trimesh, volume: float) -> str:
    nearest = nearest_primitive(surface, volume)
    text = "contact 'primitive': no box, cylinder or sphere comes close to its volume"
    if nearest is not None:
        primitive, fit = nearest
        text = (
            f"contact 'primitive': the nearest, a {primitive.shape}, is"
            f" {1e3 * fit.hausdorff:.1f} mm off"
        )
    return f"{text}; choose 'pieces', or leave contact out"
