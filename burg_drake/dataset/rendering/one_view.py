"""One look at a scene."""

from __future__ import annotations

from collections.abc import Iterable

from burg_drake.cameras.optics import of_camera
from burg_drake.core import InvalidInputError, inverse
from burg_drake.dataset.blender import RendererName
from burg_drake.dataset.rendering.images import Images
from burg_drake.dataset.rendering.scene_renderer import ImageKind, SceneRenderer
from burg_drake.dataset.views import View
from burg_drake.scene.document import SceneLike, as_scene
from burg_drake.station.document import Station, StationLike, as_station


def render(
    scene: SceneLike,
    station: StationLike,
    camera: str | View = "board",
    kinds: Iterable[ImageKind] = ("color", "depth", "labels"),
    *,
    arm: bool = False,
    renderer: RendererName = "drake",
) -> Images:
    """What a camera sees of a scene on a station.

    Example::

        images = burg.render("tabletop_six", "panda_tabletop", "board", ["depth", "labels"])
        print(images.depth.max(), images.labels.max())

    Args:
        scene: what stands on the board.
        station: what is around it.
        camera: its name in the station, or any view.
        kinds: of images: `color`, `depth`, `labels`, `normals`.
        arm: whether the station's arm is there, in its home posture if the camera is a name.
        renderer: of colours, `drake` or `blender`; all else is the same with both.

    Returns:
        Images whose pixels are the same ones; those that were not asked for are None.

    Raises:
        UnknownNameError: there is no such camera, scene, station or renderer.
        MissingDependencyError: colours were asked for, and the renderer is not installed or lacks a
            system library.
        SimulationError: Blender failed.
        InvalidInputError: there is no such kind of image, or the station has no arm.
    """
    scene, station = as_scene(scene), as_station(station)
    kinds = tuple(kinds)
    view = camera if isinstance(camera, View) else station_view(station, camera, arm=arm)
    rendered = SceneRenderer(
        scene,
        station,
        arm=view.posture is not None,
        colors="color" in kinds,
        renderer=renderer,
    )
    return rendered.images(view, kinds)


def station_view(station: Station, camera: str, *, arm: bool = False) -> View:
    """The view of a station's camera.

    Args:
        station: has the camera.
        camera: its name.
        arm: whether the arm is there, in its home posture.

    Raises:
        UnknownNameError: there is no such camera.
        InvalidInputError: the station has no arm.
    """
    document = station.document
    if arm and document.arm is None:
        raise InvalidInputError(
            f"station {station.name!r} has no arm to show in the view; give a station with an arm"
        )
    found = station.camera(camera)
    return View(
        camera=camera,
        intrinsics=of_camera(found),
        X_SC=inverse(document.X_WS.matrix()) @ found.X_WC.matrix(),
        depth_range=found.depth_range,
        posture=tuple(document.arm.home) if arm and document.arm is not None else None,
    )
