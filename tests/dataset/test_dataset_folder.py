"""The folder of a data set: whole or not there, gone on with, and read by several processes."""

from __future__ import annotations

import hashlib
import json
import multiprocessing
import os
import pickle
import resource
import signal
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from burg_drake.core import DocumentError, InvalidInputError, UnknownNameError
from burg_drake.dataset import (
    Dataset,
    DatasetWriter,
    Sample,
    check_dataset,
    load_dataset,
    write_index,
    write_scene,
)
from tests.dataset import drawn_samples as drawn


def files(folder: Path) -> dict[str, bytes]:
    """Contents of all files by their path."""
    return {
        path.relative_to(folder).as_posix(): path.read_bytes()
        for path in folder.rglob("*")
        if path.is_file()
    }


def test_the_document_comes_back(tmp_path: Path) -> None:
    dataset = load_dataset(drawn.write(tmp_path, []))
    assert dataset.document == drawn.DOCUMENT
    assert len(dataset) == 0 and dataset.keys == () and list(dataset) == []


def test_the_index_is_that_of_wids(tmp_path: Path) -> None:
    index = json.loads((drawn.write(tmp_path) / "index.json").read_text())
    assert index["wids_version"] == 1 and index["name"] == "drawn"
    for number, line in zip((12, 13), index["shardlist"], strict=True):
        data = (tmp_path / f"shards/{number:06d}.tar").read_bytes()
        assert line == {
            "url": f"shards/{number:06d}.tar",
            "nsamples": 2,
            "filesize": len(data),
            "md5sum": hashlib.md5(data).hexdigest(),
        }
    before = (tmp_path / "index.json").read_bytes()
    (tmp_path / "index.json").unlink()
    with pytest.raises(InvalidInputError, match=r"has no index\.json"):
        load_dataset(tmp_path)
    write_index(tmp_path)
    assert (tmp_path / "index.json").read_bytes() == before


def test_scenes_come_back_with_their_library(tmp_path: Path) -> None:
    dataset = load_dataset(drawn.write(tmp_path))
    assert dataset.scenes == (12, 13) and dataset.indices(13) == range(2, 4)
    assert dataset.scene(13).content == drawn.scene().content
    text = (tmp_path / "scenes/000013.yaml").read_text()
    assert "library: package://burg_drake/models/" in text  # and no path of this machine
    with pytest.raises(UnknownNameError, match="has no scene 14"):
        dataset.scene(14)


def test_only_what_is_asked_for_is_read(tmp_path: Path) -> None:
    dataset = load_dataset(drawn.write(tmp_path))
    sample = dataset.read(-1, images=("depth",))
    assert sample.key == dataset.keys[-1] == "000013_001"
    assert sample.images.depth is not None and sample.images.color is None
    assert sample.sensor_depth is None and sample.grasps is None
    assert dataset.read(0, ["grasps"]).grasps is not None
    assert dataset.read("000012_001", ()).key == "000012_001"
    assert {"color", "depth", "grasps"} <= {*dataset.parts(0)}
    with pytest.raises(UnknownNameError, match="has no sample '000012_1'"):
        dataset.read("000012_1")
    assert [one.key for one in dataset[1:3]] == ["000012_001", "000013_000"]
    with pytest.raises(IndexError, match="has no sample 4; it has 4"):
        dataset[4]
    with pytest.raises(UnknownNameError, match=r"'colour'; .*'color'"):
        dataset.read(0, ["colour"])


def depth_sum(dataset: Dataset, index: int) -> float:
    """What a worker makes of a sample."""
    depth = dataset.read(index, ["depth"]).images.depth
    assert depth is not None
    return float(depth.sum())


def test_a_data_set_goes_to_other_processes(tmp_path: Path) -> None:
    dataset = load_dataset(drawn.write(tmp_path))
    expected = [depth_sum(dataset, i) for i in range(4)]
    copy = pickle.loads(pickle.dumps(dataset))
    assert [depth_sum(copy, i) for i in range(4)] == expected and len(set(expected)) == 2
    with multiprocessing.get_context("fork").Pool(2) as pool:
        assert pool.starmap(depth_sum, [(dataset, i % 4) for i in range(16)]) == expected * 4


def test_a_run_goes_on_where_it_stopped(tmp_path: Path) -> None:
    whole = files(drawn.write(tmp_path / "at_once", [3, 12, 13]))
    parts = tmp_path / "in_parts"
    drawn.write(parts, [13])
    with DatasetWriter(parts, drawn.DOCUMENT) as writer:
        assert writer.missing([13, 3, 12]) == [3, 12]
        with pytest.raises(InvalidInputError, match=r"000013\.tar exists already"):
            writer.add(13, drawn.scene(), [])
        samples = [drawn.sample(i, 12) for i in range(2)]
        writer.add_entry(write_scene(parts, 12, drawn.scene(), samples))
        writer.add(3, drawn.scene(), [drawn.sample(i, 3) for i in range(2)])
    assert files(parts) == whole


KILLED = """
import os, signal, sys
from pathlib import Path
from burg_drake.dataset import DatasetWriter
from tests.dataset import drawn_samples as drawn
def samples():
    yield drawn.sample(0, 13)
    if "within" in sys.argv:
        os.kill(os.getpid(), signal.SIGKILL)
writer = DatasetWriter(sys.argv[1], drawn.DOCUMENT)
writer.add(12, drawn.scene(), [drawn.sample(i, 12) for i in range(2)])
writer.add(13, drawn.scene(), samples())
os.kill(os.getpid(), signal.SIGKILL)
"""


@pytest.mark.parametrize(("when", "complete"), [("within", [12]), ("before the index", [12, 13])])
def test_kills_lose_and_double_nothing(tmp_path: Path, when: str, complete: list[int]) -> None:
    data = tmp_path / "data"
    command = [sys.executable, "-c", KILLED, str(data), when]
    root = str(Path(__file__).parents[2])
    done = subprocess.run(command, env=os.environ | {"PYTHONPATH": root}, cwd=root)
    assert done.returncode == -signal.SIGKILL
    said = " ".join(map(str, check_dataset(data)))
    assert "has no index.json" in said
    assert ("it is unfinished: the process that wrote it was interrupted" in said) == (
        when == "within"
    )
    assert ("scenes/000013.yaml: the scene has no shard" in said) == (when == "within")
    with DatasetWriter(data, drawn.DOCUMENT) as writer:
        missing = writer.missing([12, 13])
        assert missing == [n for n in (12, 13) if n not in complete]
        for number in missing:
            assert not (data / f"scenes/{number:06d}.yaml").exists()
            writer.add(number, drawn.scene(), [drawn.sample(0, number)])
    expected = tmp_path / "expected"
    with DatasetWriter(expected, drawn.DOCUMENT) as writer:
        writer.add(12, drawn.scene(), [drawn.sample(i, 12) for i in range(2)])
        writer.add(13, drawn.scene(), [drawn.sample(0, 13)])
    assert files(data) == files(expected) and check_dataset(data) == []


def test_a_full_disk_leaves_nothing_half_written(tmp_path: Path) -> None:
    drawn.write(tmp_path, [12])
    before = files(tmp_path)
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    with DatasetWriter(tmp_path, drawn.DOCUMENT) as writer:
        resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, limits[1]))
        try:
            with pytest.raises(InvalidInputError) as refused:
                writer.add(13, drawn.scene(), [drawn.sample(i, 13) for i in range(2)])
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert str(refused.value) == (
        f"cannot write {tmp_path}/shards/000013.tar: File too large; all shards except this one"
        " are kept: make room, and run the same command to continue"
    )
    assert files(tmp_path) == before


def test_a_sample_that_cannot_be_made_takes_its_scene_with_it(tmp_path: Path) -> None:
    def samples() -> Iterator[Sample]:
        yield drawn.sample()
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt), DatasetWriter(tmp_path, drawn.DOCUMENT) as writer:
        writer.add(12, drawn.scene(), samples())
    assert list(files(tmp_path)) == ["dataset.yaml"]


def test_one_process_writes_at_a_time(tmp_path: Path) -> None:
    with (
        DatasetWriter(tmp_path, drawn.DOCUMENT),
        pytest.raises(InvalidInputError, match="is being written by another process"),
    ):
        DatasetWriter(tmp_path, drawn.DOCUMENT)
    DatasetWriter(tmp_path, drawn.DOCUMENT).close()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"objects": ("mug",)}, "objects is ['mug', 'bottle', 'box', 'screwdriver', 'bowl', "),
        ({"library_content": "ab"}, "the content of the library is none there, ab here"),
        ({"versions": {"drake": "3", "burg_drake": "1"}}, "(drake is 2 there, 3 here)"),
        ({"recipe": None}, "recipe.views.count is 3 there, none here; "),
        ({"recipe": {"views": {"count": 4}}}, "recipe.views.count is 3 there, 4 here; "),
    ],
)
def test_other_content_is_refused(tmp_path: Path, change: dict[str, object], message: str) -> None:
    drawn.write(tmp_path, [])
    with pytest.raises(InvalidInputError) as refused:
        DatasetWriter(tmp_path, replace(drawn.DOCUMENT, **change))  # type: ignore[arg-type]
    assert f"{tmp_path} holds another data set (" in str(refused.value)
    assert message in str(refused.value)
    elsewhere = replace(drawn.DOCUMENT, library="../elsewhere", versions={"burg_drake": "1"})
    elsewhere = replace(elsewhere, versions=elsewhere.versions | {"drake": "2", "editor": "9"})
    DatasetWriter(tmp_path, elsewhere).close()


def test_folders_of_other_things_are_refused(tmp_path: Path) -> None:
    (tmp_path / "thesis.tex").write_text("")
    with pytest.raises(InvalidInputError, match=r"not empty .*dataset\.yaml"):
        DatasetWriter(tmp_path, drawn.DOCUMENT)
    with pytest.raises(InvalidInputError, match=r"dataset\.yaml is missing"):
        load_dataset(tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["thesis.tex"]


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("version: 1", "version: 2", ":3: version: 2 cannot be read; this release reads version 1"),
        ("name: drawn", "nam: drawn", "unknown key 'nam'; did you mean 'name'?"),
        ("count: 3", "count: 3\n    count: 4", "recipe.views: key 'count' is given twice"),
        ("recipe:", "recipe: 4\nrecipe:", "key 'recipe' is given twice"),
    ],
)
def test_a_document_that_does_not_fit_is_refused(
    tmp_path: Path, old: str, new: str, message: str
) -> None:
    path = drawn.write(tmp_path, []) / "dataset.yaml"
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new))
    for read in (load_dataset, lambda folder: DatasetWriter(folder, drawn.DOCUMENT)):
        with pytest.raises(DocumentError) as refused:
            read(tmp_path)
        assert str(refused.value).startswith(str(path)) and message in str(refused.value)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            '"wids_version": 1',
            '"wids_version": 2',
            "wids_version is 2; this release reads",
        ),
        ("shards/000013", "../../000013", "url is '../../000013.tar'; expected a value such as"),
        ("000012.tar", "000013.tar", "shards are repeated or not in ascending order"),
        ('"nsamples": 2', '"nsamples": -2', "nsamples is -2; expected a whole number from 0"),
    ],
)
def test_an_index_that_does_not_fit_is_refused(
    tmp_path: Path, old: str, new: str, message: str
) -> None:
    path = drawn.write(tmp_path) / "index.json"
    path.write_text(path.read_text().replace(old, new))
    with pytest.raises(DocumentError) as refused:
        load_dataset(tmp_path)
    assert str(refused.value).startswith(str(path)) and message in str(refused.value)


def test_a_lost_shard_and_a_wrong_count_are_named(tmp_path: Path) -> None:
    index = drawn.write(tmp_path) / "index.json"
    index.write_text(index.read_text().replace('"nsamples": 2', '"nsamples": 3'))
    with pytest.raises(DocumentError, match=r"000012\.tar has 2 samples"):
        load_dataset(tmp_path)[0]
    (tmp_path / "shards/000013.tar").unlink()
    with pytest.raises(InvalidInputError, match=r"000013\.tar: No such file"):
        load_dataset(tmp_path)[3]


def test_samples_are_found_by_their_keys(tmp_path: Path) -> None:
    dataset = load_dataset(drawn.write(tmp_path))
    assert "000013_000" in dataset and dataset.index("000013_000") == 2
    assert drawn.sample(1, 12) in dataset and dataset.index(dataset[1]) == 1
    assert "000013_002" not in dataset and "mug" not in dataset and 2 not in dataset
    assert (dataset.count("000013_000"), dataset.count("000014_000")) == (1, 0)
    assert [one.key for one in reversed(dataset)] == list(reversed(dataset.keys))
    with pytest.raises(UnknownNameError, match=r"no sample '000013_2'; did you mean '000013_00"):
        dataset.index("000013_2")
    with pytest.raises(UnknownNameError, match=r"'000014_000'.* its scenes are 000012, 000013"):
        dataset.index("000014_000")
    with pytest.raises(UnknownNameError, match="no sample '000012_001'"):
        dataset.index("000012_001", 2)
    (tmp_path / "shards/000012.tar").unlink()
    assert "000013_000" in dataset  # reads no other shard
    with pytest.raises(InvalidInputError, match=r"000012\.tar"):
        assert "000012_000" in dataset


def test_pixels_of_a_sample_are_its_own(tmp_path: Path) -> None:
    dataset = load_dataset(drawn.write(tmp_path))
    color = dataset[0].images.color
    assert color is not None
    color[...] = 0
    again = dataset[0].images.color
    assert again is not None and np.count_nonzero(again)
