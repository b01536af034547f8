"""Runs on disk: what is read back, what moves along, and what has changed since."""

from __future__ import annotations

import dataclasses
import importlib.metadata
import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from burg_drake.core import (
    DocumentError,
    InvalidInputError,
    Outcome,
    UnknownNameError,
    portable_reference,
)
from burg_drake.evaluation import (
    EvaluationSettings,
    Run,
    RunDocument,
    evaluate,
    load_run,
    read_table,
    repeat_section,
    require_same_run,
    run_hash,
    write_report,
)
from burg_drake.scene import Scene
from burg_drake.station import ENGINES, Station, load_station


@pytest.fixture
def run(own_run: Run) -> Run:
    return own_run


def test_a_run_is_read_back_as_it_was(run: Run) -> None:
    back = load_run(run.path)
    assert back.document == run.document and back.complete
    table = read_table(run.table_path)
    assert list(table) == list(back.results)
    for name, values in back.results.items():
        np.testing.assert_array_equal(values, table[name], err_msg=name)
    assert {f"q_grasp_{k}" for k in range(1, 8)} <= set(table)


def test_rows_and_candidates_go_by_id(run: Run) -> None:
    id = run.candidates.id[7]
    assert run.row(id)["id"] == id == run.candidate(id).id
    np.testing.assert_array_equal(run.candidate(id).X_OG, run.candidates.grasps.X_OG[7])
    for look_up in (run.row, run.candidate):
        with pytest.raises(UnknownNameError, match=f"did you mean.* {id}"):
            look_up(id[:-1] + "x")


def test_an_id_that_is_like_no_other_gets_no_suggestion(run: Run) -> None:
    first = ", ".join(run.candidates.id[:9])
    for id in ("nope-1", f"{run.candidates.instance[0]}-xxx"):
        with pytest.raises(UnknownNameError) as caught:
            run.row(id)
        assert str(caught.value) == (
            f"{run.path} has no judged grasp {id!r}; known: {first} and 81 others (all ids are in"
            " results.csv)"
        )


def test_a_run_shows_itself_in_a_line(run: Run) -> None:
    assert repr(run) == f"Run('{run.path}', scene 'three', 90 of 90 grasps judged)"


def test_the_best_grasp_is_lifted_and_disturbs_least(run: Run) -> None:
    best = run.best(3)
    lifted = [id for id in run.candidates.id if run.row(id)["outcome"] == Outcome.LIFTED]
    assert set(best) <= set(lifted)
    slips = [round(run.row(id)["slip"], 4) for id in best]  # a tenth of a millimetre counts
    assert slips == sorted(slips)
    assert slips[0] == min(round(run.row(id)["slip"], 4) for id in lifted)
    assert len(run.best(10_000)) == len(lifted)


def test_scene_and_station_are_those_that_were_judged(
    run: Run, scene: Scene, station: Station
) -> None:
    assert run.scene().content == scene.content
    assert run.station().content == station.content
    assert list(run.scene().instances) == list(scene.instances)


def test_a_run_moves_with_its_library_or_without(run: Run, tmp_path: Path) -> None:
    content = run.document.scene.content
    (tmp_path / "elsewhere" / "deep").mkdir(parents=True)
    alone = tmp_path / "elsewhere" / "deep" / "run"
    shutil.copytree(run.path, alone)
    assert load_run(alone).scene().content == content  # the library is where it was
    shutil.move(tmp_path / "shapes", tmp_path / "elsewhere" / "deep" / "shapes")
    assert load_run(alone).scene().content == content  # beside the run, as it was
    with pytest.raises(
        InvalidInputError, match=r"library ../shapes is missing, .* not at .*shapes"
    ):
        run.scene()


def test_a_changed_object_is_named(run: Run, scene: Scene) -> None:
    library = scene.library.document
    changed = dataclasses.replace(library.objects["bar"], build="another")
    objects = {**library.objects, "bar": changed}
    document = dataclasses.replace(library, objects=objects)
    dataclasses.replace(scene.library, document=document).save()
    with pytest.raises(
        InvalidInputError, match=r"^bar in library .* has changed since .* was judged"
    ):
        load_run(run.path).scene()
    del objects["bar"]
    dataclasses.replace(scene.library, document=document).save()
    with pytest.raises(InvalidInputError, match=r"^bar in library"):
        load_run(run.path).scene()


def test_a_changed_copy_is_noticed(run: Run) -> None:
    for name, old, new, load in (
        ("scene.yaml", "0.35", "0.36", run.scene),
        ("station.yaml", "0.24", "0.25", run.station),
    ):
        path = run.path / name
        text = path.read_text()
        assert old in text
        path.write_text(text.replace(old, new))
        with pytest.raises(InvalidInputError, match=f"{name}.* changed since"):
            load()


def test_what_is_no_run_is_said(tmp_path: Path) -> None:
    with pytest.raises(InvalidInputError, match="nowhere is not the folder of a run"):
        load_run(tmp_path / "nowhere")
    (tmp_path / "results.csv").write_text("")
    with pytest.raises(InvalidInputError, match=r"results.csv is a file"):
        load_run(tmp_path / "results.csv")
    (tmp_path / "run.yaml").write_text("version: 1\nsceen: {}\n")
    with pytest.raises(DocumentError, match=r"run.yaml:1: not a run document"):
        load_run(tmp_path)


def test_provenance_says_what_made_the_results(run: Run) -> None:
    document = run.document
    assert document.versions["burg_drake"]
    for package in ("drake", "numpy", "scipy", "trimesh", "embreex"):
        assert document.versions[package] == importlib.metadata.version(package)
    assert document.library.objects == {"cube": "build of cube", "bar": "build of bar"}
    assert document.grasps.objects == {"cube": 60, "bar": 30}
    assert document.grasps.content == run.candidates.content
    assert document.grasps.approach_angle_deg == 75.0
    assert document.engine.name == "standard" and document.trial["lift_height"] == 0.3
    assert document.station.path == "panda_tabletop"
    assert sum(s.judged or 0 for s in document.stretches) == 90
    assert RunDocument.__dataclass_fields__["version"].default == 1


def test_a_results_file_on_its_own_leads_to_its_run(run: Run) -> None:
    document = load_run(run.path).document
    assert set(read_table(run.table_path)["run"].tolist()) == {document.hash}
    assert len(document.hash) == 12 and document.hash in run.report_path.read_text()
    assert run_hash(dataclasses.replace(document, stretches=(), command="")) == document.hash
    others = [
        dataclasses.replace(document, seed=1),
        dataclasses.replace(document, versions={**document.versions, "drake": "0"}),
        dataclasses.replace(document, grasps=dataclasses.replace(document.grasps, content="0")),
        dataclasses.replace(document, scene=dataclasses.replace(document.scene, content="0")),
        dataclasses.replace(document, trial={**document.trial, "lift_height": 0.1}),
    ]
    assert len({document.hash, *map(run_hash, others)}) == 6


def test_the_engine_is_stored_with_every_setting(run: Run) -> None:
    """Defaults may change one day; what a run was made with may not."""
    written = yaml.safe_load((run.path / "run.yaml").read_text())["engine"]
    assert written == vars(run.document.engine)


def test_an_engine_of_the_same_name_and_other_settings_is_another_run(
    run: Run, scene: Scene, station: Station
) -> None:
    engine = dataclasses.replace(run.document.engine, whole_trial=True)
    assert run_hash(dataclasses.replace(run.document, engine=engine)) != run.document.hash
    with pytest.raises(InvalidInputError, match=r"engine is standard there, standard \(custom\)"):
        evaluate(
            scene,
            station,
            run.path,
            settings=EvaluationSettings(grasps_per_object=30, blind=True, engine=engine),
            progress=False,
        )


def test_what_makes_another_run_is_told_without_hashes(run: Run) -> None:
    there = run.document

    def told(**changes: Any) -> str:
        with pytest.raises(InvalidInputError) as error:
            require_same_run(run.path, there, dataclasses.replace(there, **changes))
        return str(error.value).partition("another run (")[2].partition("); choose another")[0]

    replace = dataclasses.replace
    assert told(trial={**there.trial, "lift_time": 9.0}) == (
        f"lift_time is {there.trial['lift_time']} there, 9.0 here"
    )
    station, scene = there.station, there.scene
    moved = replace(station, content="0", path="other.yaml")
    assert told(station=moved) == f"station is {station.path} there, other.yaml here"
    assert told(station=replace(station, content="0")) == (
        f"station {station.path} has changed, or models that it uses have"
    )
    built = replace(there.library, objects={**there.library.objects, "bar": "0"})
    assert told(scene=replace(scene, content="0"), library=built) == (
        f"scene {scene.path} has objects that were built again: bar"
    )
    given = replace(there.grasps, origin="given", content="0", count=5)
    there = replace(there, grasps=given)
    assert told(grasps=replace(given, content="1", correction=("turn:z90", "inverse"))) == (
        "correction is none there, turn:z90,inverse here"
    )
    assert told(grasps=replace(given, content="1", count=4)) == (
        "grasps are 5 given there, 4 given here"
    )
    assert told(grasps=replace(given, content="1")) == "the given grasps are others"


def test_a_run_goes_on_with_the_version_of_its_engine_only(run: Run) -> None:
    versions = {**run.document.versions, "mujoco": "3.10.0"}
    there = dataclasses.replace(run.document, engine=ENGINES["mujoco"], versions=versions)
    newer = dataclasses.replace(there, versions={**versions, "mujoco": "4.0.0"})
    with pytest.raises(InvalidInputError, match=r"\(mujoco is 3.10.0 there, 4.0.0 here\)"):
        require_same_run(run.path, there, newer)
    assert run_hash(there) != run_hash(newer)
    assert "mujoco 3.10.0" in str(repeat_section(Run(run.path, there)))
    by_drake = [dataclasses.replace(one, engine=run.document.engine) for one in (there, newer)]
    require_same_run(run.path, *by_drake)
    assert {run_hash(one) for one in by_drake} == {run.document.hash}


def test_a_run_of_an_older_release_is_read(run: Run) -> None:
    document = yaml.safe_load((run.path / "run.yaml").read_text())
    for name in ("whole_trial", "contact_model", "contact_surface", "contact_approximation"):
        del document["engine"][name]
    del document["trial"]["disturbance"]
    (run.path / "run.yaml").write_text(yaml.safe_dump(document))
    journal = run.path / "journal.jsonl"
    records = [json.loads(line) for line in journal.read_text().splitlines()]
    for record in records:
        del record["displacements"]
        record["margins"].pop("patch_area", None)
    journal.write_text("".join(f"{json.dumps(record)}\n" for record in records))
    old = load_run(run.path)
    assert old.document.engine == run.document.engine and old.complete
    assert old.results["outcome"].tolist() == run.results["outcome"].tolist()
    for name in ("patch_area", "moved_left", "moved_right", "moved_bar"):
        assert np.isnan(old.results[name]).all()
    write_report(old)
    assert "What was disturbed" not in old.report_path.read_text()


def test_references_of_copies_hold_everywhere(tmp_path: Path) -> None:
    station = load_station("panda_tabletop")
    assert portable_reference(station.hand_model, tmp_path) == (
        "package://burg_drake/models/panda/panda_hand.sdf"
    )
    (tmp_path / "a" / "b").mkdir(parents=True)
    assert portable_reference(tmp_path / "lib", tmp_path / "a" / "b") == "../../lib"
