"""What the writers of this room take, a data set, and what they ask of its samples."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from itertools import groupby
from typing import Protocol

from burg_drake.core import InvalidInputError, Single, UnknownNameError, nearest
from burg_drake.dataset.labels import InstanceLabel
from burg_drake.dataset.samples import Sample
from burg_drake.objects.library import ObjectLibrary


class Samples(Protocol):
    """A data set as a sequence of samples, all views of a scene one after the other."""

    @property
    def name(self) -> str:
        """Of the data set."""

    @property
    def objects(self) -> tuple[str, ...]:
        """Names of the library's objects, in the order of their numbers in other formats."""

    @property
    def library(self) -> ObjectLibrary:
        """Where these objects are."""

    def __len__(self) -> int: ...

    def __getitem__(self, index: int, /) -> Sample: ...

    def __iter__(self) -> Iterator[Sample]: ...


def scenes_of(samples: Iterable[Sample]) -> Iterator[tuple[int, Iterator[Sample]]]:
    """Scenes with their samples, one sample in memory at a time.

    Raises:
        InvalidInputError: the samples of a scene do not follow each other.
    """
    seen: set[int] = set()
    for number, views in groupby(samples, key=lambda sample: sample.scene):
        if number in seen:
            raise InvalidInputError(
                f"the samples of scene {number} are not next to each other; sort samples by scene"
            )
        seen.add(number)
        yield number, views


def require_images(sample: Sample, format: str, *names: str) -> None:
    """Refuses a sample without images that a format is made of.

    Args:
        sample: of the data set.
        format: its name, for the message.
        names: of attributes of `Images`.

    Raises:
        InvalidInputError: one of them is missing.
    """
    for name in names:
        if getattr(sample.images, name) is None:
            raise InvalidInputError(
                f"sample {sample.key} has no {name} image, which {format} needs; generate a data"
                f" set with {name}"
            )


def require_pinhole(sample: Sample, format: str) -> None:
    """Refuses a camera whose lens bends straight lines, for a format that has nothing but K.

    Raises:
        InvalidInputError: there is distortion.
    """
    if not sample.view.intrinsics.is_pinhole:
        raise InvalidInputError(
            f"camera {sample.view.camera} of sample {sample.key} has lens distortion, which"
            f" {format} cannot store; generate the data set with a camera without distortion"
        )


def depth_of(sample: Sample, format: str, *, sensor: bool) -> Single:
    """(H, W) depth to write [m].

    Args:
        sample: of the data set.
        format: its name, for the message.
        sensor: that of the simulated sensor, and not the exact one.

    Raises:
        InvalidInputError: there is none.
    """
    if not sensor:
        require_images(sample, format, "depth")
    depth = sample.sensor_depth if sensor else sample.images.depth
    if depth is None:
        raise InvalidInputError(
            f"sample {sample.key} has no depth of a simulated sensor; write the exact depth, or"
            " generate the data set with a sensor"
        )
    return depth


def lost_depth(sample: Sample, format: str, *, sensor: bool) -> set[str]:
    """What is lost of the depth by a format that has one depth image of a view, in a sentence.

    Args:
        sample, format, sensor: as for `depth_of`.
    """
    if sensor and sample.images.depth is not None:
        return {f"{format} stores one depth image per view: the exact depth is left out."}
    if not sensor and sample.sensor_depth is not None:
        return {f"{format} stores one depth image per view: the depth of the sensor is left out."}
    return set()


def object_index(objects: Sequence[str], sample: Sample, label: InstanceLabel) -> int:
    """The position of an instance's object in the data set's list.

    Raises:
        UnknownNameError: it is not there.
    """
    if label.object not in objects:
        raise UnknownNameError(
            f"object {label.object!r} of sample {sample.key} is not an object of the data set;"
            f" {nearest(label.object, objects)}"
        )
    return objects.index(label.object)
