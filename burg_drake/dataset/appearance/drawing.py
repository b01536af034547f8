"""Draws how a scene looks."""

from __future__ import annotations

import numpy as np

from burg_drake.core import rot_z
from burg_drake.core.documents import Vector3
from burg_drake.dataset.appearance.appearance import (
    WHITE,
    Appearance,
    DirectedLight,
    Photometry,
    TableSurface,
)
from burg_drake.dataset.appearance.distractors import place_distractors
from burg_drake.dataset.appearance.settings import AppearanceSettings
from burg_drake.scene.document import SceneLike, as_scene
from burg_drake.station.document import StationLike, as_station

SEEDS = 1 << 32
TABLE_LIGHT = (0.75, 1.0)
"""Irradiance of the table by all lights together; with 1, what is white is white in the image."""
ROOM_SHARE = (0.3, 0.7)
"""Of it by the room, if that lights the scene."""
CAMERA_SHARE = (0.12, 0.3)
"""Otherwise by a light that goes with the camera: it stands for what walls and ceiling scatter."""
OTHER_WEIGHT = (0.2, 0.7)
"""What other lights give the table, relative to the first one."""
OTHER_ELEVATION_DEG = (25.0, 75.0)
STEEP = 0.4
"""The sine of elevations from which lights are no longer made brighter for shining flatly."""
NEUTRAL = 6500.0
"""Temperature of light that is white in sRGB [K]."""


def draw_appearance(
    settings: AppearanceSettings,
    scene: SceneLike,
    station: StationLike,
    rng: np.random.Generator,
) -> Appearance:
    """Draws how a scene looks.

    Args:
        settings: ranges and choices.
        scene: that stands on the station; distractors stay clear of its objects.
        station: has the table.
        rng: draws; the same one gives the same appearance.

    Raises:
        UnknownNameError: there is no such library of distractors.
        InvalidInputError: no object of it can stand.
    """
    scene, station = as_scene(scene), as_station(station)
    objects = len(scene.instances) + len(scene.background)
    room = int(rng.integers(SEEDS)) if rng.random() < settings.room else None
    by_room = room is not None and rng.random() < settings.room_light
    total = float(rng.uniform(*TABLE_LIGHT))
    share = float(rng.uniform(*ROOM_SHARE)) if by_room else 0.0
    return Appearance(
        lights=_lights(settings, total * (1.0 - share), not by_room, rng),
        room=room,
        room_light=total * share if settings.lights is not None else float(by_room),
        table=_table(settings, rng),
        board=bool(rng.random() < settings.board),
        photometry=_photometry(settings, rng),
        object_gains=_gains(settings, objects, rng),
        library=settings.distractor_library,
        distractors=place_distractors(settings, scene, station, rng),
    )


def _lights(
    settings: AppearanceSettings, total: float, camera_light: bool, rng: np.random.Generator
) -> tuple[DirectedLight, ...]:
    """Lights that give the table so much irradiance together, by the settings; with one that goes
    with the camera if wanted."""
    if settings.lights is None:
        return ()
    low, high = settings.lights
    count = int(rng.integers(low, high + 1))
    elevation = np.deg2rad(rng.uniform(*OTHER_ELEVATION_DEG, count))
    elevation[0] = np.deg2rad(rng.uniform(*settings.light_elevation_deg))
    azimuth = rng.uniform(-np.pi, np.pi, count)
    camera_share = float(rng.uniform(*CAMERA_SHARE)) if camera_light else 0.0
    shares = rng.uniform(*OTHER_WEIGHT, count)
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
                irradiance=float(total * shares[k] / max(up, STEEP)),
                color=_light_color(settings, rng),
                shadows=k == 0 and shadows,
            )
        )
    if not camera_light:
        return tuple(found)
    x, y = rng.uniform(-0.4, 0.4, 2).tolist()
    fill = DirectedLight(
        direction=(x, y, 1.0), frame="camera", irradiance=float(total * camera_share)
    )
    return (*found, fill)


def _light_color(settings: AppearanceSettings, rng: np.random.Generator) -> Vector3:
    if settings.temperature is None:
        return WHITE
    low, high = settings.temperature
    return color_of_temperature(1e6 / float(rng.uniform(1e6 / high, 1e6 / low)))


def color_of_temperature(kelvin: float) -> Vector3:
    """Linear red, green, blue of a black body, relative to one of `NEUTRAL`, with green at 1; half
    of the difference, as cameras balance most of it.

    By Planck's law at the wavelengths of sRGB's primaries, which is as good as needed here.
    """
    wavelength = np.array([612e-9, 549e-9, 464e-9])  # dominant ones of sRGB's primaries [m]
    hc_k = 1.438777e-2  # second radiation constant [m K], CODATA 2018
    radiance = 1.0 / np.expm1(hc_k / (wavelength * kelvin))
    neutral = 1.0 / np.expm1(hc_k / (wavelength * NEUTRAL))
    ratio = np.sqrt(radiance / neutral)
    r, g, b = (ratio / ratio[1]).tolist()
    return (r, g, b)


def _table(settings: AppearanceSettings, rng: np.random.Generator) -> TableSurface | None:
    if not settings.table:
        return None
    pattern = settings.table[int(rng.integers(len(settings.table)))]
    return TableSurface(pattern=pattern, seed=int(rng.integers(SEEDS)))


def _photometry(settings: AppearanceSettings, rng: np.random.Generator) -> Photometry:
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


def _gains(
    settings: AppearanceSettings, objects: int, rng: np.random.Generator
) -> tuple[Vector3, ...]:
    if not settings.color_gain:
        return ()
    found = 1.0 + rng.uniform(-1.0, 1.0, (objects, 3)) * settings.color_gain
    return tuple((r, g, b) for r, g, b in found.tolist())
