"""Parts that all exports share: samples and their checks, the new folder, and image files."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from itertools import groupby
from pathlib import Path
from typing import Any, Protocol

import cv2
import numpy as np
from numpy.typing import NDArray

from burg_drake.core import (
    Bytes,
    InvalidInputError,
    Single,
    UnknownNameError,
    atomic_folder,
    suggest_names,
)
from burg_drake.dataset.sample import InstanceLabel, Sample
from burg_drake.dataset.sample_encoding import encode_png
from burg_drake.objects import ObjectLibrary


class Samples(Protocol):
    """A data set as a sequence of samples, all views of a scene one after the other."""

    @property
    def name(self) -> str:
        """Name of the data set."""

    @property
    def objects(self) -> tuple[str, ...]:
        """Names of the library's objects, in the order of their ids in other formats."""

    @property
    def library(self) -> ObjectLibrary:
        """Library of the objects."""

    def __len__(self) -> int: ...

    def __getitem__(self, index: int, /) -> Sample: ...

    def __iter__(self) -> Iterator[Sample]: ...


def group_by_scene(samples: Iterable[Sample]) -> Iterator[tuple[int, Iterator[Sample]]]:
    """Numbers of scenes with their samples, one sample in memory at a time: use up the samples of a
    scene before asking for the next.

    Raises:
        InvalidInputError: the samples of a scene are not consecutive.
    """
    seen: set[int] = set()
    for number, views in groupby(samples, key=lambda sample: sample.scene):
        if number in seen:
            raise InvalidInputError(
                f"the samples of scene {number} are not next to each other; sort samples by scene"
            )
        seen.add(number)
        yield number, views


def required_image(sample: Sample, format: str, name: str) -> NDArray[Any]:
    """An image of a sample that a format requires.

    Args:
        sample: the sample.
        format: name of the format, for the message.
        name: attribute of `Images`.

    Raises:
        InvalidInputError: the image is missing.
    """
    image = getattr(sample.images, name)
    if image is None:
        raise InvalidInputError(
            f"sample {sample.key} has no {name} image, which {format} needs; generate a data"
            f" set with {name}"
        )
    return np.asarray(image)


def require_pinhole(sample: Sample, format: str) -> None:
    """Refuses a camera with lens distortion, for a format that only has the camera matrix K.

    Raises:
        InvalidInputError: the lens has distortion.
    """
    if not sample.view.intrinsics.is_pinhole:
        raise InvalidInputError(
            f"camera {sample.view.camera} of sample {sample.key} has lens distortion, which"
            f" {format} cannot store; generate the data set with a camera without distortion"
        )


def exported_depth(sample: Sample, format: str, *, sensor: bool) -> Single:
    """(H, W) depth to write [m].

    Args:
        sample: the sample.
        format: name of the format, for the message.
        sensor: whether to take the simulated sensor's depth instead of the exact one.

    Raises:
        InvalidInputError: the sample lacks this depth.
    """
    if not sensor:
        return required_image(sample, format, "depth")
    if sample.sensor_depth is None:
        raise InvalidInputError(
            f"sample {sample.key} has no depth of a simulated sensor; write the exact depth, or"
            " generate the data set with a sensor"
        )
    return sample.sensor_depth


def describe_lost_depth(sample: Sample, format: str, *, sensor: bool) -> set[str]:
    """A set with a sentence on the depth lost in a format with one depth image per view; empty if
    none is lost.

    Args:
        sample, format, sensor: as for `exported_depth`.
    """
    if sensor and sample.images.depth is not None:
        return {f"{format} stores one depth image per view: the exact depth is left out."}
    if not sensor and sample.sensor_depth is not None:
        return {f"{format} stores one depth image per view: the depth of the sensor is left out."}
    return set()


def object_index(objects: Sequence[str], sample: Sample, label: InstanceLabel) -> int:
    """Index of an instance's object in the data set's list.

    Raises:
        UnknownNameError: the object is not in the list.
    """
    if label.object not in objects:
        raise UnknownNameError(
            f"object {label.object!r} of sample {sample.key} is not an object of the data set;"
            f" {suggest_names(label.object, objects)}"
        )
    return objects.index(label.object)


@contextmanager
def new_folder(folder: str | Path) -> Iterator[Path]:
    """Creates a temporary folder, and renames it to `folder` if the block succeeds.

    Args:
        folder: new or empty folder.

    Yields:
        The temporary folder, beside `folder`.

    Raises:
        InvalidInputError: `folder` is a file, is not empty or cannot be written to, or the disk is
            full. The temporary folder is removed.
    """
    path = Path(os.path.realpath(folder))
    if os.path.lexists(path):
        if not path.is_dir():
            raise InvalidInputError(f"{folder} is a file; give a folder for the export")
        if any(path.iterdir()):
            raise InvalidInputError(f"{folder} is not empty; choose another folder for the export")
    with atomic_folder(path) as fresh:
        yield fresh


def encode_color_image(image: Bytes, suffix: str) -> bytes:
    """Encodes colours (H, W, 3) as `.jpg` or `.png`."""
    if suffix == ".png":
        return encode_png(image)
    _, data = cv2.imencode(".jpg", image[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, 95])
    return bytes(data)


def depth_in_units(depth: Single, unit: float, key: str) -> NDArray[np.uint16]:
    """Depth as 16-bit integers.

    Args:
        depth: (H, W) depth [m], 0 for no depth.
        unit: unit of the integers [m].
        key: key of the sample, for the message.

    Raises:
        InvalidInputError: a depth does not fit into 16 bits.
    """
    max_number = np.iinfo(np.uint16).max
    numbers = np.rint(depth / unit)
    if numbers.max(initial=0.0) > max_number:
        raise InvalidInputError(
            f"sample {key} has depths up to {depth.max():.3g} m, but 16-bit images with a unit of"
            f" {1e3 * unit:g} mm end at {max_number * unit:.3g} m; give a larger unit"
        ).about("depth_unit")
    return np.asarray(numbers, dtype=np.uint16)
