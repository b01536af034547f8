"""A data set in memory whose images follow from formulas: convex bodies, seen along lines.

A body is the set of points with n @ p <= d for each of its faces; a line enters it at the last of
the faces that it passes inward, and leaves it at the first that it passes outward.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from burg_drake.cameras import Intrinsics
from burg_drake.core import inverse, make_pose, rotation_from_rpy
from burg_drake.dataset import Images, InstanceLabel, LabelledGrasps, Sample, View
from burg_drake.objects import (
    ContactGeometry,
    Fit,
    LibraryDocument,
    MassProperties,
    ObjectEntry,
    ObjectLibrary,
    Primitive,
    Source,
)

WIDTH, HEIGHT = 96, 72
CAMERA = Intrinsics(width=WIDTH, height=HEIGHT, focal=(90.0, 92.0), center=(46.3, 36.9))
BOX = (np.array([-0.01, -0.03, 0.0]), np.array([0.07, 0.03, 0.05]))
"""Corners; the origin is not in the middle."""
RADIUS = 0.045
"""Of the octahedron, from its middle to its corners."""
COLORS = {"box": (200, 30, 30), "gem": (30, 30, 200)}

BOX_CORNERS = np.array([[BOX[k >> a & 1][a] for a in range(3)] for k in range(8)])
BOX_QUADS = [(0, 4, 6, 2), (1, 3, 7, 5), (0, 1, 5, 4), (2, 6, 7, 3), (0, 2, 3, 1), (4, 5, 7, 6)]
BOX_FACES = [f for a, b, c, d in BOX_QUADS for f in ((a, b, c), (a, c, d))]
GEM_CORNERS = RADIUS * np.vstack([np.eye(3), -np.eye(3)])
GEM_FACES = [
    tuple(f if x * y * z > 0 else f[::-1])
    for x in (1, -1) for y in (1, -1) for z in (1, -1)
    for f in [[0 if x > 0 else 3, 1 if y > 0 else 4, 2 if z > 0 else 5]]
]  # fmt: skip
SHAPES = {"box": (BOX_CORNERS, BOX_FACES), "gem": (GEM_CORNERS, GEM_FACES)}
SIDES = np.vstack([np.eye(3), -np.eye(3)])
SIGNS = np.array([[x, y, z] for x in (1, -1) for y in (1, -1) for z in (1, -1)], float)
HALF_SPACES = {
    "box": (SIDES, np.concatenate([BOX[1], -BOX[0]])),
    "gem": (SIGNS, np.full(8, RADIUS)),
}


def first_depth(name: str, X_CO: NDArray, u: NDArray, v: NDArray) -> NDArray:
    """Depth at which lines through pixels enter a body [m]; inf where they miss it."""
    (fx, fy), (cx, cy) = CAMERA.focal, CAMERA.center
    lines = np.stack([(u - cx) / fx, (v - cy) / fy, np.ones_like(u)], axis=-1)
    d, o = lines @ X_CO[:3, :3], -X_CO[:3, 3] @ X_CO[:3, :3]
    normals, limits = HALF_SPACES[name]
    along, start = d @ normals.T, limits - o @ normals.T
    with np.errstate(divide="ignore", invalid="ignore"):
        t = start / along
    enter = np.where(along < 0, t, -np.inf).max(axis=-1)
    leave = np.where(along > 0, t, np.inf).min(axis=-1)
    outside = ((along == 0) & (start < 0)).any(axis=-1)
    return np.where((enter < leave) & (enter > 0) & ~outside, enter, np.inf)


def write_library(folder: Path, texture: bytes = b"") -> ObjectLibrary:
    """A library of both bodies with colours, or a texture: corner k is at (k / 8, k / 16)."""
    entries = {}
    for name, (corners, faces) in SHAPES.items():
        place = folder / name
        place.mkdir(parents=True)
        rgb = " ".join(f"{c / 255:.6f}" for c in COLORS[name])
        (place / "image.png").write_bytes(texture)
        map_Kd = "map_Kd image.png\n" if texture else ""
        (place / "mesh.mtl").write_text(f"newmtl paint\nKd {rgb}\n{map_Kd}")
        lines = ["mtllib mesh.mtl", *(f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in corners)]
        lines += [f"vt {k / 8} {k / 16}" for k in range(len(corners))] if texture else []
        form = "{0}/{0}" if texture else "{0}"
        lines.append("usemtl paint")
        lines += [f"f {' '.join(form.format(k + 1) for k in face)}" for face in faces]
        (place / "mesh.obj").write_text("\n".join(lines) + "\n")
        entries[name] = ObjectEntry(
            mesh=f"{name}/mesh.obj",
            sdf=f"{name}/{name}.sdf",
            pieces=(),
            lower=tuple(corners.min(axis=0)),
            upper=tuple(corners.max(axis=0)),
            contact=_contact() if name == "box" else ContactGeometry(),
            mass_properties=MassProperties(
                mass=0.1, source="given", volume=1e-4, center_of_mass=(0, 0, 0), inertia=(1,) * 6
            ),
            stable_poses=(),
            source=Source(file=f"{name}.stl", sha256=f"{name}{'0' * 60}"),
            build="",
        )
    return ObjectLibrary(LibraryDocument(name="bodies", objects=entries), folder)


def _contact() -> ContactGeometry:
    from burg_drake.core import Pose

    lower, upper = BOX
    middle = Pose(tuple(0.5 * (lower + upper)))
    primitive = Primitive(shape="box", size=tuple(upper - lower), X_OP=middle)
    fit = Fit(volume_ratio=1.0, hausdorff=0.0)
    return ContactGeometry(kind="primitive", fit=fit, primitive=primitive)


def camera_at(eye: tuple[float, float, float], aim: tuple[float, float, float]) -> NDArray:
    """X_SC of a camera that looks at a point, the top of its image upward."""
    forward = np.subtract(aim, eye) / np.linalg.norm(np.subtract(aim, eye))
    right = np.cross(forward, (0.0, 0.0, 1.0))
    right /= np.linalg.norm(right)
    return make_pose(np.column_stack([right, np.cross(forward, right), forward]), eye)


def box_of(mask: NDArray, left: int = 0, top: int = 0) -> tuple[int, int, int, int] | None:
    """Left column, top row, width, height."""
    if not mask.any():
        return None
    v, u = np.nonzero(mask)
    size = int(u.max() - u.min()) + 1, int(v.max() - v.min()) + 1
    return int(u.min()) + left, int(v.min()) + top, *size


def draw(
    scene: int, number: int, X_SC: NDArray, bodies: list[tuple[str, str, NDArray]], **more: object
) -> Sample:
    """A view of bodies (instance, object, X_SO) on the plane z = 0 of the scene."""
    X_CS = inverse(X_SC)
    v, u = np.mgrid[-HEIGHT : 2 * HEIGHT, -WIDTH : 2 * WIDTH].astype(float)
    inside = np.s_[HEIGHT : 2 * HEIGHT, WIDTH : 2 * WIDTH]
    wide = [first_depth(obj, X_CS @ X_SO, u, v) for _, obj, X_SO in bodies]
    depths = np.stack([_plane(X_CS, u, v)[inside], *(d[inside] for d in wide)])
    labels = depths.argmin(axis=0).astype(np.uint16)
    depth = depths.min(axis=0)
    tints = np.array([(120, 130, 120), *(COLORS[obj] for _, obj, _ in bodies)], np.uint8)
    found = []
    for k, ((name, obj, X_SO), distance) in enumerate(zip(bodies, wide, strict=True), start=1):
        whole, visible = np.isfinite(distance), labels == k
        found.append(
            InstanceLabel(
                name=name,
                object=obj,
                number=k,
                X_CO=X_CS @ X_SO,
                visible_pixels=int(visible.sum()),
                silhouette_pixels=int(whole.sum()),
                visibility=float(visible.sum() / max(whole.sum(), 1)),
                visible_box=box_of(visible),
                amodal_box=box_of(whole, -WIDTH, -HEIGHT),
                amodal=whole[inside],
            )
        )
    images = Images(tints[labels], np.where(np.isfinite(depth), depth, 0).astype("f4"), labels)
    given = {"scene": scene, "number": number, "images": images, "instances": tuple(found)}
    view = View(camera="sphere", intrinsics=CAMERA, X_SC=X_SC)
    X_WS = make_pose(rotation_from_rpy((0.0, 0.0, 0.3)), (0.5, -0.2, 0.1))
    return Sample(**{"view": view, "X_WS": X_WS, **given, **more})


def _plane(X_CS: NDArray, u: NDArray, v: NDArray) -> NDArray:
    (fx, fy), (cx, cy) = CAMERA.focal, CAMERA.center
    lines = np.stack([(u - cx) / fx, (v - cy) / fy, np.ones_like(u)], axis=-1)
    normal = X_CS[:3, 2]
    with np.errstate(divide="ignore"):
        t = (normal @ X_CS[:3, 3]) / (lines @ normal)
    return np.where((t > 0) & (t < 3), t, np.inf)


@dataclass(frozen=True)
class InMemory:
    """A data set as the writers take it."""

    samples: tuple[Sample, ...]
    library: ObjectLibrary
    name: str = "bodies"
    objects: tuple[str, ...] = ("gem", "box")

    def __len__(self) -> int:
        return len(self.samples)

    def __getitem__(self, index: int) -> Sample:
        return self.samples[index]

    def __iter__(self):
        return iter(self.samples)


def scene_of(number: int, *, twice: bool = False, **more: object) -> list[Sample]:
    """Two views of a scene: one from the side, where a body hides another, one that cuts it off."""
    turned = make_pose(rotation_from_rpy((0.3, 0.2, 0.5 + number)), (0.1, 0.1, 0.05))
    bodies = [("crate", "box", turned), ("ruby", "gem", make_pose(np.eye(3), (0.12, 0.2, RADIUS)))]
    if twice:
        bodies.append(("second", "gem", make_pose(np.eye(3), (0.25, 0.12, RADIUS))))
    views = [
        camera_at((0.08, -0.25, 0.2), (0.12, 0.15, 0.03)),
        camera_at((0.35, 0.0, 0.35), (0.0, 0.07, 0.0)),
    ]
    return [draw(number, k, X_SC, bodies, **more) for k, X_SC in enumerate(views)]


def zoomed(data: InMemory) -> InMemory:
    """With other intrinsics in the second view."""
    view = replace(data[1].view, intrinsics=replace(CAMERA, focal=(80.0, 80.0)))
    return replace(data, samples=(data[0], replace(data[1], view=view)))


def some_grasps() -> LabelledGrasps:
    """Of instances 1 and 2, with every kind of outcome."""
    outcomes = ["", "lifted", "lifted", "lifted_disturbed", "slipped", "simulation_failed"]
    rpy = np.zeros((6, 3))
    rpy[:, 2] = np.arange(6) * 0.4  # about the optical axis
    rpy[2, 0] = 0.8
    X_CG = make_pose(
        rotation_from_rpy(rpy), np.array([[0.02, -0.01, 0.3]] * 6) + 0.01 * np.eye(6, 3)
    )
    slip = np.array([np.nan, 0.0, 0.01, 0.04, np.nan, np.nan])
    return LabelledGrasps(
        X_CG=X_CG,
        width=np.full(6, 0.04),
        number=np.array([1, 1, 2, 1, 2, 1], np.uint16),
        outcome=np.array(outcomes),
        margins={"slip": slip},
    )
