"""An appearance in Drake: its renderer, and what the scene graph has to show it."""

from __future__ import annotations

import contextlib
import os
import tempfile
import time
from pathlib import Path

import cv2
import numpy as np
from pydrake.geometry import (
    Box,
    EnvironmentMap,
    EquirectangularMap,
    GeometryInstance,
    LightParameter,
    Mesh,
    PerceptionProperties,
    RenderEngineVtkParams,
    RenderLabel,
    Rgba,
    Role,
)
from pydrake.math import RigidTransform
from pydrake.multibody.tree import RigidBody

from burg_drake.core import (
    InvalidInputError,
    cache_folder,
    content_hash,
    make_pose,
)
from burg_drake.core.files import atomic_write
from burg_drake.dataset.appearance.appearance import Appearance, DirectedLight
from burg_drake.dataset.appearance.background import NOWHERE
from burg_drake.dataset.appearance.distractors import distractor_library
from burg_drake.dataset.appearance.patterns import EXTENT, table_texture
from burg_drake.dataset.appearance.room import room_radiance
from burg_drake.dataset.appearance.textured_box import textured_box
from burg_drake.station.diagram import StationDiagram
from burg_drake.station.world import LIGHTS, add_renderer

RENDERER = "appearance"
POINT_LIGHT_DISTANCE = 50.0
"""Distance of lights that are points [m]."""
SHADOW_MAP = 1024
"""Pixels along a side of the image that decides about shadows, which spans the whole table."""
HEADROOM = 1.5
"""Of the speck that is put above the board where there are shadows [m]: what of a scene is nearest
to the light has false shadows in VTK, so that something has to be nearer than the objects."""
SPECK = 5e-4
"""Its size [m]: less than a pixel."""
OLD = 86_400.0
"""Files of rooms older than that are removed [s]; each has some tens of kilobytes."""


def apply_appearance(built: StationDiagram, appearance: Appearance) -> str:
    """Makes a diagram look like that: `place_appearance`, and a renderer with its light.

    Args:
        built, appearance: see there.

    Returns:
        The renderer's name, for `RenderCameraCore`. Its images need `with_background`, then
        `photometric`.

    Raises:
        MissingDependencyError, InvalidInputError: see `add_renderer`.
        UnknownNameError: there is no such library of distractors, or no such object in it.
    """
    place_appearance(built, appearance)
    add_renderer(built.scene_graph, RENDERER, render_parameters(appearance))
    return RENDERER


def place_appearance(built: StationDiagram, appearance: Appearance) -> None:
    """Gives a diagram the surfaces of an appearance, which rays meet, too: covers the table with
    its pattern, takes the printed board away, and puts distractors onto the table. Contact and
    poses stay as they are; no system libraries are needed.

    Args:
        built: whose board has markers, and before a context of it is created.
        appearance: how it shall look.

    Raises:
        UnknownNameError: there is no such library of distractors, or no such object in it.
    """
    if appearance.table is not None:
        _cover_table(built, appearance)
    if not appearance.board:
        _unseen(built, built.plant.GetBodyByName("board"))
    _add_distractors(built, appearance)
    if any(light.shadows for light in appearance.lights):
        _add_speck(built)


def render_parameters(appearance: Appearance) -> RenderEngineVtkParams:
    """Parameters of Drake's renderer: its lights, whether they cast shadows, and the picture of the
    room if that lights the scene. Lights add up linearly."""
    shadows = any(light.shadows for light in appearance.lights)
    parameters = RenderEngineVtkParams(
        default_clear_color=np.array(NOWHERE) / 255.0,
        lights=[_light(one, shadows) for one in appearance.lights] or LIGHTS,
        force_to_pbr=bool(appearance.lights),
        cast_shadows=shadows,
        shadow_map_size=SHADOW_MAP,
    )
    if appearance.room is not None and appearance.room_light:
        texture = EquirectangularMap(path=str(environment_file(appearance)))
        parameters.environment_map = EnvironmentMap(skybox=False, texture=texture)
    return parameters


def environment_file(appearance: Appearance) -> Path:
    """The light of a room, as a file that Drake's `EquirectangularMap` takes: in the cache, or in
    the folder of temporary files if there is no cache.

    It is a Radiance HDR file: Drake takes a PNG's values for linear ones, and 30 times as long.

    Raises:
        InvalidInputError: there is no room.
    """
    if appearance.room is None:
        raise InvalidInputError("the appearance has no room, so it has no environment")
    radiance = room_radiance(appearance.room, appearance.room_light or 1.0)
    _, encoded = cv2.imencode(".hdr", np.ascontiguousarray(radiance[..., ::-1]))
    content = bytes(encoded)
    folder = cache_folder() or Path(tempfile.gettempdir()) / f"burg_drake_{os.getuid()}"
    path = folder / f"room-{content_hash(content)[:32]}.hdr"
    if not path.exists():
        _remove_old(folder)
        atomic_write(path, content)
    return path


def _remove_old(folder: Path) -> None:
    """Removes files of rooms that nobody can be about to read any more."""
    for path in folder.glob("room-*.hdr"):
        with contextlib.suppress(OSError):  # another process has removed it
            if time.time() - path.stat().st_mtime > OLD:
                path.unlink()


def _light(light: DirectedLight, shadows: bool) -> LightParameter:
    """A light for Drake, whose physically based shading divides by pi what a white surface
    reflects.

    Args:
        light: far away.
        shadows: whether any light of the scene casts shadows: all directional ones do then, but
            points do not. Otherwise directional ones are quicker.
    """
    direction = np.array(light.direction) / np.linalg.norm(light.direction)
    brightest = max(light.color)
    found = LightParameter(
        type="directional" if light.shadows or not shadows else "point",
        frame=light.frame,
        color=Rgba(*(np.array(light.color) / brightest), 1.0),
        intensity=light.irradiance * brightest * np.pi,
        attenuation_values=np.array([1.0, 0.0, 0.0]),
    )
    found.direction = direction
    found.position = -POINT_LIGHT_DISTANCE * direction
    return found


def _cover_table(built: StationDiagram, appearance: Appearance) -> None:
    """Puts a box with the texture in the place of the one that cameras see."""
    assert appearance.table is not None
    table = built.plant.get_body(built.table)
    inspector = built.scene_graph.model_inspector()
    for geometry in built.plant.GetVisualGeometriesForBody(table):
        size = inspector.GetShape(geometry).size()
        X_TB = inspector.GetPoseInFrame(geometry)
        mesh = textured_box(size, EXTENT[appearance.table.pattern], table_texture(appearance))
        instance = GeometryInstance(X_TB, mesh, "table_texture")
        instance.set_perception_properties(_without_label())
        frame = built.plant.GetBodyFrameIdOrThrow(table.index())
        built.scene_graph.RegisterGeometry(built.plant.get_source_id(), frame, instance)
    _unseen(built, table)


def _add_distractors(built: StationDiagram, appearance: Appearance) -> None:
    if not appearance.distractors:
        return
    library = distractor_library(appearance.library)
    X_WS = built.station.document.X_WS.matrix()
    for k, one in enumerate(appearance.distractors):
        mesh = Mesh(str(library.path(library.entry(one.object).mesh)))
        X_WO = RigidTransform(X_WS @ one.X_SO.matrix())
        instance = GeometryInstance(X_WO, mesh, f"distractor_{k}")
        instance.set_perception_properties(_without_label())
        built.scene_graph.RegisterAnchoredGeometry(built.plant.get_source_id(), instance)


def _add_speck(built: StationDiagram) -> None:
    x, y = built.scene.board.size
    X_WQ = built.station.document.X_WS.matrix() @ make_pose(p_AB=(x / 2, y / 2, HEADROOM))
    instance = GeometryInstance(RigidTransform(X_WQ), Box(SPECK, SPECK, SPECK), "headroom")
    instance.set_perception_properties(_without_label())
    built.scene_graph.RegisterAnchoredGeometry(built.plant.get_source_id(), instance)


def _unseen(built: StationDiagram, body: RigidBody) -> None:
    """Takes what cameras see of a body away from them."""
    source = built.plant.get_source_id()
    inspector = built.scene_graph.model_inspector()
    for geometry in built.plant.GetVisualGeometriesForBody(body):
        if inspector.GetPerceptionProperties(geometry) is not None:
            built.scene_graph.RemoveRole(source, geometry, Role.kPerception)


def _without_label() -> PerceptionProperties:
    properties = PerceptionProperties()
    properties.AddProperty("label", "id", RenderLabel.kDontCare)
    return properties
