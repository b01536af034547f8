"""Checks a data set on disk: missing, damaged and extra files, and inconsistent samples."""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from burg_drake.core import (
    UNFINISHED_FILE,
    Array,
    Booleans,
    BurgError,
    InvalidInputError,
    Outcome,
    inverse,
    load_document,
    quote_value,
    rotation_angle,
)
from burg_drake.dataset.document import (
    DATASET_FILE as DOCUMENT_FILE,
    SHARD_INDEX_FILE,
    load_dataset_document,
    read_index,
    scene_of,
    shard_numbers,
)
from burg_drake.dataset.sample import Box, Images, InstanceLabel, Sample, box_of_mask
from burg_drake.dataset.sample_files import (
    FILE_SUFFIXES,
    GRASPS_KIND,
    RECORD_KIND,
    SampleRecord,
    member_kind,
)
from burg_drake.dataset.shards import (
    SHARD_FOLDER,
    SampleShard,
    ShardEntry,
    open_shard,
    shard_name,
    size_and_md5,
    tar_members,
)
from burg_drake.dataset.writer import SCENE_FOLDER, scene_name
from burg_drake.scene import Scene, SceneDocument, load_scene

Fault = tuple[str, str]


def label_faults(sample: Sample) -> Iterator[Fault]:
    """Contradictions between the label image and the records of the instances."""
    labels = sample.images.labels
    if labels is None:
        return
    top = int(labels.max(initial=0))
    if top > len(sample.instances):
        yield "labels", f"label {top} has no instance; there are {len(sample.instances)} instances"
    counts = np.bincount(labels.ravel(), minlength=len(sample.instances) + 1)
    for one in sample.instances:
        count = int(counts[one.number]) if one.number < len(counts) else 0
        if count != one.visible_pixels:
            yield (
                "labels",
                f"{one.name!r} has {count} pixels, but its record says {one.visible_pixels}",
            )
        visible = labels == one.number
        box = box_of_mask(visible)
        if box != one.visible_box:
            yield (
                RECORD_KIND,
                f"visible_box of {one.name!r} is {one.visible_box}, but its labels have {box}",
            )
        outside = int(np.count_nonzero(visible & ~one.amodal))
        if outside:
            yield (
                RECORD_KIND,
                f"the amodal mask of {one.name!r} lacks {outside} of its {count} visible pixels",
            )


def silhouette_faults(sample: Sample) -> Iterator[Fault]:
    """Contradictions between the values and the mask of each instance."""
    for i, one in enumerate(sample.instances, start=1):
        if one.number != i:
            yield RECORD_KIND, f"{one.name!r} has number {one.number}; expected {i}"
        yield from (
            (RECORD_KIND, f"{one.name!r}: {text}") for text in _instance_contradictions(one)
        )


def _instance_contradictions(one: InstanceLabel) -> Iterator[str]:
    visibility_tolerance = 1e-6
    within, pixels = int(np.count_nonzero(one.amodal)), one.silhouette_pixels
    if within > pixels:
        yield f"silhouette_pixels is {pixels}, less than the {within} of the amodal mask"
    if one.visible_pixels > pixels:
        yield f"visible_pixels is {one.visible_pixels}, more than silhouette_pixels, {pixels}"
    share = one.visible_pixels / pixels if pixels else 0.0
    if abs(share - one.visibility) > visibility_tolerance:
        yield f"visibility is {one.visibility:g}, but its pixels give {share:g}"
    box = box_of_mask(one.amodal)
    if (one.amodal_box is None) != (pixels == 0):
        yield f"amodal_box {one.amodal_box} does not fit silhouette_pixels {pixels}"
    elif box is not None and one.amodal_box is not None and not _contains(one.amodal_box, box):
        yield f"amodal_box {one.amodal_box} does not contain the mask, whose box is {box}"


def surface_faults(sample: Sample, depth_unit: float) -> Iterator[Fault]:
    """Depth and normals out of their ranges. The sensor's depth may have any value."""
    length_tolerance = 1e-3  # Difference of a normal's length from 1.
    near, far = sample.view.depth_range
    depth, normals = sample.images.depth, sample.images.normals
    if depth is not None:
        measured = depth > 0.0
        wrong = measured & ((depth < near - depth_unit) | (depth > far + depth_unit))
        if wrong.any():
            yield (
                "depth",
                f"{np.count_nonzero(wrong)} pixels are outside the depth range {near:g} to {far:g}"
                " m of the view",
            )
    if normals is not None:
        length = np.linalg.norm(normals, axis=-1)
        wrong = (length > 0.0) & (np.abs(length - 1.0) > length_tolerance)
        if wrong.any():
            yield "normals", f"{np.count_nonzero(wrong)} normals have a length other than 1"


def grasp_faults(sample: Sample) -> Iterator[Fault]:
    """Invalid values of grasps."""
    if sample.grasps is None:
        return
    known = {"", *(outcome.value for outcome in Outcome)}
    unknown = sorted(set(sample.grasps.outcome.tolist()) - known)
    if unknown:
        yield GRASPS_KIND, f"outcome {quote_value(unknown[0])} does not exist"
    if (sample.grasps.width < 0.0).any() or np.isinf(sample.grasps.width).any():
        yield GRASPS_KIND, "widths are negative or infinite"


def scene_faults(
    sample: Sample, scene: SceneDocument, X_SO: Mapping[str, Array]
) -> Iterator[Fault]:
    """Contradictions between a sample's instances and the scene: names, order and poses.

    Args:
        sample: the sample, with its record.
        scene: document of the scene.
        X_SO: (4, 4) poses of all instances by name.
    """
    pose_tolerance = 1e-6  # Metres, and difference in the entries of the rotation matrix.
    placed = {one.name or one.object: one.object for one in (*scene.instances, *scene.background)}
    names = [one.name for one in sample.instances]
    if names != list(placed):
        yield RECORD_KIND, f"instances are {', '.join(names)}; the scene has {', '.join(placed)}"
    for one in sample.instances:
        if one.name not in placed:
            continue
        if one.object != placed[one.name]:
            yield (
                RECORD_KIND,
                f"{one.name!r} is object {one.object!r}; in the scene it is {placed[one.name]!r}",
            )
        X_CO = inverse(sample.view.X_SC) @ X_SO[one.name]
        if np.abs(one.X_CO - X_CO).max() > pose_tolerance:
            distance = 1e3 * float(np.linalg.norm(one.X_CO[:3, 3] - X_CO[:3, 3]))
            angle = float(np.rad2deg(rotation_angle(one.X_CO[:3, :3].T @ X_CO[:3, :3])))
            yield (
                RECORD_KIND,
                f"X_CO of {one.name!r} is {distance:.3g} mm and {angle:.3g} degrees from its pose"
                " in the scene",
            )


def drawing_faults(sample: Sample, drawn: Images, depth_unit: float) -> Iterator[Fault]:
    """Differences of labels and depth from newly rendered ones; skips images that are None."""
    labels, depth = sample.images.labels, sample.images.depth
    if labels is not None and drawn.labels is not None:
        yield from _image_difference("labels", labels, drawn.labels != labels)
    if depth is not None and drawn.depth is not None:
        apart = np.abs(drawn.depth - depth) > depth_unit
        yield from _image_difference("depth", depth, apart)


def _image_difference(kind: str, image: NDArray[np.generic], differs: Booleans) -> Iterator[Fault]:
    max_share = 2e-4  # Share of pixels, on edges, that another version may render differently.
    if differs.shape != image.shape:
        raise InvalidInputError(
            f"{kind} rendered again has shape {differs.shape}, not {image.shape}"
        )
    count = int(np.count_nonzero(differs))
    if count > max_share * differs.size:
        y, x = np.argwhere(differs)[0]
        yield (
            kind,
            f"{count} pixels differ when rendered again, the first in column {x} of row {y}",
        )


def _contains(outer: Box, inner: Box) -> bool:
    return all(
        outer[i] <= inner[i] and inner[i] + inner[i + 2] <= outer[i] + outer[i + 2] for i in (0, 1)
    )


Redraw = Callable[[Scene, Sample], Images]
"""Renders the labels and the depth of a sample again, from its scene and its view."""


@dataclass(frozen=True)
class DatasetFinding:
    """An error in a data set.

    Attributes:
        sample: key of the sample; empty if the error belongs to no sample.
        file: file in the data set; for a sample, the shard and its member, separated by a colon.
        message: description of the error.
    """

    sample: str
    file: str
    message: str

    def __str__(self) -> str:
        return f"{self.file}: {self.message}"


def check_dataset(folder: str | Path, redraw: Redraw | None = None) -> list[DatasetFinding]:
    """Checks every file of a data set.

    Args:
        folder: folder of the data set.
        redraw: renders labels and depth again, to compare them with the stored ones; needs the
            library of the scenes. No comparison if None.

    Returns:
        All errors, in the order of the scenes; empty for a sound data set.
    """
    folder = Path(folder)
    try:
        load_dataset_document(folder / DOCUMENT_FILE)
    except InvalidInputError as error:
        return [_finding_of_error(folder, DOCUMENT_FILE, error)]
    found = list(_find_leftover_files(folder))
    entries: dict[int, ShardEntry] = {}
    try:
        entries = {scene_of(entry): entry for entry in read_index(folder)}
    except InvalidInputError as error:
        found.append(_finding_of_error(folder, SHARD_INDEX_FILE, error))
    for number in sorted({*entries, *shard_numbers(folder)}):
        if entries and number not in entries:
            found.append(DatasetFinding("", shard_name(number), "it is not in the index"))
        found += check_shard(folder, number, entries.get(number), redraw)
    return found


def check_shard(
    folder: str | Path, scene: int, entry: ShardEntry | None = None, redraw: Redraw | None = None
) -> list[DatasetFinding]:
    """Checks the samples of one scene. Several processes can check different scenes at once.

    Args:
        folder: folder of the data set.
        scene: number of the scene.
        entry: entry of the index with the checksum, if there is one.
        redraw: see `check_dataset`.
    """
    folder, name = Path(folder), shard_name(scene)
    if not (folder / name).is_file():
        return [DatasetFinding("", name, "the shard is missing")]
    found = [] if entry is None else list(_check_index_entry(folder, entry))
    try:
        shard = open_shard(folder / name)
    except InvalidInputError as error:
        return [*found, _finding_of_error(folder, name, error)]
    found += [
        DatasetFinding("", f"{name}: {one}", "it belongs to no sample")
        for one in shard.foreign_members
    ]
    if entry is not None and len(shard.keys) != entry.nsamples:
        message = f"it has {len(shard.keys)} samples, but the index says {entry.nsamples}"
        found.append(DatasetFinding("", name, message))
    found += _find_scattered_samples(shard, name)
    document, scene_to_draw = None, None
    try:
        document = load_document(folder / scene_name(scene), SceneDocument)
        if redraw is not None:
            scene_to_draw = load_scene(folder / scene_name(scene))
    except BurgError as error:
        found.append(_finding_of_error(folder, scene_name(scene), error))
    for key in shard.keys:
        for kind, message in _sample_faults(shard, key, document, scene_to_draw, redraw):
            file = f"{key}.{FILE_SUFFIXES[kind]}"
            found.append(DatasetFinding(key, f"{name}: {file}", message))
    return found


def _find_leftover_files(folder: Path) -> Iterator[DatasetFinding]:
    """Finds scenes without a shard, and unfinished files."""
    for place in (folder, folder / SCENE_FOLDER, folder / SHARD_FOLDER):
        if not place.is_dir():
            yield DatasetFinding("", place.name, "the folder is missing")
            continue
        for path in sorted(place.iterdir()):
            if UNFINISHED_FILE.fullmatch(path.name):
                name = path.relative_to(folder).as_posix()
                yield DatasetFinding(
                    "", name, "it is unfinished: the process that wrote it was interrupted"
                )
    complete = {scene_name(number) for number in shard_numbers(folder)}
    for path in sorted((folder / SCENE_FOLDER).glob("*.yaml")):
        name = path.relative_to(folder).as_posix()
        if name not in complete:
            yield DatasetFinding("", name, "the scene has no shard")


def _check_index_entry(folder: Path, entry: ShardEntry) -> Iterator[DatasetFinding]:
    size, md5 = size_and_md5(folder / entry.url)
    if size != entry.filesize:
        message = f"it has {size} bytes, but the index says {entry.filesize}"
        yield DatasetFinding("", entry.url, message)
    elif md5 != entry.md5sum:
        message = f"it was changed: its MD5 is {md5}, but the index says {entry.md5sum}"
        yield DatasetFinding("", entry.url, message)


def _find_scattered_samples(shard: SampleShard, name: str) -> Iterator[DatasetFinding]:
    """Finds samples whose files are not adjacent, as readers of WebDataset expect them."""
    kinds = filter(None, map(member_kind, tar_members(shard.path)))
    runs = Counter(key for key, _ in itertools.groupby(kinds, key=lambda kind: kind[0]))
    for key, count in runs.items():
        if count > 1:
            yield DatasetFinding(
                key, name, f"the files of {key} are not next to each other, but in {count} places"
            )


def _sample_faults(
    shard: SampleShard,
    key: str,
    document: SceneDocument | None,
    scene: Scene | None,
    redraw: Redraw | None,
) -> Iterator[Fault]:
    """Errors of one sample, with the kinds of files."""
    try:
        record = shard.record(key)
    except InvalidInputError as error:
        yield RECORD_KIND, _message_without_place(error, shard, key, RECORD_KIND)
        return
    unannounced = sorted({*shard.samples[key]} - {RECORD_KIND, *record.files})
    for kind in unannounced:
        yield kind, "it is not in the record"
    sample = record.sample
    for kind in record.files:
        if kind not in FILE_SUFFIXES or kind == RECORD_KIND:
            yield RECORD_KIND, f"files has {kind!r}, which no sample has"
            continue
        try:
            sample = shard.sample(replace(record, sample=sample), [kind])
        except InvalidInputError as error:
            yield kind, _message_without_place(error, shard, key, kind)
    yield from _sample_contradictions(sample, record, document)
    if scene is not None and redraw is not None:
        try:
            yield from drawing_faults(sample, redraw(scene, sample), record.depth_unit)
        except BurgError as error:
            yield RECORD_KIND, f"it cannot be rendered again: {error}"


def _sample_contradictions(
    sample: Sample, record: SampleRecord, document: SceneDocument | None
) -> Iterator[Fault]:
    yield from silhouette_faults(sample)
    yield from label_faults(sample)
    yield from surface_faults(sample, record.depth_unit)
    yield from grasp_faults(sample)
    if document is not None:
        placed = (*document.instances, *document.background)
        X_SO = {one.name or one.object: one.X_SO.matrix() for one in placed}
        yield from scene_faults(sample, document, X_SO)


def _finding_of_error(folder: Path, name: str, error: BurgError) -> DatasetFinding:
    """Converts an error about a file of the data set."""
    return DatasetFinding("", name, str(error).removeprefix(str(folder / name)).lstrip(":, "))


def _message_without_place(
    error: InvalidInputError, shard: SampleShard, key: str, kind: str
) -> str:
    """Message of an error about a member, without its location."""
    text = str(error).removeprefix(f"{shard.path}: {key}.{FILE_SUFFIXES[kind]}")
    return text.removeprefix(":").strip()
