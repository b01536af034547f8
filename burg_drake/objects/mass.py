"""Mass properties of solids of uniform density."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, cast

import numpy as np
import trimesh

from burg_drake.core.errors import InvalidInputError
from burg_drake.core.frames import Array
from burg_drake.core.schema import Vector3
from burg_drake.objects.library import MassProperties

DEFAULT_DENSITY = 300.0
"""Density where neither mass nor density is given [kg/m^3]. It is a guess between things that are
mostly air and solid ones: the published masses of six YCB objects (boxes of food, cans, a full
bottle) over the volumes of their scans give 190 to 1090. Give the mass where it matters."""


@dataclass(frozen=True, eq=False)
class Solid:
    """Geometry of a solid as mass properties need it.

    Attributes:
        volume: [m^3].
        p_OOcm: (3,) centroid in O [m].
        G_OOcm: (3, 3) inertia about the centroid in the axes of O, per unit of mass [m^2].
    """

    volume: float
    p_OOcm: Array
    G_OOcm: Array


def solid_of_surface(surface: trimesh.Trimesh) -> Solid:
    """Exact integrals over the polyhedron inside a closed surface, cavities left out.

    Args:
        surface: watertight, wound outward.

    Raises:
        InvalidInputError: the surface encloses no positive volume.
    """
    return _combined([surface])


def solid_of_pieces(pieces: Sequence[trimesh.Trimesh]) -> Solid:
    """The sum of convex pieces; where pieces overlap, the overlap counts for each of them.

    Args:
        pieces: convex, wound outward.
    """
    return _combined(pieces)


def mass_properties(
    solid: Solid, mass: float | None = None, density: float | None = None
) -> MassProperties:
    """Mass, centre of mass and inertia.

    Args:
        solid: geometry.
        mass: [kg]; goes before `density`.
        density: [kg/m^3]; `DEFAULT_DENSITY` if neither is given.

    Raises:
        InvalidInputError: mass or density is not a positive number.
    """
    for name, value, unit in (("mass", mass, "kg"), ("density", density, "kg/m^3")):
        if value is not None and not (np.isfinite(value) and value > 0.0):
            raise InvalidInputError(f"{name} is {value:g} {unit}; a free object needs one above 0")
    source: Literal["given", "density"] = "density" if mass is None else "given"
    if mass is None:
        mass = (DEFAULT_DENSITY if density is None else density) * solid.volume
    inertia = mass * solid.G_OOcm
    moments = (*np.diag(inertia).tolist(), inertia[0, 1], inertia[0, 2], inertia[1, 2])
    return MassProperties(
        mass=float(mass),
        source=source,
        volume=solid.volume,
        center_of_mass=cast(Vector3, tuple(solid.p_OOcm.tolist())),
        inertia=cast("tuple[float, float, float, float, float, float]", tuple(map(float, moments))),
    )


def _combined(meshes: Sequence[trimesh.Trimesh]) -> Solid:
    volume, first, second = 0.0, np.zeros(3), np.zeros((3, 3))
    origin = np.mean([m.bounds.mean(axis=0) for m in meshes], axis=0)
    for mesh in meshes:
        v, f, s = _moments(mesh.triangles - origin)
        volume, first, second = volume + v, first + f, second + s
    if not volume > 0.0:
        raise InvalidInputError("the surface encloses no volume; its normals must point outward")
    centroid = first / volume
    covariance = second / volume - np.outer(centroid, centroid)
    G = np.trace(covariance) * np.eye(3) - covariance
    return Solid(float(volume), centroid + origin, 0.5 * (G + G.T))


def _moments(triangles: Array) -> tuple[float, Array, Array]:
    """Integrals of 1, x and x x^T over the tetrahedra from the origin to each triangle."""
    det = np.einsum("ij,ij->i", triangles[:, 0], np.cross(triangles[:, 1], triangles[:, 2]))
    total = triangles.sum(axis=1)
    outer = np.einsum("i,ij,ik->jk", det, total, total) + np.einsum(
        "i,imj,imk->jk", det, triangles, triangles
    )
    return float(det.sum() / 6.0), (det[:, None] * total).sum(axis=0) / 24.0, outer / 120.0
