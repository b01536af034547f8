"""An object library in Meshcat: visual meshes, convex pieces, contact geometry, poses, grasps."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray
from pydrake.geometry import Box, Mesh, Meshcat, Rgba
from pydrake.math import RigidTransform

from burg_drake.core import (
    Array,
    GraspSet,
    InvalidInputError,
    count_with_noun,
    distinct_colors,
    make_pose,
    rot_z,
)
from burg_drake.geometry import hull_mesh
from burg_drake.objects import ObjectEntry, ObjectLibrary
from burg_drake.visualization.colors import hex_color
from burg_drake.visualization.contact_sheet import mass_text, percent_text
from burg_drake.visualization.gallery_layout import (
    GALLERY_ELEVATION,
    GalleryItem,
    GalleryLayout,
    GalleryRow,
    layout_gallery,
)
from burg_drake.visualization.gltf import draw_label, gltf_mesh, label_mesh
from burg_drake.visualization.grasp_view import grasp_triangles
from burg_drake.visualization.hydroelastic_mesh import (
    HIGH_PRESSURE_COLOR,
    HydroelasticMesh,
    cut_open,
    hydroelastic_meshes,
    pressure_colors,
)
from burg_drake.visualization.legend import LegendEntry
from burg_drake.visualization.meshcat_drawing import aim_at
from burg_drake.visualization.object_drawing import best_yaw, camera_rotation, upright_rotation
from burg_drake.visualization.thumbnails import explosion_offsets

GALLERY_PATH = "/drake/library"  # Path of the gallery in Meshcat's tree.
MAX_COLUMNS = 3
"""Number of columns of the gallery: visual mesh, pieces, contact geometry."""


LINE_HEIGHT = 0.22
"""Apparent height of a line of text, as a share of the gallery's unit."""
TEXT_STRETCH = 1.0 / float(np.sin(GALLERY_ELEVATION))
"""Length of text on the floor over its apparent height."""
SLAB_HEIGHT = 0.002
"""Thickness of floors and of the tiles on which objects stand, in metres."""


GALLERY_FLOOR_COLOR = Rgba(0.90, 0.91, 0.92, 1.0)
GALLERY_FIELD_OF_VIEW_DEG = 22.0
"""Vertical angle of view: little perspective, so that rows at the back are not small."""


def show_library(
    library: ObjectLibrary, meshcat: Meshcat, names: Iterable[str] | None = None
) -> tuple[LegendEntry, ...]:
    """Shows a row for each object: visual mesh, convex pieces, contact geometry, stable poses.

    Paths below `/drake/library`: `labels/NAME`, `visual/NAME`, `pieces/NAME/000`, `contact/NAME`
    and `poses/NAME/0`.

    Args:
        library: library to show.
        meshcat: Meshcat to draw in; anything below that path is replaced.
        names: names of objects, in this order; all if None.

    Returns:
        Legend switches for the columns, for `save_html`.

    Raises:
        UnknownNameError: no such object, or one of its files is missing.
        InvalidInputError: no objects, or Drake cannot load one.
    """
    chosen = list(library.objects if names is None else names)
    if not chosen:
        raise InvalidInputError(f"library {library.root} has no objects to show")
    meshcat.Delete(GALLERY_PATH)
    unit = _usual_size(map(library.entry, chosen))
    contact = hydroelastic_meshes(library, chosen)
    objects = {name: _object_exhibits(library, name, contact[name], unit) for name in chosen}
    labels = [_object_label(library, name, unit) for name in chosen]
    rows = [
        GalleryRow(
            label[1],
            [exhibit.item for exhibit in exhibits[:MAX_COLUMNS]],
            [exhibit.item for exhibit in exhibits[MAX_COLUMNS:]],
        )
        for label, exhibits in zip(labels, objects.values(), strict=True)
    ]
    layout = layout_gallery(rows, unit, TEXT_STRETCH * LINE_HEIGHT * unit)
    for name, label, row in zip(chosen, labels, layout.rows, strict=True):
        left = row.p_WL + np.array([0.5 * label[1], 0.0, 0.0])
        write_label(meshcat, f"{GALLERY_PATH}/labels/{name}", label, left)
        for exhibit, p_WI, p_WL in zip(objects[name], row.p_WI, row.captions, strict=True):
            _draw_exhibit(meshcat, exhibit, p_WI, unit)
            write_label(meshcat, f"{exhibit.path}/caption", exhibit.caption, p_WL)
    _show_floor(meshcat, layout)
    return _gallery_legend(any(m.compliant for meshes in contact.values() for m in meshes))


def _usual_size(entries: Iterable[ObjectEntry]) -> float:
    """Median of the objects' longest sides, the unit of a gallery [m]."""
    return float(np.median([np.max(np.subtract(e.upper, e.lower)) for e in entries]))


def _show_floor(meshcat: Meshcat, layout: GalleryLayout) -> None:
    """Draws the floors of a gallery, and aims camera and lamp at it."""
    for k, bank in enumerate(layout.banks):
        draw_slab(meshcat, f"{GALLERY_PATH}/floor/{k}", bank, -SLAB_HEIGHT, GALLERY_FLOOR_COLOR)
    aim_at_gallery(meshcat, layout)


def aim_at_gallery(meshcat: Meshcat, layout: GalleryLayout) -> None:
    """Aims camera and lamp at a gallery, whose middle is the origin."""
    # Intensities. That of the lamp holds at 1 m.
    lights = {
        "AmbientLight": 0.55,
        "FillLight": 0.0,
        "PointLightNegativeX": 0.0,
        "PointLightPositiveX": 0.0,
        "SpotLight": 2.9,
    }
    lamp_offset = np.array([-1.1, -1.2, 2.4])  # Position of the lamp, in radii of the gallery.
    # Half the lamp's cone, in radians: just covers the gallery, for sharp shadows.
    cone_angle = 0.45
    min_radius = 0.3  # Metres. The lamp's shadow starts at 0.5 m.
    forward = camera_rotation(GALLERY_ELEVATION)[:, 2]
    aim_at(meshcat, layout.corners(), forward, field_of_view_deg=GALLERY_FIELD_OF_VIEW_DEG)
    radius = max(min_radius, float(np.linalg.norm(layout.corners()[:, :2], axis=1).max()))
    p_WL = radius * lamp_offset
    for light, intensity in lights.items():
        power = intensity * float(p_WL @ p_WL) if light == "SpotLight" else intensity
        meshcat.SetProperty(f"/Lights/{light}", "visible", intensity > 0.0)
        meshcat.SetProperty(f"/Lights/{light}/<object>", "intensity", power)
    lamp = "/Lights/SpotLight/<object>"
    meshcat.SetProperty(lamp, "position", p_WL.tolist())
    meshcat.SetProperty(lamp, "angle", cone_angle)


def _gallery_legend(compliant: bool) -> tuple[LegendEntry, ...]:
    """Switches for the columns; `compliant` if any object has a pressure field."""
    contact = "pressure field, cut open" if compliant else "contact surfaces as Drake has them"
    contact_color = hex_color(HIGH_PRESSURE_COLOR) if compliant else "#9eadba"
    entries = (
        ("visual mesh", "#f2f2f2", "visual"),
        ("convex pieces, moved apart", "#4a90c0", "pieces"),
        (contact, contact_color, "contact"),
        ("stable poses, with probability", "#d6dee3", "poses"),
        ("names, sizes, masses (~ from density)", "#40454d", "labels"),
    )
    return tuple(LegendEntry(text, c, (f"{GALLERY_PATH}/{name}",)) for text, c, name in entries)


@dataclass(frozen=True)
class GalleryExhibit:
    """An exhibit of the gallery: an object in one of its representations.

    Attributes:
        path: path in Meshcat's tree.
        R_WO: (3, 3) orientation.
        item: space for the exhibit and its caption.
        caption: text in front of it, and width of the text [m].
        draw: draws the exhibit in its frame O, at a path of Meshcat.
        has_tile: whether it stands on a tile.
    """

    path: str
    R_WO: Array
    item: GalleryItem
    caption: tuple[Mesh, float]
    draw: Callable[[Meshcat, str], None]
    has_tile: bool = False


def _object_exhibits(
    library: ObjectLibrary, name: str, contact: tuple[HydroelasticMesh, ...], unit: float
) -> list[GalleryExhibit]:
    """The columns of an object, then its stable poses; `unit` is the size of a usual object [m]."""
    explosion = 0.25  # Share of each piece's distance from the middle by which it is moved outward.
    entry = library.entry(name)
    meshes = [library.mesh(piece) for piece in entry.pieces]
    hulls = [np.asarray(mesh.vertices) for mesh in meshes]
    corners = np.vstack([*hulls, _hull_corners(library, name)])
    moved_apart = [h + o for h, o in zip(hulls, explosion_offsets(hulls, explosion), strict=True)]
    pieces = [(v, np.asarray(m.faces)) for v, m in zip(moved_apart, meshes, strict=True)]
    touching = np.vstack([m.vertices for m in contact]) if contact else corners
    visual = gltf_mesh(library.path(entry.mesh))

    def draw_visual(meshcat: Meshcat, path: str) -> None:
        meshcat.SetObject(path, visual)

    count = len(pieces)
    kind = _contact_caption(entry) if contact else "point contact"
    R_WO = _turn_to_camera(corners, upright_rotation(entry))
    draw_pieces = partial(_draw_pieces, pieces=pieces)
    draw_contact = partial(_draw_contact, meshes=contact, R_WO=R_WO)
    columns = (
        ("visual", "visual", corners, draw_visual),
        ("pieces", count_with_noun(count, "piece"), np.vstack(moved_apart), draw_pieces),
        ("contact", kind, touching, draw_contact),
    )
    exhibits = []
    for column, text, points, draw in columns:
        caption = _caption_mesh((text,), unit)
        item = _room_for(points @ R_WO.T, caption)
        exhibits.append(
            GalleryExhibit(f"{GALLERY_PATH}/{column}/{name}", R_WO, item, caption, draw)
        )
    for k, pose in enumerate(entry.stable_poses):
        path = f"{GALLERY_PATH}/poses/{name}/{k}"
        R_WO = _turn_to_camera(corners, pose.X_SO.matrix()[:3, :3])
        text = percent_text(pose.probability) + (", rolls" if pose.rolls else "")
        caption = _caption_mesh((text,), unit)
        item = _room_for(corners @ R_WO.T, caption)
        exhibits.append(GalleryExhibit(path, R_WO, item, caption, draw_visual, has_tile=True))
    return exhibits


def _hull_corners(library: ObjectLibrary, name: str) -> Array:
    """Corners (N, 3) of the convex hull of an object in O [m]."""
    return np.asarray(hull_mesh(library.surface(name).vertices).vertices)


def _turn_to_camera(corners: Array, R_SO: Array) -> Array:
    """(3, 3) orientation of a standing object with the best yaw for its corners (N, 3)."""
    return rot_z(best_yaw(corners @ R_SO.T, camera_rotation(GALLERY_ELEVATION))) @ R_SO


def _room_for(points: Array, caption: tuple[Mesh, float]) -> GalleryItem:
    """Space for points (N, 3) around O, along the axes of the world [m]."""
    return GalleryItem(points.min(axis=0), points.max(axis=0), caption[1])


def _caption_mesh(lines: tuple[str, ...], unit: float) -> tuple[Mesh, float]:
    """A caption, smaller than a label, and its width [m]."""
    return label_mesh(lines, 0.85 * LINE_HEIGHT * unit, TEXT_STRETCH)


def _object_label(library: ObjectLibrary, name: str, unit: float) -> tuple[Mesh, float]:
    """Name, size, mass and friction of an object, and the width of the text [m]."""
    entry = library.entry(name)
    size = " x ".join(f"{1e3 * (b - a):.0f}" for a, b in zip(entry.lower, entry.upper, strict=True))
    about = "" if entry.mass_properties.source == "given" else "~"
    mass = f"{about}{mass_text(entry.mass)}, friction {entry.friction:g}"
    return label_mesh((name, f"{size} mm", mass), LINE_HEIGHT * unit, TEXT_STRETCH)


def _contact_caption(entry: ObjectEntry) -> str:
    if entry.contact.primitive is not None:
        return entry.contact.primitive.shape
    return {
        "surface": "rigid surface to pads",
        "pieces": "rigid pieces",
        "compliant_pieces": "compliant pieces",
        "mesh": "rigid mesh",
    }.get(entry.contact.kind, entry.contact.kind)


def _draw_exhibit(meshcat: Meshcat, exhibit: GalleryExhibit, p_WI: Array, unit: float) -> None:
    """Draws an exhibit with its origin at `p_WI` (3,), higher if it stands on a tile [m]."""
    tile_color = Rgba(0.70, 0.75, 0.79, 1.0)
    margin_share = 0.04  # Of the gallery's unit.
    exhibit.draw(meshcat, f"{exhibit.path}/object")
    p_WO = p_WI
    if exhibit.has_tile:
        margin = margin_share * unit
        lower, upper = exhibit.item.lower[:2] - margin, exhibit.item.upper[:2] + margin
        bounds = np.array([lower, upper]) + p_WI[:2]
        draw_slab(meshcat, f"{exhibit.path}/ground", bounds, 0.0, tile_color)
        p_WO = p_WI + np.array([0.0, 0.0, SLAB_HEIGHT])
    X_WO = RigidTransform(make_pose(exhibit.R_WO, p_WO))
    meshcat.SetTransform(f"{exhibit.path}/object", X_WO)


def _draw_pieces(
    meshcat: Meshcat, path: str, pieces: Sequence[tuple[Array, NDArray[np.int64]]]
) -> None:
    """Vertices (N, 3) and faces (F, 3) of convex pieces, each in its own colour."""
    colors = distinct_colors(len(pieces))
    for i, ((vertices, faces), color) in enumerate(zip(pieces, colors, strict=True)):
        meshcat.SetTriangleMesh(
            f"{path}/{i:03d}", vertices.T, faces.T.astype(np.int32), Rgba(*color)
        )


def _draw_contact(
    meshcat: Meshcat, path: str, meshes: tuple[HydroelasticMesh, ...], R_WO: Array
) -> None:
    """Rigid surfaces with the edges of their triangles; compliant bodies cut open in front."""
    surface_color = Rgba(0.72, 0.79, 0.85, 1.0)
    edge_color = Rgba(0.70, 0.76, 0.82, 1.0)
    max_triangles = 5000  # Finer surfaces are drawn without edges.
    rigid = [mesh for mesh in meshes if not mesh.compliant]
    if rigid:
        vertices, faces, _ = _join_meshes([(m.vertices, m.faces, m.pressure) for m in rigid])
        meshcat.SetTriangleMesh(f"{path}/surface", vertices, faces, surface_color)
        if faces.shape[1] <= max_triangles:
            meshcat.SetTriangleMesh(f"{path}/edges", vertices, faces, edge_color, wireframe=True)
    compliant = [mesh for mesh in meshes if mesh.compliant]
    if compliant:
        corners = np.vstack([mesh.vertices for mesh in compliant])
        middle = (corners.min(axis=0) + corners.max(axis=0)) / 2.0
        normal = R_WO.T @ _cut_normal(corners @ R_WO.T)
        cut = [cut_open(mesh, middle, normal) for mesh in compliant]
        vertices, faces, pressure = _join_meshes(cut)
        colors = np.asfortranarray(pressure_colors(pressure).T)
        meshcat.SetTriangleColorMesh(f"{path}/field", vertices, faces, colors)


def _cut_normal(points: Array) -> Array:
    """Normal (3,) of the cut through points (N, 3), front or top, whichever shows more area."""
    _, depth, height = np.ptp(points, axis=0)
    front = height * np.cos(GALLERY_ELEVATION) > depth * np.sin(GALLERY_ELEVATION)
    return np.array([0.0, -1.0, 0.0] if front else [0.0, 0.0, 1.0])


def _join_meshes(
    meshes: Sequence[tuple[Array, NDArray[np.int64], Array]],
) -> tuple[Array, NDArray[np.int32], Array]:
    """Joins meshes for Meshcat: vertices (3, V), faces (3, F), values (V,)."""
    vertices, faces, values = zip(*meshes, strict=True)
    first = np.cumsum([0, *map(len, vertices)])
    shifted = [f + start for f, start in zip(faces, first, strict=False)]
    return (
        np.asfortranarray(np.vstack(vertices).T),
        np.asfortranarray(np.vstack(shifted).T.astype(np.int32)),
        np.concatenate(values),
    )


def write_label(meshcat: Meshcat, path: str, label: tuple[Mesh, float], p_WL: Array) -> None:
    """Writes a text on the floor, with the middle of its foot at `p_WL` (3,) [m]."""
    text_lift = 1e-3  # Metres above the floor, against flicker.
    draw_label(meshcat, path, label, make_pose(p_AB=p_WL + np.array([0.0, 0.0, text_lift])))


def draw_slab(meshcat: Meshcat, path: str, bounds: Array, bottom: float, color: Rgba) -> None:
    """Draws a slab between corners (2, 2) in x and y, `SLAB_HEIGHT` high."""
    (x0, y0), (x1, y1) = bounds
    meshcat.SetObject(path, Box(x1 - x0, y1 - y0, SLAB_HEIGHT), color)
    middle = [(x0 + x1) / 2.0, (y0 + y1) / 2.0, bottom + SLAB_HEIGHT / 2.0]
    meshcat.SetTransform(path, RigidTransform(middle))


def show_objects_for_grasps(
    library: ObjectLibrary, grasps: GraspSet, width: Array, meshcat: Meshcat
) -> Array:
    """Shows the objects of grasps in rows and aims the camera. Does not draw the grasps.

    Args:
        library: library of the objects.
        grasps: at least one grasp.
        width: (N,) distance between the fingers of the drawn grasps [m].
        meshcat: Meshcat to draw in; anything below `/drake/library` is replaced.

    Returns:
        `X_WG` (N, 4, 4) of the grasps.

    Raises:
        UnknownNameError: no such object, or its mesh is missing.
    """
    meshcat.Delete(GALLERY_PATH)
    counts = Counter(grasps.object.tolist())
    unit = _usual_size(map(library.entry, counts))
    exhibits = [_object_with_grasps(library, name, grasps, width, unit) for name in counts]
    layout, rows = _layout_rows(exhibits, unit)
    X_WO = {}
    for members, row in zip(rows, layout.rows, strict=True):
        for (name, exhibit), p_WI, p_WL in zip(members, row.p_WI, row.captions, strict=True):
            X_WO[name] = make_pose(exhibit.R_WO, p_WI)
            exhibit.draw(meshcat, exhibit.path)
            meshcat.SetTransform(exhibit.path, RigidTransform(X_WO[name]))
            write_label(meshcat, f"{GALLERY_PATH}/labels/{name}", exhibit.caption, p_WL)
    _show_floor(meshcat, layout)
    return np.stack([X_WO[name] for name in grasps.object.tolist()]) @ grasps.X_OG


def _object_with_grasps(
    library: ObjectLibrary, name: str, grasps: GraspSet, width: Array, unit: float
) -> tuple[str, GalleryExhibit]:
    """Name of an object, and the object with space for its grasps."""
    corners = _hull_corners(library, name)
    R_WO = _turn_to_camera(corners, upright_rotation(library.entry(name)))
    own = grasps.object == name
    drawn, _ = grasp_triangles(grasps.X_OG[own], width[own])
    count = int(own.sum())
    caption = _caption_mesh((name, count_with_noun(count, "grasp")), unit)
    item = _room_for(np.vstack([corners, drawn.T]) @ R_WO.T, caption)
    visual = gltf_mesh(library.path(library.entry(name).mesh))
    path = f"{GALLERY_PATH}/visual/{name}"
    return name, GalleryExhibit(path, R_WO, item, caption, lambda m, p: m.SetObject(p, visual))


def _layout_rows(
    exhibits: list[tuple[str, GalleryExhibit]], unit: float
) -> tuple[GalleryLayout, list[list[tuple[str, GalleryExhibit]]]]:
    """Divides objects into the number of rows that lets the camera come nearest."""
    layouts = []
    for count in range(1, len(exhibits) + 1):
        size = -(-len(exhibits) // count)
        rows = [exhibits[k : k + size] for k in range(0, len(exhibits), size)]
        items = [GalleryRow(0.0, (), [exhibit.item for _, exhibit in row]) for row in rows]
        layouts.append((layout_gallery(items, unit, TEXT_STRETCH * LINE_HEIGHT * unit, 1), rows))
    return min(layouts, key=lambda layout: layout[0].distance())
