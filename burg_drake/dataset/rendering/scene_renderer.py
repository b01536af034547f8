"""A scene to be looked at from anywhere: images of it, and labels of its objects."""

from __future__ import annotations

from collections.abc import Iterable
from functools import cached_property, partial
from typing import Literal

import numpy as np
from pydrake.multibody.tree import BodyIndex

from burg_drake.core import Array, InvalidInputError, UnknownNameError, inverse, nearest
from burg_drake.dataset.appearance import (
    Appearance,
    apply_appearance,
    photometric,
    place_appearance,
    with_background,
)
from burg_drake.dataset.blender import RENDERERS, RendererName, blender_scene
from burg_drake.dataset.rendering.blender_colors import BlenderColors
from burg_drake.dataset.rendering.colors import DrakeColors
from burg_drake.dataset.rendering.images import SURROUNDINGS, Images, instance_numbers
from burg_drake.dataset.rendering.ray_scene import RayScene, Silhouette
from burg_drake.dataset.rendering.ray_surface import RaySurface, surfaces_of_body
from burg_drake.dataset.views import View
from burg_drake.scene.document import SceneLike, as_scene
from burg_drake.station.diagram import build_station_diagram, visible_surfaces
from burg_drake.station.document import StationLike, as_station
from burg_drake.station.world import RENDERER

ImageKind = Literal["color", "depth", "labels", "normals"]
KINDS: tuple[ImageKind, ...] = ("color", "depth", "labels", "normals")


class SceneRenderer:
    """Renders one scene on one station from many places.

    Depth, labels and normals come from rays and are exact, and the same with any renderer; colours
    come from Drake's renderer or Blender.

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
            scene: what stands on the board.
            station: what is around it.
            appearance: how it looks; as simulated cameras see it if None.
            arm: whether the station's arm is there.
            colors: whether colours will be asked for; without them no system libraries are needed,
                and all other images are the same.
            renderer: of colours, `drake` or `blender`, which needs no system libraries.

        Raises:
            MissingDependencyError: a system library of Drake's renderer is missing.
            UnknownNameError: there is no such renderer.
            InvalidInputError: the station has no arm; and as `build_station_diagram`.
        """
        if renderer not in RENDERERS:
            raise UnknownNameError(
                f"renderer {renderer!r} does not exist; {nearest(renderer, RENDERERS)}"
            ).about("renderer")
        self.scene, self.station = as_scene(scene), as_station(station)
        self.numbers = instance_numbers(self.scene)
        self._appearance, self._in_blender = appearance, renderer == "blender"
        self._built = build_station_diagram(
            self.scene,
            self.station,
            robot="arm" if arm else "none",
            # The board has markers in any case.
            cameras=() if self._in_blender else colors or (),
        )
        self._renderer = RENDERER if colors else None
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
        """What a camera sees.

        Args:
            view: the camera.
            kinds: of images.
            rng: draws the noise of colours, where the appearance has some.

        Raises:
            InvalidInputError: an image of another kind, or colours of a renderer without them.
        """
        kinds = tuple(kinds)
        for kind in kinds:
            if kind not in KINDS:
                raise InvalidInputError(
                    f"image kind {kind!r} does not exist; {nearest(kind, KINDS)}"
                )
        self._place_arm(view)
        by_rays = Images()
        if {"depth", "labels", "normals"} & {*kinds} or self._appearance is not None:
            by_rays = self._ray_scene.images(view, normals="normals" in kinds)
        color = None
        if "color" in kinds:
            X_WC = self.station.document.X_WS.matrix() @ view.X_SC
            color = self._colors.image(view.intrinsics, X_WC, view.depth_range)
            if self._appearance is not None:
                color = photometric(
                    color, by_rays.labels, self._appearance, rng or np.random.default_rng(0)
                )
        return Images(
            color,
            by_rays.depth if "depth" in kinds else None,
            by_rays.labels if "labels" in kinds else None,
            by_rays.normals,
        )

    def silhouette(self, number: int, view: View) -> Silhouette:
        """All that a camera would see of an object if it were alone.

        Args:
            number: its label.
            view: the camera. Without lens distortion up to one image size beyond each edge of the
                image counts, with it the image alone: the model of a lens does not reach further.
        """
        self._place_arm(view)
        return self._ray_scene.silhouette(number, view)

    @cached_property
    def _colors(self) -> DrakeColors | BlenderColors:
        if self._renderer is None:
            raise InvalidInputError(
                "this scene was built without colours, so colour images cannot be rendered"
            )
        if self._in_blender:
            scene = blender_scene(self._built, self._appearance)
            return BlenderColors(scene, self._poses, self._appearance)
        scene_graph = self._built.scene_graph
        context = scene_graph.GetMyContextFromRoot(self._context)
        query = scene_graph.get_query_output_port().Eval(context)
        fill = None
        if self._appearance is not None:
            fill = partial(with_background, look=self._appearance)
        return DrakeColors(query, scene_graph.world_frame_id(), self._renderer, fill)

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
        if len(view.posture) != len(joints):
            raise InvalidInputError(
                f"the view has joint positions of {len(view.posture)} joints; the arm has"
                f" {len(joints)}"
            )
        for joint, position in zip(joints, view.posture, strict=True):
            joint.set_angle(self._plant_context, position)
        self._posture, self._rays = view.posture, None

    @cached_property
    def _seen(self) -> list[tuple[BodyIndex, RaySurface]]:
        """The surfaces that rays meet, each in its body's frame."""
        placed = {**self._built.free, **self._built.fixed}
        owner = {placed[name]: number for name, number in self.numbers.items()}
        found = []
        surfaces = visible_surfaces(self._built.plant, self._built.scene_graph)
        for body in dict.fromkeys(one.body for one in surfaces):
            parts = [(one.vertices, one.faces) for one in surfaces if one.body == body]
            label = owner.get(body, SURROUNDINGS)
            found += [(body, surface) for surface in surfaces_of_body(label, parts)]
        return found

    @property
    def _ray_scene(self) -> RayScene:
        if self._rays is None:
            X_SW = inverse(self.station.document.X_WS.matrix())
            poses = [X_SW @ self._X_WB(body) for body, _ in self._seen]
            self._rays = RayScene([surface for _, surface in self._seen], poses)
        return self._rays

    def _poses(self) -> dict[str, Array]:
        return {str(int(body)): self._X_WB(body) for body, _ in self._seen}

    def _X_WB(self, body: BodyIndex) -> Array:
        plant = self._built.plant
        pose = plant.EvalBodyPoseInWorld(self._plant_context, plant.get_body(body))
        X_WB: Array = pose.GetAsMatrix4()
        return X_WB
