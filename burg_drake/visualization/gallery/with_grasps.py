"""Objects of a library beside each other, each as it stands, with room for its grasps."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

import numpy as np
from pydrake.geometry import Mesh, Meshcat
from pydrake.math import RigidTransform

from burg_drake.core import Array, make_pose, rot_z
from burg_drake.core.grasps import GraspSet
from burg_drake.geometry import hull_mesh
from burg_drake.objects.library import ObjectLibrary
from burg_drake.visualization.gallery.gallery_object import (
    CAPTION,
    LETTER_STRETCH,
    LINE,
    ROOT,
    TILE_HEIGHT,
    draw_slab,
    write_label,
)
from burg_drake.visualization.gallery.layout import (
    ELEVATION,
    GalleryLayout,
    GalleryRow,
    Item,
    lay_out,
)
from burg_drake.visualization.gallery.library import FLOOR, aim
from burg_drake.visualization.grasps import grasp_triangles
from burg_drake.visualization.meshcat import (
    best_yaw,
    camera_rotation,
    gltf_mesh,
    label_mesh,
    upright,
)

TEXT_ROOM = 1.0
"""Height of the line for which the gallery is laid out, compared with that of a line of text: it
has room for one and a half, and captions of two smaller ones stand in it."""


@dataclass(frozen=True)
class ObjectWithGrasps:
    """An object that is to be placed.

    Attributes:
        name: of the object.
        R_WO: (3, 3) how it stands.
        item: room for it and its grasps.
        caption: what is written in front of it, and how wide that is [m].
    """

    name: str
    R_WO: Array
    item: Item
    caption: tuple[Mesh, float]


def show_with_grasps(
    library: ObjectLibrary, grasps: GraspSet, width: Array, meshcat: Meshcat
) -> Array:
    """Shows the objects of grasps in rows and aims the camera; the grasps are left to draw.

    Args:
        library: of the objects.
        grasps: at least one.
        width: (N,) at which they will be drawn [m].
        meshcat: where, below `/drake/library`; what was there before is removed.

    Returns:
        `X_WG` (N, 4, 4) of the grasps.

    Raises:
        UnknownNameError: no such object, or its mesh is missing.
    """
    meshcat.Delete(ROOT)
    counts = Counter(grasps.object.tolist())
    entries = [library.entry(name) for name in counts]
    unit = float(np.median([np.max(np.subtract(e.upper, e.lower)) for e in entries]))
    stands = [_object_with_grasps(library, name, grasps, width, unit) for name in counts]
    layout, rows = _in_rows(stands, unit)
    X_WO = {}
    for members, row in zip(rows, layout.rows, strict=True):
        for stand, p_WO, p_WL in zip(members, row.p_WI, row.captions, strict=True):
            X_WO[stand.name] = make_pose(stand.R_WO, p_WO)
            path, (label, label_width) = f"{ROOT}/visual/{stand.name}", stand.caption
            meshcat.SetObject(path, gltf_mesh(library.path(library.entry(stand.name).mesh)))
            meshcat.SetTransform(path, RigidTransform(X_WO[stand.name]))
            left = p_WL - (label_width / 2.0, 0.0, 0.0)
            write_label(meshcat, f"{ROOT}/labels/{stand.name}", label, left)
    for k, bank in enumerate(layout.banks):
        draw_slab(meshcat, f"{ROOT}/floor/{k}", bank, -TILE_HEIGHT, FLOOR)
    aim(meshcat, layout)
    return np.stack([X_WO[name] for name in grasps.object.tolist()]) @ grasps.X_OG


def _object_with_grasps(
    library: ObjectLibrary, name: str, grasps: GraspSet, width: Array, unit: float
) -> ObjectWithGrasps:
    corners = np.asarray(hull_mesh(library.surface(name).vertices).vertices)
    R_WO = upright(library.entry(name))
    R_WO = rot_z(best_yaw(corners @ R_WO.T, camera_rotation(ELEVATION))) @ R_WO
    own = grasps.object == name
    drawn, _ = grasp_triangles(grasps.X_OG[own], width[own])
    points = np.vstack([corners, drawn.T]) @ R_WO.T
    count = int(own.sum())
    text = (name, f"{count} grasp{'' if count == 1 else 's'}")
    caption = label_mesh(text, CAPTION * LINE * unit, LETTER_STRETCH)
    return ObjectWithGrasps(
        name, R_WO, Item(points.min(axis=0), points.max(axis=0), caption[1]), caption
    )


def _in_rows(
    stands: list[ObjectWithGrasps], unit: float
) -> tuple[GalleryLayout, list[list[ObjectWithGrasps]]]:
    """As many rows, one behind the other, as let the camera come nearest."""
    layouts = []
    for count in range(1, len(stands) + 1):
        size = -(-len(stands) // count)
        rows = [stands[k : k + size] for k in range(0, len(stands), size)]
        items = [GalleryRow(0.0, (), [stand.item for stand in row]) for row in rows]
        layouts.append((lay_out(items, unit, TEXT_ROOM * LETTER_STRETCH * LINE * unit, 1), rows))
    return min(layouts, key=lambda layout: layout[0].distance())
