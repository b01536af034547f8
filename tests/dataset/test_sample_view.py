"""A sample in 3D: its points, camera, arm and grasps are where they are in the world."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pydrake.geometry import Meshcat

from burg_drake.core import InvalidInputError
from burg_drake.dataset import DatasetWriter, Sample, load_dataset, show_sample
from burg_drake.station import load_station
from burg_drake.visualization import open_meshcat
from tests.dataset import drawn_samples as drawn

msgpack = pytest.importorskip("msgspec").msgpack
STATION = load_station("panda_tabletop")
X_WS = STATION.document.X_WS.matrix()
X_SC = drawn.view().X_SC


@pytest.fixture
def meshcat() -> Meshcat:
    return open_meshcat()


def sample(**changes: Any) -> Sample:
    """Without the arm, on the station."""
    given = {"X_WS": X_WS, "view": replace(drawn.view(), posture=None), **changes}
    return drawn.sample(**given)


def transform(meshcat: Meshcat, path: str) -> np.ndarray:
    """(4, 4) as the viewer was told."""
    values = msgpack.decode(meshcat._GetPackedTransform(path))["matrix"]
    return np.reshape(values, (4, 4)).T


def points(meshcat: Meshcat, path: str) -> tuple[np.ndarray, np.ndarray]:
    """(N, 3) points in the world, and their colours (N, 3), linear."""
    message = msgpack.decode(meshcat._GetPackedObject(path), ext_hook=lambda _, data: bytes(data))
    attributes = message["object"]["geometries"][0]["data"]["attributes"]
    p, color = (
        np.frombuffer(attributes[name]["array"], np.float32).reshape(-1, 3)
        for name in ("position", "color")
    )
    X = transform(meshcat, path)
    return p @ X[:3, :3].T + X[:3, 3], color


def test_points_are_where_the_pixels_saw_something(meshcat: Meshcat) -> None:
    made = sample()
    holes = np.where(np.arange(drawn.WIDTH) % 3 == 0, 0.0, made.images.depth).astype(np.float32)
    made = replace(made, sensor_depth=holes)
    show_sample(made, drawn.scene(), STATION, meshcat)
    p_W, color = points(meshcat, "/drake/cloud")
    rows, columns = np.mgrid[: drawn.HEIGHT, : drawn.WIDTH]
    (fx, fy), (cx, cy) = made.view.intrinsics.focal, made.view.intrinsics.center
    z = made.images.depth
    p_C = np.stack([(columns - cx) / fx * z, (rows - cy) / fy * z, z, np.ones_like(z)], axis=-1)
    expected = (p_C.reshape(-1, 4) @ (X_WS @ X_SC).T)[:, :3]
    assert np.linalg.norm(p_W - expected, axis=1).max() < 2.1e-3
    shown = made.images.color.reshape(-1, 3)  # a full and a dark byte are the same in linear light
    assert (color[shown == 255] == 1.0).all() and (color[shown == 0] == 0.0).all()
    assert color.mean() < 0.8 * shown.mean() / 255  # others are darker
    sensor, _ = points(meshcat, "/drake/sensor")
    assert len(sensor) == np.count_nonzero(made.sensor_depth) < len(p_W)


def test_what_is_shown_and_what_is_not(meshcat: Meshcat) -> None:
    legend = show_sample(sample(), drawn.scene(), STATION, meshcat)
    assert [entry.label.partition(" (")[0] for entry in legend] == [
        "models", "depth", "depth of the sensor", "camera with its image",
        "lifted", "arm cannot reach", "not judged",
    ]  # fmt: skip
    assert [entry.shown for entry in legend] == [True, True, False, True, True, True, True]
    for entry in legend:
        assert all(meshcat.HasPath(path) for path in entry.paths)
    np.testing.assert_allclose(transform(meshcat, "/drake/camera"), X_WS @ X_SC, atol=1e-12)
    bare = replace(sample(), sensor_depth=None, grasps=None)
    bare = replace(bare, images=replace(bare.images, color=None, depth=None))
    legend = show_sample(bare, drawn.scene(), STATION, meshcat)
    assert [entry.label for entry in legend] == ["models", "camera with its image"]
    for path in ("cloud", "sensor", "grasps", "camera/picture"):
        assert not meshcat.HasPath(f"/drake/{path}")


def test_the_arm_is_where_the_view_has_it(meshcat: Meshcat) -> None:
    assert STATION.document.arm is not None
    posture = (*STATION.document.arm.home[:-1], STATION.document.arm.home[-1] + 0.5)
    view = replace(drawn.view(), posture=posture)
    show_sample(sample(), drawn.scene(), STATION, meshcat)
    assert not meshcat.HasPath("/drake/visualizer/arm/panda_link7")
    show_sample(sample(view=view), drawn.scene(), STATION, meshcat)
    turned = transform(meshcat, "/drake/visualizer/arm/panda_link7")
    show_sample(
        sample(view=replace(view, posture=STATION.document.arm.home)),
        drawn.scene(), STATION, meshcat,
    )  # fmt: skip
    home = transform(meshcat, "/drake/visualizer/arm/panda_link7")
    turn = home[:3, :3].T @ turned[:3, :3]
    assert np.arccos((np.trace(turn) - 1) / 2) == pytest.approx(0.5)
    with pytest.raises(InvalidInputError, match=r"3 joints; .* has 7"):
        show_sample(sample(view=drawn.view()), drawn.scene(), STATION, meshcat)


def test_a_data_set_without_a_station(tmp_path: Path) -> None:
    assert (
        load_dataset(with_station(tmp_path / "one", "panda_tabletop")).station.name == STATION.name
    )
    with pytest.raises(InvalidInputError, match="has no station"):
        _ = load_dataset(with_station(tmp_path / "two", "")).station


def with_station(folder: Path, name: str) -> Path:
    with DatasetWriter(folder, replace(drawn.DOCUMENT, station=name)) as writer:
        writer.add(12, drawn.scene(), [sample()])
    return folder
