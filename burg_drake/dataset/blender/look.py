"""The lights of an appearance for Blender, where they are as bright as in Drake's renderer."""

from __future__ import annotations

import numpy as np

from burg_drake.dataset.appearance import Appearance, DirectedLight, environment_file
from burg_drake.dataset.blender.scene import BlenderScene, Lamp
from burg_drake.dataset.blender.surfaces import painted_surfaces
from burg_drake.station.diagram import StationDiagram
from burg_drake.station.world import LIGHTS

LAMP_ANGLE = np.deg2rad(4.0)
"""That a lamp takes, seen from the table: 20 cm at 3 m."""


def blender_scene(built: StationDiagram, appearance: Appearance | None = None) -> BlenderScene:
    """A diagram as it is for Blender.

    Lights that stand in the world cast shadows whether or not they are asked to: without them
    things seem to float. One that goes with the camera stands for what walls scatter, and casts
    them only if it is asked to.

    Args:
        built: with the markers of its board, and the things of the appearance.
        appearance: has the lights; those of simulated cameras if it has none.
    """
    lights = () if appearance is None else appearance.lights
    environment = b""
    if appearance is not None and appearance.room is not None and appearance.room_light:
        environment = environment_file(appearance).read_bytes()
    surfaces = painted_surfaces(built.plant, built.scene_graph, linear=bool(lights))
    lamps = [_lamp(light) for light in lights or _usual_lights()]
    return BlenderScene(surfaces, tuple(lamps), environment)


def _usual_lights() -> list[DirectedLight]:
    found = []
    for light in LIGHTS:
        x, y, z = np.asarray(light.direction, float).tolist()
        intensity = float(light.intensity)
        found.append(DirectedLight(direction=(x, y, z), frame=light.frame, irradiance=intensity))
    return found


def _lamp(light: DirectedLight) -> Lamp:
    return Lamp(
        direction=light.direction,
        frame=light.frame,
        irradiance=light.irradiance * np.pi,  # a white surface reflects the pi-th part
        color=light.color,
        shadows=light.shadows or light.frame == "world",
        angle=float(LAMP_ANGLE),
    )
