"""Three scenes of the same library, and runs over them around the known judge."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from asked import asked
from inline_executor import Inline
from known_scene import write_scene

from burg_drake.core import Pose
from burg_drake.evaluation import TEXT_COLUMNS, Campaign, Columns, Run, evaluate
from burg_drake.scene import save_scene
from burg_drake.station import Station

OPTIONS: dict[str, Any] = {"grasps_per_object": 5, "blind": True, "progress": False}


def write_scenes(folder: Path) -> list[Path]:
    """Three scenes of the same library: one moved, one without the bar."""
    document = write_scene(folder).document
    moved = replace(document.instances[0], X_SO=Pose((0.12, 0.2, 0.025)))
    (folder / "scenes").mkdir()
    for name, instances in (
        ("cubes", document.instances[:2]),
        ("moved", (moved, *document.instances[1:])),
        ("three", document.instances),
    ):
        changed = replace(document, name=name, library="../shapes", instances=instances)
        save_scene(changed, folder / "scenes" / f"{name}.yaml")
    return sorted((folder / "scenes").iterdir())


def run_all(scenes: list[Path], station: Station, out: Path, **options) -> Campaign:
    """A run over scenes, in this process."""
    executor = options.pop("executor", None) or Inline()
    return evaluate(scenes, station, out, **asked(executor=executor, **{**OPTIONS, **options}))


def same(a: Columns, b: Columns) -> bool:
    """Whether tables agree bit for bit in everything but time."""
    names = [name for name in a if not name.startswith("cpu_")]
    assert names == [name for name in b if not name.startswith("cpu_")]
    return all(np.array_equal(a[n], b[n], equal_nan=n not in TEXT_COLUMNS) for n in names)


def empty_pages(setattr: Callable[[str, Any], None]) -> None:
    """Reports are written without anything in them, which takes no time."""
    setattr("burg_drake.evaluation.run_preparation.write_report", _write_nothing)
    setattr("burg_drake.evaluation.many_scenes.renew_report", lambda campaign: None)
    setattr("burg_drake.evaluation.run_merging.write_campaign_report", _write_nothing)


def _write_nothing(run: Run | Campaign) -> None:
    run.report_path.write_text("")
