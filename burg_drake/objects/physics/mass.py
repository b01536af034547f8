"""Mass properties of solids of uniform density, or as given; and which of them are implausible."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, cast

import numpy as np
import trimesh

from burg_drake.core import Array, InvalidInputError
from burg_drake.core.documents import Vector3
from burg_drake.objects.library import Inertia, MassProperties

DEFAULT_DENSITY = 300.0
"""Density where neither mass nor density is given [kg/m^3]. It is a guess between things that are
mostly air and solid ones: the published masses of six YCB objects (boxes of food, cans, a full
bottle) over the volumes of their scans give 190 to 1090. Give the mass where it matters."""

LIGHTEST, DENSEST = 10.0, 9000.0
"""Range of the mean density of household things [kg/m^3]: from expanded polystyrene, 10 to 50, to
copper, 8960 (CRC Handbook of Chemistry and Physics); steel has 7850. Closed containers that are
empty are as light as foam, as their volume counts as filled."""

AIR = 1.2
"""Density of air at 20 degC and 1013 hPa [kg/m^3] (International Standard Atmosphere: 1.20)."""

GYRATION = 0.05
"""Least radius of gyration of a thing, about the axis where it is largest, as a share of half the
diagonal of its bounding box; a slender rod has 0.58, a cube 0.41."""

TRIANGLE = 1e-6
"""Principal moments may miss the triangle inequality by this share of the largest: rounded ones of
a flat thing do."""


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
    solid: Solid,
    mass: float | None = None,
    density: float | None = None,
    *,
    center_of_mass: Vector3 | None = None,
    inertia: Inertia | None = None,
    wall_thickness: float | None = None,
    bounds: Array | None = None,
) -> MassProperties:
    """Mass, centre of mass and inertia.

    Args:
        solid: geometry; that of the wall of a hollow body, see `shell.solid_of_shell`.
        mass: [kg]; goes before `density`.
        density: of the material [kg/m^3]; `DEFAULT_DENSITY` if neither is given.
        center_of_mass: `p_OOcm` in place of the centroid [m]. Without `inertia`, the inertia is
            that of uniform density about the centroid, taken to be that about the centre of mass:
            right where a heavy part sits near the given centre, and else an estimate.
        inertia: Ixx, Iyy, Izz, Ixy, Ixz, Iyz about the centre of mass in the axes of O [kg m^2].
        wall_thickness: of the hollow body that `solid` is [m]; only noted in the result.
        bounds: (2, 3) corners of the bounding box in O [m]; a given centre of mass must be inside.

    Raises:
        InvalidInputError: mass or density is not a positive number, the centre of mass lies
            outside the bounding box, or no distribution of mass has that inertia.
    """
    for name, value, unit in (("mass", mass, "kg"), ("density", density, "kg/m^3")):
        if value is not None and not (np.isfinite(value) and value > 0.0):
            raise InvalidInputError(
                f"{name} is {value:g} {unit}; for a free object it must be above 0"
            )
    source: Literal["given", "density"] = "density" if mass is None else "given"
    if mass is None:
        mass = (DEFAULT_DENSITY if density is None else density) * solid.volume
    overridden: list[Literal["center_of_mass", "inertia"]] = []
    centre = solid.p_OOcm
    if center_of_mass is not None:
        overridden.append("center_of_mass")
        centre = _checked_centre(center_of_mass, bounds)
    I = mass * solid.G_OOcm  # noqa: E741
    moments = (*np.diag(I).tolist(), I[0, 1], I[0, 2], I[1, 2])
    if inertia is not None:
        overridden.append("inertia")
        _check_inertia(inertia)
        moments = inertia
    return MassProperties(
        mass=float(mass),
        source=source,
        volume=solid.volume,
        center_of_mass=cast(Vector3, tuple(np.asarray(centre, dtype=float).tolist())),
        inertia=cast(Inertia, tuple(map(float, moments))),
        wall_thickness=wall_thickness,
        overridden=tuple(overridden),
    )


def inertia_matrix(inertia: Inertia) -> Array:
    """(3, 3) of Ixx, Iyy, Izz, Ixy, Ixz, Iyz."""
    xx, yy, zz, xy, xz, yz = inertia
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def implausible(properties: MassProperties, lower: Vector3, upper: Vector3) -> tuple[str, ...]:
    """What no household thing of this size has, one sentence each; empty if all is plausible.

    Args:
        properties: in the object frame O.
        lower, upper: corners of the bounding box in O [m].
    """
    low, high = np.asarray(lower, dtype=float), np.asarray(upper, dtype=float)
    mass, box = properties.mass, float(np.prod(high - low))
    half_diagonal = 0.5 * float(np.linalg.norm(high - low))
    found = []
    density = mass / properties.volume
    if not LIGHTEST <= density <= DENSEST:
        rare = "lighter than foam" if density < LIGHTEST else "denser than copper"
        found.append(
            f"density is {density:.3g} kg/m^3 ({mass:.3g} kg in "
            f"{1e6 * properties.volume:.3g} cm^3), {rare}: usual are {LIGHTEST:g} to "
            f"{DENSEST:g}; check the mass and the unit of length"
        )
    if mass < AIR * box:
        found.append(
            f"mass is {mass:.3g} kg, less than that of the air in its bounding box; check the"
            " mass and the unit of length"
        )
    if mass > DENSEST * box:
        found.append(
            f"mass is {mass:.3g} kg, more than a bounding box full of copper has; check the"
            " mass and the unit of length"
        )
    gyration = np.sqrt(np.linalg.eigvalsh(inertia_matrix(properties.inertia))[-1] / mass)
    if not GYRATION * half_diagonal <= gyration <= half_diagonal:
        found.append(
            f"inertia is too large: its radius of gyration is {1e3 * gyration:.3g} mm,"
            f" but half the diagonal of the bounding box is {1e3 * half_diagonal:.3g} mm;"
            " give kg m^2 about the centre of mass"
        )
    centre = np.asarray(properties.center_of_mass)
    if (centre < low).any() or (centre > high).any():
        found.append(f"centre of mass {_outside(centre, low, high)}")
    return tuple(found)


def _outside(centre: Array, low: Array, high: Array) -> str:
    a, b, c = (np.round(v, 6).tolist() for v in (centre, low, high))
    return f"{a} lies outside the bounding box {b} to {c} (metres, object frame)"


def _checked_centre(center_of_mass: Vector3, bounds: Array | None) -> Array:
    centre = np.asarray(center_of_mass, dtype=float)
    if centre.shape != (3,) or not np.isfinite(centre).all():
        raise InvalidInputError(f"center_of_mass is {center_of_mass}; expected three numbers [m]")
    if bounds is not None and ((centre < bounds[0]) | (centre > bounds[1])).any():
        raise InvalidInputError(f"center_of_mass {_outside(centre, bounds[0], bounds[1])}")
    return centre


def _check_inertia(inertia: Inertia) -> None:
    if len(inertia) != 6 or not np.isfinite(inertia).all():
        raise InvalidInputError(
            f"inertia is {list(inertia)}; expected Ixx, Iyy, Izz, Ixy, Ixz, Iyz [kg m^2]"
        )
    a, b, c = np.linalg.eigvalsh(inertia_matrix(inertia)).tolist()
    principal = f"its principal moments are {a:.3g}, {b:.3g} and {c:.3g} kg m^2"
    if a <= 0.0:
        raise InvalidInputError(
            f"inertia is not positive definite: {principal}; all must be above 0"
        )
    if c > (a + b) + TRIANGLE * c:
        raise InvalidInputError(
            f"no body has this inertia: {principal}; the largest must be at most the sum"
            " of the others"
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
