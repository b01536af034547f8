"""Observations of scenes: what a planner is given, rendered with the noise of a depth camera."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from burg_drake.benchmark.burg_planner import Observation, observation_id
from burg_drake.cameras import DepthNoise, Intrinsics, noisy_depth
from burg_drake.core import Array, content_hash, make_pose
from burg_drake.dataset import ImageKind, SceneRenderer, View
from burg_drake.scene import Scene, SceneLike, as_scene
from burg_drake.station import Station, StationLike, as_station, station_gripper

WORKSPACE_HEIGHT = 0.4
"""Height of `Observation.bounds` above the board [m]: of every object, and of the shelf's roof."""


@dataclass(frozen=True, kw_only=True, eq=False)
class SceneCamera:
    """The camera that observes the scenes of a suite.

    Attributes:
        intrinsics: of colour and depth images, without distortion.
        X_SC: (4, 4) pose of the optical frame in the scene frame.
        depth_range: nearest and farthest depth that it measures [m].
        noise: noise of the depth; None for exact depth.
        color: whether it takes colour images.
        shift, turn: standard deviations of the error of the pose that a planner is told: of the
            position along each axis [m], and of the orientation about each axis [rad].
        name: name of the camera, part of the seed of its noise.
    """

    intrinsics: Intrinsics
    X_SC: Array
    depth_range: tuple[float, float]
    noise: DepthNoise | None = None
    color: bool = True
    shift: float = 0.0
    turn: float = 0.0
    name: str = "camera"

    def observe(self, scene: SceneLike, station: StationLike, *, take: int = 0) -> Observation:
        """Renders what the camera sees; the same scene and take give the same observation.

        Args:
            scene: objects on the board.
            station: surroundings of the board; its arm is not in view.
            take: number of the image; each has other noise.

        Raises:
            MissingDependencyError: a system library of the renderer of colours is missing.
        """
        scene, station = as_scene(scene), as_station(station)
        view = View(
            camera=self.name,
            intrinsics=self.intrinsics,
            X_SC=self.X_SC,
            depth_range=self.depth_range,
        )
        kinds: tuple[ImageKind, ...] = ("depth", "labels", "normals")
        kinds = ("color", *kinds) if self.color else kinds
        images = SceneRenderer(scene, station, colors=self.color).images(view, kinds)
        assert images.depth is not None
        depth = images.depth
        if self.noise is not None:
            seed = content_hash([scene.content, self.name, self.X_SC.tolist(), take])
            depth = noisy_depth(
                depth,
                self.noise,
                self.intrinsics,
                np.random.default_rng(int(seed[:16], 16)),
                normals=images.normals,
                color=images.color,
            )
        return make_observation(
            scene,
            station,
            X_SC=self.X_SC @ self._pose_error(scene, take),
            K=self.intrinsics.K,
            depth=depth,
            color=images.color,
            segmentation=images.labels,
        )

    def _pose_error(self, scene: Scene, take: int) -> Array:
        """(4, 4) the told pose in the true one: the same for all planners, and for larger errors
        the same direction."""
        if not self.shift and not self.turn:
            return np.eye(4)
        rng = np.random.default_rng(int(content_hash([scene.content, self.name, take])[:16], 16))
        shift, turn = rng.standard_normal((2, 3))
        return make_pose(Rotation.from_rotvec(self.turn * turn).as_matrix(), self.shift * shift)


def make_observation(
    scene: Scene, station: Station, *, X_SC: Array, K: Array, **images: Any
) -> Observation:
    """The observation of a scene on a station.

    Args:
        scene, station: what is observed.
        X_SC: (4, 4) pose of the camera in the scene frame, as far as it is known.
        K: (3, 3) intrinsics of the images.
        images: `depth`, `color` and `segmentation`, see `Observation`; those that are there.
    """
    width, height = scene.board.size
    X_WS = station.document.X_WS.matrix()
    parts: dict[str, Any] = {
        **images,
        "K": K,
        "X_WC": X_WS @ X_SC,
        "X_WS": X_WS,
        "bounds": np.array([[0.0, 0.0, 0.0], [width, height, WORKSPACE_HEIGHT]]),
        "hand": hand_facts(station),
    }
    return Observation(id=observation_id(**parts), color=parts.pop("color", None), **parts)


def hand_facts(station: StationLike) -> Mapping[str, Any]:
    """What a planner is told of a station's hand; see `Observation.hand`."""
    gripper = station_gripper(as_station(station))
    return {
        "name": gripper.name,
        "opening": list(gripper.opening),
        "tip": gripper.tip,
        "X_HG": gripper.X_HG.tolist(),
    }
