"""A comparison over several scenes equals the comparisons of the single scenes together."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from burg_drake.core import InvalidInputError, Outcome, Pose
from burg_drake.evaluation import (
    Campaign,
    EvaluationSettings,
    evaluate,
    run_preparation,
    write_table,
)
from burg_drake.experiment import compare
from burg_drake.scene import save_scene
from burg_drake.station import load_station
from tests.evaluation import known_judge
from tests.evaluation.inline_executor import Inline
from tests.evaluation.known_scene import write_scene

pytest.importorskip("pyarrow")


def test_many_scenes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    document, paths = write_scene(tmp_path).document, []
    for k, name in enumerate(("here", "there")):
        place = replace(document.instances[0], X_SO=Pose((0.1 + 0.01 * k, 0.2, 0.025)))
        instances = (place, *document.instances[1:])
        paths.append(tmp_path / f"{name}.yaml")
        save_scene(replace(document, name=name, instances=instances), paths[-1])
    settings = EvaluationSettings(grasps_per_object=6, blind=True)
    options = {"progress": False, "executor": Inline()}
    station = load_station("panda_tabletop")
    known_judge.install(monkeypatch.setattr)
    monkeypatch.setattr(run_preparation, "write_report", lambda run: None)  # nobody reads them here
    first = evaluate(paths, station, tmp_path / "first", settings=settings, **options)
    monkeypatch.setattr(known_judge, "expected", _other)
    second = evaluate(
        paths,
        station,
        tmp_path / "second",
        settings=replace(settings, engine="screening"),
        **options,
    )
    whole = compare(first, second.path)
    parts = [compare(first.run(name), second.run(name)) for name in ("here", "there")]
    assert whole.coverage.compared == sum(p.coverage.compared for p in parts) == 36
    assert [g.name for g in whole.judgement.scenes] == ["here", "there"]
    found = [g.agreement.cells for g in whole.judgement.scenes]
    assert found == [p.judgement.selected.cells for p in parts]
    for cell in ("tp", "fp", "fn", "tn"):
        alone = [getattr(p.judgement.selected, cell) for p in parts]
        assert getattr(whole.judgement.selected, cell) == sum(alone)
    assert whole.judgement.selected.fp > 0 and whole.judgement.selected.tp > 0
    _shares_belong_to_their_scene(first, second, tmp_path)
    longer = replace(first.document, trial={**first.document.trial, "hold_time": 1.0})
    place = f"the grasps of one (of each scene folder {first.folder('SCENE')}) again as"
    with pytest.raises(InvalidInputError, match=re.escape(place)):
        compare(Campaign(first.path, longer), second)
    one = compare(first, second.run("there"))
    assert one.judgement.selected == parts[1].judgement.selected
    assert one.coverage.only_first == 18
    assert {text.split()[0] for text in whole.settings} == {"engine"}
    replays = {line for d in whole.judgement.disagreements for line in d.replays}
    assert all(str(tmp_path) in line for line in replays)


def _shares_belong_to_their_scene(first: Campaign, second: Campaign, folder: Path) -> None:
    """The runs of different scenes have the same objects, and so grasps with the same ids."""
    ids = first.run("here").candidates.id
    assert ids == first.run("there").candidates.id
    shares = np.linspace(0.1, 0.4, len(ids))
    columns = {"id": np.array(ids), "success": shares}
    write_table(folder / "old.csv", columns)
    run = np.full(len(ids), first.run("there").document.hash)
    for path in (folder / "new.csv", first.folder("there") / "robustness.parquet"):
        write_table(path, columns | {"run": run})
    with pytest.raises(InvalidInputError, match="has no column run"):
        compare(first, second, robustness=folder / "old.csv")
    for table in (folder / "new.csv", None):
        found = {c.name: c for c in compare(first, second, robustness=table).judgement.calibration}
        assert found["probability"].trials == len(ids) == found["probability"].without


_first = known_judge.expected


def _other(id: str) -> Outcome:
    """About half of the grasps that were lifted slip."""
    outcome = _first(id)
    slips = outcome is Outcome.LIFTED and known_judge.number(id) % 2 == 0
    return Outcome.SLIPPED if slips else outcome
