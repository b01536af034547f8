"""The files of a sample: its record in JSON, its images and its grasps, written and read."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from burg_drake.cameras import Intrinsics
from burg_drake.core import (
    Array,
    DocumentError,
    InvalidInputError,
    Ranges,
    UnknownNameError,
    check_pose,
    parse_json,
    plain_data,
    quote_value,
    read_plain_data,
    require_ranges,
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

INTRINSICS_KEYS = ("camera", "width", "height", "focal", "center", "distortion", "residual")
"""Keys of intrinsics in a record."""


class SampleLimits:
    """Limits of samples that are written and read."""

    image_pixels = 1 << 26  # Pixels of an image: 8192 x 8192.
    mask_pixels = 1 << 30  # Pixels of all masks of a sample: 3,400 objects at 640 x 480.
    instances = 65535  # Instances that 16-bit labels can distinguish.


@dataclass(frozen=True, eq=False)
class SampleRecord:
    """The record of a sample.

    Attributes:
        sample: the sample without images and grasps.
        files: kinds of the sample's other files, such as `depth` and `grasps`.
        depth_unit: unit of its depth images [m].
    """

    sample: Sample
    files: tuple[str, ...]
    depth_unit: float

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of the images [pixels]."""
        intrinsics = self.sample.view.intrinsics
        return intrinsics.width, intrinsics.height


def record_text(sample: Sample, files: Sequence[str]) -> str:
    """The record of a sample as JSON; equal samples give equal text.

    Args:
        sample: the sample; its images and grasps are not written.
        files: kinds of the sample's other files.

    Raises:
        InvalidInputError: the record is too large, its appearance is no plain data, or its depth
            range cannot be represented.
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
        "version": RecordFields.version,
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


MAX_COUNT = 1 << 53
"""Largest integer that every JSON reader represents exactly."""


@dataclass(frozen=True, kw_only=True)
class ViewFields:
    """View of a record, before its pose is checked; see `View`."""

    camera: str
    intrinsics: Intrinsics
    X_SC: Any
    depth_range: tuple[float, float]
    posture: tuple[float, ...] | None


@dataclass(frozen=True, kw_only=True)
class InstanceFields:
    """Instance of a record, before its pose is checked, its mask as text; see `InstanceLabel`."""

    RANGES: ClassVar[Ranges] = {
        "number": (1, SampleLimits.instances),
        "visible_pixels": (0, MAX_COUNT),
        "silhouette_pixels": (0, MAX_COUNT),
        "visibility": (0.0, 1.0),
    }

    name: str
    object: str
    number: int
    X_CO: Any
    visible_pixels: int
    silhouette_pixels: int
    visibility: float
    visible_box: Box | None
    amodal_box: Box | None
    amodal: str

    def __post_init__(self) -> None:
        require_ranges(self)


@dataclass(frozen=True, kw_only=True)
class RecordFields:
    """Fields of a record in JSON, before its pose is checked; see `Sample` and `SampleRecord`."""

    RANGES: ClassVar[Ranges] = {
        "scene": (0, MAX_COUNT),
        "number": (0, MAX_COUNT),
        "depth_unit": (1e-6, 1.0),
    }

    version: int = 1
    scene: int
    number: int
    files: tuple[str, ...]
    view: ViewFields
    X_WS: Any
    depth_unit: float
    instances: tuple[InstanceFields, ...]
    appearance: dict[str, Any]

    def __post_init__(self) -> None:
        require_ranges(self)
        width, height = self.view.intrinsics.width, self.view.intrinsics.height
        if width * height > SampleLimits.image_pixels:
            raise InvalidInputError(
                f"{width} x {height} pixels are too many; an image may have"
                f" {SampleLimits.image_pixels:,}"
            )
        count = len(self.instances)
        if count > SampleLimits.instances or count * width * height > SampleLimits.mask_pixels:
            raise InvalidInputError(f"{count} instances are too many for images of this size")


def parse_record(text: str, where: str) -> SampleRecord:
    """Reads the record of a sample.

    Args:
        text: content of the file.
        where: shard and member, for messages.

    Raises:
        DocumentError: the record is of another version, or a value is invalid; the message names
            the value.
    """
    values = parse_json(text, where)
    fields = read_plain_data(values, RecordFields, where)
    keys = values["view"]["intrinsics"].keys()
    if keys != set(INTRINSICS_KEYS):  # a default distortion would be another camera
        raise DocumentError(
            f"{where}: view.intrinsics has the keys {sorted(keys)}, not {sorted(INTRINSICS_KEYS)}"
        )
    with _locate_errors(f"{where}: view"):
        view = View(**vars(fields.view) | {"X_SC": _read_pose(fields.view.X_SC, "X_SC")})
    instances = []
    for i, one in enumerate(fields.instances):
        with _locate_errors(f"{where}: instances[{i}]"):
            X_CO = _read_pose(one.X_CO, "X_CO")
            amodal = decode_mask(one.amodal, view.intrinsics.height, view.intrinsics.width)
        instances.append(InstanceLabel(**vars(one) | {"X_CO": X_CO, "amodal": amodal}))
    with _locate_errors(where):
        X_WS = _read_pose(fields.X_WS, "X_WS")
    sample = Sample(
        scene=fields.scene,
        number=fields.number,
        view=view,
        X_WS=X_WS,
        images=Images(),
        instances=tuple(instances),
        appearance=fields.appearance,
    )
    return SampleRecord(sample, fields.files, fields.depth_unit)


def _read_pose(rows: Any, name: str) -> Array:
    """(4, 4) pose from four lists of four numbers."""
    try:
        X = np.array(rows)
    except ValueError:  # rows of different lengths
        X = np.empty(0)
    if X.shape != (4, 4) or X.dtype.kind not in "if":
        raise InvalidInputError(
            f"{name} is {quote_value(rows)}; expected a pose, four lists of four numbers"
        )
    return check_pose(X.astype(float), name)


@contextmanager
def _locate_errors(where: str) -> Iterator[None]:
    try:
        yield
    except InvalidInputError as error:
        raise DocumentError(f"{where}: {error}") from error


def _matrix_rows(X: Array) -> list[list[float]]:
    rows: list[list[float]] = np.asarray(X, dtype=float).tolist()
    return rows


def _write_view(view: View) -> dict[str, Any]:
    intrinsics = {name: getattr(view.intrinsics, name) for name in INTRINSICS_KEYS}
    return vars(view) | {"intrinsics": intrinsics, "X_SC": _matrix_rows(view.X_SC)}


def _write_instance(instance: InstanceLabel) -> dict[str, Any]:
    return vars(instance) | {
        "X_CO": _matrix_rows(instance.X_CO),
        "amodal": encode_mask(instance.amodal),
    }


RECORD_KIND = "json"  # Kind of file of a sample's record.
GRASPS_KIND = "grasps"  # Kind of file of a sample's grasps.
FILE_SUFFIXES = {RECORD_KIND: "json", GRASPS_KIND: "grasps.npz"} | {
    name: f"{name}.png" for name in PNG_KINDS
}
"""Suffixes of file names by kind."""
FILE_KINDS = {suffix: kind for kind, suffix in FILE_SUFFIXES.items()}
"""Kinds of file by the suffixes of their names."""
SAMPLE_KEY = re.compile(r"\d{6,12}_\d{3,12}", re.ASCII)
"""Pattern of the keys of samples."""
READABLE_PARTS = (*PNG_KINDS, GRASPS_KIND)
"""Parts of a sample that can be read, other than its record."""


def member_kind(name: str) -> tuple[str, str] | None:
    """Sample key and kind of a file from its name; None if the file is not part of a sample."""
    key, _, suffix = name.partition(".")
    return (key, FILE_KINDS[suffix]) if suffix in FILE_KINDS and SAMPLE_KEY.fullmatch(key) else None


def encode_sample(sample: Sample) -> Iterator[tuple[str, bytes]]:
    """Names and contents of the files of a sample, the record first.

    Raises:
        InvalidInputError: images do not match the intrinsics, a value cannot be represented, or the
            instances are not numbered 1, 2, 3...
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
    """Refuses a sample whose parts contradict each other.

    Raises:
        InvalidInputError: parts contradict each other; the message names the sample.
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
    """The requested parts as a set.

    Raises:
        UnknownNameError: there is no part of a name.
    """
    requested_parts = frozenset([parts] if isinstance(parts, str) else parts)
    for name in requested_parts:
        if name not in READABLE_PARTS:
            raise UnknownNameError(
                f"samples have no part {name!r}; {suggest_names(name, READABLE_PARTS)}"
            )
    return requested_parts


def _available_images(sample: Sample) -> dict[str, Any]:
    """The images that the sample has, by name."""
    images = {name: getattr(sample.images, name) for name in PNG_KINDS if name != "sensor_depth"}
    images["sensor_depth"] = sample.sensor_depth
    return {name: image for name, image in images.items() if image is not None}
