"""COCO: read by its own library, and by the words of its documents."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from burg_drake.dataset import write_coco
from tests.dataset.exported_files import image, mask_of
from tests.dataset.polyhedra import COLORS, InMemory


@pytest.fixture(scope="module")
def coco(samples: InMemory, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("coco") / "data"
    write_coco(samples, folder, images="png")
    return folder


def test_coco_has_every_visible_instance(coco: Path, samples: InMemory) -> None:
    content = json.loads((coco / "instances.json").read_text())
    names = {c["id"]: c["name"] for c in content["categories"]}
    assert names == {1: "gem", 2: "box"}
    assert [x["id"] for x in content["images"]] == [1, 2, 3, 4]
    found = 0
    for listed, sample in zip(content["images"], samples, strict=True):
        shown = image(coco / "images" / listed["file_name"])[..., ::-1]
        np.testing.assert_array_equal(shown, sample.images.color)
        assert (listed["width"], listed["height"]) == (96, 72)
        own = [x for x in content["annotations"] if x["image_id"] == listed["id"]]
        for annotation in own:
            mask = mask_of(annotation["segmentation"])
            color = COLORS[names[annotation["category_id"]]]
            assert (shown[mask] == color).all()
            assert annotation["area"] == mask.sum() and annotation["iscrowd"] == 0
            x, y, width, height = annotation["bbox"]
            rows, columns = mask.any(axis=1).nonzero()[0], mask.any(axis=0).nonzero()[0]
            assert (x, y) == (columns[0], rows[0])
            assert (x + width - 1, y + height - 1) == (columns[-1], rows[-1])
            found += mask.sum()
        assert found == sum((s.images.labels > 0).sum() for s in samples.samples[: listed["id"]])


def test_coco_is_read_by_its_own_library(coco: Path) -> None:
    api = pytest.importorskip("pycocotools.coco").COCO(coco / "instances.json")
    for annotation in api.loadAnns(api.getAnnIds()):
        mask = api.annToMask(annotation).astype(bool)
        np.testing.assert_array_equal(mask, mask_of(annotation["segmentation"]))
        assert annotation["area"] == mask.sum()
