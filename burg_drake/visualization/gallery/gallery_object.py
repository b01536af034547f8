"""One object of a gallery: its looks, its pieces, what contact sees, and its resting poses."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pydrake.geometry import Box, Mesh, Meshcat, Rgba
from pydrake.math import RigidTransform, RotationMatrix

from burg_drake.core import Array, rot_z
from burg_drake.core.terminal import distinct_colors
from burg_drake.geometry import hull_mesh
from burg_drake.objects.library import ObjectEntry, ObjectLibrary
from burg_drake.visualization.gallery.layout import ELEVATION, GalleryRow, Item, PlacedGalleryRow
from burg_drake.visualization.meshcat import (
    HydroelasticMesh,
    best_yaw,
    camera_rotation,
    cut_open,
    gltf_mesh,
    label_mesh,
    pressure_colors,
    upright,
)
from burg_drake.visualization.pictures import exploded, grams, share

ROOT = "/drake/library"
COLUMNS = ("visual", "pieces", "contact")
"""Names of the columns, in Meshcat's tree too."""
EXPLODED = 0.25
"""How far pieces are moved outward, as a share of their distance from the object's middle."""
LINE = 0.22
"""Height of a line of text as it is seen, as a share of the gallery's unit."""
LETTER_STRETCH = 1.0 / float(np.sin(ELEVATION))
"""Text on the floor is longer than it is seen."""
CAPTION = 0.85
"""Size of captions, compared with labels."""
TILE = Rgba(0.70, 0.75, 0.79, 1.0)
TILE_HEIGHT = 0.002
"""Of the ground that poses stand on above the floor [m]."""
TILE_MARGIN = 0.04
"""Of that ground around an object, as a share of the gallery's unit."""
RIGID = Rgba(0.72, 0.79, 0.85, 1.0)
EDGES = Rgba(0.70, 0.76, 0.82, 1.0)
MAX_EDGES = 5000
"""Finer surfaces are drawn without the edges of their triangles."""
LIFT = 1e-3
"""Of text above the floor, against flicker [m]."""


@dataclass(frozen=True)
class GalleryObject:
    """One object, ready to be placed.

    Attributes:
        name: of the object.
        R_WO: (3, 3) how it stands in the columns.
        R_WO_poses: the same for each stable pose.
        visual: as it looks, in O.
        pieces: vertices (N, 3), moved apart, and faces (F, 3) of each piece, in O [m].
        contact: what hydroelastic contact sees, in O.
        label: the text at its row's start.
        captions: the texts in front of its things.
        row: sizes of all that.
    """

    name: str
    R_WO: Array
    R_WO_poses: tuple[Array, ...]
    visual: Mesh
    pieces: tuple[tuple[Array, NDArray[np.int64]], ...]
    contact: tuple[HydroelasticMesh, ...]
    label: Mesh
    captions: tuple[tuple[Mesh, float], ...]
    row: GalleryRow


def prepare_object(
    library: ObjectLibrary, name: str, contact: tuple[HydroelasticMesh, ...], unit: float
) -> GalleryObject:
    entry = library.entry(name)
    camera = camera_rotation(ELEVATION)
    meshes = [library.mesh(piece) for piece in entry.pieces]
    hulls = [np.asarray(mesh.vertices) for mesh in meshes]
    corners = np.vstack([*hulls, hull_mesh(library.surface(name).vertices).vertices])

    def turned(R: Array) -> Array:
        return rot_z(best_yaw(corners @ R.T, camera)) @ R

    R_WO = turned(upright(entry))
    poses = [turned(pose.X_SO.matrix()[:3, :3]) for pose in entry.stable_poses]
    apart = [h + o for h, o in zip(hulls, exploded(hulls, EXPLODED), strict=True)]
    touching = np.vstack([m.vertices for m in contact]) if contact else corners
    things = [corners @ R_WO.T, np.vstack(apart) @ R_WO.T, touching @ R_WO.T]
    things += [corners @ R.T for R in poses]
    label, label_width = label_mesh(_description(name, entry), LINE * unit, LETTER_STRETCH)
    size = CAPTION * LINE * unit
    captions = [label_mesh((text,), size, LETTER_STRETCH) for text in _captions(entry, contact)]
    items = [
        Item(points.min(axis=0), points.max(axis=0), width)
        for points, (_, width) in zip(things, captions, strict=True)
    ]
    return GalleryObject(
        name=name,
        R_WO=R_WO,
        R_WO_poses=tuple(poses),
        visual=gltf_mesh(library.path(entry.mesh)),
        pieces=tuple((v, np.asarray(m.faces)) for v, m in zip(apart, meshes, strict=True)),
        contact=contact,
        label=label,
        captions=tuple(captions),
        row=GalleryRow(label_width, items[: len(COLUMNS)], items[len(COLUMNS) :]),
    )


def _description(name: str, entry: ObjectEntry) -> tuple[str, ...]:
    size = " x ".join(f"{1e3 * (b - a):.0f}" for a, b in zip(entry.lower, entry.upper, strict=True))
    about = "" if entry.mass_properties.source == "given" else "~"
    return name, f"{size} mm", f"{about}{grams(entry.mass)}, friction {entry.friction:g}"


def _captions(entry: ObjectEntry, contact: tuple[HydroelasticMesh, ...]) -> list[str]:
    count = len(entry.pieces)
    texts = ["visual", f"{count} piece{'' if count == 1 else 's'}"]
    texts.append(_touching(entry) if contact else "point contact")
    for pose in entry.stable_poses:
        texts.append(share(pose.probability) + (", rolls" if pose.rolls else ""))
    return texts


def _touching(entry: ObjectEntry) -> str:
    if entry.contact.primitive is not None:
        return entry.contact.primitive.shape
    return {
        "surface": "rigid surface to pads",
        "pieces": "rigid pieces",
        "compliant_pieces": "compliant pieces",
        "mesh": "rigid mesh",
    }.get(entry.contact.kind, entry.contact.kind)


def draw_object(
    meshcat: Meshcat, shown: GalleryObject, placed: PlacedGalleryRow, unit: float
) -> None:
    name = shown.name
    write_label(meshcat, f"{ROOT}/labels/{name}", shown.label, placed.p_WL)
    poses = [f"poses/{name}/{k}" for k in range(len(shown.R_WO_poses))]
    homes = [f"{ROOT}/{home}" for home in (*(f"{c}/{name}" for c in COLUMNS), *poses)]
    for k, (home, p_WI) in enumerate(zip(homes, placed.p_WI, strict=True)):
        resting = k - len(COLUMNS)
        R_WO = shown.R_WO if resting < 0 else shown.R_WO_poses[resting]
        lift = np.zeros(3)
        if home == f"{ROOT}/pieces/{name}":
            _draw_pieces(meshcat, f"{home}/object", shown.pieces)
        elif home == f"{ROOT}/contact/{name}":
            _draw_contact(meshcat, f"{home}/object", shown.contact, R_WO)
        else:
            meshcat.SetObject(f"{home}/object", shown.visual)
        if resting >= 0:
            item, margin = shown.row.rest[resting], TILE_MARGIN * unit
            bounds = np.array([item.lower[:2] - margin, item.upper[:2] + margin]) + p_WI[:2]
            draw_slab(meshcat, f"{home}/ground", bounds, 0.0, TILE)
            lift[2] = TILE_HEIGHT
        X_WO = RigidTransform(RotationMatrix(R_WO), p_WI + lift)
        meshcat.SetTransform(f"{home}/object", X_WO)
        caption, width = shown.captions[k]
        write_label(
            meshcat, f"{home}/caption", caption, placed.captions[k] - (width / 2.0, 0.0, 0.0)
        )


def _draw_pieces(
    meshcat: Meshcat, path: str, pieces: tuple[tuple[Array, NDArray[np.int64]], ...]
) -> None:
    colors = distinct_colors(len(pieces))
    for i, ((vertices, faces), color) in enumerate(zip(pieces, colors, strict=True)):
        meshcat.SetTriangleMesh(
            f"{path}/{i:03d}", vertices.T, faces.T.astype(np.int32), Rgba(*color)
        )


def _draw_contact(
    meshcat: Meshcat, path: str, meshes: tuple[HydroelasticMesh, ...], R_WO: Array
) -> None:
    """Rigid surfaces with the edges of their triangles; compliant bodies cut open in front."""
    rigid = [mesh for mesh in meshes if not mesh.compliant]
    if rigid:
        vertices, faces, _ = _joined([(m.vertices, m.faces, m.pressure) for m in rigid])
        meshcat.SetTriangleMesh(f"{path}/surface", vertices, faces, RIGID)
        if faces.shape[1] <= MAX_EDGES:
            meshcat.SetTriangleMesh(f"{path}/edges", vertices, faces, EDGES, wireframe=True)
    compliant = [mesh for mesh in meshes if mesh.compliant]
    if compliant:
        corners = np.vstack([mesh.vertices for mesh in compliant])
        middle = (corners.min(axis=0) + corners.max(axis=0)) / 2.0
        normal = R_WO.T @ _cut_normal(corners @ R_WO.T)
        cut = [cut_open(mesh, middle, normal) for mesh in compliant]
        vertices, faces, pressure = _joined(cut)
        colors = np.asfortranarray(pressure_colors(pressure).T)
        meshcat.SetTriangleColorMesh(f"{path}/field", vertices, faces, colors)


def _cut_normal(points: Array) -> Array:
    """Normal (3,) of the cut through points (N, 3) of which the camera sees more: front or top."""
    _, depth, height = np.ptp(points, axis=0)
    front = height * np.cos(ELEVATION) > depth * np.sin(ELEVATION)
    return np.array([0.0, -1.0, 0.0] if front else [0.0, 0.0, 1.0])


def _joined(
    meshes: Sequence[tuple[Array, NDArray[np.int64], Array]],
) -> tuple[Array, NDArray[np.int32], Array]:
    """Several meshes as one for Meshcat: vertices (3, V), faces (3, F), values (V,)."""
    first = np.cumsum([0, *(len(vertices) for vertices, _, _ in meshes)])
    faces = [f + start for (_, f, _), start in zip(meshes, first, strict=False)]
    return (
        np.asfortranarray(np.vstack([vertices for vertices, _, _ in meshes]).T),
        np.asfortranarray(np.vstack(faces).T.astype(np.int32)),
        np.concatenate([values for _, _, values in meshes]),
    )


def write_label(meshcat: Meshcat, path: str, text: Mesh, p_WL: Array) -> None:
    """Puts a text's left foot at `p_WL` (3,) on the floor [m]."""
    meshcat.SetObject(path, text)
    meshcat.SetTransform(path, RigidTransform(p_WL + np.array([0.0, 0.0, LIFT])))


def draw_slab(meshcat: Meshcat, path: str, bounds: Array, bottom: float, color: Rgba) -> None:
    """A slab between corners (2, 2) in x and y, `TILE_HEIGHT` high."""
    (x0, y0), (x1, y1) = bounds
    meshcat.SetObject(path, Box(x1 - x0, y1 - y0, TILE_HEIGHT), color)
    middle = [(x0 + x1) / 2.0, (y0 + y1) / 2.0, bottom + TILE_HEIGHT / 2.0]
    meshcat.SetTransform(path, RigidTransform(middle))
