"""Mass properties: uniform density, shells of constant thickness, or given values.

Implausible values are reported.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, cast

import numpy as np
import trimesh

from burg_drake.core import Array, InvalidInputError, Vector3
from burg_drake.objects.library import Inertia, MassProperties
from burg_drake.objects.mesh_repair import signed_volume
from burg_drake.objects.open_surfaces import folded_share, vertex_offsets

DEFAULT_DENSITY = 300.0
"""kg/m^3, if neither mass nor density is given; scans of YCB objects have 190 to 1090."""


@dataclass(frozen=True, eq=False)
class Solid:
    """Volume, centroid and second moments of a solid.

    Attributes:
        volume: volume [m^3].
        p_OOcm: (3,) centroid in O [m].
        G_OOcm: (3, 3) inertia about the centroid in the axes of O, per unit of mass [m^2].
    """

    volume: float
    p_OOcm: Array
    G_OOcm: Array


def solid_of_surface(surface: trimesh.Trimesh) -> Solid:
    """Exact integrals over the polyhedron inside a closed surface, cavities left out.

    Args:
        surface: watertight surface, wound outward.

    Raises:
        InvalidInputError: the surface encloses no positive volume.
    """
    return solid_of_pieces([surface])


def solid_of_pieces(pieces: Sequence[trimesh.Trimesh]) -> Solid:
    """Sum of the integrals over convex pieces; overlaps count for each piece.

    Args:
        pieces: convex pieces, wound outward.
    """
    volume, first, second = 0.0, np.zeros(3), np.zeros((3, 3))
    origin = np.mean([m.bounds.mean(axis=0) for m in pieces], axis=0)
    for mesh in pieces:
        v, f, s = _tetrahedron_integrals(mesh.triangles - origin)
        volume, first, second = volume + v, first + f, second + s
    if not volume > 0.0:
        raise InvalidInputError("the surface encloses no volume; its normals must point outward")
    centroid = first / volume
    covariance = second / volume - np.outer(centroid, centroid)
    G = np.trace(covariance) * np.eye(3) - covariance
    return Solid(float(volume), centroid + origin, 0.5 * (G + G.T))


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
        solid: geometry; that of the wall of a hollow body, see `solid_of_shell`.
        mass: mass [kg]; has precedence over `density`.
        density: density of the material [kg/m^3]; `DEFAULT_DENSITY` if neither is given.
        center_of_mass: `p_OOcm` in place of the centroid [m]. Without `inertia`, the inertia of
            uniform density about the centroid is used about this centre: correct if a heavy part
            sits near it, otherwise an estimate.
        inertia: Ixx, Iyy, Izz, Ixy, Ixz, Iyz about the centre of mass in the axes of O [kg m^2].
        wall_thickness: thickness of a hollow body's wall [m]; only copied to the result.
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
        centre = _check_center_of_mass(center_of_mass, bounds)
    I_OOcm = mass * solid.G_OOcm
    moments = (*np.diag(I_OOcm).tolist(), I_OOcm[0, 1], I_OOcm[0, 2], I_OOcm[1, 2])
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
    """Inertia matrix (3, 3) of Ixx, Iyy, Izz, Ixy, Ixz, Iyz."""
    xx, yy, zz, xy, xz, yz = inertia
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def implausible_properties(
    properties: MassProperties, lower: Vector3, upper: Vector3
) -> tuple[str, ...]:
    """Mass properties that are implausible for a household object of this size, a sentence each.

    Args:
        properties: mass properties in the object frame O.
        lower, upper: corners of the bounding box in O [m].
    """
    min_density = 10.0  # kg/m^3; expanded polystyrene has 10 to 50.
    max_density = 9000.0  # kg/m^3; copper has 8960.
    air_density = 1.2  # kg/m^3 at 20 degC and 1013 hPa.
    min_gyration_share = 0.05  # Radius of gyration over half the diagonal; a cube has 0.41.
    low, high = np.asarray(lower, dtype=float), np.asarray(upper, dtype=float)
    mass, box = properties.mass, float(np.prod(high - low))
    half_diagonal = 0.5 * float(np.linalg.norm(high - low))
    found = []
    density = mass / properties.volume
    if not min_density <= density <= max_density:
        rare = "lighter than foam" if density < min_density else "denser than copper"
        found.append(
            f"density is {density:.3g} kg/m^3 ({mass:.3g} kg in "
            f"{1e6 * properties.volume:.3g} cm^3), {rare}: usual are {min_density:g} to "
            f"{max_density:g}; check the mass and the unit of length"
        )
    if mass < air_density * box:
        found.append(
            f"mass is {mass:.3g} kg, less than that of the air in its bounding box; check the"
            " mass and the unit of length"
        )
    if mass > max_density * box:
        found.append(
            f"mass is {mass:.3g} kg, more than a bounding box full of copper has; check the"
            " mass and the unit of length"
        )
    gyration = np.sqrt(np.linalg.eigvalsh(inertia_matrix(properties.inertia))[-1] / mass)
    if not min_gyration_share * half_diagonal <= gyration <= half_diagonal:
        found.append(
            f"inertia is too large: its radius of gyration is {1e3 * gyration:.3g} mm,"
            f" but half the diagonal of the bounding box is {1e3 * half_diagonal:.3g} mm;"
            " give kg m^2 about the centre of mass"
        )
    centre = np.asarray(properties.center_of_mass)
    if (centre < low).any() or (centre > high).any():
        found.append(f"centre of mass {_outside_message(centre, low, high)}")
    return tuple(found)


def _outside_message(centre: Array, low: Array, high: Array) -> str:
    a, b, c = (np.round(v, 6).tolist() for v in (centre, low, high))
    return f"{a} lies outside the bounding box {b} to {c} (metres, object frame)"


def _check_center_of_mass(center_of_mass: Vector3, bounds: Array | None) -> Array:
    centre = np.asarray(center_of_mass, dtype=float)
    if centre.shape != (3,) or not np.isfinite(centre).all():
        raise InvalidInputError(f"center_of_mass is {center_of_mass}; expected three numbers [m]")
    if bounds is not None and ((centre < bounds[0]) | (centre > bounds[1])).any():
        raise InvalidInputError(f"center_of_mass {_outside_message(centre, bounds[0], bounds[1])}")
    return centre


def _check_inertia(inertia: Inertia) -> None:
    tolerance = 1e-6  # Share of the largest moment; rounded moments of flat objects miss by it.
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
    if c > (a + b) + tolerance * c:
        raise InvalidInputError(
            f"no body has this inertia: {principal}; the largest must be at most the sum"
            " of the others"
        )


def _tetrahedron_integrals(triangles: Array) -> tuple[float, Array, Array]:
    """Integrals of 1, x and x x^T over the tetrahedra from the origin to each triangle."""
    det = np.einsum("ij,ij->i", triangles[:, 0], np.cross(triangles[:, 1], triangles[:, 2]))
    total = triangles.sum(axis=1)
    outer = np.einsum("i,ij,ik->jk", det, total, total) + np.einsum(
        "i,imj,imk->jk", det, triangles, triangles
    )
    return float(det.sum() / 6.0), (det[:, None] * total).sum(axis=0) / 24.0, outer / 120.0


def solid_of_shell(surface: trimesh.Trimesh, thickness: float) -> Solid:
    """The wall between a closed surface and its inner surface, offset inward by the thickness.

    Exact where three planes or fewer meet at each vertex: a box's inner side is the smaller box.

    Args:
        surface: outer side [m]; closed, wound outward.
        thickness: thickness of the wall [m].

    Raises:
        InvalidInputError: the wall is not above 0, or thicker than the body has room for.
    """
    max_folded_share = 0.2  # Share of the area that may turn over, at creases and narrow dents.
    if not (np.isfinite(thickness) and thickness > 0.0):
        raise InvalidInputError(f"wall_thickness is {thickness:g} m; it must be above 0")
    room = _depth_inside_surface(surface)
    offset = surface.vertices - thickness * vertex_offsets(surface)
    inner = trimesh.Trimesh(offset, surface.faces[:, ::-1], process=False)
    fits = folded_share(surface, offset) <= max_folded_share and signed_volume(inner) < 0.0
    if 2.0 * thickness > room or not fits:
        most = min(0.5 * room, thickness)
        raise InvalidInputError(
            f"wall_thickness is {1e3 * thickness:.3g} mm, which is too much for this"
            f" body; give less than {1e3 * most:.2g} mm, or leave it out for a solid body"
        )
    return solid_of_surface(trimesh.util.concatenate([surface.copy(), inner]))


def _depth_inside_surface(surface: trimesh.Trimesh) -> float:
    """Smallest distance straight inward from the surface to the other side [m], ignoring the
    thinnest `thin_share` of the area."""
    thin_share = 0.15  # Share of the area that may be too thin for two walls, as at rims.
    start_share = 1e-6  # Inset of the start of the rays, over the size of the surface.
    areas = surface.area_faces
    sound = areas > 1e-9 * areas.sum() / len(areas)
    normals, centres = surface.face_normals[sound], surface.triangles_center[sound]
    start = centres - start_share * surface.scale * normals
    hits, rays, _ = surface.ray.intersects_location(start, -normals, multiple_hits=False)
    depth = np.full(len(start), np.inf)
    depth[rays] = np.linalg.norm(hits - centres[rays], axis=1)
    order = np.argsort(depth)
    share = np.cumsum(areas[sound][order]) / areas.sum()
    return float(depth[order][np.searchsorted(share, thin_share)])
