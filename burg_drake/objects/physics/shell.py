"""Mass integrals of hollow bodies: a closed surface with a wall of uniform thickness inside it."""

from __future__ import annotations

import numpy as np
import trimesh

from burg_drake.core import InvalidInputError
from burg_drake.objects.meshes import folded, offsets, signed_volume
from burg_drake.objects.physics.mass import Solid, solid_of_surface

FOLDED = 0.2
"""Share of the area that may turn over when the wall's inner side is made: at the creases of a
scan and in dents narrower than the wall."""

THIN = 0.15
"""Share of the area that may have no room for two walls behind it, as at the rims of a
can (a tenth of its area) or near the edge of a wedge."""

INWARD = 1e-6
"""Rays start this far inside the surface, as a share of its size, so that they do not meet it."""


def solid_of_shell(surface: trimesh.Trimesh, thickness: float) -> Solid:
    """The wall between a closed surface and the surface that lies the thickness inside it.

    Exact where three planes or fewer meet at each vertex: a box's inner side is the smaller box.

    Args:
        surface: outer side [m]; closed, wound outward.
        thickness: of the wall [m].

    Raises:
        InvalidInputError: the wall is not above 0, or thicker than the body has room for.
    """
    if not (np.isfinite(thickness) and thickness > 0.0):
        raise InvalidInputError(f"wall_thickness is {thickness:g} m; it must be above 0")
    room = _room(surface)
    offset = surface.vertices - thickness * offsets(surface)
    inner = trimesh.Trimesh(offset, surface.faces[:, ::-1], process=False)
    fits = folded(surface, offset) <= FOLDED and signed_volume(inner) < 0.0
    if 2.0 * thickness > room or not fits:
        most = min(0.5 * room, thickness)
        raise InvalidInputError(
            f"wall_thickness is {1e3 * thickness:.3g} mm, which is too much for this"
            f" body; give less than {1e3 * most:.2g} mm, or leave it out for a solid body"
        )
    return solid_of_surface(trimesh.util.concatenate([surface.copy(), inner]))


def _room(surface: trimesh.Trimesh) -> float:
    """How far it is from the surface, straight inward, to the other side [m], at the least but for
    a share `THIN` of the area."""
    areas = surface.area_faces
    sound = areas > 1e-9 * areas.sum() / len(areas)
    normals, centres = surface.face_normals[sound], surface.triangles_center[sound]
    start = centres - INWARD * surface.scale * normals
    hits, rays, _ = surface.ray.intersects_location(start, -normals, multiple_hits=False)
    depth = np.full(len(start), np.inf)
    depth[rays] = np.linalg.norm(hits - centres[rays], axis=1)
    order = np.argsort(depth)
    share = np.cumsum(areas[sound][order]) / areas.sum()
    return float(depth[order][np.searchsorted(share, THIN)])
