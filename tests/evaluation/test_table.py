"""The results table: what other tools see, and that numbers survive the way there and back."""

from __future__ import annotations

import csv
import json
import math
import re
import sys
from dataclasses import replace
from pathlib import Path
from urllib.parse import unquote

import numpy as np
import pytest

from burg_drake.core import (
    MODES,
    GraspSet,
    InvalidInputError,
    Limits,
    MissingDependencyError,
    Outcome,
    Stage,
    Verdict,
    make_pose,
    rotation_from_quaternion,
    rotation_from_rpy,
)
from burg_drake.evaluation import (
    RUN_METADATA_KEY,
    Candidates,
    Columns,
    RecordedTrial,
    TrialOrigin,
    make_columns,
    read_origin,
    read_table,
    read_trial,
    require_writer,
    table_file,
    table_row,
    trial_columns,
    write_table,
)
from burg_drake.station import ENGINES

INSTANCES = ("mug_1", "box", "bowl.2")
ORIGIN = TrialOrigin(
    scene="/some where/scene.yaml",
    scene_content="0123456789ab",
    station="panda_tabletop",
    station_content="ba9876543210",
    mode="reach",
    engine=ENGINES["standard"],
    trial={"lift_height": 0.1 + 0.2},
    versions={"drake": "1.51.1"},
    seed=2**40,
    run="0a1b",
)


def candidates() -> Candidates:
    rng = np.random.default_rng(4)
    X_OG = make_pose(rotation_from_rpy(rng.uniform(-3, 3, (4, 3))), rng.normal(size=(4, 3)))
    grasps = GraspSet.create(
        X_OG, object=["mug", "mug", "box", "box"], width=0.1 + 0.2, score=1 / 3
    )
    return Candidates(grasps, np.array(["mug_1", "mug_1", "box", "box"]))


def columns() -> Columns:
    ids = candidates().id
    verdicts = {
        ids[3]: Verdict(
            Outcome.COLLISION_TABLE, Stage.CLEAR, blocker="table", cpu={Stage.CLEAR: 1e-4}
        ),
        ids[0]: Verdict(
            Outcome.LIFTED,
            Stage.EXECUTED,
            reason='comma, "quote", Ä',
            margins={"slip": 2.0 / 3.0, "tilt": math.nan, "patch_area": 1e-4 / 3},
            displacements={"box": 1.0 / 7.0, "bowl.2": 0.0},
            q_grasp=(0.1,) * 7,
            q_pregrasp=(math.pi,) * 7,
            cpu={Stage.CLEAR: 1e-4, Stage.EXECUTED: 0.2},
        ),
    }
    return columns_of(verdicts)


def columns_of(verdicts: dict[str, Verdict]) -> Columns:
    """The table of some of the candidates, by id."""
    rows = np.sort(candidates().rows(list(verdicts)))
    found = [verdicts[candidates().id[row]] for row in rows]
    return make_columns(candidates(), rows, found, ORIGIN, instances=INSTANCES, joints=7)


def test_rows_are_the_judged_grasps_in_the_order_of_the_candidates() -> None:
    table, ids = columns(), candidates().id
    assert table["id"].tolist() == [ids[0], ids[3]]
    assert table["instance"].tolist() == ["mug_1", "box"]
    assert table["outcome"].tolist() == ["lifted", "collision_table"]
    assert table["cpu_reach"].tolist() == [pytest.approx(math.nan, nan_ok=True)] * 2
    assert {len(values) for values in table.values()} == {2}


def test_position_and_quaternion_are_the_grasp_frame() -> None:
    table = columns()
    wxyz = np.stack([table[name] for name in ("qw", "qx", "qy", "qz")], axis=-1)
    position = np.stack([table[name] for name in "xyz"], axis=-1)
    X_OG = make_pose(rotation_from_quaternion(wxyz), position)
    np.testing.assert_allclose(X_OG, candidates().grasps.X_OG[[0, 3]], atol=1e-14)


@pytest.mark.parametrize("suffix", ["csv", "parquet"])
def test_a_row_gives_back_its_trial_bit_for_bit(tmp_path: Path, suffix: str) -> None:
    write_table(tmp_path / f"r.{suffix}", columns())
    row = table_row(read_table(tmp_path / f"r.{suffix}"), 0)
    trial = read_trial(row, "here")
    assert trial.X_OG.tobytes() == candidates().grasps.X_OG[0].tobytes()
    assert (trial.id, trial.instance) == (candidates().id[0], "mug_1")
    assert trial.friction is None and trial.mass is None
    assert trial.verdict is not None
    assert trial.verdict.margins["patch_area"] == 1e-4 / 3
    assert trial.verdict.displacements == {"box": 1.0 / 7.0, "bowl.2": 0.0}


def test_each_mode_has_the_columns_of_what_it_asks() -> None:
    arm = {"arm_clearance", "joint_excess"}
    trial = {"duration", "tracking_error", "tracking_distance", "pushed", "touched", "cpu_plan"}
    trial |= {f"pushed_{name}" for name in INSTANCES}
    verdict = Verdict(Outcome.LIFTED, Stage.EXECUTED)
    one = [RecordedTrial(id="a", instance="box", X_OG=np.eye(4), verdict=verdict)]
    found = {
        mode: set(trial_columns(one, replace(ORIGIN, mode=mode), instances=INSTANCES))
        for mode in MODES
    }
    assert not found["hand"] & (arm | trial)
    assert found["reach"] == found["hand"] | arm
    assert found["arm"] == found["hand"] | arm | trial


def test_every_column_has_its_unit_and_meaning_in_the_files(tmp_path: Path) -> None:
    pyarrow = pytest.importorskip("pyarrow.parquet")
    verdict = Verdict(Outcome.LIFTED, Stage.EXECUTED)
    one = [RecordedTrial(id="a", instance="box", X_OG=np.eye(4), verdict=verdict)]
    table = trial_columns(one, replace(ORIGIN, mode="arm"), instances=INSTANCES, joints=7)
    table |= {"given_label": np.array([1]), "tug_+x_g": np.array([math.inf])}
    for suffix in ("csv", "parquet"):
        write_table(tmp_path / f"r.{suffix}", table)
    described = json.loads((tmp_path / "r.csv-metadata.json").read_text("utf-8"))
    assert described["url"] == "r.csv"
    by_title = {c["titles"]: c for c in described["tableSchema"]["columns"]}
    assert list(by_title) == list(table)
    fields = pyarrow.read_schema(tmp_path / "r.parquet")
    for name, column in by_title.items():
        metadata = fields.field(name).metadata
        assert metadata[b"description"].decode() == column["dc:description"] != ""
        assert metadata[b"unit"].decode() == column.get("schema:unitText", "")
        # The standard's names: https://www.w3.org/TR/tabular-metadata/#dfn-column-name
        assert re.fullmatch(r"(\w|%[0-9A-F]{2})(\w|[.]|%[0-9A-F]{2})*", column["name"], re.A)
        assert unquote(column["name"]) == name
    assert by_title["slip"]["schema:unitText"] == "m"
    assert by_title["slip"]["datatype"] == "double"
    assert by_title["seed"]["datatype"] == "integer"
    assert by_title["outcome"]["datatype"] == "string"
    assert (tmp_path / "r.csv").read_text().splitlines()[1].endswith(",1,INF")
    assert read_table(tmp_path / "r.csv")["tug_+x_g"].tolist() == [math.inf]


def test_a_row_of_an_arm_trial_gives_back_all_that_it_was(tmp_path: Path) -> None:
    verdict = Verdict(
        Outcome.BLOCKED,
        Stage.EXECUTED,
        blocker="panda_link5 vs box",
        margins={"tracking_error": 1e-3 / 3, "duration": 5.25, "arm_clearance": 2e-3 / 7},
        pushed={"mug_1": 1 / 7, "box": 0.0},
        touched="panda_link5 vs box",
    )
    trial = RecordedTrial(id="a", instance="box", X_OG=np.eye(4), width=0.1 / 3, verdict=verdict)
    origin = replace(ORIGIN, mode="arm")
    table = trial_columns([trial], origin, instances=INSTANCES)
    write_table(tmp_path / "arm.csv", table)
    row = table_row(read_table(tmp_path / "arm.csv"), 0)
    back = read_trial(row, "here")
    for name, bad, said in (
        ("width", "wide", "here: width is 'wide', not a number"),
        ("mass", -1.0, "here: mass is -1; it must be above 0"),
        ("friction", 1e300, "here: friction is 1e\\+300; it must be"),
        ("X_OG", "9" * 5000, "here: X_OG has 1 numbers"),
        ("stage", "x" * 5000, "here: stage 'xxx"),
    ):
        with pytest.raises(InvalidInputError, match=said) as raised:
            read_trial({**row, name: bad}, "here")
        assert len(str(raised.value)) < 300
    assert read_origin(row, "here") == origin
    assert back.width == back.candidate.width == 0.1 / 3
    assert back.verdict is not None and back.verdict.touched == "panda_link5 vs box"
    assert back.verdict.pushed == {"mug_1": 1 / 7, "box": 0.0}
    assert {name: back.verdict.margins[name] for name in verdict.margins} == verdict.margins


def test_displacements_are_columns_of_numbers() -> None:
    table = columns()
    assert [name for name in table if name.startswith("moved_")] == [
        "moved_mug_1",
        "moved_box",
        "moved_bowl.2",
    ]
    assert np.isnan(table["moved_mug_1"]).all()  # the target itself, and a trial that never began
    np.testing.assert_array_equal(table["moved_box"], [1.0 / 7.0, math.nan])


def test_trials_with_another_friction_and_mass_share_the_format() -> None:
    verdict = Verdict(Outcome.LIFTED, Stage.EXECUTED)
    X_OG = candidates().grasps.X_OG[0]
    trials = [
        RecordedTrial(
            id="mug_1-a", instance="mug_1", X_OG=X_OG, friction=mu, mass=mass, verdict=verdict
        )
        for mu, mass in ((0.1, None), (0.0, 1 / 3))
    ]
    table = trial_columns(trials, ORIGIN, instances=INSTANCES)
    assert list(table) == [name for name in columns() if not name.startswith("q_")]
    back = [read_trial(table_row(table, k), "here") for k in range(2)]
    assert [(t.friction, t.mass) for t in back] == [(0.1, None), (0.0, 1 / 3)]


@pytest.mark.parametrize("suffix", ["csv", "parquet"])
def test_a_file_gives_back_every_bit(tmp_path: Path, suffix: str) -> None:
    table = columns()
    write_table(tmp_path / f"results.{suffix}", table)
    back = read_table(tmp_path / f"results.{suffix}")
    assert list(back) == list(table)
    for name in table:
        assert back[name].dtype.kind == table[name].dtype.kind, name
        np.testing.assert_array_equal(back[name], table[name], err_msg=name)


def test_csv_is_plain(tmp_path: Path) -> None:
    write_table(tmp_path / "results.csv", columns())
    with (tmp_path / "results.csv").open(newline="") as file:
        first, second = csv.DictReader(file)
    assert first["slip"] == repr(2.0 / 3.0)
    assert first["reason"] == 'comma, "quote", Ä'
    assert first["tilt"] == second["slip"] == second["q_grasp_7"] == ""
    assert first["seed"] == "1099511627776"
    assert first["run"] == second["run"] == "0a1b"


def test_parquet_has_nulls_and_metadata(tmp_path: Path) -> None:
    parquet = pytest.importorskip("pyarrow.parquet")
    write_table(tmp_path / "results.parquet", columns(), {"seed": 3, "versions": {"a": "1"}})
    table = parquet.read_table(tmp_path / "results.parquet")
    assert table.column("slip").to_pylist() == [2.0 / 3.0, None]
    metadata = json.loads(table.schema.metadata[RUN_METADATA_KEY])
    assert metadata == {"seed": 3, "versions": {"a": "1"}}


@pytest.mark.parametrize("suffix", ["csv", "parquet"])
def test_whole_numbers_with_gaps_stay_whole(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"t.{suffix}"
    gaps, none = np.array([20, None], dtype=object), np.array([None, None], dtype=object)
    write_table(path, {"n": gaps, "k": none})
    if suffix == "csv":
        assert path.read_text() == "n,k\n20,\n,\n"
    else:
        parquet = pytest.importorskip("pyarrow.parquet")
        assert {str(field.type) for field in parquet.read_table(path).schema} == {"int64"}
    np.testing.assert_array_equal(read_table(path)["n"], [20.0, math.nan])


@pytest.mark.parametrize("suffix", ["csv", "parquet"])
def test_no_rows_are_a_table_too(tmp_path: Path, suffix: str) -> None:
    table = columns_of({})
    write_table(tmp_path / f"r.{suffix}", table)
    assert [len(v) for v in read_table(tmp_path / f"r.{suffix}").values()] == [0] * len(table)


def test_without_pyarrow_the_message_says_how_to_get_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    require_writer("csv")
    with pytest.raises(MissingDependencyError, match=r"pip install 'burg-drake\[parquet\]'"):
        require_writer("parquet")


def test_what_other_programs_add_does_not_matter(tmp_path: Path) -> None:
    write_table(tmp_path / "r.csv", columns())
    header, *rows = (tmp_path / "r.csv").read_text().splitlines()
    lines = [f",{header},note", *(f"{k},{row},text {k}" for k, row in enumerate(rows))]
    (tmp_path / "more.csv").write_bytes(("\ufeff" + "\r\n".join(lines) + "\r\n\r\n").encode())
    back = read_table(tmp_path / "more.csv")
    assert back[""].tolist() == [0.0, 1.0] and back["note"].tolist() == ["text 0", "text 1"]
    for name, values in columns().items():
        np.testing.assert_array_equal(back[name], values, err_msg=name)


def test_damaged_cells_are_named(tmp_path: Path) -> None:
    path = tmp_path / "r.csv"
    for text, message in (
        ("id,slip\na,1\nb\n", "row 2 has 1 cells, the header has 2"),
        ("id,slip\na,1\nb,much\n", "row 2: slip is 'much'; it must be a number, or empty"),
        ("id,moved_mug\na,much\n", "row 1: moved_mug is 'much'; it must be a number, or empty"),
        ("id,seed\na,1.5\n", "row 1: seed is '1.5'; it must be a whole number"),
        ("id;slip\na;0,1\n", "its cells are separated by semicolons; save it with commas"),
        ("\n", "it is empty"),
    ):
        path.write_text(text)
        with pytest.raises(InvalidInputError, match=f"r.csv is not a results table .{message}"):
            read_table(path)


def test_a_table_of_an_older_release_is_read_but_its_rows_need_their_run(tmp_path: Path) -> None:
    (tmp_path / "old.csv").write_text(
        "id,instance,outcome,stage,slip,others_moved,seed,engine,run\n"
        "mug-1,mug,lifted,executed,0.002,0.0,0,standard,0a1b\n"
    )
    table = read_table(tmp_path / "old.csv")
    assert table["slip"].tolist() == [0.002]
    with pytest.raises(InvalidInputError, match=r"old.csv: column X_OG, scene, .* of its run"):
        read_trial(table_row(table, 0), "old.csv")


def test_bad_files_and_formats_are_named(tmp_path: Path) -> None:
    (tmp_path / "empty.csv").write_text("")
    for name, message in (
        ("empty.csv", "empty.csv is not a results table"),
        ("none.csv", "cannot read .*none.csv: No such file or directory$"),
        ("none.parquet", "cannot read .*none.parquet: No such file or directory$"),
    ):
        with pytest.raises(InvalidInputError, match=message):
            read_table(tmp_path / name)
    with pytest.raises(InvalidInputError, match="'xlsx' does not exist; give csv or parquet"):
        require_writer("xlsx")


def test_small_files_of_large_tables_are_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    cells = tmp_path / "cells.csv"
    cells.write_text("id,reason\na," + "x" * 130_000 + "\n" + "a,b\n" * 7_000)
    with pytest.raises(InvalidInputError, match=r"cells\.csv: reason would take .* GiB"):
        read_table(cells)
    parquet = tmp_path / "rows.parquet"
    pytest.importorskip("pyarrow")
    write_table(parquet, {"reason": np.full(5_000, "x" * 100)})
    assert len(read_table(parquet)["reason"]) == 5_000
    for limits, match in ((Limits(1 << 30, 4_999), "4,999 cells"), (Limits(400_000, 5_000), "GiB")):
        monkeypatch.setattr(table_file.FileLimits, "table", limits)
        with pytest.raises(InvalidInputError, match=rf"rows\.parquet: .*{match}"):
            read_table(parquet)
