"""What is known of a sample but for its pixels and grasps: the JSON beside its images."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, cast

import numpy as np

from burg_drake.cameras.optics import Intrinsics
from burg_drake.core import Array, DocumentError, InvalidInputError
from burg_drake.core.documents import parse_json, plain_data
from burg_drake.dataset.labels import Box, InstanceLabel, decode_mask, encode_mask
from burg_drake.dataset.rendering import Images
from burg_drake.dataset.samples.plain_fields import PlainFields
from burg_drake.dataset.samples.png import depth_unit_of
from burg_drake.dataset.samples.sample import Sample
from burg_drake.dataset.views import View

VERSION = 1
"""Of the record of a sample."""
KEYS = (
    *("version", "scene", "number", "files", "view", "X_WS", "depth_unit", "instances"),
    "appearance",
)
VIEW_KEYS = ("camera", "intrinsics", "X_SC", "depth_range", "posture")
INTRINSICS_KEYS = ("camera", "width", "height", "focal", "center", "distortion", "residual")
INSTANCE_KEYS = (
    *("name", "object", "number", "X_CO", "visible_pixels", "silhouette_pixels", "visibility"),
    *("visible_box", "amodal_box", "amodal"),
)

LONGEST_SIDE = 1 << 15
MOST_PIXELS = 1 << 26
"""Of an image; 8192 x 8192."""
MOST_MASK_PIXELS = 1 << 30
"""Of the masks of a sample together, a byte each; 3,400 objects at 640 x 480."""
MOST_INSTANCES = 65535
"""That labels of 16 bits tell apart."""


@dataclass(frozen=True, eq=False)
class SampleRecord:
    """The record of a sample.

    Attributes:
        sample: without images and grasps.
        files: kinds of those that it has besides, such as `depth` and `grasps`.
        depth_unit: of its depth images [m].
    """

    sample: Sample
    files: tuple[str, ...]
    depth_unit: float

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of its images."""
        intrinsics = self.sample.view.intrinsics
        return intrinsics.width, intrinsics.height


def record_text(sample: Sample, files: Sequence[str]) -> str:
    """The record of a sample as JSON, the same for the same values.

    Args:
        sample: whose images are left aside.
        files: kinds of those that it has besides.

    Raises:
        InvalidInputError: it is too large, its appearance is no plain data, or its depth range
            cannot be kept.
    """
    width, height = sample.view.intrinsics.width, sample.view.intrinsics.height
    count = len(sample.instances)
    if width * height > MOST_PIXELS or count * width * height > MOST_MASK_PIXELS:
        raise InvalidInputError(
            f"sample {sample.key} is too large with {width} x {height} pixels and {count}"
            f" instances: an image may have {MOST_PIXELS:,} pixels, and all masks together"
            f" {MOST_MASK_PIXELS:,}"
        )
    values = {
        "version": VERSION,
        "scene": sample.scene,
        "number": sample.number,
        "files": sorted(files),
        "view": _view_values(sample.view),
        "X_WS": _rows(sample.X_WS),
        "depth_unit": depth_unit_of(sample.view.depth_range),
        "instances": [_instance_values(instance) for instance in sample.instances],
        "appearance": dict(sample.appearance),
    }
    try:
        return json.dumps(plain_data(values), sort_keys=True, allow_nan=False, indent=1)
    except (TypeError, ValueError) as error:
        raise InvalidInputError(
            f"sample {sample.key} has values that cannot be written as JSON: {error}"
        ) from error


def parse_record(text: str, where: str) -> SampleRecord:
    """The record of a sample.

    Args:
        text: of the file.
        where: shard and member, for messages.

    Raises:
        DocumentError: of another version, or a value that does not fit; the message names it.
    """
    values = parse_json(text, where)
    version = values.get("version") if isinstance(values, dict) else None
    if version != VERSION:
        raise DocumentError(
            f"{where}: the sample has version {version!r}; this release reads version {VERSION}"
        )
    fields = PlainFields(values, KEYS, where)
    view = _view(fields.within("view", VIEW_KEYS))
    width, height = view.intrinsics.width, view.intrinsics.height
    instances = fields.each("instances", INSTANCE_KEYS)
    if len(instances) > MOST_INSTANCES or len(instances) * width * height > MOST_MASK_PIXELS:
        raise DocumentError(
            f"{where}: {len(instances)} instances are too many for images of this size"
        )
    sample = Sample(
        scene=fields.whole("scene"),
        number=fields.whole("number"),
        view=view,
        X_WS=fields.pose("X_WS"),
        images=Images(),
        instances=tuple(_instance(one, height, width) for one in instances),
        appearance=fields.mapping("appearance"),
    )
    unit = fields.number("depth_unit", 1e-6, 1.0)
    return SampleRecord(sample, tuple(fields.texts("files")), unit)


def _rows(X: Array) -> list[list[float]]:
    rows: list[list[float]] = np.asarray(X, dtype=float).tolist()
    return rows


def _view_values(view: View) -> dict[str, Any]:
    intrinsics = {name: getattr(view.intrinsics, name) for name in INTRINSICS_KEYS}
    return {
        "camera": view.camera,
        "intrinsics": intrinsics,
        "X_SC": _rows(view.X_SC),
        "depth_range": view.depth_range,
        "posture": view.posture,
    }


def _instance_values(instance: InstanceLabel) -> dict[str, Any]:
    values = {name: getattr(instance, name) for name in INSTANCE_KEYS}
    return values | {"X_CO": _rows(instance.X_CO), "amodal": encode_mask(instance.amodal)}


def _view(fields: PlainFields) -> View:
    intrinsics = _intrinsics(fields.within("intrinsics", INTRINSICS_KEYS))
    near, far = fields.numbers("depth_range", 2)
    try:
        view = View(
            camera=fields.text("camera"),
            intrinsics=intrinsics,
            X_SC=fields.pose("X_SC"),
            depth_range=(near, far),
        )
    except DocumentError:
        raise
    except InvalidInputError as error:
        raise fields.refused(error) from error
    return view if fields.is_null("posture") else replace(view, posture=fields.numbers("posture"))


def _intrinsics(fields: PlainFields) -> Intrinsics:
    width, height = (fields.whole(name, 1, LONGEST_SIDE) for name in ("width", "height"))
    if width * height > MOST_PIXELS:
        raise DocumentError(
            f"{fields.where}: {width} x {height} pixels are too many; an image may have"
            f" {MOST_PIXELS:,}"
        )
    focal, center = fields.numbers("focal", 2), fields.numbers("center", 2)
    try:
        return Intrinsics(
            camera=fields.text("camera"),
            width=width,
            height=height,
            focal=(focal[0], focal[1]),
            center=(center[0], center[1]),
            distortion=fields.numbers("distortion"),
            residual=None if fields.is_null("residual") else fields.number("residual"),
        )
    except DocumentError:
        raise
    except InvalidInputError as error:
        raise fields.refused(error) from error


def _instance(fields: PlainFields, height: int, width: int) -> InstanceLabel:
    try:
        amodal = decode_mask(fields.text("amodal"), height, width)
    except DocumentError:
        raise
    except InvalidInputError as error:
        raise fields.refused(error) from error
    return InstanceLabel(
        name=fields.text("name"),
        object=fields.text("object"),
        number=fields.whole("number", 1, MOST_INSTANCES),
        X_CO=fields.pose("X_CO"),
        visible_pixels=fields.whole("visible_pixels"),
        silhouette_pixels=fields.whole("silhouette_pixels"),
        visibility=fields.number("visibility", 0.0, 1.0),
        visible_box=cast(Box | None, fields.wholes("visible_box", 4)),
        amodal_box=cast(Box | None, fields.wholes("amodal_box", 4)),
        amodal=amodal,
    )
