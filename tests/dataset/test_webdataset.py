"""WebDataset: tar files read by Python's own reader, and by its own library."""

from __future__ import annotations

import json
import tarfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from burg_drake.dataset import load_dataset, write_card, write_webdataset
from tests.dataset import drawn_samples
from tests.dataset.exported_files import decoded, mask_of
from tests.dataset.polyhedra import InMemory, some_grasps


def test_webdataset_has_shards_of_whole_samples(samples: InMemory, tmp_path: Path) -> None:
    grasped = replace(samples[0], grasps=some_grasps(), sensor_depth=samples[0].images.depth * 2)
    data = InMemory((grasped, *samples.samples[1:]), samples.library)
    for name in ("one", "two"):
        write_webdataset(data, tmp_path / name, shard_size=3, images="png")
    shards = sorted((tmp_path / "one").iterdir())
    assert [s.name for s in shards] == ["shard-000000.tar", "shard-000001.tar"]
    for shard in shards:
        assert shard.read_bytes() == (tmp_path / "two" / shard.name).read_bytes()
    files = {}
    for shard in shards:
        with tarfile.open(shard) as tar:
            files |= {m.name: tar.extractfile(m).read() for m in tar}
    keys = list(dict.fromkeys(name.partition(".")[0] for name in files))
    assert keys == ["000003_000", "000003_001", "000005_000", "000005_001"]
    assert [n.partition(".")[2] for n in list(files)[:5]] == [
        "png", "depth.png", "seg.png", "sensor.png", "json"]  # fmt: skip
    for key, sample in zip(keys, data, strict=True):
        content = json.loads(files[f"{key}.json"])
        seg = decoded(files[f"{key}.seg.png"])
        np.testing.assert_array_equal(seg, sample.images.labels)
        depth = decoded(files[f"{key}.depth.png"]) * content["depth_unit"]
        assert np.abs(depth - sample.images.depth).max() < 6e-5
        np.testing.assert_array_equal(content["X_SC"], sample.view.X_SC)
        for entry, label in zip(content["instances"], sample.instances, strict=True):
            np.testing.assert_array_equal(mask_of(entry["amodal"]), label.amodal)
            assert data.objects[entry["object_id"] - 1] == label.object
    grasps = json.loads(files["000003_000.json"])["grasps"]
    assert grasps["margins"]["slip"] == [None, 0.0, 0.01, 0.04, None, None]
    twice = decoded(files["000003_000.sensor.png"]).astype(int)
    assert np.abs(twice - 2 * decoded(files["000003_000.depth.png"])).max() <= 1


def test_webdataset_is_read_by_its_own_library(samples: InMemory, tmp_path: Path) -> None:
    webdataset = pytest.importorskip("webdataset")
    write_webdataset(samples, tmp_path / "out", images="png")
    shard = str(tmp_path / "out/shard-000000.tar")
    found = list(webdataset.WebDataset(shard, shardshuffle=False).decode())
    assert [one["__key__"] for one in found] == [sample.key for sample in samples]
    for one, sample in zip(found, samples, strict=True):
        np.testing.assert_array_equal(decoded(one["seg.png"]), sample.images.labels)
        assert [entry["name"] for entry in one["json"]["instances"]] == [
            label.name for label in sample.instances
        ]


def test_a_data_set_on_disk_is_exported(tmp_path: Path) -> None:
    dataset = load_dataset(drawn_samples.write(tmp_path / "data"))
    write_webdataset(dataset, tmp_path / "out")
    write_card(dataset, tmp_path / "card")
    with tarfile.open(tmp_path / "out/shard-000000.tar") as tar:
        for sample in dataset:
            content = json.load(tar.extractfile(f"{sample.key}.json"))
            ids = {x["object"]: x["object_id"] for x in content["instances"]}
            assert ids == {name: k for k, name in enumerate(dataset.document.objects, start=1)}
            seg = decoded(tar.extractfile(f"{sample.key}.seg.png").read())
            np.testing.assert_array_equal(seg, sample.images.labels)
    assert "Object library `household`" in (tmp_path / "card/README.md").read_text()
