"""The files of a sample: its record in JSON, its images and its grasps, written and read."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any, cast

import numpy as np

from burg_drake.cameras import Intrinsics
from burg_drake.core import (
    Array,
    DocumentError,
    InvalidInputError,
    UnknownNameError,
    check_pose,
    parse_json,
    plain_data,
    quote_value,
    suggest_names,
)
from burg_drake.dataset.sample import Box, Images, InstanceLabel, Sample
from burg_drake.dataset.sample_encoding import (
    PNG_KINDS,
    decode_mask,
    depth_unit_of,
    encode_grasps,
    encode_image,
    encode_mask,
    require_fitting,
)
from burg_drake.dataset.views import View

MAX_EXACT_INTEGER = 1 << 53
"""Largest integer that every JSON reader represents exactly."""


class PlainFields:
    """The values of a JSON mapping.

    Attributes:
        where: it is, for messages.
    """

    def __init__(self, values: Any, names: Iterable[str], where: str) -> None:
        """Takes a mapping that has exactly these names.

        Raises:
            DocumentError: it has not.
        """
        self.where = where
        if not isinstance(values, dict):
            raise DocumentError(f"{where}: {quote_value(values)} is not a mapping")
        names = list(names)
        for name in values:
            if name not in names:
                raise DocumentError(
                    f"{where}: unknown key {quote_value(name)}; {suggest_names(name, names)}"
                )
        for name in names:
            if name not in values:
                raise DocumentError(f"{where}: key {name!r} is missing")
        self._values = values

    def nested(self, name: str, names: Iterable[str]) -> PlainFields:
        """A mapping in this one."""
        return PlainFields(self._values[name], names, f"{self.where}: {name}")

    def nested_list(self, name: str, names: Iterable[str]) -> list[PlainFields]:
        """The mappings of a list."""
        names, where = list(names), f"{self.where}: {name}"
        return [
            PlainFields(item, names, f"{where}[{i}]") for i, item in enumerate(self._list(name))
        ]

    def text(self, name: str) -> str:
        """A text."""
        value = self._values[name]
        if not isinstance(value, str) or "\0" in value:
            raise self._unexpected(name, "a text")
        return value

    def texts(self, name: str) -> list[str]:
        """A list of texts."""
        values = self._list(name)
        if not all(isinstance(value, str) for value in values):
            raise self._unexpected(name, "a list of texts")
        return values

    def integer(self, name: str, low: int = 0, high: int = MAX_EXACT_INTEGER) -> int:
        """A whole number in this range."""
        value = self._values[name]
        if type(value) is not int or not low <= value <= high:
            raise self._unexpected(name, f"a whole number from {low} to {high}")
        return value

    def integers(self, name: str, count: int) -> tuple[int, ...] | None:
        """So many whole numbers, or None for null."""
        values = self._values[name]
        if values is None:
            return None
        good = isinstance(values, list) and len(values) == count
        if not good or any(
            type(value) is not int or abs(value) > MAX_EXACT_INTEGER for value in values
        ):
            raise self._unexpected(name, f"{count} whole numbers, or null")
        return tuple(values)

    def number(self, name: str, low: float = -math.inf, high: float = math.inf) -> float:
        """A finite number in this range."""
        value = self._values[name]
        if not _is_number(value) or not low <= value <= high:
            among = "" if low == -math.inf else f" from {low:g} to {high:g}"
            raise self._unexpected(name, f"a finite number{among}")
        return float(value)

    def numbers(self, name: str, count: int | None = None) -> tuple[float, ...]:
        """Finite numbers, so many if that is given."""
        values = self._list(name)
        if len(values) != (len(values) if count is None else count) or not all(
            map(_is_number, values)
        ):
            raise self._unexpected(name, f"a list of {'' if count is None else f'{count} '}numbers")
        return tuple(map(float, values))

    def pose(self, name: str) -> Array:
        """A (4, 4) pose, as four lists of four numbers."""
        rows = self._list(name)
        if not all(isinstance(row, list) and all(map(_is_number, row)) for row in rows):
            raise self._unexpected(name, "a pose, four lists of four numbers")
        try:
            return check_pose(rows, name)
        except ValueError as error:  # rows of different lengths, too
            raise DocumentError(f"{self.where}: {name} is not a pose: {error}") from error

    def mapping(self, name: str) -> dict[str, Any]:
        """A mapping, with whatever it holds."""
        value = self._values[name]
        if not isinstance(value, dict):
            raise self._unexpected(name, "a mapping")
        return value

    def is_null(self, name: str) -> bool:
        """There is nothing under this name."""
        return self._values[name] is None

    def _unexpected(self, name: str, expected: str) -> DocumentError:
        """The error about a value that is not what is expected."""
        value = quote_value(self._values[name])
        return DocumentError(f"{self.where}: {name} is {value}; expected {expected}")

    @contextmanager
    def locate_errors(self) -> Iterator[None]:
        """Puts this mapping's place before errors that do not name it."""
        try:
            yield
        except DocumentError:
            raise
        except InvalidInputError as error:
            raise DocumentError(f"{self.where}: {error}") from error

    def _list(self, name: str) -> list[Any]:
        value = self._values[name]
        if not isinstance(value, list):
            raise self._unexpected(name, "a list")
        return value


def _is_number(value: object) -> bool:
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return False
    return abs(value) < 1e300


RECORD_VERSION = 1
"""Version of the record's format."""
INTRINSICS_KEYS = ("camera", "width", "height", "focal", "center", "distortion", "residual")
"""Keys of the intrinsics in a record."""
INSTANCE_KEYS = (
    *("name", "object", "number", "X_CO", "visible_pixels", "silhouette_pixels", "visibility"),
    *("visible_box", "amodal_box", "amodal"),
)
"""Keys of an instance in a record."""


class SampleLimits:
    """Limits of samples that are written and read."""

    image_pixels = 1 << 26  # Pixels of an image: 8192 x 8192.
    mask_pixels = 1 << 30  # Pixels of all masks of a sample: 3,400 objects at 640 x 480.
    instances = 65535  # Instances that labels of 16 bits distinguish.


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
    if (
        width * height > SampleLimits.image_pixels
        or count * width * height > SampleLimits.mask_pixels
    ):
        raise InvalidInputError(
            f"sample {sample.key} is too large with {width} x {height} pixels and {count}"
            f" instances: an image may have {SampleLimits.image_pixels:,} pixels, and all masks"
            f" together {SampleLimits.mask_pixels:,}"
        )
    values = {
        "version": RECORD_VERSION,
        "scene": sample.scene,
        "number": sample.number,
        "files": sorted(files),
        "view": _write_view(sample.view),
        "X_WS": _matrix_rows(sample.X_WS),
        "depth_unit": depth_unit_of(sample.view.depth_range),
        "instances": [_write_instance(instance) for instance in sample.instances],
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
    # Keys of the record.
    record_keys = (
        *("version", "scene", "number", "files", "view", "X_WS", "depth_unit", "instances"),
        "appearance",
    )
    view_keys = ("camera", "intrinsics", "X_SC", "depth_range", "posture")  # Keys of the view.
    values = parse_json(text, where)
    version = values.get("version") if isinstance(values, dict) else None
    if version != RECORD_VERSION:
        raise DocumentError(
            f"{where}: the sample has version {version!r}; this release reads version"
            f" {RECORD_VERSION}"
        )
    fields = PlainFields(values, record_keys, where)
    view = _read_view(fields.nested("view", view_keys))
    width, height = view.intrinsics.width, view.intrinsics.height
    instances = fields.nested_list("instances", INSTANCE_KEYS)
    if (
        len(instances) > SampleLimits.instances
        or len(instances) * width * height > SampleLimits.mask_pixels
    ):
        raise DocumentError(
            f"{where}: {len(instances)} instances are too many for images of this size"
        )
    sample = Sample(
        scene=fields.integer("scene"),
        number=fields.integer("number"),
        view=view,
        X_WS=fields.pose("X_WS"),
        images=Images(),
        instances=tuple(_read_instance(one, height, width) for one in instances),
        appearance=fields.mapping("appearance"),
    )
    unit = fields.number("depth_unit", 1e-6, 1.0)
    return SampleRecord(sample, tuple(fields.texts("files")), unit)


def _matrix_rows(X: Array) -> list[list[float]]:
    rows: list[list[float]] = np.asarray(X, dtype=float).tolist()
    return rows


def _write_view(view: View) -> dict[str, Any]:
    intrinsics = {name: getattr(view.intrinsics, name) for name in INTRINSICS_KEYS}
    return {
        "camera": view.camera,
        "intrinsics": intrinsics,
        "X_SC": _matrix_rows(view.X_SC),
        "depth_range": view.depth_range,
        "posture": view.posture,
    }


def _write_instance(instance: InstanceLabel) -> dict[str, Any]:
    values = {name: getattr(instance, name) for name in INSTANCE_KEYS}
    return values | {"X_CO": _matrix_rows(instance.X_CO), "amodal": encode_mask(instance.amodal)}


def _read_view(fields: PlainFields) -> View:
    intrinsics = _read_intrinsics(fields.nested("intrinsics", INTRINSICS_KEYS))
    near, far = fields.numbers("depth_range", 2)
    with fields.locate_errors():
        view = View(
            camera=fields.text("camera"),
            intrinsics=intrinsics,
            X_SC=fields.pose("X_SC"),
            depth_range=(near, far),
        )
    return view if fields.is_null("posture") else replace(view, posture=fields.numbers("posture"))


def _read_intrinsics(fields: PlainFields) -> Intrinsics:
    max_side = 1 << 15  # Pixels.
    width, height = (fields.integer(name, 1, max_side) for name in ("width", "height"))
    if width * height > SampleLimits.image_pixels:
        raise DocumentError(
            f"{fields.where}: {width} x {height} pixels are too many; an image may have"
            f" {SampleLimits.image_pixels:,}"
        )
    focal, center = fields.numbers("focal", 2), fields.numbers("center", 2)
    with fields.locate_errors():
        return Intrinsics(
            camera=fields.text("camera"),
            width=width,
            height=height,
            focal=(focal[0], focal[1]),
            center=(center[0], center[1]),
            distortion=fields.numbers("distortion"),
            residual=None if fields.is_null("residual") else fields.number("residual"),
        )


def _read_instance(fields: PlainFields, height: int, width: int) -> InstanceLabel:
    with fields.locate_errors():
        amodal = decode_mask(fields.text("amodal"), height, width)
    return InstanceLabel(
        name=fields.text("name"),
        object=fields.text("object"),
        number=fields.integer("number", 1, SampleLimits.instances),
        X_CO=fields.pose("X_CO"),
        visible_pixels=fields.integer("visible_pixels"),
        silhouette_pixels=fields.integer("silhouette_pixels"),
        visibility=fields.number("visibility", 0.0, 1.0),
        visible_box=cast(Box | None, fields.integers("visible_box", 4)),
        amodal_box=cast(Box | None, fields.integers("amodal_box", 4)),
        amodal=amodal,
    )


RECORD_KIND = "json"  # Kind of file of a sample's record.
GRASPS_KIND = "grasps"  # Kind of file of a sample's grasps.
FILE_SUFFIXES = {RECORD_KIND: "json", GRASPS_KIND: "grasps.npz"} | {
    name: f"{name}.png" for name in PNG_KINDS
}
"""Suffixes of file names by kind."""
MEMBER_NAME = re.compile(
    r"(\d{6,12})_(\d{3,12})\.(" + "|".join(re.escape(end) for end in FILE_SUFFIXES.values()) + ")",
    re.ASCII,
)
"""Pattern of the file names of samples."""
READABLE_PARTS = (*PNG_KINDS, GRASPS_KIND)
"""Parts of a sample that can be read besides its record."""


def member_kind(name: str) -> tuple[str, str] | None:
    """Key and kind of a file by its name; None for a file that is none of a sample."""
    match = MEMBER_NAME.fullmatch(name)
    if match is None:
        return None
    kinds = {suffix: kind for kind, suffix in FILE_SUFFIXES.items()}
    return f"{match[1]}_{match[2]}", kinds[match[3]]


def encode_sample(sample: Sample) -> Iterator[tuple[str, bytes]]:
    """Names and contents of the files of a sample, the record first.

    Raises:
        InvalidInputError: images that do not fit its intrinsics, values that cannot be kept, or
            numbers of instances that are not 1, 2, 3...
    """
    require_consistent(sample)
    images = _available_images(sample)
    files = [*images] + ([GRASPS_KIND] if sample.grasps is not None else [])
    yield f"{sample.key}.{FILE_SUFFIXES[RECORD_KIND]}", record_text(sample, files).encode()
    unit = depth_unit_of(sample.view.depth_range)
    for name, image in images.items():
        try:
            data = encode_image(name, image, unit)
        except InvalidInputError as error:
            raise InvalidInputError(f"sample {sample.key}: {error}") from error
        yield f"{sample.key}.{FILE_SUFFIXES[name]}", data
    if sample.grasps is not None:
        yield f"{sample.key}.{FILE_SUFFIXES[GRASPS_KIND]}", encode_grasps(sample.grasps)


def require_consistent(sample: Sample) -> None:
    """Refuses a sample whose parts do not fit one another.

    Raises:
        InvalidInputError: they do not; the message names the sample.
    """
    where = f"sample {sample.key}"
    intrinsics = sample.view.intrinsics
    size = intrinsics.height, intrinsics.width
    images: dict[str, Any] = dict(_available_images(sample))
    masks = {f"amodal mask of {one.name!r}": one.amodal for one in sample.instances}
    for name, image in (images | masks).items():
        channels = (3,) if name in PNG_KINDS and PNG_KINDS[name].channels == 3 else ()
        if image.shape != size + channels:
            raise InvalidInputError(
                f"{where}: {name} has shape {image.shape}; its intrinsics are for {size[1]} x"
                f" {size[0]} pixels"
            )
    numbers = [one.number for one in sample.instances]
    if numbers != list(range(1, len(numbers) + 1)):
        raise InvalidInputError(f"{where}: instances have numbers {numbers}; expected 1, 2, ...")
    color, labels = sample.images.color, sample.images.labels
    if color is not None and color.dtype != np.uint8:
        raise InvalidInputError(f"{where}: color has type {color.dtype}; expected uint8")
    if labels is not None and labels.dtype.kind != "u":
        raise InvalidInputError(f"{where}: labels has type {labels.dtype}; expected uint16")
    if labels is not None and labels.max(initial=0) > len(numbers):
        raise InvalidInputError(f"{where}: label {labels.max()} has no instance of that number")
    if sample.grasps is not None:
        require_fitting(sample.grasps, len(numbers), where)


def check_part_names(parts: Iterable[str]) -> frozenset[str]:
    """Names of parts that are asked for.

    Raises:
        UnknownNameError: one is none.
    """
    asked = frozenset([parts] if isinstance(parts, str) else parts)
    for name in asked:
        if name not in READABLE_PARTS:
            raise UnknownNameError(
                f"samples have no part {name!r}; {suggest_names(name, READABLE_PARTS)}"
            )
    return asked


def _available_images(sample: Sample) -> dict[str, Any]:
    """Those that there are, by name."""
    images = {name: getattr(sample.images, name) for name in PNG_KINDS if name != "sensor_depth"}
    images["sensor_depth"] = sample.sensor_depth
    return {name: image for name, image in images.items() if image is not None}
