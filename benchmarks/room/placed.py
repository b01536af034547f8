"""Photos of objects that stand off their places, on a board in the light of a room."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np
import trimesh
from scipy.spatial.transform import Rotation

from .covers import nothing
from .exposure import PAPER, Surface, no_gloss, table
from .lens import Camera
from .light import Light, irradiance, map_of
from .objects import Objects, Thing, arranged, household, photographed
from .paper import Array, Image
from .rows import BOARD, WEBCAM, sheet
from .sensor import image_of
from .sheet import AS_MEANT
from .views import look_at

LIGHTS = {"ambient": None, "soft sun": 0.06, "hard sun": 0.0}
"""Radius of the lamp [m]; None for light from everywhere alone."""
KINDS = ("plain", "extra", "plain", "missing", "plain", "swapped")
"""Of photos, in turn."""
OTHERS = ("can", "airplane", "scissors")
"""Objects that stand there though the scene has none of them."""
GAP = 0.01
"""Between footprints, at least [m]."""
FAR, TURNED = 0.03, 20.0
"""Most displacement [m] and turn [deg]."""


@dataclass(frozen=True, eq=False)
class PlacedPhoto:
    """A photo of a scene, and the truth about it.

    Attributes:
        image: (H, W, 3) RGB.
        X_SC: (4, 4) true pose of the optical frame.
        X_SO: (4, 4) where each object of the scene stands; those that are missing are not in it.
        seen: share of each object's silhouette that is in the image and not hidden.
        kind: of `KINDS`.
        odd: the objects that are missing or swapped.
        extra: (2,) middle of an object too many on the board [m]; None without.
    """

    image: Image
    X_SC: Array
    X_SO: dict[str, Array]
    seen: dict[str, float]
    kind: str
    odd: tuple[str, ...]
    extra: Array | None


def placed_photo(
    light: str, camera: Camera, seed: tuple[int, ...], view: int = 0, recolored: bool = False
) -> PlacedPhoto:
    """A photo of `tabletop_six`; the same seed makes the same one.

    Args:
        light: of `LIGHTS`.
        camera: that takes it.
        seed: of the scene; the last number chooses the kind as well.
        view: of the same scene, in the same light.
        recolored: red, green and blue of the objects are exchanged.
    """
    kind = KINDS[seed[-1] % len(KINDS)]
    rng = np.random.default_rng(seed)
    things, odd, extra = standing(kind, rng)
    lit = _light(LIGHTS[light], rng)
    ground = table(rng)
    rng = np.random.default_rng([*seed, view, *camera.size])
    X_SC = _view(rng)
    lying = sheet(BOARD, "A2", AS_MEANT, 0)
    surface = Surface(
        lying.texture,
        lying.relief,
        ground,
        map_of(irradiance(lit, BOARD.size)),
        nothing(),
        no_gloss(),
    )
    if recolored:
        things = {name: _recolored(thing) for name, thing in things.items()}
    objects = Objects(list(things.values()))
    seen = photographed(camera, X_SC, surface, lit, objects, BOARD.size, rng)
    image = image_of(seen.radiance, PAPER, WEBCAM, rng)
    shown = seen.share.sum(axis=(0, 1))
    return PlacedPhoto(
        image,
        X_SC,
        {name: thing.X_SO for name, thing in things.items() if name in arranged("tabletop_six")},
        {
            name: float(shown[i] / max(_silhouette(camera, X_SC, thing), 1.0))
            for i, (name, thing) in enumerate(things.items())
        },
        kind,
        odd,
        extra,
    )


def kept(
    path: Path,
    light: str,
    camera: Camera,
    seed: tuple[int, ...],
    view: int,
    recolored: bool = False,
) -> PlacedPhoto:
    """The same, from a folder if it has been there before."""
    words = (light.replace(" ", "_"), camera.size[0], *seed, view, *["recolored"] * recolored)
    file = path / f"{'-'.join(map(str, words))}.npz"
    if not file.exists():
        photo = placed_photo(light, camera, seed, view, recolored)
        path.mkdir(parents=True, exist_ok=True)
        np.savez(
            file,
            image=photo.image,
            X_SC=photo.X_SC,
            names=list(photo.X_SO),
            X_SO=list(photo.X_SO.values()),
            seen=[photo.seen[name] for name in photo.X_SO],
            kind=photo.kind,
            odd=list(photo.odd),
            extra=[] if photo.extra is None else photo.extra,
        )
    with np.load(file) as f:
        names = f["names"].tolist()
        return PlacedPhoto(
            f["image"],
            f["X_SC"],
            dict(zip(names, f["X_SO"], strict=True)),
            dict(zip(names, f["seen"].tolist(), strict=True)),
            str(f["kind"]),
            tuple(f["odd"].tolist()),
            f["extra"] if f["extra"].size else None,
        )


def standing(
    kind: str, rng: np.random.Generator
) -> tuple[dict[str, Thing], tuple[str, ...], Array | None]:
    """The objects of a photo.

    Args:
        kind: of `KINDS`.
        rng: of where they stand.

    Returns:
        Those of the scene by name, and `extra`; names of those that are missing or swapped; and
        (2,) the middle of one too many [m].
    """
    while True:
        things = {
            name: replace(_displaced(thing, rng), contrast=rng.uniform(0.0, 0.4))
            for name, thing in arranged("tabletop_six").items()
        }
        odd: tuple[str, ...] = ()
        extra = None
        if kind == "missing":
            odd = (str(rng.choice(list(things))),)
            del things[odd[0]]
        if kind == "swapped":
            a, b = odd = tuple(rng.choice(list(things), 2, replace=False).tolist())
            at = {name: _middle(things[name]) for name in odd}
            things[a] = _moved(things[a], np.r_[at[b] - at[a], 0.0])
            things[b] = _moved(things[b], np.r_[at[a] - at[b], 0.0])
        if kind == "extra":
            things["extra"] = _extra(rng)
            extra = _middle(things["extra"])
        if _apart(list(things.values())):
            return things, odd, extra


def _displaced(thing: Thing, rng: np.random.Generator) -> Thing:
    """One in four stands on its place."""
    far = 0.0 if rng.uniform() < 0.25 else rng.uniform(0, FAR)
    way, turn = rng.uniform(-np.pi, np.pi), rng.uniform(-TURNED, TURNED) * (far > 0)
    middle = np.r_[_middle(thing), 0.0]
    X = np.eye(4)
    X[:3, :3] = Rotation.from_euler("z", turn, degrees=True).as_matrix()
    X[:3, 3] = middle - X[:3, :3] @ middle + far * np.array([np.cos(way), np.sin(way), 0.0])
    return replace(thing, X_SO=X @ thing.X_SO)


def _extra(rng: np.random.Generator) -> Thing:
    """An object of the library that the scene does not have, somewhere on the board."""
    mesh = household(str(rng.choice(OTHERS)))
    X_SO = np.eye(4)
    X_SO[:3, :3] = Rotation.from_euler("z", rng.uniform(-np.pi, np.pi)).as_matrix()
    lowest = (mesh.vertices @ X_SO[:3, :3].T)[:, 2].min()
    X_SO[:2, 3] = rng.uniform(0.15, 0.85, 2) * BOARD.size
    X_SO[2, 3] = -lowest
    return Thing(mesh, X_SO, contrast=float(rng.uniform(0.0, 0.4)))


def _recolored(thing: Thing) -> Thing:
    mesh = thing.mesh.copy()
    if mesh.visual.kind == "texture":
        mesh.visual = mesh.visual.to_color()
    colors = np.array(mesh.visual.vertex_colors)
    colors[:, :3] = np.roll(colors[:, :3], 1, axis=1)
    mesh.visual = trimesh.visual.ColorVisuals(mesh, vertex_colors=colors)
    return replace(thing, mesh=mesh)


def _moved(thing: Thing, shift: Array) -> Thing:
    X_SO = thing.X_SO.copy()
    X_SO[:3, 3] += shift
    return replace(thing, X_SO=X_SO)


def _points(thing: Thing) -> Array:
    return np.asarray(thing.mesh.vertices) @ thing.X_SO[:3, :3].T + thing.X_SO[:3, 3]


def _middle(thing: Thing) -> Array:
    """(2,) of its bounding box from above."""
    p = _points(thing)[:, :2]
    return (p.min(axis=0) + p.max(axis=0)) / 2


def _apart(things: list[Thing]) -> bool:
    """No footprint is nearer to another than `GAP`."""
    hulls = [cv2.convexHull(np.float32(_points(thing)[:, :2])) for thing in things]
    step = 2e-3
    taken = np.zeros((300, 400), np.uint8)
    for hull in hulls:
        here = np.zeros_like(taken)
        cv2.fillPoly(here, [np.int32(np.round((hull + 0.1) / step))], 1)
        if (taken & here).any():
            return False
        taken |= cv2.dilate(here, np.ones((2 * round(GAP / step) + 1,) * 2, np.uint8))
    return True


def _light(radius: float | None, rng: np.random.Generator) -> Light:
    """A lamp to one side, as bright as a window's sun in a lit room."""
    if radius is None:
        return Light(ambient=1.0)
    direction = rng.uniform(-np.pi, np.pi)
    away = rng.uniform(0.7, 1.3)
    x, y = np.array(BOARD.size) / 2 + away * np.array([np.cos(direction), np.sin(direction)])
    return Light(ambient=0.35, lamp=(float(x), float(y), 1.6), radius=radius)


def _view(rng: np.random.Generator) -> Array:
    """(4, 4) of a camera that is held upright over the board's middle, from all sides."""
    tilt = np.radians(90.0 - rng.uniform(35, 70))
    X_SC = look_at(
        np.array(BOARD.size) / 2,
        rng.uniform(0.6, 1.0),
        tilt,
        rng.uniform(-np.pi, np.pi),
        np.pi / 2 + np.radians(rng.uniform(-15, 15)),
    )
    if X_SC[2, 1] > 0.0:  # upside down
        X_SC[:3, :2] *= -1.0
    return X_SC


def _silhouette(camera: Camera, X_SC: Array, thing: Thing) -> float:
    """Pixels that an object alone would cover, also beyond the image, without the lens's bend."""
    width, height = camera.size
    u = np.arange(-width // 2, 3 * width // 2)
    v = np.arange(-height // 2, 3 * height // 2)
    pixel = np.stack(np.meshgrid(u, v), axis=-1).reshape(-1, 2)
    xy = (pixel - np.array(camera.center)) / camera.focal
    along = np.c_[xy, np.ones(len(xy))] @ X_SC[:3, :3].T
    start = np.broadcast_to(X_SC[:3, 3], along.shape)
    return float((Objects([thing]).first(start, along)[0] >= 0).sum())
