"""Applies an appearance to a Drake diagram: renderer, lights, textured table and distractors."""

from __future__ import annotations

import contextlib
import os
import tempfile
import time
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from pydrake.common import MemoryFile
from pydrake.geometry import (
    Box,
    EnvironmentMap,
    EquirectangularMap,
    GeometryInstance,
    InMemoryMesh,
    LightParameter,
    Mesh,
    PerceptionProperties,
    RenderEngineVtkParams,
    RenderLabel,
    Rgba,
    Role,
    Shape,
)
from pydrake.math import RigidTransform
from pydrake.multibody.tree import RigidBody

from burg_drake.core import (
    Array,
    InvalidInputError,
    atomic_write,
    cache_folder,
    content_hash,
    make_pose,
)
from burg_drake.dataset.appearance import Appearance, DirectedLight
from burg_drake.dataset.appearance_sampling import distractor_library
from burg_drake.dataset.room import NO_SURFACE_COLOR, room_radiance
from burg_drake.dataset.textures import TEXTURE_EXTENTS, table_texture
from burg_drake.station import DEFAULT_LIGHTS, StationDiagram, add_renderer


def apply_appearance(built: StationDiagram, appearance: Appearance) -> str:
    """Applies an appearance to a diagram: `place_appearance`, and a renderer with its lights.

    Args:
        built, appearance: as for `place_appearance`.

    Returns:
        The renderer's name, for `RenderCameraCore`. Apply `fill_background`, then
        `apply_photometry`, to its images.

    Raises:
        MissingDependencyError, InvalidInputError: see `add_renderer`.
        UnknownNameError: there is no such library of distractors, or no such object in it.
    """
    renderer = "appearance"  # Name of the renderer in the scene graph.
    place_appearance(built, appearance)
    add_renderer(built.scene_graph, renderer, render_parameters(appearance))
    return renderer


def place_appearance(built: StationDiagram, appearance: Appearance) -> None:
    """Adds the surfaces of an appearance to a diagram, for renderers and ray casting: the pattern
    of the table and the distractors; removes the printed board if it shall not be visible. Contact
    and poses stay the same. Needs no system libraries.

    Args:
        built: diagram whose board has markers, without a context so far.
        appearance: the appearance.

    Raises:
        UnknownNameError: there is no such library of distractors, or no such object in it.
    """
    if appearance.table is not None:
        _cover_table(built, appearance)
    if not appearance.board:
        _hide_from_cameras(built, built.plant.GetBodyByName("board"))
    _add_distractors(built, appearance)
    if any(light.shadows for light in appearance.lights):
        _add_shadow_speck(built)


def render_parameters(appearance: Appearance) -> RenderEngineVtkParams:
    """Parameters of Drake's renderer: its lights, whether they cast shadows, and the environment
    map if the room lights the scene. Lights add up linearly."""
    shadows = any(light.shadows for light in appearance.lights)
    parameters = RenderEngineVtkParams(
        default_clear_color=np.array(NO_SURFACE_COLOR) / 255.0,
        lights=[_drake_light(one, shadows) for one in appearance.lights] or DEFAULT_LIGHTS,
        force_to_pbr=bool(appearance.lights),
        cast_shadows=shadows,
        shadow_map_size=1024,
    )
    if appearance.room is not None and appearance.room_light:
        texture = EquirectangularMap(path=str(environment_file(appearance)))
        parameters.environment_map = EnvironmentMap(skybox=False, texture=texture)
    return parameters


def environment_file(appearance: Appearance) -> Path:
    """Writes the radiance map of a room as a file for Drake's `EquirectangularMap`, in the cache,
    or in the folder of temporary files without a cache.

    The format is Radiance HDR, as Drake takes a PNG's values for linear ones and loads it 30 times
    as long.

    Raises:
        InvalidInputError: the appearance has no room.
    """
    if appearance.room is None:
        raise InvalidInputError("the appearance has no room, so it has no environment")
    radiance = room_radiance(appearance.room, appearance.room_light or 1.0)
    _, encoded = cv2.imencode(".hdr", np.ascontiguousarray(radiance[..., ::-1]))
    content = bytes(encoded)
    folder = cache_folder() or Path(tempfile.gettempdir()) / f"burg_drake_{os.getuid()}"
    path = folder / f"room-{content_hash(content)[:32]}.hdr"
    if not path.exists():
        _remove_old_environment_files(folder)
        atomic_write(path, content)
    return path


def _remove_old_environment_files(folder: Path) -> None:
    """Removes environment files that are too old to be still in use."""
    max_age = 86_400.0  # Seconds, after which no process still has to read a file.
    for path in folder.glob("room-*.hdr"):
        with contextlib.suppress(OSError):  # another process has removed it
            if time.time() - path.stat().st_mtime > max_age:
                path.unlink()


def _drake_light(light: DirectedLight, shadows: bool) -> LightParameter:
    """Converts a light for Drake, whose physically based shading divides the light that a white
    surface reflects by pi.

    Args:
        light: the light.
        shadows: whether any light of the scene casts shadows. Then all directional lights of Drake
            do, so that lights without shadows become point lights; directional ones are faster.
    """
    point_light_distance = 50.0  # Metres.
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
    found.position = -point_light_distance * direction
    return found


def _cover_table(built: StationDiagram, appearance: Appearance) -> None:
    """Replaces the visible box of the table with a textured one."""
    assert appearance.table is not None
    table = built.plant.get_body(built.table)
    inspector = built.scene_graph.model_inspector()
    for geometry in built.plant.GetVisualGeometriesForBody(table):
        size = inspector.GetShape(geometry).size()
        X_TB = inspector.GetPoseInFrame(geometry)
        mesh = textured_box(
            size, TEXTURE_EXTENTS[appearance.table.pattern], table_texture(appearance)
        )
        instance = _unlabelled_geometry(X_TB, mesh, "table_texture")
        frame = built.plant.GetBodyFrameIdOrThrow(table.index())
        built.scene_graph.RegisterGeometry(built.plant.get_source_id(), frame, instance)
    _hide_from_cameras(built, table)


def _add_distractors(built: StationDiagram, appearance: Appearance) -> None:
    if not appearance.distractors:
        return
    library = distractor_library(appearance.library)
    X_WS = built.station.document.X_WS.matrix()
    for k, one in enumerate(appearance.distractors):
        mesh = Mesh(str(library.path(library.entry(one.object).mesh)))
        X_WO = RigidTransform(X_WS @ one.X_SO.matrix())
        instance = _unlabelled_geometry(X_WO, mesh, f"distractor_{k}")
        built.scene_graph.RegisterAnchoredGeometry(built.plant.get_source_id(), instance)


def _add_shadow_speck(built: StationDiagram) -> None:
    # Metres above the board; VTK gives the body nearest to the light false shadows.
    speck_height = 1.5
    speck_size = 5e-4  # Metres, less than a pixel.
    x, y = built.scene.board.size
    X_WQ = built.station.document.X_WS.matrix() @ make_pose(p_AB=(x / 2, y / 2, speck_height))
    speck = Box(speck_size, speck_size, speck_size)
    instance = _unlabelled_geometry(RigidTransform(X_WQ), speck, "headroom")
    built.scene_graph.RegisterAnchoredGeometry(built.plant.get_source_id(), instance)


def _hide_from_cameras(built: StationDiagram, body: RigidBody) -> None:
    """Hides a body from cameras."""
    source = built.plant.get_source_id()
    inspector = built.scene_graph.model_inspector()
    for geometry in built.plant.GetVisualGeometriesForBody(body):
        if inspector.GetPerceptionProperties(geometry) is not None:
            built.scene_graph.RemoveRole(source, geometry, Role.kPerception)


def _unlabelled_geometry(X_FG: RigidTransform, shape: Shape, name: str) -> GeometryInstance:
    """Visible geometry without a label of its own."""
    properties = PerceptionProperties()
    properties.AddProperty("label", "id", RenderLabel.kDontCare)
    instance = GeometryInstance(X_FG, shape, name)
    instance.set_perception_properties(properties)
    return instance


def textured_box(size: Array, extent: float, png: bytes) -> Mesh:
    """A textured box around the origin. Its faces are tiled with squares that show the texture
    once each, as Drake's renderer does not repeat textures.

    Args:
        size: (3,) extents [m].
        extent: side of a square [m].
        png: a seamless texture.
    """
    # Wavefront material that shows only the texture.
    material = "newmtl surface\nKd 1 1 1\nmap_Kd surface.png\n"
    lines = ["mtllib box.mtl", "usemtl surface"]
    count = 0
    for k, (axis, sign) in enumerate((axis, sign) for axis in range(3) for sign in (-1.0, 1.0)):
        normal = sign * np.eye(3)[axis]
        lines.append(f"vn {_format_numbers(normal)}")
        u, v = ((1, 2), (2, 0), (0, 1))[axis]
        for low, high in _texture_tiles(size[[u, v]], extent):
            for a, b in ((0, 0), (1, 0), (1, 1), (0, 1)):
                share = np.where((a, b), high, low) / size[[u, v]]
                p = 0.5 * normal
                p[u], p[v] = sign * (share[0] - 0.5), share[1] - 0.5  # counter-clockwise outside
                lines.append(f"v {_format_numbers(p * size)}")
                lines.append(f"vt {_format_numbers(np.where((a, b), (high - low) / extent, 0.0))}")
            corners = range(count + 1, count + 5)
            lines.append("f " + " ".join(f"{i}/{i}/{k + 1}" for i in corners))
            count += 4
    contents: Any = png  # which the stub has as text
    return Mesh(
        InMemoryMesh(
            mesh_file=MemoryFile("\n".join(lines) + "\n", ".obj", "box.obj"),
            supporting_files={
                "box.mtl": MemoryFile(material, ".mtl", "box.mtl"),
                "surface.png": MemoryFile(contents, ".png", "surface.png"),
            },
        )
    )


def _texture_tiles(size: Array, extent: float) -> list[tuple[Array, Array]]:
    """Lower and upper corners (2,) of squares that tile a rectangle; the last ones are clipped."""
    x, y = (np.append(np.arange(0.0, length - 1e-9, extent), length) for length in size)
    return [
        (np.array([x[i], y[j]]), np.array([x[i + 1], y[j + 1]]))
        for i in range(len(x) - 1)
        for j in range(len(y) - 1)
    ]


def _format_numbers(values: Array) -> str:
    return " ".join(f"{value:.9g}" for value in values)
