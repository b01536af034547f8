"""What a data set is made of, counted in one pass through its samples."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection
from dataclasses import dataclass, field

import numpy as np

from burg_drake.core import Array
from burg_drake.dataset.exchange.source import Samples
from burg_drake.dataset.samples import Dataset, Sample


@dataclass(eq=False)
class Tally:
    """Counts and distributions of a data set.

    Attributes:
        scenes: numbers of its scenes.
        views: samples by what their camera was made from.
        sizes: samples by width and height of their images.
        images: samples by what images they have.
        instances: by object, in all samples, visible or not.
        visible: the same, of those that are visible.
        outcomes: of grasps.
        distances: of each visible instance, from the camera to the origin of its frame [m].
        visibilities: of each instance.
        elevations: of each view, by which its optical axis points down [rad].
        objects: of each view, visible instances.
    """

    scenes: set[int] = field(default_factory=set)
    views: Counter[str] = field(default_factory=Counter)
    sizes: Counter[tuple[int, int]] = field(default_factory=Counter)
    images: Counter[str] = field(default_factory=Counter)
    instances: Counter[str] = field(default_factory=Counter)
    visible: Counter[str] = field(default_factory=Counter)
    outcomes: Counter[str] = field(default_factory=Counter)
    distances: list[float] = field(default_factory=list)
    visibilities: list[float] = field(default_factory=list)
    elevations: list[float] = field(default_factory=list)
    objects: list[int] = field(default_factory=list)

    @property
    def samples(self) -> int:
        """Number of samples."""
        return self.views.total()

    def add(self, sample: Sample, parts: Collection[str]) -> None:
        """Counts a sample that has such images, read or not."""
        view = sample.view
        self.scenes.add(sample.scene)
        self.views[view.camera] += 1
        self.sizes[view.intrinsics.width, view.intrinsics.height] += 1
        for name in ("color", "depth", "labels", "normals"):
            self.images[name] += name in parts
        self.images["depth of a sensor"] += "sensor_depth" in parts
        self.elevations.append(elevation(view.X_SC))
        seen = [label for label in sample.instances if label.visible_pixels]
        self.objects.append(len(seen))
        self.instances.update(label.object for label in sample.instances)
        self.visible.update(label.object for label in seen)
        self.visibilities += [label.visibility for label in sample.instances]
        self.distances += [float(np.linalg.norm(label.X_CO[:3, 3])) for label in seen]
        if sample.grasps is not None:
            self.outcomes.update(str(outcome) for outcome in sample.grasps.outcome)


def tally(samples: Samples) -> Tally:
    """Counts all samples; images of a data set on disk are not decoded for that."""
    counted = Tally()
    if isinstance(samples, Dataset):
        for index in range(len(samples)):
            counted.add(samples.read(index, ("grasps",)), samples.parts(index))
        return counted
    for sample in samples:
        there = {name for name, image in vars(sample.images).items() if image is not None}
        if sample.sensor_depth is not None:
            there.add("sensor_depth")
        counted.add(sample, there)
    return counted


def elevation(X_SC: Array) -> float:
    """By how much the optical axis of a camera points down [rad]: pi / 2 from straight above."""
    return float(np.arcsin(np.clip(-X_SC[2, 2], -1.0, 1.0)))
