"""The files of a sample, and the sample of its files.

Files are `KEY.json`, `KEY.grasps.npz`, and `KEY.NAME.png` for each image that there is.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from burg_drake.core import DocumentError, InvalidInputError, UnknownNameError, nearest
from burg_drake.core.files import DOCUMENT
from burg_drake.dataset.rendering import Images
from burg_drake.dataset.samples.grasps_file import decode_grasps, encode_grasps, require_fitting
from burg_drake.dataset.samples.png import KINDS, decode_image_of, depth_unit_of, encode_image
from burg_drake.dataset.samples.record import SampleRecord, parse_record, record_text
from burg_drake.dataset.samples.sample import Sample

RECORD, GRASPS = "json", "grasps"
SUFFIXES = {RECORD: "json", GRASPS: "grasps.npz"} | {name: f"{name}.png" for name in KINDS}
"""Ends of the names of files, by kind."""
MEMBER = re.compile(
    r"(\d{6,12})_(\d{3,12})\.(" + "|".join(re.escape(end) for end in SUFFIXES.values()) + ")",
    re.ASCII,
)
LARGEST_FILE = 256 << 20
"""Bytes of a file other than the record."""
PARTS = (*KINDS, GRASPS)
"""What can be asked for of a sample besides its record."""


def member_kind(name: str) -> tuple[str, str] | None:
    """Key and kind of a file by its name; None for a file that is none of a sample."""
    match = MEMBER.fullmatch(name)
    if match is None:
        return None
    kinds = {suffix: kind for kind, suffix in SUFFIXES.items()}
    return f"{match[1]}_{match[2]}", kinds[match[3]]


def encoded(sample: Sample) -> Iterator[tuple[str, bytes]]:
    """Names and contents of the files of a sample, the record first.

    Raises:
        InvalidInputError: images that do not fit its intrinsics, values that cannot be kept, or
            numbers of instances that are not 1, 2, 3...
    """
    require_consistent(sample)
    images = _images(sample)
    files = [*images] + ([GRASPS] if sample.grasps is not None else [])
    yield f"{sample.key}.{SUFFIXES[RECORD]}", record_text(sample, files).encode()
    unit = depth_unit_of(sample.view.depth_range)
    for name, image in images.items():
        try:
            data = encode_image(name, image, unit)
        except InvalidInputError as error:
            raise InvalidInputError(f"sample {sample.key}: {error}") from error
        yield f"{sample.key}.{SUFFIXES[name]}", data
    if sample.grasps is not None:
        yield f"{sample.key}.{SUFFIXES[GRASPS]}", encode_grasps(sample.grasps)


def require_consistent(sample: Sample) -> None:
    """Refuses a sample whose parts do not fit one another.

    Raises:
        InvalidInputError: they do not; the message names the sample.
    """
    where = f"sample {sample.key}"
    intrinsics = sample.view.intrinsics
    size = intrinsics.height, intrinsics.width
    images: dict[str, Any] = dict(_images(sample))
    masks = {f"amodal mask of {one.name!r}": one.amodal for one in sample.instances}
    for name, image in (images | masks).items():
        channels = (3,) if name in KINDS and KINDS[name].channels == 3 else ()
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


def asked_parts(parts: Iterable[str]) -> frozenset[str]:
    """Names of parts that are asked for.

    Raises:
        UnknownNameError: one is none.
    """
    asked = frozenset([parts] if isinstance(parts, str) else parts)
    for name in asked:
        if name not in PARTS:
            raise UnknownNameError(f"samples have no part {name!r}; {nearest(name, PARTS)}")
    return asked


def read_record(key: str, read: Callable[[str, int], bytes], where: str) -> SampleRecord:
    """The record of a sample.

    Args:
        key: of the sample.
        read: content of a file by its kind, with the most bytes that it may have.
        where: shard, for messages.

    Raises:
        DocumentError: it is damaged, of another version, or of another sample.
    """
    where = f"{where}: {key}.{SUFFIXES[RECORD]}"
    try:
        text = read(RECORD, DOCUMENT.size).decode()
    except UnicodeDecodeError as error:
        raise DocumentError(f"{where} is not text") from error
    record = parse_record(text, where)
    if record.sample.key != key:
        raise DocumentError(f"{where} belongs to sample {record.sample.key}")
    return record


def read_parts(
    record: SampleRecord, asked: Iterable[str], read: Callable[[str, int], bytes], where: str
) -> Sample:
    """A sample with those of its images and grasps that are asked for.

    Args:
        record: of the sample.
        asked: of `PARTS`; what the sample does not have stays None.
        read, where: see `read_record`.

    Raises:
        InvalidInputError: a file is missing, damaged, or does not fit.
    """
    sample, found = record.sample, {}
    for name in asked:
        if name not in record.files:
            continue
        place = f"{where}: {sample.key}.{SUFFIXES[name]}"
        data = read(name, LARGEST_FILE)
        if name == GRASPS:
            grasps = decode_grasps(data, place)
            require_fitting(grasps, len(sample.instances), place)
            sample = replace(sample, grasps=grasps)
        else:
            found[name] = decode_image_of(name, data, record.size, record.depth_unit, place)
    sensor_depth = found.pop("sensor_depth", None)
    return replace(sample, images=Images(**found), sensor_depth=sensor_depth)


def _images(sample: Sample) -> dict[str, Any]:
    """Those that there are, by name."""
    images = {name: getattr(sample.images, name) for name in KINDS if name != "sensor_depth"}
    images["sensor_depth"] = sample.sensor_depth
    return {name: image for name, image in images.items() if image is not None}
