"""Runs over many scenes around a known judge."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from burg_drake.core.schema import Pose
from burg_drake.evaluation.cascade import evaluate
from burg_drake.evaluation.results import read_results
from burg_drake.evaluation.summary import summarize
from burg_drake.evaluation.table import TEXT, Columns
from burg_drake.scene.scene import Scene, save_scene
from burg_drake.station.station import Station

pytest.importorskip("pyarrow")
OPTIONS = {"grasps_per_object": 6, "blind": True, "progress": False, "workers": 1}


@pytest.fixture
def scenes(scene: Scene, tmp_path: Path) -> list[Path]:
    """Three scenes of the same library: one moved, one without the bar."""
    document = scene.document
    moved = replace(document.instances[0], X_SO=Pose((0.12, 0.2, 0.025)))
    paths = [tmp_path / f"{name}.yaml" for name in ("three", "moved", "cubes")]
    save_scene(
        replace(document, name="moved", instances=(moved, *document.instances[1:])), paths[1]
    )
    save_scene(replace(document, name="cubes", instances=document.instances[:2]), paths[2])
    return paths


def same(a: Columns, b: Columns) -> bool:
    """Whether tables agree bit for bit in everything but time."""
    names = [name for name in a if not name.startswith("cpu_")]
    assert names == [name for name in b if not name.startswith("cpu_")]
    return all(np.array_equal(a[n], b[n], equal_nan=n not in TEXT) for n in names)


def test_each_scene_is_as_on_its_own(
    scenes: list[Path], station: Station, tmp_path: Path, known_judge: None
) -> None:
    campaign = evaluate(scenes, station, tmp_path / "all", **OPTIONS)
    assert campaign.names == ["three", "moved", "cubes"] and campaign.complete
    alone = [evaluate(path, station, tmp_path / path.stem, **OPTIONS) for path in scenes]
    for run, own in zip(campaign.runs, alone, strict=True):
        assert same(run.results, own.results)
        assert (
            run.table_path.read_bytes().split(b"\n")[0]
            == own.table_path.read_bytes().split(b"\n")[0]
        )
        assert {p.name for p in run.path.iterdir()} == {p.name for p in own.path.iterdir()}
    whole = campaign.results
    for name in ("id", "outcome", "slip", "run", "seed", "X_OG"):
        assert np.array_equal(
            whole[name],
            np.concatenate([run.results[name] for run in alone]),
            equal_nan=name not in TEXT,
        )
    assert np.isnan(whole["moved_bar"][-12:]).all()
    summary = summarize(campaign)
    assert [g.judged for g in summary.scenes] == [18, 18, 12]
    assert summary.total.outcomes == sum(
        (summarize(r).total.outcomes for r in alone), start=type(summary.total.outcomes)()
    )
    assert list(read_results(tmp_path / "all", ["outcome", "nonsense"])) == ["outcome", "nonsense"]
