"""Objects on the board: rays to their meshes, and the light that they get and take away.

Lambert's law, a lamp that is a point (hard shadows) or a sphere (soft ones), light from everywhere
that other objects keep away, and what white paper sends back from below. Rays are embree's.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path

import cv2
import numpy as np
import trimesh
import yaml
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from .exposure import PAPER, SIDE, Surface, radiance
from .lens import Camera, corner_directions
from .light import AROUND, Light, Map, lamp_light
from .paper import Array

ROOT = Path(__file__).parents[2]
LAMP_RAYS = 48
"""From a point of the table to a lamp that is not a point."""
SKY_RAYS = 64
COARSE, FINE, HARD = 4e-3, 1e-3, 0.5e-3
"""Distances of the points on the table for light from everywhere, for soft and hard shadows [m]."""
OFF = 1e-5
"""Where rays start above a surface [m]."""
SMOOTH = 0.9
"""Least cosine between the normals of a face and of its vertices for these to be used."""
BETWEEN = 0.25
"""Light that comes from another object, over that from everywhere."""


@dataclass(frozen=True, eq=False)
class Thing:
    """An object.

    Attributes:
        mesh: in its own frame O [m], with its colors.
        X_SO: (4, 4) where it is.
        contrast: of stripes and spots on its surface, 0 to 1.
    """

    mesh: trimesh.Trimesh
    X_SO: Array
    contrast: float = 0.0


@dataclass(frozen=True, eq=False)
class Seen:
    """What a camera receives.

    Attributes:
        radiance: (H, W, 3) as `exposure.radiance` has it.
        share: (H, W, N) of the samples of each pixel that show each object.
    """

    radiance: Array
    share: NDArray[np.float32]


@cache
def household(name: str) -> trimesh.Trimesh:
    """The mesh of a built-in object."""
    return trimesh.load(ROOT / "models" / "household" / name / "mesh.obj", force="mesh")


def arranged(scene: str) -> dict[str, Thing]:
    """The household objects of a built-in scene by the names of their instances."""
    document = yaml.safe_load((ROOT / "scenes" / f"{scene}.yaml").read_text("utf-8"))
    things = {}
    for instance in document["instances"]:
        pose = instance["X_SO"]
        X_SO = np.eye(4)
        X_SO[:3, 3] = pose["translation"]
        X_SO[:3, :3] = Rotation.from_euler(  # roll, pitch, yaw about the fixed axes x, y, z
            "xyz", pose.get("rpy_deg", [0, 0, 0]), degrees=True
        ).as_matrix()
        name = instance.get("name", instance["object"])
        things[name] = Thing(household(instance["object"]), X_SO)
    return things


class Objects:
    """Objects that rays are sent at."""

    def __init__(self, things: list[Thing]) -> None:
        moved = [thing.mesh.copy().apply_transform(thing.X_SO) for thing in things]
        self.mesh = trimesh.util.concatenate(
            [trimesh.Trimesh(m.vertices, m.faces, process=False) for m in moved]
        )
        self.owner = np.repeat(np.arange(len(things)), [len(m.faces) for m in moved])
        self.count = len(things)
        self._normals = np.concatenate([m.vertex_normals for m in moved])
        self._colors = np.concatenate([_reflectance(thing) for thing in things])
        self._scene = EmbreeScene(robust=True)
        TriangleMesh(self._scene, np.float32(self.mesh.triangles))

    def first(self, start: Array, along: Array) -> tuple[NDArray[np.int64], Array, Array]:
        """The faces (N,) that rays meet first, -1 for none, distances (N,), and weights (N, 3) of
        the faces' corners."""
        hit = self._scene.run(np.float32(start), np.float32(along), output=1)
        u, v = hit["u"].astype(float), hit["v"].astype(float)
        return hit["primID"].astype(int), hit["tfar"].astype(float), np.c_[1 - u - v, u, v]

    def free(self, start: Array, along: Array) -> NDArray[np.bool_]:
        """(N,) rays that meet nothing."""
        return self._scene.run(np.float32(start), np.float32(along), query="OCCLUDED") < 0

    def surface(self, face: NDArray[np.int64], weight: Array) -> tuple[Array, Array, Array]:
        """Normals of faces and of the rounded surface, and reflectance, (N, 3) each."""
        flat = self.mesh.face_normals[face]
        corners = self.mesh.faces[face]
        smooth = (weight[..., None] * self._normals[corners]).sum(axis=1)
        smooth /= np.linalg.norm(smooth, axis=1, keepdims=True)
        round_here = (flat * smooth).sum(axis=1, keepdims=True) > SMOOTH
        color = (weight[..., None] * self._colors[corners]).sum(axis=1)
        return flat, np.where(round_here, smooth, flat), color


def photographed(
    camera: Camera,
    X_SC: Array,
    surface: Surface,
    light: Light,
    objects: Objects,
    size: tuple[float, float],
    rng: np.random.Generator,
) -> Seen:
    """What a camera receives of objects on a board.

    Args:
        camera: with its lens.
        X_SC: (4, 4) its optical frame.
        surface: the board; its light is replaced by that which the objects leave.
        light: of the room; its own shadows do not count.
        objects: on the board.
        size: of the board [m].
        rng: of the directions that light comes from.
    """
    surface = surface._replace(light=light_left(light, objects, size, rng))
    width, height = camera.size
    pixels = _near_objects(camera, X_SC, objects)
    start, along = _rays(camera, X_SC, pixels)
    face, distance, weight = objects.first(start, along)
    hit = face >= 0
    color = np.zeros((len(face), 3))
    p = start[hit] + distance[hit, None] * along[hit]
    color[hit] = _shaded(objects, light, size, (p, along[hit], face[hit], weight[hit]), rng)
    samples = SIDE * SIDE
    hidden = np.zeros(height * width, np.uint16)
    hidden[pixels] = hit.reshape(-1, samples) @ (1 << np.arange(samples))
    found = radiance(camera, X_SC[None, None], surface, SIDE, hidden.reshape(height, width))
    found.reshape(-1, 3)[pixels] += color.reshape(-1, samples, 3).mean(axis=1)
    share = np.zeros((height * width, objects.count), np.float32)
    owner = np.where(hit, objects.owner[face], -1).reshape(-1, samples)
    share[pixels] = (owner[..., None] == np.arange(objects.count)).mean(axis=1)
    return Seen(found, share.reshape(height, width, -1))


def light_left(
    light: Light, objects: Objects, size: tuple[float, float], rng: np.random.Generator
) -> Map:
    """The light that objects leave the table."""
    spacing = HARD if light.radius == 0.0 else FINE
    p = _points(size, spacing)
    sky = _open_sky(objects, _points(size, COARSE), rng)
    row, column = np.float32(np.indices(p.shape[:2]) * spacing / COARSE)
    sky = cv2.remap(sky, column, row, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    full = lamp_light(light, size, p) - light.ambient
    lit = light.ambient * sky + full * _lamp_seen(objects, light, p)
    return Map(lit.astype(np.float32), -AROUND, -AROUND, 1 / spacing)


def _points(size: tuple[float, float], spacing: float) -> Array:
    """(R, C, 2) points of the table."""
    x, y = (np.arange(-AROUND, s + AROUND, spacing) for s in size)
    return np.stack(np.meshgrid(x, y), axis=-1)


def _open_sky(objects: Objects, p: Array, rng: np.random.Generator) -> NDArray[np.float32]:
    """(R, C) share of the light from everywhere that reaches points of the table."""
    start = np.c_[p.reshape(-1, 2), np.full(p[..., 0].size, OFF)]
    found = np.zeros(len(start))
    for k in range(SKY_RAYS):
        height = (k + rng.uniform(size=len(start))) / SKY_RAYS
        angle = 2 * np.pi * (0.618034 * k + rng.uniform(size=len(start)))
        flat = np.sqrt(height)
        along = np.c_[flat * np.cos(angle), flat * np.sin(angle), np.sqrt(1 - height)]
        found += np.where(objects.free(start, along), 1.0, BETWEEN) / SKY_RAYS
    return np.float32(found.reshape(p.shape[:2]))


def _lamp_seen(objects: Objects, light: Light, p: Array) -> Array:
    """(R, C) share of the lamp that points of the table see; soft shadows are looked at closely
    only where a coarser look says that there is an edge."""
    start = np.c_[p.reshape(-1, 2), np.full(p[..., 0].size, OFF)]
    if light.radius == 0.0:
        return objects.free(start, light.lamp - start).reshape(p.shape[:2]).astype(float)
    step = round(COARSE / FINE)
    coarse = np.float32(_share_of_lamp(objects, light, p[::step, ::step].reshape(-1, 2)))
    coarse = coarse.reshape(p[::step, ::step].shape[:2])
    around = np.ones((3, 3), np.uint8)
    edge = cv2.dilate(coarse, around) - cv2.erode(coarse, around) > 1e-6
    edge = np.kron(edge, np.ones((step, step), bool))[: p.shape[0], : p.shape[1]]
    seen = np.kron(coarse, np.ones((step, step)))[: p.shape[0], : p.shape[1]]
    seen[edge] = _share_of_lamp(objects, light, p[edge])
    return seen


def _share_of_lamp(objects: Objects, light: Light, p: Array) -> Array:
    """(N,) share of a round lamp that points (N, 2) of the table see."""
    start = np.c_[p, np.full(len(p), OFF)]
    seen = np.zeros(len(p))
    for k in range(LAMP_RAYS):  # a spiral on the lamp's disk, equal areas
        radius, angle = light.radius * np.sqrt((k + 0.5) / LAMP_RAYS), 2.399963 * k
        end = light.lamp + radius * _across(light, p) @ [np.cos(angle), np.sin(angle)]
        seen += objects.free(start, end - start) / LAMP_RAYS
    return seen


def _across(light: Light, p: Array) -> Array:
    """(3, 2) two directions across the way from points to the lamp, those of their middle."""
    way = np.array(light.lamp) - np.r_[p.mean(axis=0), 0.0]
    return np.linalg.svd(way[None])[2][1:].T


def _near_objects(camera: Camera, X_SC: Array, objects: Objects) -> NDArray[np.int64]:
    """(N,) pixels in which objects can be: those of a ray to the corner that meets one, and their
    neighbours."""
    directions = corner_directions(camera)
    along = np.dstack([directions, np.ones(directions.shape[:2])]).reshape(-1, 3) @ X_SC[:3, :3].T
    start = np.broadcast_to(X_SC[:3, 3], along.shape)
    met = (objects.first(start, along)[0] >= 0).reshape(directions.shape[:2])
    near = cv2.dilate(met.astype(np.uint8), np.ones((7, 7), np.uint8))[:-1, :-1]
    return np.flatnonzero(near)


def _rays(camera: Camera, X_SC: Array, pixels: NDArray[np.int64]) -> tuple[Array, Array]:
    """Starts and directions (N * SIDE², 3) of the samples of pixels (N,): those of `exposure`."""
    directions = corner_directions(camera)
    v, u = np.divmod(pixels, camera.size[0])
    inner = (np.arange(SIDE) + 0.5) / SIDE
    b, a = (each.reshape(1, -1, 1) for each in np.meshgrid(inner, inner, indexing="ij"))
    above = (1 - a) * directions[v, u, None] + a * directions[v, u + 1, None]
    below = (1 - a) * directions[v + 1, u, None] + a * directions[v + 1, u + 1, None]
    xy = ((1 - b) * above + b * below).reshape(-1, 2)
    along = np.c_[xy, np.ones(len(xy))] @ X_SC[:3, :3].T
    return np.broadcast_to(X_SC[:3, 3], along.shape), along


def _shaded(
    objects: Objects,
    light: Light,
    size: tuple[float, float],
    met: tuple[Array, Array, NDArray[np.int64], Array],
    rng: np.random.Generator,
) -> Array:
    """(N, 3) radiance of points of objects: one ray to the lamp and one to the sky each.

    Args:
        objects: all of them.
        light: of the room.
        size: of the board [m].
        met: points (N, 3), directions they are seen along, their faces and weights in these.
        rng: of the rays.
    """
    p, along, face, weight = met
    flat, normal, color = objects.surface(face, weight)
    toward = np.where((flat * along).sum(axis=1, keepdims=True) > 0, -1.0, 1.0)
    flat, normal = flat * toward, normal * toward
    start = p + OFF * flat
    to_lamp = np.array(light.lamp) + light.radius * _on_sphere(rng, len(p)) - start
    distance = np.linalg.norm(to_lamp, axis=1)
    slant = np.maximum((normal * to_lamp).sum(axis=1) / distance, 0.0)
    slant *= (flat * to_lamp).sum(axis=1) > 0
    middle = np.array([size[0] / 2, size[1] / 2, 0.0])
    reference = np.linalg.norm(light.lamp - middle) ** 3 / light.lamp[2]
    lamp = (1 - light.ambient) * reference * slant / distance**2 * objects.free(start, to_lamp)
    out = normal + 0.999 * _on_sphere(rng, len(p))  # directions as Lambert weighs them
    open_sky = np.where(out[:, 2] > 0.0, 1.0, PAPER)
    sky = light.ambient * np.where(objects.free(start, out), open_sky, BETWEEN)
    return color * (lamp + sky)[:, None]


def _on_sphere(rng: np.random.Generator, count: int) -> Array:
    """(N, 3) points of the unit sphere; those that follow each other, as the samples of a pixel do,
    are spread evenly (Roberts, "The unreasonable effectiveness of quasirandom sequences", 2018)."""
    first, second = (
        (rng.uniform() + step * np.arange(count)) % 1.0 for step in (0.7548776662, 0.5698402910)
    )
    z, angle = 2.0 * first - 1.0, 2.0 * np.pi * second
    flat = np.sqrt(1.0 - z * z)
    return np.stack([flat * np.cos(angle), flat * np.sin(angle), z], axis=-1)


def _reflectance(thing: Thing) -> Array:
    """(V, 3) linear reflectance of a mesh's vertices."""
    visual = thing.mesh.visual
    colors = visual.to_color() if visual.kind == "texture" else visual
    srgb = np.asarray(colors.vertex_colors)[:, :3] / 255.0
    linear = np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)
    p = np.asarray(thing.mesh.vertices)
    waves = np.sin(p @ [170.0, 90.0, 210.0]) * np.sin(p @ [-60.0, 240.0, 110.0])
    return linear * (1.0 - 0.5 * thing.contrast * (1.0 + waves[:, None]))
