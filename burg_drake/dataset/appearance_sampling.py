"""Draws the appearance of a scene: lights, table, camera response, colours and distractors."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from burg_drake.core import (
    Array,
    InvalidInputError,
    Pose,
    Vector3,
    inverse,
    make_pose,
    rot_z,
    transform_points,
)
from burg_drake.dataset.appearance import (
    WHITE_LIGHT,
    Appearance,
    AppearanceSettings,
    DirectedLight,
    Distractor,
    Photometry,
    TableSurface,
)
from burg_drake.dataset.view_sampler import PlacedBox, box_around
from burg_drake.objects import ObjectEntry, ObjectLibrary, load_library
from burg_drake.scene import Scene, SceneLike, as_scene
from burg_drake.station import Station, StationLike, as_station, obstacle_corners

UNIT_CUBE_CORNERS = np.array(list(itertools.product((0.0, 1.0), repeat=3)))
"""(8, 3) corners of the cube between 0 and 1."""


@dataclass(frozen=True, eq=False)
class FreeTable:
    """Free area of a scene's table, seen from above in the scene frame.

    Attributes:
        X_ST: (4, 4) pose of the table's middle.
        half: (2,) half extents of the table [m].
        rectangles: lower and upper corners (2, 2) of occupied rectangles [m].
        circles: centres and radii (3,) of occupied circles [m].
    """

    X_ST: Array
    half: Array
    rectangles: list[Array]
    circles: list[Array]

    def place(self, radius: float, rng: np.random.Generator) -> Array | None:
        """Draws a free circle and marks it as occupied. Returns its centre (2,), or None."""
        room = self.half - radius
        if (room <= 0.0).any():
            return None
        for _ in range(40):
            p_T = np.array([*rng.uniform(-room, room), 0.0])
            p = transform_points(self.X_ST, p_T[None])[0, :2]
            if self._is_free(p, radius + 0.01):
                self.circles.append(np.array([*p, radius]))
                return np.asarray(p)
        return None

    def _is_free(self, p: Array, radius: float) -> bool:
        if any(np.linalg.norm(p - np.clip(p, *box)) < radius for box in self.rectangles):
            return False
        return all(np.hypot(*(p - c[:2])) >= radius + c[2] for c in self.circles)


def place_distractors(
    settings: AppearanceSettings, scene: Scene, station: Station, rng: np.random.Generator
) -> tuple[Distractor, ...]:
    """Draws distractors and their poses: on the table in a stable pose, their bounding circles
    clear of the scene's objects, of obstacles, the arm's base and, unless allowed, the board.
    Objects that are part of the scene are not used.

    Raises:
        UnknownNameError: there is no such library.
        InvalidInputError: no object of the library has a stable pose.
    """
    low, high = settings.distractors
    count = int(rng.integers(low, high + 1))
    if not count:
        return ()
    library = distractor_library(settings.distractor_library)
    labelled = {one.object for one in (*scene.instances.values(), *scene.background.values())}
    if library.root.resolve() != scene.library.root.resolve():
        labelled = set()
    usable = sorted(n for n, e in library.objects.items() if e.stable_poses and n not in labelled)
    if not usable:
        raise InvalidInputError(
            f"library {library.root} has no object that could be a distractor: it needs a stable"
            " pose, and must not be in the scene"
        )
    table = free_table(scene, station, settings.distractors_on_board)
    found = []
    for name in (usable[int(k)] for k in rng.integers(len(usable), size=count)):
        entry = library.entry(name)
        probability = np.array([pose.probability for pose in entry.stable_poses])
        pose = int(rng.choice(len(probability), p=probability / probability.sum()))
        X_SO = make_pose(rot_z(rng.uniform(-np.pi, np.pi))) @ entry.X_SO(pose)
        middle, radius = bounding_circle(entry, X_SO)
        place = table.place(radius, rng)
        if place is not None:
            X_SO[:2, 3] += place - middle
            found.append(Distractor(object=name, X_SO=Pose.readable(X_SO)))
    return tuple(found)


def distractor_boxes(appearance: Appearance) -> tuple[PlacedBox, ...]:
    """Bounding boxes of an appearance's distractors, in the scene frame.

    Raises:
        UnknownNameError: there is no such library, or no such object in it.
    """
    if not appearance.distractors:
        return ()
    library = distractor_library(appearance.library)
    return tuple(
        box_around(f"distractor {k}", library.entry(one.object), one.X_SO.matrix())
        for k, one in enumerate(appearance.distractors)
    )


@lru_cache(maxsize=4)
def distractor_library(reference: str) -> ObjectLibrary:
    """The library of distractors; cached, as loading takes longer than the rest of drawing."""
    return load_library(reference)


def free_table(scene: Scene, station: Station, on_board: bool) -> FreeTable:
    """The table area that a scene leaves free."""
    document = station.document
    X_SW = inverse(document.X_WS.matrix())
    boxes = [corners[:, :2] for corners in obstacle_corners(station)]
    rectangles = [np.array([box.min(axis=0), box.max(axis=0)]) for box in boxes]
    if not on_board:
        rectangles.append(np.array([(0.0, 0.0), scene.board.size]))
    circles = []
    for name in (*scene.instances, *scene.background):
        middle, radius = bounding_circle(scene.entry(name), scene.X_SO(name))
        circles.append(np.array([*middle, radius]))
    if document.arm is not None:
        p_SA = transform_points(X_SW, document.arm.X_WA.matrix()[:3, 3][None])[0]
        circles.append(np.array([*p_SA[:2], 0.2]))  # the base of a Panda reaches 0.14 m
    X_ST = X_SW @ make_pose(p_AB=(*document.table.center, 0.0))
    return FreeTable(X_ST, np.array(document.table.size[:2]) / 2, rectangles, circles)


def bounding_circle(entry: ObjectEntry, X_SO: Array) -> tuple[Array, float]:
    """Centre (2,) and radius of a circle around the corners of an object's bounding box, seen from
    above [m]."""
    lower, upper = np.array(entry.lower), np.array(entry.upper)
    corners = transform_points(X_SO, lower + UNIT_CUBE_CORNERS * (upper - lower))[:, :2]
    middle = corners.mean(axis=0)
    return middle, float(np.linalg.norm(corners - middle, axis=1).max())


def draw_appearance(
    settings: AppearanceSettings,
    scene: SceneLike,
    station: StationLike,
    rng: np.random.Generator,
) -> Appearance:
    """Draws the appearance of a scene.

    Args:
        settings: ranges and choices.
        scene: scene on the station; distractors stay clear of its objects.
        station: station with the table.
        rng: random numbers; the same state gives the same appearance.

    Raises:
        UnknownNameError: there is no such library of distractors.
        InvalidInputError: no object of that library has a stable pose.
    """
    scene, station = as_scene(scene), as_station(station)
    objects = len(scene.instances) + len(scene.background)
    room = int(rng.integers(1 << 32)) if rng.random() < settings.room else None
    by_room = room is not None and rng.random() < settings.room_light
    # Irradiance of the table by all lights (at 1 a white surface is white), and the room's share.
    irradiance = float(rng.uniform(0.75, 1.0))
    share = float(rng.uniform(0.3, 0.7)) if by_room else 0.0
    return Appearance(
        lights=_draw_lights(settings, irradiance * (1.0 - share), not by_room, rng),
        room=room,
        room_light=irradiance * share if settings.lights is not None else float(by_room),
        table=_draw_table_surface(settings, rng),
        board=bool(rng.random() < settings.board),
        photometry=_draw_photometry(settings, rng),
        object_gains=_draw_color_gains(settings, objects, rng),
        library=settings.distractor_library,
        distractors=place_distractors(settings, scene, station, rng),
    )


def _draw_lights(
    settings: AppearanceSettings, irradiance: float, camera_light: bool, rng: np.random.Generator
) -> tuple[DirectedLight, ...]:
    """Draws lights with a total `irradiance` of the table, and one that moves with the
    camera if `camera_light`."""
    if settings.lights is None:
        return ()
    low, high = settings.lights
    count = int(rng.integers(low, high + 1))
    elevation = np.deg2rad(rng.uniform(25.0, 75.0, count))
    elevation[0] = np.deg2rad(rng.uniform(*settings.light_elevation_deg))
    azimuth = rng.uniform(-np.pi, np.pi, count)
    # Share of a light at the camera, which replaces scattered light.
    camera_share = float(rng.uniform(0.12, 0.3)) if camera_light else 0.0
    shares = rng.uniform(0.2, 0.7, count)
    shares[0] = 1.0
    shares *= (1.0 - camera_share) / shares.sum()
    shadows = bool(rng.random() < settings.shadows)
    found = []
    for k in range(count):
        flat, up = np.cos(elevation[k]), np.sin(elevation[k])
        x, y, z = (rot_z(azimuth[k]) @ [-flat, 0.0, -up]).tolist()
        found.append(
            DirectedLight(
                direction=(x, y, z),
                irradiance=float(irradiance * shares[k] / max(up, 0.4)),
                color=_draw_light_color(settings, rng),
                shadows=k == 0 and shadows,
            )
        )
    if not camera_light:
        return tuple(found)
    x, y = rng.uniform(-0.4, 0.4, 2).tolist()
    fill = DirectedLight(
        direction=(x, y, 1.0), frame="camera", irradiance=float(irradiance * camera_share)
    )
    return (*found, fill)


def _draw_light_color(settings: AppearanceSettings, rng: np.random.Generator) -> Vector3:
    if settings.temperature is None:
        return WHITE_LIGHT
    low, high = settings.temperature
    return color_of_temperature(1e6 / float(rng.uniform(1e6 / high, 1e6 / low)))


def color_of_temperature(kelvin: float) -> Vector3:
    """Linear red, green, blue of a black body relative to one of 6500 K, with green at 1. Takes the
    square root of the ratio, as cameras balance most of the difference.

    By Planck's law at the wavelengths of sRGB's primaries, which is accurate enough here.
    """
    wavelength = np.array([612e-9, 549e-9, 464e-9])  # dominant ones of sRGB's primaries [m]
    hc_k = 1.438777e-2  # second radiation constant [m K], CODATA 2018
    radiance = 1.0 / np.expm1(hc_k / (wavelength * kelvin))
    neutral = 1.0 / np.expm1(hc_k / (wavelength * 6500.0))  # white in sRGB
    ratio = np.sqrt(radiance / neutral)
    r, g, b = (ratio / ratio[1]).tolist()
    return (r, g, b)


def _draw_table_surface(
    settings: AppearanceSettings, rng: np.random.Generator
) -> TableSurface | None:
    if not settings.table:
        return None
    pattern = settings.table[int(rng.integers(len(settings.table)))]
    return TableSurface(pattern=pattern, seed=int(rng.integers(1 << 32)))


def _draw_photometry(settings: AppearanceSettings, rng: np.random.Generator) -> Photometry:
    def drawn(span: tuple[float, float] | None, usual: float) -> float:
        return usual if span is None else float(rng.uniform(*span))

    electrons = None
    if settings.electrons is not None:
        electrons = float(np.exp(rng.uniform(*np.log(settings.electrons))))
    red, blue = (1.0 + rng.uniform(-1.0, 1.0, 2) * settings.white_balance).tolist()
    return Photometry(
        exposure=drawn(settings.exposure, 0.0),
        white_balance=(red, 1.0, blue),
        gamma=drawn(settings.gamma, 1.0),
        blur=drawn(settings.blur, 0.0),
        electrons=electrons,
    )


def _draw_color_gains(
    settings: AppearanceSettings, objects: int, rng: np.random.Generator
) -> tuple[Vector3, ...]:
    if not settings.color_gain:
        return ()
    found = 1.0 + rng.uniform(-1.0, 1.0, (objects, 3)) * settings.color_gain
    return tuple((r, g, b) for r, g, b in found.tolist())
