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
    """Images of one view; those that were not asked for are None.

    Labels and normals are those of the nearest surface, whether its depth is in the depth range of
    the view or not: a pixel can have both and no depth.

    Attributes:
        color: (H, W, 3) red, green, blue.
        depth: (H, W) distance along the optical axis [m]; 0 where nothing is in the depth range.
        labels: (H, W) number of the instance that the pixel's centre shows: 1 for the first free
            one of the scene, free ones before background; `SURROUNDINGS_LABEL` for everything else.
        normals: (H, W, 3) unit normals of the surfaces' faces in the camera frame, towards the
            camera; 0 where nothing is.
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

    Its silhouette is all that the camera would see of it if it were alone, and if the image had no
    edges (up to one image size beyond each).

    Attributes:
        name: instance in the scene.
        object: of the library.
        number: in the label image.
        X_CO: (4, 4) object's frame in the camera's optical frame.
        visible_pixels: pixels that show it.
        silhouette_pixels: of its silhouette, within the image or not.
        visibility: the first as a share of the second, in [0, 1]; 0 without silhouette.
        visible_box: smallest one around the visible pixels; None if there are none.
        amodal_box: around the silhouette; it may reach beyond the image.
        amodal: (H, W) the part of the silhouette that lies within the image.
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
    """The smallest box around the pixels of a mask (H, W) that are on; None if there are none."""
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
        width: (N,) distance of the pads when they touch [m]; nan if not known.
        number: (N,) instance that each grasps, as in the label image.
        outcome: (N,) outcomes as in a run's table; `""` for a grasp that was not judged.
        margins: (N,) each by its column in a run's table; nan where there is none.
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
        number: of the view among those of its scene.
        view: the camera at its place.
        X_WS: (4, 4) scene frame in the world.
        images: what it sees, without noise.
        sensor_depth: (H, W) the depth as the sensor measures it [m], 0 where it does not; None if
            no sensor is simulated.
        instances: objects of the scene, in the order of their numbers.
        grasps: on them; None if none were asked for.
        appearance: how it looks, as plain data; empty if as usual.
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
        """Names it in the data set, as in `000012_003`."""
        return f"{self.scene:06d}_{self.number:03d}"
