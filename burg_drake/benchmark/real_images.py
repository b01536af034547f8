"""Images that a real depth camera took of the scenes of a suite, as observations.

A folder has for each scene `SCENE.png` (or .jpg), the colours, and `SCENE.depth.png` (16 bit, or
`SCENE.depth.npy`), the depth in the same pixels. `intrinsics.yaml` has the camera. `camera.yaml`,
or `SCENE.camera.yaml`, has its pose in the scene frame; without them it follows from the markers of
the board in the colour image.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from burg_drake.benchmark.burg_planner import Observation
from burg_drake.benchmark.observing import make_observation
from burg_drake.cameras import (
    BoardPose,
    Intrinsics,
    Undistortion,
    load_intrinsics,
    read_depth,
    read_image,
)
from burg_drake.core import (
    Array,
    Bytes,
    InvalidInputError,
    Single,
    UnknownNameError,
    suggest_names,
)
from burg_drake.formats import read_poses
from burg_drake.scene import Scene
from burg_drake.station import Station

INTRINSICS_FILE = "intrinsics.yaml"
CAMERA_FILE = "camera.yaml"
COLOR_SUFFIXES = (".png", ".jpg", ".jpeg")
DEPTH_SUFFIXES = (".depth.png", ".depth.npy")


@dataclass(frozen=True)
class RealImages:
    """Images of scenes in a folder.

    Attributes:
        folder: the folder.
        intrinsics: of colour and depth images.
        scenes: names of the scenes that have a depth image.
        depth_unit: unit of the depth images [m]; see `read_depth`.
        content: hash of all files that are read.
    """

    folder: Path
    intrinsics: Intrinsics
    scenes: tuple[str, ...]
    depth_unit: float | None
    content: str

    @classmethod
    def open(
        cls, folder: str | Path, scenes: Sequence[str], *, depth_unit: float | None = None
    ) -> RealImages:
        """Finds the images of scenes.

        Args:
            folder: the folder.
            scenes: names of the scenes of the suite; images of other scenes are refused.
            depth_unit: unit of the depth images [m]; if None, whole numbers are millimetres,
                others metres.

        Raises:
            InvalidInputError: the intrinsics or all depth images are missing.
            UnknownNameError: there is no scene for a depth image.
        """
        folder = Path(folder)
        if not folder.is_dir():
            raise InvalidInputError(f"folder of images {folder} does not exist").about("images")
        found: dict[str, Path] = {}
        for path in sorted(folder.iterdir()):
            for suffix in DEPTH_SUFFIXES:
                name = path.name.removesuffix(suffix)
                if name == path.name:
                    continue
                if name not in scenes:
                    raise UnknownNameError(
                        f"{path}: the suite has no scene {name!r}; {suggest_names(name, scenes)}"
                    ).about("images")
                if name in found:
                    raise InvalidInputError(
                        f"{path} and {found[name]} are both depth images of scene {name}; keep one"
                    ).about("images")
                found[name] = path
        if not found:
            raise InvalidInputError(
                f"{folder} has no depth image of a scene of the suite; name them SCENE.depth.png"
                f" or SCENE.depth.npy, such as {scenes[0]}.depth.png"
            ).about("images")
        if not (folder / INTRINSICS_FILE).is_file():
            raise InvalidInputError(
                f"{folder / INTRINSICS_FILE} does not exist; write the intrinsics of the camera"
                " there"
            ).about("images")
        images = cls(
            folder=folder.absolute(),
            intrinsics=load_intrinsics(folder / INTRINSICS_FILE),
            scenes=tuple(name for name in scenes if name in found),
            depth_unit=depth_unit,
            content="",
        )
        digest = hashlib.sha256(repr(depth_unit).encode())
        for path in images._files():
            digest.update(f"{path.name}\n".encode() + path.read_bytes())
        return cls(**{**vars(images), "content": digest.hexdigest()})

    def observe(self, scene: Scene, station: Station, *, color: bool) -> Observation:
        """The observation of a scene; lens distortion is removed from its images.

        Args:
            scene: the scene that was set up.
            station: the station.
            color: whether the planner gets the colours.

        Raises:
            InvalidInputError: an image is missing or has another size than the intrinsics, the
                board is not seen and there is no pose of the camera, or the depth cannot be that of
                the board; the message names the file.
        """
        depth_path, color_path = self._depth_path(scene.name), self._color_path(scene.name)
        depth = read_depth(depth_path, self.depth_unit)
        self.intrinsics.require_size(depth.shape[1], depth.shape[0], str(depth_path))
        image = None if color_path is None else read_image(color_path)
        if image is not None:
            self.intrinsics.require_size(image.shape[1], image.shape[0], str(color_path))
        elif color:
            raise InvalidInputError(
                f"{self.folder / scene.name}.png does not exist; add the colour image, or give the"
                " planner depth only"
            ).about("images")
        X_SC = self._camera_pose(scene, image)
        self._require_plausible_depth(depth, X_SC, depth_path)
        straight = Undistortion(self.intrinsics)
        return make_observation(
            scene,
            station,
            X_SC=X_SC,
            K=self.intrinsics.K,
            depth=straight.depth(depth),
            color=straight.color(image) if color and image is not None else None,
        )

    def _require_plausible_depth(self, depth: Single, X_SC: Array, path: Path) -> None:
        """Refuses depth (H, W) in another unit: what a camera sees of a board is little nearer than
        the plane of the board."""
        K = self.intrinsics.K
        height, width = depth.shape
        x, y = (np.arange(width) - K[0, 2]) / K[0, 0], (np.arange(height) - K[1, 2]) / K[1, 1]
        fall = -(X_SC[2, 0] * x + X_SC[2, 1] * y[:, None] + X_SC[2, 2])  # of a ray, by depth
        seen = (depth > 0.0) & (fall > 0.05)
        ratio = np.median(depth[seen] * fall[seen] / X_SC[2, 3]) if seen.any() else 1.0
        if not 0.3 < ratio < 3.0:
            raise InvalidInputError(
                f"{path}: the depth is {ratio:.2g} times the distance of the board; give its unit"
                " in metres, or correct the pose of the camera"
            ).about("depth_unit")

    def _camera_pose(self, scene: Scene, image: Bytes | None) -> Array:
        """(4, 4) pose of the camera in the scene frame."""
        for name in (f"{scene.name}.{CAMERA_FILE}", CAMERA_FILE):
            if (self.folder / name).is_file():
                return read_poses([str(self.folder / name)])
        missing = f"there is no {scene.name}.{CAMERA_FILE} or {CAMERA_FILE} in {self.folder}"
        if image is None:
            raise InvalidInputError(
                f"the pose of the camera is unknown: {missing}, and no colour image of scene"
                f" {scene.name} that shows the board"
            ).about("images")
        estimate = BoardPose(scene.board, self.intrinsics).estimate(image)
        if not estimate.valid:
            raise InvalidInputError(
                f"{self._color_path(scene.name)}: the camera's pose cannot be measured on the"
                f" board: {estimate.reason}; {missing}, which would tell it"
            ).about("images")
        return estimate.X_SC

    def _depth_path(self, scene: str) -> Path:
        paths = [self.folder / f"{scene}{suffix}" for suffix in DEPTH_SUFFIXES]
        return next(path for path in paths if path.exists())

    def _color_path(self, scene: str) -> Path | None:
        paths = [self.folder / f"{scene}{suffix}" for suffix in COLOR_SUFFIXES]
        return next((path for path in paths if path.exists()), None)

    def _files(self) -> list[Path]:
        """All files that are read, in order."""
        paths = [self.folder / name for name in (INTRINSICS_FILE, CAMERA_FILE)]
        for scene in self.scenes:
            color = self._color_path(scene)
            paths += [self._depth_path(scene), *([color] if color else [])]
            paths.append(self.folder / f"{scene}.{CAMERA_FILE}")
        return [path for path in paths if path.is_file()]
