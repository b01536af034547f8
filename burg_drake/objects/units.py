"""Length units of meshes, and a hint at the right unit if a size is implausible."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from burg_drake.core import MeshError, UnknownNameError, suggest_names

UNITS = {"mm": 1e-3, "cm": 1e-2, "m": 1.0, "in": 0.0254}
"""Units of meshes, in metres."""


MAX_EXTENT = 2.5  # Metres; above it the unit is taken to be wrong.
MIN_EXTENT = 1e-3  # Metres.
USUAL_EXTENTS = (0.01, 1.0)  # Metres, of nearly all objects on a table.


def unit_scale(name: str) -> float:
    """Factor from a unit to metres.

    Example::

        scale = burg.objects.unit_scale("mm")
        can = burg.ObjectSource.from_file("can.stl", scale=scale, mass=0.35)

    Args:
        name: a key of `UNITS`, such as `mm`.

    Raises:
        UnknownNameError: there is no such unit; the message lists them.
    """
    if name not in UNITS:
        raise UnknownNameError(f"unit {name!r} is not known; {suggest_names(name, UNITS)}")
    return UNITS[name]


def format_length(metres: float) -> str:
    """A length as text for messages: in millimetres, or in metres above one metre."""
    return f"{metres:.4g} m" if metres > 1.0 else f"{1000.0 * metres:.4g} mm"


def check_extent(extent: float, name: str, scale: float) -> None:
    """Checks a size.

    Args:
        extent: largest extent, scaled [m].
        name: how messages call the mesh.
        scale: factor that the mesh was scaled by.

    Raises:
        MeshError: the size tells of a wrong unit; it has those that would do.
    """
    if extent == 0.0:
        raise MeshError(f"{name}: all vertices are at one point")
    if not MIN_EXTENT <= extent <= MAX_EXTENT:
        units = _fitting_units(extent / scale)
        error = MeshError(
            f"{name}: taken as metres, the mesh is {format_length(extent)} long; "
            f"{_unit_hint(extent / scale, units)}"
        )
        error.units = tuple(units)
        raise error


def _fitting_units(extent: float) -> dict[str, float]:
    """Units and scales with which a mesh of this largest extent, in its own unit, gets a usual
    size, or else a possible one."""
    for low, high in (USUAL_EXTENTS, (MIN_EXTENT, MAX_EXTENT)):
        if fits := {u: s for u, s in UNITS.items() if low <= s * extent <= high}:
            return fits
    return {}


def _unit_hint(extent: float, units: Mapping[str, float]) -> str:
    """Advice on the unit of a mesh with this largest extent in its own unit."""
    if not units:
        scale = 10.0 ** (-1.0 - np.ceil(np.log10(extent)))  # 10 to 100 mm
        return f"try scale={scale:g}"
    return "try " + " or ".join(
        f"unit {unit} (scale={scale:g} makes it {format_length(scale * extent)})"
        for unit, scale in units.items()
    )
