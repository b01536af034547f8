"""Finds what is wrong with a data set on disk: files that are lost, damaged or left over, and
samples that contradict themselves, their scene, or what is drawn of it anew."""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

from burg_drake.core import BurgError, InvalidInputError
from burg_drake.core.documents import load_document
from burg_drake.core.files import UNFINISHED
from burg_drake.dataset.rendering import Images
from burg_drake.dataset.samples.document import FILE as DOCUMENT_FILE, load_dataset_document
from burg_drake.dataset.samples.index import FILE, read_index, scene_of, shard_numbers
from burg_drake.dataset.samples.record import SampleRecord
from burg_drake.dataset.samples.sample import Sample
from burg_drake.dataset.samples.sample_checks import (
    Fault,
    drawing_faults,
    grasp_faults,
    label_faults,
    scene_faults,
    silhouette_faults,
    surface_faults,
)
from burg_drake.dataset.samples.sample_files import RECORD, SUFFIXES, member_kind
from burg_drake.dataset.samples.shard import (
    FOLDER,
    SampleShard,
    ShardEntry,
    file_sum,
    open_shard,
    shard_name,
)
from burg_drake.dataset.samples.tar import tar_members
from burg_drake.dataset.samples.writer import SCENES, scene_name
from burg_drake.scene.document import Scene, SceneDocument, load_scene

Redraw = Callable[[Scene, Sample], Images]
"""Draws the labels and the depth of a sample anew, from its scene and its view."""
SAMPLE_PARTS = ("sensor_depth", "grasps")
"""Kinds of files that are fields of a sample; all others are of its images."""


@dataclass(frozen=True)
class DatasetFinding:
    """Something that is wrong.

    Attributes:
        sample: its key; empty if it is of no sample.
        file: in the data set; of a sample the shard and the member, with a colon between them.
        message: what is wrong.
    """

    sample: str
    file: str
    message: str

    def __str__(self) -> str:
        return f"{self.file}: {self.message}"


def check_dataset(folder: str | Path, redraw: Redraw | None = None) -> list[DatasetFinding]:
    """Looks at every file of a data set.

    Args:
        folder: of the data set.
        redraw: draws labels and depth anew, with which those of the samples are compared; they
            are not if it is None. It needs the library of the scenes.

    Returns:
        All that is wrong, in the order of the scenes; empty of a sound data set.
    """
    folder = Path(folder)
    try:
        load_dataset_document(folder / DOCUMENT_FILE)
    except InvalidInputError as error:
        return [_finding(folder, DOCUMENT_FILE, error)]
    found = list(_left_over(folder))
    entries: dict[int, ShardEntry] = {}
    try:
        entries = {scene_of(entry): entry for entry in read_index(folder)}
    except InvalidInputError as error:
        found.append(_finding(folder, FILE, error))
    for number in sorted({*entries, *shard_numbers(folder)}):
        if entries and number not in entries:
            found.append(DatasetFinding("", shard_name(number), "it is not in the index"))
        found += check_shard(folder, number, entries.get(number), redraw)
    return found


def check_shard(
    folder: str | Path, scene: int, entry: ShardEntry | None = None, redraw: Redraw | None = None
) -> list[DatasetFinding]:
    """Looks at the samples of one scene; several processes can do so, each with other scenes.

    Args:
        folder: of the data set.
        scene: number.
        entry: of the index, for the check sum; None if there is none.
        redraw: see `check_dataset`.
    """
    folder, name = Path(folder), shard_name(scene)
    if not (folder / name).is_file():
        return [DatasetFinding("", name, "the shard is missing")]
    found = [] if entry is None else list(_wrong_entry(folder, entry))
    try:
        shard = open_shard(folder / name)
    except InvalidInputError as error:
        return [*found, _finding(folder, name, error)]
    found += [
        DatasetFinding("", f"{name}: {one}", "it belongs to no sample") for one in shard.strangers
    ]
    if entry is not None and len(shard.keys) != entry.nsamples:
        message = f"it has {len(shard.keys)} samples, but the index says {entry.nsamples}"
        found.append(DatasetFinding("", name, message))
    found += _apart(shard, name)
    document, drawn = None, None
    try:
        document = load_document(folder / scene_name(scene), SceneDocument)
        if redraw is not None:
            drawn = load_scene(folder / scene_name(scene))
    except BurgError as error:
        found.append(_finding(folder, scene_name(scene), error))
    for key in shard.keys:
        for kind, message in _sample_faults(shard, key, document, drawn, redraw):
            file = f"{key}.{SUFFIXES[kind]}"
            found.append(DatasetFinding(key, f"{name}: {file}", message))
    return found


def _left_over(folder: Path) -> Iterator[DatasetFinding]:
    """Scenes without shard, and files that were being written."""
    for place in (folder, folder / SCENES, folder / FOLDER):
        if not place.is_dir():
            yield DatasetFinding("", place.name, "the folder is missing")
            continue
        for path in sorted(place.iterdir()):
            if UNFINISHED.fullmatch(path.name):
                name = path.relative_to(folder).as_posix()
                yield DatasetFinding(
                    "", name, "it is unfinished: the process that wrote it was interrupted"
                )
    complete = {scene_name(number) for number in shard_numbers(folder)}
    for path in sorted((folder / SCENES).glob("*.yaml")):
        name = path.relative_to(folder).as_posix()
        if name not in complete:
            yield DatasetFinding("", name, "the scene has no shard")


def _wrong_entry(folder: Path, entry: ShardEntry) -> Iterator[DatasetFinding]:
    size, md5 = file_sum(folder / entry.url)
    if size != entry.filesize:
        message = f"it has {size} bytes, but the index says {entry.filesize}"
        yield DatasetFinding("", entry.url, message)
    elif md5 != entry.md5sum:
        message = f"it was changed: its MD5 is {md5}, but the index says {entry.md5sum}"
        yield DatasetFinding("", entry.url, message)


def _apart(shard: SampleShard, name: str) -> Iterator[DatasetFinding]:
    """Samples whose files do not lie next to each other, as readers of WebDataset expect."""
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
    """Kind of file and what is wrong with it, of one sample."""
    try:
        record = shard.record(key)
    except InvalidInputError as error:
        yield RECORD, _short(error, shard, key, RECORD)
        return
    unannounced = sorted({*shard.samples[key]} - {RECORD, *record.files})
    for kind in unannounced:
        yield kind, "it is not in the record"
    sample = record.sample
    for kind in record.files:
        if kind not in SUFFIXES or kind == RECORD:
            yield RECORD, f"files has {kind!r}, which no sample has"
            continue
        try:
            part = shard.sample(record, [kind])
        except InvalidInputError as error:
            yield kind, _short(error, shard, key, kind)
        else:
            sample = _with_part(sample, part, kind)
    yield from _contradictions(sample, record, document)
    if scene is not None and redraw is not None:
        try:
            yield from drawing_faults(sample, redraw(scene, sample), record.depth_unit)
        except BurgError as error:
            yield RECORD, f"it cannot be rendered again: {error}"


def _with_part(sample: Sample, part: Sample, kind: str) -> Sample:
    """A sample with that which another one was read with."""
    if kind in SAMPLE_PARTS:
        return replace(sample, **{kind: getattr(part, kind)})
    return replace(sample, images=replace(sample.images, **{kind: getattr(part.images, kind)}))


def _contradictions(
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


def _finding(folder: Path, name: str, error: BurgError) -> DatasetFinding:
    """Of an error about a file of the data set."""
    return DatasetFinding("", name, str(error).removeprefix(str(folder / name)).lstrip(":, "))


def _short(error: InvalidInputError, shard: SampleShard, key: str, kind: str) -> str:
    """What an error says of a member, without where it is."""
    text = str(error).removeprefix(f"{shard.path}: {key}.{SUFFIXES[kind]}")
    return text.removeprefix(":").strip()
