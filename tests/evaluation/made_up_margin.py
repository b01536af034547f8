"""Declares two more margins and looks for them in all that verdicts are written to; run as a
program in a process of its own, with a folder for files, by `test_one_record`."""

from __future__ import annotations

import dataclasses
import importlib.util
import json
import math
import sys
from pathlib import Path

import numpy as np
import pyarrow.parquet

DECLARATION = "burg_drake.core.verdict"
LINES = (
    '    wobble: float = margin_field("rad", "how much it wobbles", mode="reach")\n'
    '    detour: float = margin_field("m", "how far round", mode="reach", stage=Stage.REACHABLE)\n'
)
AFTER = "    def of_trial(self) -> dict[str, float]:\n"


def declare() -> None:
    """The declaration with two lines more, in the place of the installed one."""
    spec = importlib.util.find_spec(DECLARATION)
    assert spec is not None and spec.origin is not None and DECLARATION not in sys.modules
    source = Path(spec.origin).read_text(encoding="utf-8")
    assert source.count(AFTER) == 1
    module = importlib.util.module_from_spec(spec)
    sys.modules[DECLARATION] = module
    source = source.replace(AFTER, LINES + "\n" + AFTER)
    exec(compile(source, spec.origin, "exec"), vars(module))


def look_for_it(folder: Path) -> None:
    """Fails where the margin of a trial is missing."""
    from burg_drake.core import COLUMN_GROUPS, Margins, Outcome, Stage, Verdict, describe_column
    from burg_drake.evaluation import (
        TrialOrigin,
        as_result,
        differences,
        journal,
        results_table,
        table_file,
        trial_verdict,
    )
    from burg_drake.simulation import TrialResult
    from burg_drake.station import ENGINES

    margins = Margins(**{"wobble": 0.25})
    verdict = trial_verdict(TrialResult(outcome=Outcome.LIFTED, margins=margins))
    assert verdict.margins["wobble"] == 0.25
    line = journal.encode_verdict("box-1", verdict)
    assert json.loads(line)["margins"]["wobble"] == 0.25
    assert journal.decode_verdict(line)[1].margins["wobble"] == 0.25

    meaning = describe_column("wobble")
    assert meaning is not None and meaning.unit == "rad"
    assert COLUMN_GROUPS["Margins and cost"]["wobble"] == meaning

    judged = results_table.RecordedTrial(
        id="box-1", instance="box", X_OG=np.eye(4), verdict=verdict
    )
    for mode in ("hand", "reach", "arm"):
        origin = TrialOrigin(
            scene="a scene",
            scene_content="0123",
            station="a station",
            station_content="4567",
            mode=mode,
            engine=ENGINES["standard"],
            trial={"hold": 0.1},
            versions={"drake": "1"},
            seed=0,
            run="89ab",
        )
        columns = results_table.trial_columns([judged], origin, instances=["box"])
        assert ("wobble" in columns) == (mode != "hand")
    names = list(columns)
    declared = [one.name for one in dataclasses.fields(Margins)]
    before = declared[declared.index("wobble") - 1]
    assert names[names.index(before) + 1] == "wobble"
    for suffix in (".csv", ".parquet"):
        path = (folder / "results").with_suffix(suffix)
        table_file.write_table(path, columns)
        back = results_table.read_trial(
            results_table.table_row(table_file.read_table(path), 0), "here"
        )
        assert back.verdict is not None and back.verdict.margins["wobble"] == 0.25
    described = json.loads((folder / "results.csv-metadata.json").read_text(encoding="utf-8"))
    (column,) = [c for c in described["tableSchema"]["columns"] if c["name"] == "wobble"]
    assert {"rad", "how much it wobbles"} <= set(json.dumps(column).split('"'))
    field = pyarrow.parquet.read_schema(folder / "results.parquet").field("wobble")
    assert field.metadata == {b"unit": b"rad", b"description": b"how much it wobbles"}

    other = Verdict(Outcome.LIFTED, Stage.EXECUTED, margins={**verdict.margins, "wobble": 0.5})
    (found,) = differences(verdict, other)
    assert str(found) == "wobble: recorded 0.25, now 0.5"
    assert vars(as_result(other).margins)["wobble"] == 0.5


def look_for_it_where_people_read() -> None:
    """Fails where reports or replays do not show the margins."""
    from burg_drake.core import Margins, Outcome, Stage, Verdict
    from burg_drake.evaluation import FURTHER_MARGINS, arm_figures, further_margins
    from burg_drake.simulation import TrialResult
    from burg_drake.visualization import describe_trial

    assert {"wobble", "detour"} <= set(FURTHER_MARGINS)
    values = {"wobble": np.array([0.1, 0.2]), "detour": np.array([0.1, 0.2])}
    page = "".join(further_margins(values, np.zeros(2, dtype=np.int8)).charts)
    assert "wobble [°]" in page and "detour [mm]" in page
    found = Margins(**{"slip": 0.001, "wobble": np.deg2rad(3.0)})
    told = describe_trial(TrialResult(outcome=Outcome.LIFTED, margins=found))
    assert told == ["lifted", "slip 1.0 mm, wobble 3.0 deg"]
    verdict = Verdict(Outcome.LIFTED, Stage.EXECUTED, margins={"wobble": 1.0, "detour": 0.25})
    assert arm_figures(verdict) == ["detour 250.0 mm"]


def look_for_that_of_the_arm() -> None:
    """Fails where the margin that the arm's screen measures is missing, or taken for a trial's."""
    from burg_drake.core import Margins, Outcome, Stage, Verdict
    from burg_drake.evaluation import REACH_MARGIN_COLUMNS, as_result, differences

    assert "detour" in REACH_MARGIN_COLUMNS and "wobble" not in REACH_MARGIN_COLUMNS
    assert "detour" not in Margins().of_trial()
    recorded = Verdict(Outcome.LIFTED, Stage.EXECUTED, margins={"clearance": 0.1, "detour": 0.5})
    by_hand = Verdict(Outcome.LIFTED, Stage.EXECUTED, margins={"clearance": 0.1})
    assert differences(recorded, by_hand) == []  # a replay that need not ask the arm
    again = Verdict(Outcome.LIFTED, Stage.EXECUTED, margins={"clearance": 0.1, "detour": 1.0})
    (found,) = differences(recorded, again)
    assert found.name == "detour"
    assert math.isnan(vars(as_result(recorded).margins)["detour"])


if __name__ == "__main__":
    declare()
    look_for_it(Path(sys.argv[1]))
    look_for_it_where_people_read()
    look_for_that_of_the_arm()
