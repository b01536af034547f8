"""The card of a data set: a README with counts, histograms and example pictures."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from burg_drake.core import (
    Array,
    InvalidInputError,
    UnknownNameError,
    atomic_write_all,
    software_versions,
    suggest_names,
)
from burg_drake.dataset.export_common import Samples
from burg_drake.dataset.reader import Dataset
from burg_drake.dataset.sample import Sample
from burg_drake.dataset.sample_sheet import evenly_spaced_indices, sheet_png
from burg_drake.visualization import bars_of_counts_file, histogram_file


@dataclass(eq=False)
class DatasetCounts:
    """Counts and distributions of a data set.

    Attributes:
        scenes: numbers of the scenes.
        views: samples by camera (a camera of the station, `sphere` or `wrist`).
        sizes: samples by width and height of their images.
        images: samples by kind of image.
        instances: instances in all samples by object, visible or not.
        visible: visible instances in all samples by object.
        outcomes: grasps by outcome.
        distances: distance of each visible instance's origin from the camera [m].
        visibilities: visibility of each instance.
        elevations: downward angle of each view's optical axis [rad].
        objects: number of visible instances of each view.
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
        """Counts a sample with the parts `parts`, which need not be read."""
        view = sample.view
        self.scenes.add(sample.scene)
        self.views[view.camera] += 1
        self.sizes[view.intrinsics.width, view.intrinsics.height] += 1
        for name in ("color", "depth", "labels", "normals"):
            self.images[name] += name in parts
        self.images["depth of a sensor"] += "sensor_depth" in parts
        self.elevations.append(camera_elevation(view.X_SC))
        seen = [label for label in sample.instances if label.visible_pixels]
        self.objects.append(len(seen))
        self.instances.update(label.object for label in sample.instances)
        self.visible.update(label.object for label in seen)
        self.visibilities += [label.visibility for label in sample.instances]
        self.distances += [float(np.linalg.norm(label.X_CO[:3, 3])) for label in seen]
        if sample.grasps is not None:
            self.outcomes.update(str(outcome) for outcome in sample.grasps.outcome)


def count_dataset(samples: Samples) -> DatasetCounts:
    """Counts all samples, without decoding images of a data set on disk."""
    counted = DatasetCounts()
    if isinstance(samples, Dataset):
        for index in range(len(samples)):
            counted.add(samples.read(index, ("grasps",)), samples.parts(index))
        return counted
    for sample in samples:
        image_kinds = {name for name, image in vars(sample.images).items() if image is not None}
        if sample.sensor_depth is not None:
            image_kinds.add("sensor_depth")
        counted.add(sample, image_kinds)
    return counted


def camera_elevation(X_SC: Array) -> float:
    """Downward angle of a camera's optical axis [rad]: pi / 2 for a view from straight above."""
    return float(np.arcsin(np.clip(-X_SC[2, 2], -1.0, 1.0)))


CARD_FILE = "README.md"  # File name of the card in the folder of a data set.
CARD_MARKER = "<!-- Card of a data set, written by burg_drake. -->"
"""First line of a card that burg_drake wrote and may replace."""


def write_card(
    samples: Samples,
    folder: str | Path,
    *,
    description: str = "",
    facts: Mapping[str, str] | None = None,
    licences: Mapping[str, str] | None = None,
) -> None:
    """Writes the card of a data set: `README.md`, and the folder `card` with its pictures.

    Replaces an earlier card.

    Args:
        samples: the data set.
        folder: folder of the card.
        description: a paragraph on the purpose of the data set.
        facts: facts on how the data set was made, such as its seed, by name.
        licences: licences of the meshes by object, as libraries do not state them.

    Raises:
        InvalidInputError: there are no samples, there is another README.md, or the folder cannot be
            written to.
        UnknownNameError: the data set has no object that a licence names.
    """
    folder = Path(folder)
    _require_own_card(folder / CARD_FILE)
    for name in licences or {}:
        if name not in samples.objects:
            raise UnknownNameError(
                f"a licence is given for object {name!r}, which is not in the data set;"
                f" {suggest_names(name, samples.objects)}"
            )
    if not len(samples):
        raise InvalidInputError(f"cannot write {folder / CARD_FILE}: the data set has no samples")
    counted = count_dataset(samples)
    chosen = [samples[k] for k in evenly_spaced_indices(len(samples), 4)]
    charts = _chart_files(counted)
    pictures: dict[str, str | bytes] = {**charts, "examples.png": sheet_png(chosen, 1)}
    made = {**(facts or {}), **software_versions(with_platform=False)}
    text = "\n\n".join(
        [
            CARD_MARKER,
            f"# {samples.name}",
            *([description] if description else []),
            _summary_table(counted),
            "![images of some samples](card/examples.png)",
            "## Objects",
            _object_table(samples, counted, licences or {}),
            "## Distributions",
            "\n".join(f"![{Path(name).stem}](card/{name})" for name in charts),
            *(["## Grasps", _outcome_table(counted)] if counted.outcomes else []),
            "## How it was made",
            _markdown_table(("", ""), list(made.items())),
        ]
    )
    contents = {folder / "card" / name: picture for name, picture in pictures.items()}
    atomic_write_all({**contents, folder / CARD_FILE: text + "\n"})


def _require_own_card(path: Path) -> None:
    """Refuses to replace a file that burg_drake did not write."""
    if not path.exists():
        return
    try:
        own = path.read_text(encoding="utf-8").startswith(CARD_MARKER)
    except (OSError, UnicodeDecodeError):
        own = False
    if not own:
        raise InvalidInputError(
            f"{path} exists already and is not the card of a data set; move it away"
        )


def _chart_files(counted: DatasetCounts) -> dict[str, str]:
    """Charts by file name."""
    degrees = np.rad2deg(counted.elevations).tolist()
    percent = [100.0 * share for share in counted.visibilities]
    return {
        "distance.svg": histogram_file(
            counted.distances, "Distance of visible objects", "from the camera [m]"
        ),
        "elevation.svg": histogram_file(
            degrees, "Elevation of views", "by which the camera looks down [°]"
        ),
        "visibility.svg": histogram_file(
            percent, "Visibility of objects", "share of the silhouette [%]", limits=(0.0, 100.0)
        ),
        "objects.svg": bars_of_counts_file(counted.objects, "Objects in images", "visible objects"),
    }


def _summary_table(counted: DatasetCounts) -> str:
    sizes = [f"{wide} x {tall} ({n:,})" for (wide, tall), n in sorted(counted.sizes.items())]
    views = [f"{name} ({n:,})" for name, n in sorted(counted.views.items())]
    images = [f"{name} ({n:,})" for name, n in counted.images.items() if n]
    instances, visible = counted.instances.total(), counted.visible.total()
    rows = [
        ("scenes", f"{len(counted.scenes):,}"),
        ("samples", f"{counted.samples:,}"),
        ("views (samples)", ", ".join(views)),
        ("images (samples)", ", ".join(images)),
        ("size [pixel] (samples)", ", ".join(sizes)),
        ("instances in samples", f"{instances:,}, {visible:,} of them visible"),
        ("grasps in samples", f"{counted.outcomes.total():,}"),
    ]
    return _markdown_table(("", ""), rows)


def _object_table(samples: Samples, counted: DatasetCounts, licences: Mapping[str, str]) -> str:
    """Table of the objects with their counts and the sources of their meshes."""
    rows = []
    for number, name in enumerate(samples.objects, start=1):
        source = samples.library.entry(name).source
        counts = f"{counted.instances[name]:,}", f"{counted.visible[name]:,}"
        origin = source.file or "made by code", source.sha256[:12]
        rows.append((str(number), name, *counts, *origin, licences.get(name, "not stated")))
    header = ("id", "object", "instances", "visible", "mesh", "sha256", "licence of the mesh")
    return f"Object library `{samples.library.name}`.\n\n{_markdown_table(header, rows)}"


def _outcome_table(counted: DatasetCounts) -> str:
    counts = counted.outcomes.most_common()
    rows = [(outcome or "clear, or not judged", f"{n:,}") for outcome, n in counts]
    return _markdown_table(("outcome", "number"), rows)


def _markdown_table(header: tuple[str, ...], rows: Sequence[tuple[str, ...]]) -> str:
    lines = [header, ("---",) * len(header), *rows]
    return "\n".join(f"| {' | '.join(map(_escape_cell, line))} |" for line in lines)


def _escape_cell(text: str) -> str:
    return text.replace("|", "\\|").replace("\n", " ")
