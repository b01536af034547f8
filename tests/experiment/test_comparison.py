"""Runs compared with trials and with each other: invented runs, rows counted by hand."""

from __future__ import annotations

import dataclasses
import json
import re
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from sklearn.metrics import confusion_matrix

import burg_drake as burg
from burg_drake.apps import main
from burg_drake.core import InvalidInputError, Outcome, RealOutcome
from burg_drake.evaluation import Run, lifted_shares
from burg_drake.experiment import (
    GRASP_CONTENT_COLUMNS,
    PREDICTION_COLUMNS,
    IdColumn,
    ObjectPlace,
    RealTrial,
    ResultTable,
    Selection,
    SelectionSettings,
    Stratum,
    TextFactor,
    TrialSheet,
    compare,
    comparison_json,
    comparison_page,
    grasp_content,
    headline_sentence,
    load_trials,
    make_source_run,
    match_rows,
    plan_trials,
    save_trials,
    text_keys,
)
from tests.experiment import known_runs

FIRST = ("lifted", "lifted", "slipped", "collision_target", "lifted_disturbed", "lifted")
SECOND = ("lifted", "slipped", "lifted", "collision_target", "lifted", "lifted")
REAL = ("lifted", "dropped", "lifted", "slipped", "lifted_disturbed", "not_attempted")


def make_runs(folder: Path) -> tuple[Run, Run]:
    """Two runs of the same twelve grasps; the second one has other verdicts."""
    scene = known_runs.make_scene(folder)
    runs = []
    for name, outcomes in (("first", FIRST), ("second", SECOND)):
        verdicts = {
            o: [known_runs.ended(v, clearance=k / 100) for k, v in enumerate(outcomes)]
            for o in known_runs.OBJECTS
        }
        runs.append(known_runs.make_run(folder / name, scene, verdicts))
    return runs[0], runs[1]


def make_sheet(run: Run, folder: Path, real: tuple[str, ...] = REAL, **fields: object) -> Path:
    """Trials of all grasps of a run; their outcomes repeat those of `real` in order."""
    results, grasps = run.results, run.candidates
    strata, trials = {}, []
    for k, id in enumerate(results["id"].tolist()):
        name, outcome = str(results["object"][k]), Outcome(results["outcome"][k])
        label = "success" if outcome is Outcome.LIFTED else "failure"
        size = sum(o == name for o in results["object"])
        strata[f"{name}-{label}"] = Stratum(
            run="a",
            object=name,
            label=label,
            population={"success": 40, "failure": 200}[label],
            selected=size // 2,
            wanted=size // 2,
        )
        place = ObjectPlace(status="measured", offset_mm=(float(k % 4), 0.0))
        trials.append(
            RealTrial(
                number=k + 1,
                block=1,
                run="a",
                grasp=id,
                content=grasp_content(
                    str(results["instance"][k]),
                    grasps.grasps.X_OG[k],
                    float(grasps.grasps.width[k]),
                ),
                instance=str(results["instance"][k]),
                object=name,
                simulated=outcome,
                stratum=f"{name}-{label}",
                outcome=RealOutcome(real[k % len(real)]),
                note="<b>slipped</b> & fell" if k == 1 else "",
                photo="photos/a b.png" if k == 1 else "",
                placement=dict.fromkeys(("box", "mug"), place) if k % 3 else {},
            )
        )
    sheet = TrialSheet(
        runs={"a": make_source_run(run, folder)},
        selection=Selection(per_object=6, balance="outcome"),
        strata=strata,
        trials=tuple(trials),
    )
    path = folder / "trials.yaml"
    save_trials(dataclasses.replace(sheet, **fields), path)  # type: ignore[arg-type]
    return path


def test_a_run_against_another(tmp_path: Path) -> None:
    first, second = make_runs(tmp_path)
    found = burg.trials.compare(first.path, second.path)
    one, other = np.array(FIRST * 2) == "lifted", np.array(SECOND * 2) == "lifted"
    tn, fp, fn, tp = confusion_matrix(other, one).ravel()
    assert found.kind == "runs" and found.coverage.compared == 12
    assert found.judgement.selected.cells == (tp, fp, fn, tn)
    assert found.judgement.all_grasps is None and found.judgement.placement is None
    assert [g.name for g in found.judgement.objects] == ["box", "mug"]
    assert found.judgement.outcomes["lifted"] == {"lifted": 4, "slipped": 2}
    assert sum(s.trials for s in found.judgement.stopped) == 12
    assert [d.kind for d in found.judgement.disagreements] == ["fp"] * 2 + ["fn"] * 4
    held = compare(first, second, success="held").judgement.selected
    assert held.cells == (6, 2, 2, 2)


def test_a_run_against_trials(tmp_path: Path) -> None:
    first, _ = make_runs(tmp_path)
    found = compare(first, make_sheet(first, tmp_path))
    assert found.coverage.left_out == {"not_attempted": 2}
    assert found.judgement.selected.cells == (2, 2, 2, 4)
    everything = found.judgement.all_grasps
    assert everything is not None
    assert sum(everything.cells) == pytest.approx(480)
    assert everything.tp == pytest.approx(40)  # half of the two strata of 40 that came true
    assert everything.fn == pytest.approx(2 / 3 * 200)
    p = found.judgement.placement
    assert p is not None
    assert (p.within.trials, p.beyond.trials, p.unmeasured.trials) == (5, 1, 4)
    wide = compare(first, tmp_path / "trials.yaml", placement_limit_mm=3.0).judgement.placement
    assert wide is not None and (wide.within.trials, wide.beyond.trials) == (6, 0)
    assert compare(first, tmp_path / "trials.yaml", success="held").judgement.selected.tp == 4


def test_placement_is_good_only_where_every_object_of_the_scene_was_measured(
    tmp_path: Path,
) -> None:
    first, _ = make_runs(tmp_path)
    path = make_sheet(first, tmp_path)
    sheet = load_trials(path)
    near = ObjectPlace(status="measured", offset_mm=(0.5, 0.0))
    far = ObjectPlace(status="measured", offset_mm=(9.0, 0.0))
    places: list[dict[str, ObjectPlace]] = [{"mug": near, "box": near}, {"mug": near}]
    places += [{"box": near}, {"box": far}, {}]
    trials = [
        dataclasses.replace(t, placement=places[k % 5], outcome=RealOutcome.LIFTED)
        for k, t in enumerate(sheet.trials[:5])  # all of them target one object
    ]
    save_trials(dataclasses.replace(sheet, trials=tuple(trials)), path)
    p = compare(first, path).judgement.placement
    assert p is not None and len({t.instance for t in trials}) == 1
    assert (p.within.trials, p.beyond.trials, p.unmeasured.trials) == (1, 1, 3)


def test_trials_that_neither_run_has_count_once(tmp_path: Path) -> None:
    first, _ = make_runs(tmp_path)
    path = make_sheet(first, tmp_path)
    scene = known_runs.make_scene(tmp_path)
    runs = []
    for name, judged in (
        ("less", (True, True, False, False)),
        ("least", (True, False, True, False)),
    ):
        told = [known_runs.ended("lifted") if there else None for there in (*judged, True, True)]
        runs.append(
            known_runs.make_run(tmp_path / name, scene, dict.fromkeys(known_runs.OBJECTS, told))
        )
    found = compare(*runs, path)
    assert found.coverage.left_out == {
        "grasp is not judged in the second run": 2,
        "grasp is not judged in the first run": 2,
        "grasp is not judged in either run": 2,
        "not_attempted": 2,
    }
    assert found.coverage.compared + sum(found.coverage.left_out.values()) == 12


def test_two_simulators_against_the_same_trials(tmp_path: Path) -> None:
    first, second = make_runs(tmp_path)
    found = compare(first, second, make_sheet(first, tmp_path))
    assert found.kind == "simulators" and found.other is not None
    assert found.other.selected.cells == (4, 2, 0, 4)
    d = found.difference
    assert d is not None and (d.both, d.only_first, d.only_second, d.neither) == (4, 2, 4, 0)
    assert d.p_value == pytest.approx(0.6875)  # 2 * (1 + 6 + 15) / 64
    same = compare(first, first, tmp_path / "trials.yaml").difference
    assert same is not None and same.p_value == 1.0


def test_grasps_are_the_same_by_id_and_content(tmp_path: Path) -> None:
    first, second = make_runs(tmp_path)
    run_only = {name: first.results[name] for name in first.results}
    missing = {name: np.full(12, np.nan) for name in PREDICTION_COLUMNS if name not in run_only}
    a, b = run_only | missing, dict(second.results) | missing
    b["x"] = b["x"].copy()
    b["x"][3] += 1e-3
    rows = np.array([5, 4, 3, 2, 1, 0])
    tables = [ResultTable.of_columns(columns, PREDICTION_COLUMNS) for columns in (a, b)]
    found = match_rows(tables[0], tables[1].take(rows, GRASP_CONTENT_COLUMNS))
    assert found.other_content == 1 and found.only_first == 6 and found.only_second == 0
    assert (a["id"][found.first] == b["id"][rows][found.second]).all() and len(found.first) == 5


def test_what_tells_nothing_is_counted(tmp_path: Path) -> None:
    scene = known_runs.make_scene(tmp_path)
    ended, failed = known_runs.ended, known_runs.failed
    runs = [
        known_runs.make_run(tmp_path / str(k), scene, {"mug": verdicts})
        for k, verdicts in enumerate(
            (
                [failed(), ended("reachable"), ended("lifted"), ended("slipped"), None],
                [failed(), ended("lifted"), failed(), ended("slipped"), ended("lifted")],
            )
        )
    ]
    found = compare(*runs)
    assert found.coverage.left_out == {
        "simulation_failed in the first": 1,
        "reachable in the first": 1,
        "simulation_failed in the second": 1,
    }
    assert found.coverage.only_second == 1 and found.judgement.selected.cells == (0, 0, 0, 1)


def test_other_scenes_and_other_grasps_are_refused(tmp_path: Path) -> None:
    first, _ = make_runs(tmp_path)
    sheet = make_sheet(first, tmp_path)
    verdicts = {"mug": [known_runs.ended("lifted")]}
    moved = known_runs.make_scene(tmp_path, "moved", 0.2)
    away = known_runs.make_run(tmp_path / "away", moved, verdicts)
    others = known_runs.make_run(
        tmp_path / "others", known_runs.make_scene(tmp_path), verdicts, seed=9
    )
    with pytest.raises(InvalidInputError, match=r"is of scene two \(.*moved \("):
        compare(first, away)
    with pytest.raises(InvalidInputError, match="have no grasp in common"):
        compare(first, others)
    with pytest.raises(InvalidInputError, match=r"is about scene two \(.*holds moved \("):
        compare(away, sheet)
    with pytest.raises(InvalidInputError, match=r"no grasp of .* is judged in"):
        compare(others, sheet)
    with pytest.raises(InvalidInputError, match="is not the folder of a run"):
        compare(first, tmp_path)


def test_trials_that_tell_nothing_yet_are_refused(tmp_path: Path) -> None:
    first, _ = make_runs(tmp_path)
    make_sheet(first, tmp_path, ("not_attempted", "perception_failed"))
    with pytest.raises(InvalidInputError, match="6 not_attempted, 6 perception_failed"):
        compare(first, tmp_path / "trials.yaml")
    make_sheet(first, tmp_path, trials=())
    with pytest.raises(InvalidInputError, match="has no trials"):
        compare(first, tmp_path / "trials.yaml")


def test_predicted_probability_comes_from_a_table_of_robustness(tmp_path: Path) -> None:
    first, second = make_runs(tmp_path)
    rows = [f"{id},{k / 10}" for k, id in enumerate(first.results["id"][:10])]
    (first.path / "robustness.csv").write_text("id,success\n" + "\n".join(rows) + "\n")
    named = {c.name: c for c in compare(first, second).judgement.calibration}
    assert named["probability"].trials == 10 and named["probability"].without == 2
    (tmp_path / "bad.csv").write_text("id,outcome\na,b\n")
    with pytest.raises(InvalidInputError, match="not a table of robustness"):
        compare(first, second, robustness=tmp_path / "bad.csv")


def test_a_table_of_robustness_of_another_run_is_refused(tmp_path: Path) -> None:
    first, second = make_runs(tmp_path)
    id, hashes = first.results["id"][0], [run.document.hash for run in (first, second)]
    tables = {
        "own": f"id,success,run\n{id},0.5,{first.document.hash}\n",
        "other": f"id,success,run\n{id},0.5,0123456789ab\n",
        "unknown": "id,success\nmug-0000000000,0.5\n",
    }
    for name, text in tables.items():
        (tmp_path / f"{name}.csv").write_text(text)
    assert lifted_shares(tmp_path / "own.csv", hashes, None) == {(hashes[0], id): 0.5}
    for refused in ("other", "unknown"):
        with pytest.raises(InvalidInputError, match=r"is of (run 0123456789ab|another run)"):
            compare(first, second, robustness=tmp_path / f"{refused}.csv")
        with pytest.raises(InvalidInputError, match=r"is of (run 0123456789ab|another run)"):
            plan_trials(
                first,
                settings=SelectionSettings(balance="probability"),
                robustness=tmp_path / f"{refused}.csv",
            )


def test_texts_as_numbers() -> None:
    texts = np.array(["mug", "", "tête-à-tête", "日本", "mug", "mu"])
    factor = TextFactor.of(texts)
    assert [factor[k] for k in range(6)] == texts.tolist()
    assert factor.names == tuple(sorted(set(texts.tolist())))
    assert (text_keys(texts) == text_keys(texts.astype("<U40"))).all()
    many = np.array([f"grasp-{k:x}" for k in range(9000)])
    assert TextFactor.of(many).take(np.array([8999]))[0] == "grasp-2327"
    assert TextFactor.of(np.broadcast_to("a", 5)).index.tolist() == [0] * 5
    assert TextFactor.of(np.array([], dtype=str)).names == ()
    coded = TextFactor.of_codes(np.array([1, -1, 0]), ["mug", "box"])
    assert [coded[k] for k in range(3)] == ["box", "", "mug"]
    assert TextFactor.of_codes(np.array([1, 0]), ["mug", "box"]).names == ("box", "mug")
    assert TextFactor.of_codes(np.array([], dtype=int), []).names == ()


def test_stored_texts_have_the_same_keys() -> None:
    arrow = pytest.importorskip("pyarrow")
    texts = ["mug-0123456789", "", "tête-à-tête", "日本", "mug", "a" * 40, "mug-0123456788"]
    stored = arrow.chunked_array([arrow.array(["x", *texts[:3]])[1:], arrow.array(texts[3:])])
    ids, array = IdColumn(stored), IdColumn(np.array(texts))
    assert len(set(array.keys.tolist())) == len(texts)
    assert ids.keys.tolist() == array.keys.tolist() == text_keys(np.array(texts)).tolist()
    rows = np.array([5, 0, 3])
    for column in (ids, array):
        some = column.take(rows).take(np.array([True, False, True]))
        assert [some[k] for k in range(len(some))] == ["a" * 40, "日本"]
        assert some.keys.tolist() == column.keys[[5, 3]].tolist() and not some.same(some)
        assert column.same(column) and not column.same(column.take(rows))
    assert ids.same(IdColumn(arrow.chunked_array([texts]))) and not ids.same(IdColumn(stored[1:]))


def test_command_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    first, second = make_runs(tmp_path)
    sheet, page = make_sheet(first, tmp_path), tmp_path / "out" / "compare.html"
    assert main(["compare", str(first.path), str(sheet), "--html", str(page)]) == 0
    out = capsys.readouterr().out
    told = " ".join(out.split())
    assert "Estimated for the 480 grasps that 10 trials on the robot stand for" in told
    assert "By object, selected trials" in out
    line = re.sub(r"<[^>]+>", "", page.read_text().split("How to repeat it")[1])
    assert f"burg-drake compare {first.path} {sheet} --html {page}" in line
    assert main(["compare", str(first.path), str(second.path), str(sheet), "--json"]) == 0
    data = json.loads(capsys.readouterr().out)
    assert data["judgement"]["selected"]["tp"] == 2 and data["difference"]["only_second"] == 4
    for wrong in ([str(sheet), str(first.path)], [str(first.path)] * 3, ["gone"]):
        assert main(["compare", str(first.path), *wrong]) == 2
        assert capsys.readouterr().err.startswith("burg-drake: error: ")
    assert main(["compare", str(sheet), str(first.path)]) == 2
    assert "is not a run; give the run first" in capsys.readouterr().err


def test_the_headline_where_nothing_succeeded(tmp_path: Path) -> None:
    scene = known_runs.make_scene(tmp_path)
    run = known_runs.make_run(tmp_path / "run", scene, {"mug": [known_runs.ended("slipped")]})
    sheet = burg.trials.plan_trials(run, out=tmp_path / "trials.yaml")
    burg.trials.TrialBook(tmp_path / "trials.yaml").record(
        sheet.trials[0].number, outcome="slipped"
    )
    told = headline_sentence(compare(run, tmp_path / "trials.yaml"))
    assert told.startswith("In 1 trial on the robot") and "undefined" not in told
    assert "It expected no grasp to succeed; no grasp succeeded." in told


def test_json_has_the_same_keys_whatever_is_undefined(tmp_path: Path) -> None:
    first, second = make_runs(tmp_path)
    scene = known_runs.make_scene(tmp_path)
    verdicts = {"mug": [known_runs.ended("slipped")]}
    one = known_runs.make_run(tmp_path / "one", scene, verdicts)
    full, empty = (json.loads(comparison_json(compare(*p))) for p in ((first, second), (one, one)))
    assert full.keys() == empty.keys() and full["judgement"].keys() == empty["judgement"].keys()
    assert empty["judgement"]["selected"]["precision"] == {
        "value": None,
        "low": None,
        "high": None,
        "reason": "no success was predicted",
    }


class Page(HTMLParser):
    """Texts, addresses and open elements of a page."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.addresses: list[str] = []
        self.open: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.addresses += [value or "" for name, value in attrs if name in ("href", "src")]
        if tag not in ("meta", "br", "line", "circle", "path", "rect"):
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert tag in ("line", "circle", "path", "rect") or self.open.pop() == tag


def test_page(tmp_path: Path) -> None:
    first, second = make_runs(tmp_path)
    found = compare(first, second, make_sheet(first, tmp_path))
    text = comparison_page(found, tmp_path / "pages" / "compare.html", "burg-drake compare a b")
    page = Page(text)
    assert page.open == []
    assert set(page.addresses) == {"../photos/a%20b.png"}
    assert "&lt;b&gt;slipped&lt;/b&gt; &amp; fell" in text and "<b>slipped</b>" not in text
    assert "first simulator" in text and "McNemar" in text and "http" not in text
    assert text.count('class="plot"') >= 4
    for title in ("By object", "How each verdict turned out"):
        assert f"<h2>{title}, selected trials (first simulator)</h2>" in text
    text = comparison_page(compare(first, second))
    Page(text)
    assert "<h2>By object</h2>" in text and "elected trials" not in text.split("<h2>Fig")[1]
