"""Contact sheet of a library: a card with pictures and properties for each object."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import burg_drake
from burg_drake.core import atomic_write, count_with_noun
from burg_drake.objects import ContactGeometry, ObjectEntry, ObjectLibrary, StablePose
from burg_drake.visualization.html_page import render_page
from burg_drake.visualization.thumbnails import ObjectRenderer

CONTACT_KIND_NAMES = {
    "surface": "surface to pads, convex pieces to others",
    "pieces": "convex pieces, rigid",
    "compliant_pieces": "convex pieces, compliant",
    "mesh": "surface mesh, rigid",
    "primitive": "primitive",
}
"""Names of `ContactGeometry.kind` for people."""


def write_contact_sheet(
    library: ObjectLibrary,
    path: str | Path,
    names: Iterable[str] | None = None,
    *,
    remarks: Mapping[str, Sequence[str]] | None = None,
) -> None:
    """Writes the page.

    Args:
        library: library to show.
        path: file to write.
        names: names of objects, in this order; all if None.
        remarks: warnings about objects, as sentences, by name.

    Raises:
        UnknownNameError: no such object, or one of its files is missing.
        InvalidInputError: an object cannot be shown, or the page cannot be written.
        MissingDependencyError: a system library of the renderer is missing.
    """
    chosen = list(library.objects if names is None else names)
    renderer = ObjectRenderer(library, chosen)
    cards = [_object_card(library, name, renderer) for name in chosen]
    poses = sum(len(library.entry(name).stable_poses) for name in chosen)
    page = render_page(
        "visualization/contact_sheet.html.jinja",
        library=library,
        about=f"{count_with_noun(len(chosen), 'object')}, {count_with_noun(poses, 'stable pose')}",
        cards=cards,
        remarks=remarks or {},
        version=burg_drake.__version__,
    )
    atomic_write(path, page)


def _object_card(library: ObjectLibrary, name: str, renderer: ObjectRenderer) -> dict[str, Any]:
    """Values of an object's card, for the template."""
    pose_size = (160, 120)  # Pixels.
    entry = library.entry(name)
    poses = [
        (
            renderer.portrait(name, pose_size, stable_pose=k),
            percent_text(pose.probability),
            pose_note(pose),
        )
        for k, pose in enumerate(entry.stable_poses)
    ]
    return {
        "name": name,
        "description": entry.description,
        "portrait": renderer.portrait(name),
        "pieces": renderer.pieces(name),
        "piece_count": count_with_noun(len(entry.pieces), "piece"),
        "figures": _object_figures(entry),
        "poses": poses,
        "notes": surface_notes(library, name),
        "source": _source_line(entry),
    }


def surface_notes(library: ObjectLibrary, name: str) -> list[str]:
    """Notes on repairs of a mesh, and on whether it is closed, as sentences."""
    repairs = list(dict.fromkeys(library.entry(name).source.repairs))
    closed = bool(library.surface(name).is_watertight)
    state = "The surface is closed." if closed else "The surface is open."
    if not repairs:
        return [f"{state} Nothing had to be repaired."]
    return [f"{state} Repairs: {'; '.join(repairs)}."]


def percent_text(probability: float) -> str:
    """A probability in percent, with enough digits not to read as zero."""
    percent = 100.0 * probability
    return f"{percent:.0f} %" if percent >= 9.95 else f"{percent:.1f} %"


def pose_note(pose: StablePose) -> str:
    """Properties of a stable pose other than its probability."""
    notes = ["rolls"] if pose.rolls else []
    if pose.residual is not None:
        notes.append(f"tilt {math.degrees(pose.residual):.1f}°")
    return ", ".join(notes)


def contact_name(contact: ContactGeometry) -> str:
    """Name of a contact geometry, in words."""
    if contact.primitive is None:
        return CONTACT_KIND_NAMES[contact.kind]
    lengths = " x ".join(_length_text(s) for s in contact.primitive.size)
    return f"{contact.primitive.shape} {lengths} mm"


def _source_line(entry: ObjectEntry) -> str:
    """Source of an object."""
    file = entry.source.file or "made by code"
    scaled = "" if entry.source.scale == 1.0 else f", times {entry.source.scale:g}"
    return file + scaled


def _object_figures(entry: ObjectEntry) -> dict[str, str]:
    """Properties of an object by name."""
    mass = entry.mass_properties
    size = [b - a for a, b in zip(entry.lower, entry.upper, strict=True)]
    pieces = entry.contact.kind in ("surface", "pieces", "compliant_pieces")
    fit = entry.fit if pieces else entry.contact.fit
    about = "" if mass.source == "given" else "~"
    wall = mass.wall_thickness
    figures = {
        "Size [mm]": " × ".join(_length_text(s) for s in size),
        "Mass": about + mass_text(mass.mass),
        "Density": f"{_three_digits(mass.mass / mass.volume)} kg/m³",
        "Contact": contact_name(entry.contact),
        "Volume ratio": f"{fit.volume_ratio:.2f}" if fit else "not measured",
        "Hausdorff distance": f"{1e3 * fit.hausdorff:.1f} mm" if fit else "not measured",
        "Friction": f"{entry.friction:g}",
        "Volume": f"{_three_digits(1e6 * mass.volume)} cm³",
        "Body": "solid" if wall is None else f"hollow, wall {1e3 * wall:.1f} mm",
    }
    if mass.overridden:
        given = " and ".join(what.replace("_", " ") for what in mass.overridden)
        figures["Given by the user"] = given
    return figures


def mass_text(mass: float) -> str:
    """A mass [kg] for people."""
    return f"{_three_digits(mass)} kg" if mass >= 0.9995 else f"{_three_digits(1e3 * mass)} g"


def _three_digits(value: float) -> str:
    """A number with three significant digits, without exponent."""
    digits = 2 - math.floor(math.log10(value)) if value > 0.0 else 0
    return f"{round(value, digits):.{max(digits, 0)}f}"


def _length_text(length: float) -> str:
    return f"{1e3 * length:.0f}" if length >= 0.00995 else f"{1e3 * length:.1f}"
