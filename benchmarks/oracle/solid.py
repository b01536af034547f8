"""A solid: samples of its surface, its mass properties, and a fine mesh of it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from .arrays import Array, rotation

UPRIGHT = np.eye(3)
LYING = rotation((1.0, 0.0, 0.0), np.pi / 2)
FALLEN = rotation((0.0, 1.0, 0.0), np.pi / 2)
"""Orientations (3, 3) in which solids rest on a plane."""


@dataclass(frozen=True, eq=False)
class Solid:
    """A closed surface, sampled in cells of about `spacing`.

    Attributes:
        points, normals: (n, 3) middles of the cells and outward unit normals [m].
        areas: (n,) of the cells [m^2].
        spacing: size of a cell [m].
        meshes: closed triangle meshes, vertices (v, 3) and faces (f, 3), whose union it is.
    """

    points: Array
    normals: Array
    areas: Array
    spacing: float
    meshes: tuple[tuple[Array, Array], ...]

    def turned(self, R: Array, p: Array | tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Solid:
        """The solid turned by R (3, 3) and moved by p (3,)."""
        meshes = tuple((vertices @ R.T + p, faces) for vertices, faces in self.meshes)
        return replace(
            self, points=self.points @ R.T + p, normals=self.normals @ R.T, meshes=meshes
        )

    def mapped(self, mapping: Callable[[Array], Array], by: float = 1e-6) -> Solid:
        """The solid deformed: normals and areas follow from the mapping's derivatives.

        Args:
            mapping: takes points (n, 3) to points; keeps right hands right.
            by: differences are taken over twice this length [m].
        """
        columns = [
            (mapping(self.points + by * axis) - mapping(self.points - by * axis)) / (2.0 * by)
            for axis in np.eye(3)
        ]
        J = np.stack(columns, axis=-1)
        cofactors = np.stack(
            [np.cross(J[:, :, (i + 1) % 3], J[:, :, (i + 2) % 3]) for i in range(3)], -1
        )
        scaled = np.einsum("nij,nj->ni", cofactors, self.normals)
        stretch = np.linalg.norm(scaled, axis=1)
        return replace(
            self,
            points=mapping(self.points),
            normals=scaled / stretch[:, None],
            areas=self.areas * stretch,
            meshes=tuple((mapping(vertices), faces) for vertices, faces in self.meshes),
        )

    def without(self, inside: Callable[[Array], Array]) -> Solid:
        """The samples that are not inside something, told by (n,) bools of points (n, 3)."""
        keep = ~inside(self.points)
        return replace(
            self, points=self.points[keep], normals=self.normals[keep], areas=self.areas[keep]
        )

    def with_(self, other: Solid) -> Solid:
        """Both together; neither has samples inside the other."""
        return Solid(
            np.concatenate((self.points, other.points)),
            np.concatenate((self.normals, other.normals)),
            np.concatenate((self.areas, other.areas)),
            self.spacing,
            self.meshes + other.meshes,
        )

    @property
    def lowest(self) -> float:
        """Smallest z of its mesh [m]."""
        return float(min(vertices[:, 2].min() for vertices, _ in self.meshes))


@dataclass(frozen=True, eq=False)
class MassProperties:
    """Of a solid of unit mass: volume [m^3], centre of mass (3,) [m], and inertia (3, 3) about it
    [m^2], in the solid's axes."""

    volume: float
    center: Array
    inertia: Array


def mass_properties(solid: Solid) -> MassProperties:
    """By Gauss's theorem, from integrals over the samples."""
    x, flux = solid.points, solid.normals * solid.areas[:, None]
    volume = float((x * flux).sum()) / 3.0
    center = (x**2 * flux).sum(axis=0) / (2.0 * volume)
    y = x - center
    squares = (y**3 * flux).sum(axis=0) / (3.0 * volume)
    second = np.diag(squares)
    for i, j in ((0, 1), (0, 2), (1, 2)):
        # x y is the divergence along x of x^2 y / 2, and along y of x y^2 / 2: the mean of both.
        products = y[:, i] ** 2 * y[:, j] * flux[:, i] + y[:, i] * y[:, j] ** 2 * flux[:, j]
        second[i, j] = second[j, i] = float(products.sum()) / (4.0 * volume)
    return MassProperties(volume, center, np.trace(second) * np.eye(3) - second)
