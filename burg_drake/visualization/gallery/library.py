"""An object library in Meshcat: what each object looks like, what touches others, how it rests."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from pydrake.geometry import Meshcat, Rgba

from burg_drake.core import InvalidInputError
from burg_drake.objects.library import ObjectLibrary
from burg_drake.visualization.gallery.gallery_object import (
    LETTER_STRETCH,
    LINE,
    ROOT,
    TILE_HEIGHT,
    GalleryObject,
    draw_object,
    draw_slab,
    prepare_object,
)
from burg_drake.visualization.gallery.layout import ELEVATION, GalleryLayout, lay_out
from burg_drake.visualization.meshcat import (
    HIGH_PRESSURE,
    aim_at,
    camera_rotation,
    hydroelastic_meshes,
)
from burg_drake.visualization.style import LegendEntry

FLOOR = Rgba(0.90, 0.91, 0.92, 1.0)
FIELD_OF_VIEW_DEG = 22.0
"""Vertical angle of view: little perspective, so that rows in the back are not small."""
LIGHTS = {
    "AmbientLight": 0.55,
    "FillLight": 0.0,
    "PointLightNegativeX": 0.0,
    "PointLightPositiveX": 0.0,
    "SpotLight": 2.9,
}
"""Intensities; that of the lamp, which casts shadows, at a distance of 1 m."""
LAMP = np.array([-1.1, -1.2, 2.4])
"""Where the lamp is, in radii of the gallery."""
LAMP_ANGLE = 0.45
"""Half the lamp's cone [rad]: it just covers the gallery, for sharp shadows."""
MIN_RADIUS = 0.3
"""Smaller galleries are lit as if they were this large [m]: the lamp's shadow starts at 0.5 m."""


def show_library(
    library: ObjectLibrary, meshcat: Meshcat, names: Iterable[str] | None = None
) -> tuple[LegendEntry, ...]:
    """Shows a row for each object: its looks, its convex pieces, what contact sees, stable poses.

    All is below `/drake/library`: `labels/NAME`, `visual/NAME`, `pieces/NAME/000`, `contact/NAME`
    and `poses/NAME/0`.

    Args:
        library: what to show.
        meshcat: where; what it showed below that path before is removed.
        names: of objects, in this order; all if None.

    Returns:
        Switches for the columns, to be given to `save_html`.

    Raises:
        UnknownNameError: no such object, or one of its files is missing.
        InvalidInputError: no objects, or Drake cannot load one.
    """
    chosen = list(library.objects if names is None else names)
    if not chosen:
        raise InvalidInputError(f"library {library.root} has no objects to show")
    meshcat.Delete(ROOT)
    entries = [library.entry(name) for name in chosen]
    unit = float(np.median([np.max(np.subtract(e.upper, e.lower)) for e in entries]))
    contact = hydroelastic_meshes(library, chosen)
    objects = [prepare_object(library, name, contact[name], unit) for name in chosen]
    layout = lay_out([e.row for e in objects], unit, LETTER_STRETCH * LINE * unit)
    for item, placed in zip(objects, layout.rows, strict=True):
        draw_object(meshcat, item, placed, unit)
    for k, bank in enumerate(layout.banks):
        draw_slab(meshcat, f"{ROOT}/floor/{k}", bank, -TILE_HEIGHT, FLOOR)
    aim(meshcat, layout)
    return _legend(objects)


def aim(meshcat: Meshcat, layout: GalleryLayout) -> None:
    """Aims camera and lamp at a gallery, whose middle is the origin."""
    forward = camera_rotation(ELEVATION)[:, 2]
    aim_at(meshcat, layout.corners(), forward, field_of_view_deg=FIELD_OF_VIEW_DEG)
    radius = max(MIN_RADIUS, float(np.linalg.norm(layout.corners()[:, :2], axis=1).max()))
    p_WL = radius * LAMP
    for light, intensity in LIGHTS.items():
        power = intensity * float(p_WL @ p_WL) if light == "SpotLight" else intensity
        meshcat.SetProperty(f"/Lights/{light}", "visible", intensity > 0.0)
        meshcat.SetProperty(f"/Lights/{light}/<object>", "intensity", power)
    lamp = "/Lights/SpotLight/<object>"
    meshcat.SetProperty(lamp, "position", p_WL.tolist())
    meshcat.SetProperty(lamp, "angle", LAMP_ANGLE)


def _legend(objects: Sequence[GalleryObject]) -> tuple[LegendEntry, ...]:
    compliant = any(mesh.compliant for e in objects for mesh in e.contact)
    contact = "pressure field, cut open" if compliant else "contact surfaces as Drake has them"
    red = "#" + "".join(f"{round(255 * c):02x}" for c in HIGH_PRESSURE)
    return (
        LegendEntry("visual mesh", "#f2f2f2", (f"{ROOT}/visual",)),
        LegendEntry("convex pieces, moved apart", "#4a90c0", (f"{ROOT}/pieces",)),
        LegendEntry(contact, red if compliant else "#9eadba", (f"{ROOT}/contact",)),
        LegendEntry("stable poses, with probability", "#d6dee3", (f"{ROOT}/poses",)),
        LegendEntry("names, sizes, masses (~ from density)", "#40454d", (f"{ROOT}/labels",)),
    )
