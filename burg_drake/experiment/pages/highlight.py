"""What is drawn over pictures: a rim around the target, others paler, names beside objects."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from burg_drake.cameras.overlay import tag, write_tags
from burg_drake.core import Array, Bytes, inverse
from burg_drake.experiment.pages.painting import Painting, Viewpoint
from burg_drake.experiment.pages.scene_bodies import GROUND, HAND, PlacedBody
from burg_drake.visualization.pictures import painted_shadow

RIM = (230, 60, 0)
"""Of the target: an orange that stays dark in print without colour."""
RIM_WIDTH = 1 / 150
"""As a share of the picture's height."""
PALE = 0.45
"""How far what is neither target nor hand fades towards white."""
SEEN = 30
"""Objects that show fewer pixels have no name written to them."""
LETTERS = 0.042
"""Height of names, as a share of the picture's."""
JPEG_QUALITY = 82


def with_target(painting: Painting, placed: Sequence[PlacedBody], target: str) -> Bytes:
    """(H, W, 3) the picture with a rim around what is seen of the target, and others paler."""
    mine, hand = painting.shows(placed, target), painting.shows(placed, HAND)
    faded = painting.color + PALE * (255.0 - painting.color)
    image = np.where((mine | hand)[..., None], painting.color, np.round(faded)).astype(np.uint8)
    width = max(2, round(RIM_WIDTH * image.shape[0]))
    around = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * width + 1, 2 * width + 1))
    mask = mine.astype(np.uint8)
    rim = (cv2.dilate(mask, around) > 0) & ~mine
    image[rim] = RIM
    return image


def with_names(
    painting: Painting, placed: Sequence[PlacedBody], marked: Sequence[str] = ()
) -> Bytes:
    """(H, W, 3) the picture with the names of the objects.

    Args:
        painting: of them.
        placed: what it shows.
        marked: names that stand out.
    """
    image = painting.color.copy()
    boxes, plates, bodies = [], [], np.zeros(image.shape[:2], dtype=bool)
    for name in dict.fromkeys(one.name for one in placed if one.name not in (GROUND, HAND)):
        body = painting.shows(placed, name)
        bodies |= body
        rows, columns = np.nonzero(body)
        if len(rows) >= SEEN:
            boxes.append([[columns.min(), rows.min()], [columns.max(), rows.max()]])
            color = (255, 205, 120) if name in marked else (255, 255, 255)
            plates.append(tag(name, color, round(LETTERS * image.shape[0])))
    if plates:
        write_tags(image, np.array(boxes, float), plates, bodies)
    return image


def shaded(
    painting: Painting, placed: Sequence[PlacedBody], view: Viewpoint, hulls: Sequence[Array]
) -> Painting:
    """The picture with soft shadows of convex pieces (N, 3) in S on the ground."""
    size = np.array([view.intrinsics.width, view.intrinsics.height])
    ahead = [hull for hull in hulls if _before(hull, view)]
    light = painted_shadow(ahead, view.X_SC, view.intrinsics.focal[0], size)
    ground = painting.shows(placed, GROUND)
    light = np.where(ground, light, 1.0)[..., None]
    return Painting(np.round(painting.color * light).astype(np.uint8), painting.owner)


def _before(hull: Array, view: Viewpoint) -> bool:
    """Whether a piece and its shadow are before the camera."""
    ground = np.vstack([hull, hull * [1.0, 1.0, 0.0]])
    X_CS = inverse(view.X_SC)
    return bool((ground @ X_CS[2, :3] + X_CS[2, 3] > 0.01).all())


def jpeg(image: Bytes) -> bytes:
    """A picture (H, W, 3) as a file."""
    options = [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY, cv2.IMWRITE_JPEG_OPTIMIZE, 1]
    _, data = cv2.imencode(".jpg", np.ascontiguousarray(image[..., ::-1]), options)
    return data.tobytes()
