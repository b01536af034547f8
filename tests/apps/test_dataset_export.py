"""`burg-drake dataset export`: which depth is written, in which unit."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from burg_drake.apps import main
from burg_drake.dataset import DatasetWriter, Sample
from tests.dataset import drawn_samples as drawn

LEFT_OUT = "burg-drake: warning: {} stores one depth image per view: the {} is left out.\n"


def drawn_sample() -> Sample:
    """A sensor that measures half as far as it is; the camera has no distortion."""
    sample = drawn.sample(0, 12)
    view = replace(sample.view, intrinsics=replace(sample.view.intrinsics, distortion=()))
    return replace(sample, view=view, sensor_depth=sample.images.depth / 2)


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A data set of one sample with both depths."""
    folder = tmp_path_factory.mktemp("data") / "set"
    with DatasetWriter(folder, drawn.DOCUMENT) as writer:
        writer.add(12, drawn.scene(), [drawn_sample()])
    return folder


def export(data: Path, out: Path, name: str, *options: str) -> int:
    return main(["dataset", "export", str(data), "--to", name, "-o", str(out), *options])


def depth_of(path: Path) -> np.ndarray:
    return cv2.imread(str(path), cv2.IMREAD_UNCHANGED).astype(float)


def test_either_depth_in_any_unit(
    data: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    sample = drawn_sample()
    image = "scenes/scene_0012/realsense/depth/0000.png"
    assert export(data, tmp_path / "exact", "graspnet") == 0
    assert LEFT_OUT.format("GraspNet", "depth of the sensor") in capsys.readouterr().err
    assert np.abs(depth_of(tmp_path / "exact" / image) * 1e-3 - sample.images.depth).max() < 6e-4
    assert export(data, tmp_path / "bop", "bop", "--sensor-depth", "--depth-unit", "0.002") == 0
    assert LEFT_OUT.format("BOP", "exact depth") in capsys.readouterr().err
    measured = depth_of(tmp_path / "bop/train_pbr/000012/depth/000000.png")
    assert np.abs(measured * 2e-3 - sample.sensor_depth).max() < 1.1e-3
    assert json.loads((tmp_path / "bop/camera.json").read_text())["depth_scale"] == 2.0
    assert export(data, tmp_path / "graspnet", "graspnet", "--sensor-depth") == 0
    assert LEFT_OUT.format("GraspNet", "exact depth") in capsys.readouterr().err
    measured = depth_of(tmp_path / "graspnet" / image)
    assert np.abs(measured * 1e-3 - sample.sensor_depth).max() < 6e-4


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (
            ("coco", "--sensor-depth"),
            "coco takes no sensor depth, which bop and graspnet take (--sensor-depth)",
        ),
        (
            ("webdataset", "--sensor-depth"),
            "webdataset takes no sensor depth, which bop and graspnet take (--sensor-depth)",
        ),
        (
            ("graspnet", "--depth-unit", "0.01"),
            "graspnet takes no depth unit, which bop and webdataset take (--depth-unit)",
        ),
        (
            ("webdataset", "--depth-unit", "1e-6"),
            "sample 000012_000 has depths up to 0.9 m, but 16-bit images with a unit of 0.001 mm"
            " end at 0.0655 m; give a larger unit (--depth-unit)",
        ),
    ],
)
def test_what_a_format_does_not_take(
    data: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    arguments: tuple[str, ...],
    said: str,
) -> None:
    assert export(data, tmp_path / "out", *arguments) == 2
    assert capsys.readouterr().err == f"burg-drake: error: {said}\n"
    assert list(tmp_path.iterdir()) == []
