"""Opens what a user names: a camera, a video, photographs, a stream or a simulated camera."""

from __future__ import annotations

import glob
from collections.abc import Sequence
from pathlib import Path

from burg_drake.cameras.optics import SIMULATED, simulated_camera
from burg_drake.cameras.sources.frame import (
    CameraLost as CameraLost,
    Frame as Frame,
    FrameSource as FrameSource,
)
from burg_drake.core import InvalidInputError
from burg_drake.core.paths import expanded
from burg_drake.scene.document import Scene, SceneLike, as_scene

STREAMS = ("rtsp://", "rtsps://", "rtmp://", "http://", "https://", "udp://", "tcp://")


def open_source(
    reference: str | Path | int | Sequence[str | Path],
    *,
    scene: SceneLike | None = None,
    size: tuple[int, int] | None = None,
    fps: float | None = None,
) -> FrameSource:
    """Opens a source of frames.

    Args:
        reference: what to open:
            `0`, `1`, ... or `/dev/video0`: a camera of this machine;
            `rtsp://...`, `http://...`: a stream from the network;
            `sim:STATION[/CAMERA]`: a simulated camera of a station that looks at `scene`;
            an image file, a folder of them, or a pattern such as `photos/*.jpg`;
            any other file: a video.
            A list of image files, folders and patterns is one sequence.
        scene: for a simulated camera.
        size: width and height that a camera of this machine shall have [pixels].
        fps: images a second that a camera of this machine, or a simulated one, shall take.

    Raises:
        InvalidInputError: there is no such thing, or it cannot be read.
        UnknownNameError: no such station, or it has no such camera.
        MissingDependencyError: a simulated camera without the renderer's system libraries.
    """
    scene = None if scene is None else as_scene(scene)
    if not isinstance(reference, (str, Path, int)):
        if len(reference) != 1:
            return _images([str(item) for item in reference])
        (reference,) = reference
    text = str(reference).strip()
    if text.startswith(SIMULATED):
        return _simulated(text, scene, fps)
    if text.isdecimal() or text.startswith(("/dev/video", *STREAMS)):
        from burg_drake.cameras.sources.device import open_device

        return open_device(int(text) if text.isdecimal() else text, size, fps)
    if not text:
        raise InvalidInputError(
            "the camera is an empty text; give 0, a file, a folder or sim:STATION"
        )
    from burg_drake.cameras.sources.photos import is_image

    path = expanded(text)
    if path.is_file() and not is_image(path):
        from burg_drake.cameras.sources.video import VideoSource

        return VideoSource(path)
    return _images([text])


def _simulated(reference: str, scene: Scene | None, fps: float | None) -> FrameSource:
    from burg_drake.cameras.sources.simulated import DEFAULT_FPS, SimulatedSource

    station, camera = simulated_camera(reference)
    if scene is None:
        raise InvalidInputError(f"{reference} is a simulated camera, which needs a scene; give one")
    return SimulatedSource(scene, station, camera, fps=fps or DEFAULT_FPS)


def _images(references: Sequence[str]) -> FrameSource:
    from burg_drake.cameras.sources.photos import ImageSource

    return ImageSource(image_paths(references), references[0] if len(references) == 1 else "")


def image_paths(references: Sequence[str]) -> list[Path]:
    """Image files by their names, folders or patterns such as `photos/*.jpg`.

    Raises:
        InvalidInputError: there are none.
    """
    from burg_drake.cameras.sources.photos import images_in, in_order, is_image

    paths: list[Path] = []
    for reference in references:
        path = expanded(reference)
        if path.is_dir():
            paths += images_in(path)
        elif path.exists():
            paths.append(path)
        elif glob.has_magic(reference):
            found = [Path(name) for name in glob.glob(str(path), recursive=True)]
            images = [name for name in found if is_image(name)]
            if not images:
                raise InvalidInputError(f"no image files match {reference!r}")
            paths += in_order(images)
        else:
            raise InvalidInputError(
                f"{reference} does not exist; give an image or video file, a folder or pattern of"
                " images, the number of a camera, an rtsp or http address, or"
                f" {SIMULATED}STATION/CAMERA"
            )
    return paths
