"""Scenes of meshes without physics behind them, and what cameras see of spheres, boxes and the
table by formula."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import trimesh

from burg_drake.cameras import Intrinsics
from burg_drake.core import Array, Pose, Single
from burg_drake.objects import LibraryDocument, MassProperties, ObjectEntry, ObjectLibrary, Source
from burg_drake.scene import Instance, Scene, SceneDocument


def shapes_scene(
    folder: Path,
    meshes: Mapping[str, trimesh.Trimesh],
    instances: tuple[Instance, ...],
    background: tuple[Instance, ...] = (),
) -> Scene:
    """A scene of meshes, whose library is written to a folder."""
    entries = {}
    for name, mesh in meshes.items():
        mesh.export(folder / f"{name}.obj", digits=12)
        lower, upper = (tuple(corner.tolist()) for corner in mesh.bounds)
        entries[name] = ObjectEntry(
            mesh=f"{name}.obj",
            sdf=f"{name}.sdf",
            pieces=(),
            lower=lower,
            upper=upper,
            mass_properties=MassProperties(
                mass=0.1, source="given", volume=1e-4, center_of_mass=(0.0, 0.0, 0.0),
                inertia=(1e-4, 1e-4, 1e-4, 0.0, 0.0, 0.0),
            ),
            stable_poses=(),
            source=Source(file="none", sha256="0"),
            build=f"build of {name}",
        )  # fmt: skip
    library = ObjectLibrary(LibraryDocument(name="shapes", objects=entries), folder)
    document = SceneDocument(name="shapes", library=".", instances=instances, background=background)
    return Scene(document, library, folder / "shapes.yaml")


@dataclass(frozen=True)
class SphereAndBox:
    """A sphere and a box with axes along S, on a table that is the plane z = 0.

    Attributes:
        center, radius: of the sphere [m].
        middle, half: centre and half extents of the box [m].
    """

    center: tuple[float, float, float]
    radius: float
    middle: tuple[float, float, float]
    half: tuple[float, float, float]

    def scene(self, folder: Path) -> Scene:
        """Both as free objects; the ball is a polyhedron, within 0.1 % of its radius."""
        ball = trimesh.creation.icosphere(subdivisions=4, radius=self.radius)
        box = trimesh.creation.box(2.0 * np.array(self.half))
        placed = (
            Instance(object="ball", X_SO=Pose(self.center)),
            Instance(object="box", X_SO=Pose(self.middle)),
        )
        return shapes_scene(folder, {"ball": ball, "box": box}, placed)

    def distance(self, p: Array) -> Array:
        """(N,) signed distances of points (N, 3)."""
        ball = np.linalg.norm(p - self.center, axis=1) - self.radius
        q = np.abs(p - self.middle) - self.half
        box = np.linalg.norm(np.maximum(q, 0.0), axis=1) + np.minimum(q.max(axis=1), 0.0)
        return np.minimum.reduce([ball, box, p[:, 2]])

    def depth(self, intrinsics: Intrinsics, X_SC: Array) -> Single:
        """(H, W) of a pinhole camera."""
        v, u = np.mgrid[: intrinsics.height, : intrinsics.width]
        (fx, fy), (cx, cy) = intrinsics.focal, intrinsics.center
        flat = np.stack([(u - cx) / fx, (v - cy) / fy, np.ones(u.shape)], axis=-1)
        d, o = flat @ X_SC[:3, :3].T, X_SC[:3, 3]
        with np.errstate(divide="ignore", invalid="ignore"):
            table = np.where(d[..., 2] < 0.0, -o[2] / d[..., 2], np.inf)
            a, b = (d * d).sum(-1), (d * (o - self.center)).sum(-1)
            root = np.sqrt(b * b - a * (((o - self.center) ** 2).sum() - self.radius**2))
            ball = np.where(root >= 0.0, (-b - root) / a, np.inf)
            sides = np.array(self.middle) + np.array([-1, 1])[:, None] * self.half
            ends = np.sort([(side - o) / d for side in sides], axis=0)
            enter, leave = ends[0].max(-1), ends[1].min(-1)
            box = np.where((enter <= leave) & (enter > 0.0), enter, np.inf)
        nearest = np.minimum.reduce([table, ball, box])
        return np.where(np.isfinite(nearest), nearest, 0.0).astype(np.float32)


def looking_at(eye: tuple[float, float, float], target: tuple[float, float, float]) -> Array:
    """(4, 4) optical frame at a point, z towards another one."""
    z = np.array(target) - eye
    z = z / np.linalg.norm(z)
    x = np.cross(z, [0.0, 0.0, 1.0] if abs(z[2]) < 0.99 else [1.0, 0.0, 0.0])
    x = x / np.linalg.norm(x)
    X_SC = np.eye(4)
    X_SC[:3, :3], X_SC[:3, 3] = np.stack([x, np.cross(z, x), z], axis=1), eye
    return X_SC
