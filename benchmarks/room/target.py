"""Pictures of a printed calibration target, anywhere in the image."""

from __future__ import annotations

import subprocess
import sys
import tempfile
from functools import lru_cache
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from .covers import nothing
from .exposure import PAPER, Surface, no_gloss, radiance, table
from .lens import Camera
from .light import Light, irradiance, map_of
from .paper import Array, Image, Page, read_pages
from .sensor import Sensor, image_of
from .sheet import Relief, assembled, flat

NEAR, FAR = 0.15, 0.35
"""Distances of the target's middle from the camera [m]."""
TILTS = (5.0, 45.0)
"""Of the target, off the line of sight [deg]."""
LOWEST = np.radians(88.0)
"""Most that the camera may look off the vertical to the target; its height is not 0."""


@lru_cache(maxsize=1)
def target_page() -> Page:
    """The page that the command writes."""
    with tempfile.TemporaryDirectory() as folder:
        pdf = Path(folder) / "target.pdf"
        command = [sys.executable, "-m", "burg_drake.apps.cli", "camera", "target", "-o", str(pdf)]
        subprocess.run(command, check=True, capture_output=True)
        (page,) = read_pages(pdf.read_bytes())
        return page


def bent(size: tuple[float, float], height: float) -> Relief:
    """A sheet whose middle stands up from its short sides, as a curve of degree two [m]."""
    relief = flat(size)
    y = relief.bottom + relief.step * np.arange(relief.z.shape[0])
    share = np.clip(y / size[1], 0.0, 1.0)
    return relief._replace(
        z=np.tile(
            (4.0 * height * share * (1 - share)).astype(np.float32)[:, None], relief.z.shape[1]
        )
    )


def view_at(camera: Camera, reach: float, rng: np.random.Generator) -> Array:
    """(4, 4) `X_SC` of a camera that sees the middle of the page somewhere in its image.

    Args:
        camera: that sees it.
        reach: share of the image's width and height in which it is, about the image's middle.
        rng: of the view.
    """
    size = np.array(target_page().size)
    pixel = (np.array(camera.size) - 1) * (0.5 + reach * (rng.random(2) - 0.5))
    sight = np.r_[camera.directions(pixel), 1.0]
    sight /= np.linalg.norm(sight)
    heading = rng.uniform(-np.pi, np.pi)
    tilt = np.radians(rng.uniform(*TILTS)) * np.array([np.cos(heading), np.sin(heading), 0.0])
    to_sight, _ = Rotation.align_vectors([sight], [[0.0, 0.0, 1.0]])
    roll = Rotation.from_euler("z", rng.uniform(-np.pi, np.pi))
    R_CS = (to_sight * Rotation.from_rotvec(tilt) * roll).as_matrix() @ np.diag([1.0, -1.0, -1.0])
    X_SC = np.eye(4)
    X_SC[:3, :3] = R_CS.T
    X_SC[:3, 3] = np.r_[size / 2, 0.0] - R_CS.T @ (rng.uniform(NEAR, FAR) * sight)
    return X_SC


def target_picture(
    camera: Camera, X_SC: Array, sensor: Sensor, rng: np.random.Generator, bulge: float = 0.0
) -> Image:
    """(H, W, 3) what the camera sees of the page on a table under a lamp, `bulge` high [m]."""
    page = target_page()
    lamp = (*(np.array(page.size) / 2 + rng.uniform(-0.8, 0.8, 2)).tolist(), 1.6)
    light = map_of(irradiance(Light(ambient=0.5, lamp=lamp), page.size))
    relief = bent(page.size, bulge)
    surface = Surface(_texture(), relief, table(rng), light, nothing(), no_gloss())
    return image_of(radiance(camera, X_SC[None, None], surface), PAPER, sensor, rng)


@lru_cache(maxsize=1)
def _texture():
    page = target_page()
    return assembled(page.size, (page,), [np.eye(3)])
