"""A sample of a data set: one view of one scene with its images, instance labels and grasps."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from burg_drake.core import Array, Bytes, Single
from burg_drake.dataset.views import View
from burg_drake.scene import Scene

SURROUNDINGS_LABEL = 0
"""Label of pixels without an object: table, board, obstacles, robot, distractors, sky."""


@dataclass(frozen=True, eq=False)
class Images:
    """Images of one view; images that were not requested are None.

    Labels and normals are those of the nearest surface, even outside the view's depth range: a
    pixel can have both and no depth.

    Attributes:
        color: (H, W, 3) red, green, blue.
        depth: (H, W) distance along the optical axis [m]; 0 where nothing is in the depth range.
        labels: (H, W) number of the instance at the pixel's centre, from 1, the scene's free
            instances before background; `SURROUNDINGS_LABEL` for everything else.
        normals: (H, W, 3) unit normals of the surfaces' faces in the camera frame, towards the
            camera; 0 without a surface.
    """

    color: Bytes | None = None
    depth: Single | None = None
    labels: NDArray[np.uint16] | None = None
    normals: Single | None = None


def instance_numbers(scene: Scene) -> dict[str, int]:
    """Numbers of instances in label images by name: from 1, free ones before background."""
    names = (*scene.instances, *scene.background)
    return {name: number for number, name in enumerate(names, SURROUNDINGS_LABEL + 1)}


Box = tuple[int, int, int, int]
"""Left column, top row, width, height [pixels]."""


@dataclass(frozen=True, eq=False)
class InstanceLabel:
    """An instance in a view.

    Its silhouette is that of the unoccluded object, up to one image size beyond each edge of the
    image.

    Attributes:
        name: name of the instance in the scene.
        object: name of the object in the library.
        number: number in the label image.
        X_CO: (4, 4) pose of the object in the camera's optical frame.
        visible_pixels: number of visible pixels.
        silhouette_pixels: number of pixels of the silhouette, within the image or not.
        visibility: visible share of the silhouette, in [0, 1]; 0 without silhouette.
        visible_box: bounding box of the visible pixels; None if there are none.
        amodal_box: bounding box of the silhouette; may exceed the image.
        amodal: (H, W) part of the silhouette within the image.
    """

    name: str
    object: str
    number: int
    X_CO: Array
    visible_pixels: int
    silhouette_pixels: int
    visibility: float
    visible_box: Box | None
    amodal_box: Box | None
    amodal: NDArray[np.bool_]


def box_of_mask(mask: NDArray[np.bool_]) -> Box | None:
    """Bounding box of a mask (H, W); None for an empty mask."""
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    if not len(rows):
        return None
    left, top = int(columns[0]), int(rows[0])
    return left, top, int(columns[-1]) - left + 1, int(rows[-1]) - top + 1


@dataclass(frozen=True, eq=False)
class LabelledGrasps:
    """Grasps on the objects of a scene.

    Attributes:
        X_CG: (N, 4, 4) grasp frames in the camera's optical frame: z approach, x closing.
        width: (N,) distance between the pads at contact [m]; nan if unknown.
        number: (N,) number of each grasp's instance in the label image.
        outcome: (N,) outcomes as in a run's table; `""` for a grasp that was not judged.
        margins: (N,) arrays of margins, by column of a run's table; nan if unknown.
    """

    X_CG: Array
    width: Array
    number: NDArray[np.uint16]
    outcome: NDArray[np.str_]
    margins: dict[str, Array]

    def __len__(self) -> int:
        return len(self.X_CG)


@dataclass(frozen=True, kw_only=True, eq=False)
class Sample:
    """One view of one scene.

    Attributes:
        scene: number of the scene in the data set.
        number: number of the view in the scene.
        view: camera and its pose.
        X_WS: (4, 4) pose of the scene frame in the world.
        images: images without sensor noise.
        sensor_depth: (H, W) depth measured by the simulated sensor [m], 0 for no measurement; None
            without a simulated sensor.
        instances: objects of the scene, in the order of their numbers.
        grasps: grasps on the objects; None if not requested.
        appearance: appearance of the scene, as plain data; empty for the default.
    """

    scene: int
    number: int
    view: View
    X_WS: Array
    images: Images
    sensor_depth: Single | None = None
    instances: tuple[InstanceLabel, ...] = ()
    grasps: LabelledGrasps | None = None
    appearance: Mapping[str, Any] = field(default_factory=dict)

    @property
    def key(self) -> str:
        """Key of the sample in the data set, such as `000012_003`."""
        return f"{self.scene:06d}_{self.number:03d}"
