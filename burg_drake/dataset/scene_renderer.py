"""Renders images of a scene from any camera pose, and labels the instances in them.

Drake or Blender renders the colours; `ray_casting` gives depth, labels and normals.
"""

from __future__ import annotations

from collections.abc import Iterable
from functools import cached_property
from typing import Literal, get_args

import cv2
import numpy as np
from pydrake.geometry import ClippingRange, ColorRenderCamera, QueryObject, RenderCameraCore
from pydrake.math import RigidTransform
from pydrake.multibody.tree import BodyIndex

from burg_drake.cameras import Intrinsics, camera_info, camera_intrinsics
from burg_drake.core import (
    Array,
    Bytes,
    InvalidInputError,
    UnknownNameError,
    inverse,
    suggest_names,
)
from burg_drake.dataset.appearance import Appearance
from burg_drake.dataset.appearance_rendering import apply_appearance, place_appearance
from burg_drake.dataset.blender_process import RENDERERS, RendererName, running_blender
from burg_drake.dataset.blender_scene import BlenderScene, make_blender_scene
from burg_drake.dataset.camera_rays import camera_rays
from burg_drake.dataset.photometry import apply_photometry
from burg_drake.dataset.ray_casting import RayScene, RaySurface, Silhouette, surfaces_of_body
from burg_drake.dataset.room import blend_over_background, fill_background
from burg_drake.dataset.sample import (
    SURROUNDINGS_LABEL,
    Images,
    InstanceLabel,
    box_of_mask,
    instance_numbers,
)
from burg_drake.dataset.views import View, set_posture
from burg_drake.scene import SceneLike, as_scene
from burg_drake.station import (
    RENDERER_NAME,
    Station,
    StationLike,
    as_station,
    build_station_diagram,
    visible_surfaces,
)

ImageKind = Literal["color", "depth", "labels", "normals"]


class SceneRenderer:
    """Renders one scene on one station from many camera poses.

    Depth, labels and normals come from ray casting: they are exact, and the same with any renderer.
    Colours come from Drake's renderer or Blender.

    Attributes:
        scene, station: what is rendered.
        numbers: label of each instance, by name.
    """

    def __init__(
        self,
        scene: SceneLike,
        station: StationLike,
        *,
        appearance: Appearance | None = None,
        arm: bool = False,
        colors: bool = True,
        renderer: RendererName = "drake",
    ) -> None:
        """Builds the scene.

        Args:
            scene: objects on the board.
            station: surroundings of the board.
            appearance: lights, textures and distractors; as in simulated cameras if None.
            arm: whether to include the station's arm.
            colors: whether to render colours. Without them no system libraries are needed, and all
                other images are the same.
            renderer: renderer of colours, `drake` or `blender`, which needs no system libraries.

        Raises:
            MissingDependencyError: a system library of Drake's renderer is missing.
            UnknownNameError: there is no such renderer.
            InvalidInputError: the station has no arm; and as `build_station_diagram`.
        """
        if renderer not in RENDERERS:
            raise UnknownNameError(
                f"renderer {renderer!r} does not exist; {suggest_names(renderer, RENDERERS)}"
            ).about("renderer")
        self.scene, self.station = as_scene(scene), as_station(station)
        self.numbers = instance_numbers(self.scene)
        self._appearance, self._in_blender = appearance, renderer == "blender"
        self._built = build_station_diagram(
            self.scene,
            self.station,
            robot="arm" if arm else "none",
            # The board has markers in either case.
            cameras=() if self._in_blender else colors or (),
        )
        self._renderer = RENDERER_NAME if colors else None
        if appearance is not None and colors and not self._in_blender:
            self._renderer = apply_appearance(self._built, appearance)
        elif appearance is not None:
            place_appearance(self._built, appearance)
        self._context = self._built.diagram.CreateDefaultContext()
        self._plant_context = self._built.plant.GetMyMutableContextFromRoot(self._context)
        self._posture: tuple[float, ...] | None = None
        self._rays: RayScene | None = None

    def images(
        self,
        view: View,
        kinds: Iterable[ImageKind] = ("color", "depth", "labels"),
        *,
        rng: np.random.Generator | None = None,
    ) -> Images:
        """Renders the images of a view.

        Args:
            view: the camera.
            kinds: kinds of images.
            rng: random numbers for the noise of colours, if the appearance has noise.

        Raises:
            InvalidInputError: a kind is unknown, or colours were not enabled.
        """
        known_kinds = get_args(ImageKind)
        kinds = tuple(kinds)
        for kind in kinds:
            if kind not in known_kinds:
                raise InvalidInputError(
                    f"image kind {kind!r} does not exist; {suggest_names(kind, known_kinds)}"
                )
        self._place_arm(view)
        by_rays = Images()
        if {"depth", "labels", "normals"} & {*kinds} or self._appearance is not None:
            by_rays = self._ray_scene.images(view, normals="normals" in kinds)
        color = None
        if "color" in kinds:
            X_WC = self.station.document.X_WS.matrix() @ view.X_SC
            color = self._color_image(view.intrinsics, X_WC, view.depth_range)
            if self._appearance is not None:
                color = apply_photometry(
                    color, by_rays.labels, self._appearance, rng or np.random.default_rng(0)
                )
        return Images(
            color,
            by_rays.depth if "depth" in kinds else None,
            by_rays.labels if "labels" in kinds else None,
            by_rays.normals,
        )

    def silhouette(self, number: int, view: View) -> Silhouette:
        """Silhouette of an object as a camera would see it without anything in front of it.

        Args:
            number: label of the object.
            view: the camera. Without lens distortion, the silhouette extends up to one image size
                beyond each edge of the image; with it, it ends at the edge, where the lens model
                ends.
        """
        self._place_arm(view)
        return self._ray_scene.silhouette(number, view)

    def _color_image(
        self, intrinsics: Intrinsics, X_WC: Array, depth_range: tuple[float, float]
    ) -> Bytes:
        """(H, W, 3) colour image of a camera at `X_WC`.

        For a lens with distortion, renders a pinhole camera that covers its field of view, and
        resamples that image.

        Raises:
            InvalidInputError: the field of view is too wide for a pinhole camera.
        """
        if self._renderer is None:
            raise InvalidInputError(
                "this scene was built without colours, so colour images cannot be rendered"
            )
        if not intrinsics.is_pinhole:
            wide, places = camera_rays(intrinsics).covering_pinhole
            image = self._color_image(wide, X_WC, depth_range)
            return np.asarray(cv2.remap(image, places, None, cv2.INTER_LINEAR), np.uint8)
        near, far = depth_range
        clip = (0.5 * near, 2.0 * far)  # wider than the measured depths
        if self._in_blender:
            poses = {str(int(body)): self._X_WB(body) for body, _ in self._surfaces}
            image = running_blender().image(self._blender_scene, poses, intrinsics, X_WC, clip)
            return blend_over_background(image, X_WC, intrinsics, self._appearance)
        core = RenderCameraCore(
            self._renderer, camera_info(intrinsics), ClippingRange(*clip), RigidTransform()
        )
        world = self._built.scene_graph.world_frame_id()
        rendered = self._query.RenderColorImage(
            ColorRenderCamera(core, False), world, RigidTransform(X_WC)
        )
        colors = np.asarray(cv2.cvtColor(rendered.data, cv2.COLOR_RGBA2RGB), np.uint8)
        if self._appearance is None:
            return colors
        return fill_background(colors, X_WC, intrinsics, self._appearance)

    @cached_property
    def _query(self) -> QueryObject:
        scene_graph = self._built.scene_graph
        context = scene_graph.GetMyContextFromRoot(self._context)
        return scene_graph.get_query_output_port().Eval(context)

    @cached_property
    def _blender_scene(self) -> BlenderScene:
        return make_blender_scene(self._built, self._appearance)

    def _place_arm(self, view: View) -> None:
        joints = self._built.arm_joints
        if bool(joints) != (view.posture is not None):
            raise InvalidInputError(
                "the view has no joint positions, but the scene has an arm; give them"
                if joints
                else "the view has joint positions, but the scene has no arm; leave them out"
            )
        if view.posture is None or view.posture == self._posture:
            return
        set_posture(joints, self._plant_context, view.posture)
        self._posture, self._rays = view.posture, None

    @cached_property
    def _surfaces(self) -> list[tuple[BodyIndex, RaySurface]]:
        """Surfaces for ray casting, each in its body's frame."""
        placed = {**self._built.free, **self._built.fixed}
        owner = {placed[name]: number for name, number in self.numbers.items()}
        found = []
        surfaces = visible_surfaces(self._built.plant, self._built.scene_graph)
        for body in dict.fromkeys(one.body for one in surfaces):
            parts = [(one.vertices, one.faces) for one in surfaces if one.body == body]
            label = owner.get(body, SURROUNDINGS_LABEL)
            found += [(body, surface) for surface in surfaces_of_body(label, parts)]
        return found

    @property
    def _ray_scene(self) -> RayScene:
        if self._rays is None:
            X_SW = inverse(self.station.document.X_WS.matrix())
            poses = [X_SW @ self._X_WB(body) for body, _ in self._surfaces]
            self._rays = RayScene([surface for _, surface in self._surfaces], poses)
        return self._rays

    def _X_WB(self, body: BodyIndex) -> Array:
        plant = self._built.plant
        pose = plant.EvalBodyPoseInWorld(self._plant_context, plant.get_body(body))
        return np.asarray(pose.GetAsMatrix4())


def render(
    scene: SceneLike,
    station: StationLike,
    camera: str | View = "board",
    kinds: Iterable[ImageKind] = ("color", "depth", "labels"),
    *,
    arm: bool = False,
    renderer: RendererName = "drake",
) -> Images:
    """Renders the images of a camera of a scene on a station.

    Example::

        images = burg.render("tabletop_six", "panda_tabletop", "board", ["depth", "labels"])
        print(images.depth.max(), images.labels.max())

    Args:
        scene: objects on the board.
        station: surroundings of the board.
        camera: name of a camera of the station, or any view.
        kinds: kinds of images: `color`, `depth`, `labels`, `normals`.
        arm: whether to include the station's arm, in its home posture if the camera is a name.
        renderer: renderer of colours, `drake` or `blender`; other images are the same with both.

    Returns:
        Pixel-aligned images. Images that were not requested are None.

    Raises:
        UnknownNameError: there is no such camera, scene, station or renderer.
        MissingDependencyError: colours are requested, and the renderer is not installed or lacks a
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
        station: station with the camera.
        camera: name of the camera.
        arm: whether to include the arm, in its home posture.

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
        intrinsics=camera_intrinsics(found),
        X_SC=inverse(document.X_WS.matrix()) @ found.X_WC.matrix(),
        depth_range=found.depth_range,
        posture=tuple(document.arm.home) if arm and document.arm is not None else None,
    )


def label_instances(
    renderer: SceneRenderer, view: View, images: Images | None = None
) -> tuple[InstanceLabel, ...]:
    """Labels of all instances, in the order of their numbers.

    Args:
        renderer: renderer of the scene.
        view: the camera.
        images: images of the view, with labels; rendered if None.
    """
    labels = images.labels if images is not None else None
    if labels is None:
        labels = renderer.images(view, ("labels",)).labels
        assert labels is not None
    X_CS, (height, width) = inverse(view.X_SC), labels.shape
    counts = np.bincount(labels.ravel(), minlength=len(renderer.numbers) + 1)
    found = []
    for name, number in renderer.numbers.items():
        silhouette = renderer.silhouette(number, view)
        amodal = silhouette.mask_in_image(width, height)
        visible_pixels = int(counts[number])
        silhouette_pixels = int(np.count_nonzero(silhouette.mask))
        rows, columns = silhouette.mask.shape
        found.append(
            InstanceLabel(
                name=name,
                object=renderer.scene.instance(name).object,
                number=number,
                X_CO=X_CS @ renderer.scene.X_SO(name),
                visible_pixels=visible_pixels,
                silhouette_pixels=silhouette_pixels,
                visibility=visible_pixels / silhouette_pixels if silhouette_pixels else 0.0,
                visible_box=box_of_mask(labels == number) if visible_pixels else None,
                amodal_box=(silhouette.left, silhouette.top, columns, rows) if rows else None,
                amodal=amodal,
            )
        )
    return tuple(found)
