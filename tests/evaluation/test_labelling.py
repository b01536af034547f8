"""Labels of grasps of a library: scenes of one object, protocols, files, and how calls go on."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh

from burg_drake.core import (
    ClusterError,
    DeviceError,
    InvalidInputError,
    MissingDependencyError,
    Outcome,
    Pose,
    SimulationError,
    UnknownNameError,
)
from burg_drake.evaluation import (
    EvaluationSettings,
    LocalExecutor,
    ObjectLabels,
    assess_robustness,
    evaluate,
    judge_again,
    label_library,
    load_run,
)
from burg_drake.experiment import plan_trials
from burg_drake.formats import (
    LABELLED_BY,
    read_grasp_file,
    success_labels,
    write_grasp_file,
)
from burg_drake.objects import ObjectLibrary, load_library
from burg_drake.pipeline import ObjectSource, build_library
from burg_drake.scene import save_scene
from burg_drake.station import Station, instance_pose, load_station

SETTINGS = EvaluationSettings(
    grasps_per_object=3, only=("cube", "heavy", "wide_"), engine="screening"
)


@pytest.fixture(scope="module")
def library(measured_once: None, tmp_path_factory: pytest.TempPathFactory) -> ObjectLibrary:
    """A cube, one that is too heavy to be lifted, one that is too wide for the hand, a long bar
    whose origin is at its upper end, and a fixed wall."""
    cube = trimesh.creation.box((0.05, 0.05, 0.05))
    cube.apply_translation((0.0, 0.0, 0.025))
    wide, long = trimesh.creation.box((0.2, 0.2, 0.2)), trimesh.creation.box((0.03, 0.7, 0.03))
    wide.apply_translation((0.0, 0.0, 0.1))
    long.apply_translation((0.0, -0.35, 0.0))
    wall = trimesh.creation.box((0.4, 0.05, 0.3))
    out = tmp_path_factory.mktemp("labelled") / "library"
    sources = [
        ObjectSource(name="cube", mesh=cube, mass=0.1),
        ObjectSource(name="heavy", mesh=cube, mass=30.0),
        ObjectSource(name="wide_", mesh=wide, mass=0.1),
        ObjectSource(name="long", mesh=long, mass=0.1),
        ObjectSource(name="wall", mesh=wall, fixed=True),
    ]
    assert not build_library(sources, out, confirm=False).failed
    return load_library(out)


@pytest.fixture(scope="module")
def station() -> Station:
    return load_station("panda_tabletop")


@pytest.fixture(scope="module")
def labelled(
    library: ObjectLibrary, station: Station, judged_here: None, tmp_path_factory
) -> list[ObjectLabels]:
    """Labels by the default protocol."""
    out = tmp_path_factory.mktemp("labels")
    found = label_library(
        library, station, out, format="acronym", settings=SETTINGS, workers=1, progress=False
    )
    return list(found)


def test_each_object_that_can_be_held_gets_a_file_of_labels(labelled: list[ObjectLabels]) -> None:
    *held, wide = labelled
    assert [found.object for found in held] == ["cube", "heavy"]
    for found, success in zip(held, (1.0, 0.0), strict=True):
        assert found.path.name == f"{found.object}.h5"
        np.testing.assert_array_equal(found.success, [success] * 3)
        read = read_grasp_file(found.path, "acronym").grasps
        np.testing.assert_array_equal(success_labels(read), found.success)
        np.testing.assert_allclose(read.X_OG, found.run.candidates.grasps.X_OG, atol=1e-9)
        assert np.isnan(found.given).all()
    assert (wide.object, len(wide.success), wide.path, wide.error) == ("wide_", 0, None, "")
    assert not (held[0].path.parent / "wide_.h5").exists()


def test_a_file_says_who_labelled_it_and_how(labelled: list[ObjectLabels]) -> None:
    by = read_grasp_file(labelled[0].path, "acronym").grasps.provenance[LABELLED_BY]
    assert (by["engine"], by["protocol"], by["mode"]) == ("screening", "lift", "hand")
    assert labelled[0].run.document.protocol == "lift"
    assert by["trial"] == labelled[0].run.document.trial
    assert by["versions"]["drake"]


def test_the_same_call_goes_on_where_it_stopped(
    labelled: list[ObjectLabels], library: ObjectLibrary, station: Station, judged_here: None
) -> None:
    out = labelled[0].path.parent
    before = {found.object: found.run.document.stretches for found in labelled}
    again = label_library(
        library, station, out, format="acronym", settings=SETTINGS, workers=1, progress=False
    )
    assert {found.object: found.run.document.stretches for found in again} == before
    scene = (out / "scenes" / "cube.yaml").read_text()
    other = replace(SETTINGS, protocol="shake")
    with pytest.raises(InvalidInputError, match="; protocol is lift there, shake here"):
        next(label_library(library, station, out, settings=other, workers=1, progress=False))
    assert (out / "scenes" / "cube.yaml").read_text() == scene


def test_an_executor_has_workers_of_its_own(
    library: ObjectLibrary, station: Station, tmp_path: Path
) -> None:
    executor, out = LocalExecutor(1), tmp_path / "labels"
    with pytest.raises(InvalidInputError, match="either workers or an executor"):
        list(label_library(library, station, out, executor=executor, workers=2))
    assert not out.exists()


def test_grasps_of_the_next_objects_are_sampled_by_other_processes(
    labelled: list[ObjectLabels],
    library: ObjectLibrary,
    station: Station,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Their runs are as if this process had made them, and errors are told in their turn."""
    monkeypatch.setattr("sys.argv", ["label", "me"])
    place = "burg_drake.evaluation.run_preparation.sample_requested"
    monkeypatch.setattr(place, lambda *_: pytest.fail("sampled here"))
    found = list(
        label_library(library, station, tmp_path, settings=SETTINGS, workers=2, progress=False)
    )
    assert [each.error for each in found] == [each.error for each in labelled]
    for each, expected in zip(found[:2], labelled, strict=False):
        assert each.run.document.hash == expected.run.document.hash
        np.testing.assert_array_equal(each.success, expected.success)
        assert each.run.document.command == "label me"


def test_errors_of_an_object_do_not_stop_the_others_and_those_of_the_machine_do(
    library: ObjectLibrary,
    station: Station,
    judged_here: None,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Not in a second call either, when the object's run exists."""

    def label() -> list[ObjectLabels]:
        settings = replace(SETTINGS, only=("cube", "heavy"), grasps_per_object=1)
        return list(label_library(library, station, tmp_path, settings=settings, progress=False))

    def fail_with(error: Exception) -> None:
        def evaluate_but_cube(scene, station, folder, **more):
            run = evaluate(scene, station, folder, **more)
            if folder.name == "cube":
                raise error
            return run

        monkeypatch.setattr("burg_drake.evaluation.labelling.evaluate", evaluate_but_cube)

    fail_with(SimulationError("50 grasps in a row could not be simulated"))
    for _ in range(2):
        cube, heavy = label()
        assert "50 grasps in a row" in cube.error and cube.run is None
        assert heavy.path is not None and not heavy.error
    shutil.rmtree(tmp_path)  # The first error meets a new object.
    for kind in (DeviceError, ClusterError, MissingDependencyError):
        fail_with(kind("it is lost"))
        with pytest.raises(kind, match="it is lost"):
            label()


def test_complete_labels_need_no_card(
    labelled: list[ObjectLabels],
    library: ObjectLibrary,
    station: Station,
    judged_here: None,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def refuse(*_: object) -> None:
        raise InvalidInputError("there is no card")

    monkeypatch.setattr("burg_drake.evaluation.labelling.require_device", refuse)

    def label(out: Path) -> list[ObjectLabels]:
        more = {"format": "acronym", "settings": SETTINGS, "progress": False}
        return list(label_library(library, station, out, **more))

    out = labelled[0].path.parent
    again = label(out)
    assert [found.path for found in again] == [found.path for found in labelled]
    with pytest.raises(InvalidInputError, match="there is no card"):
        label(out.parent / "new")


def test_given_grasps_keep_their_labels_beside_the_new_ones(
    labelled: list[ObjectLabels],
    library: ObjectLibrary,
    station: Station,
    judged_here: None,
    tmp_path: Path,
) -> None:
    given = read_grasp_file(labelled[0].path, "acronym").grasps
    wrong = given.with_columns(
        object_in_gripper=np.array([1.0, 0.0, 0.0]), instance=np.array(["left"] * 3)
    )
    wrong.save(tmp_path / "wrong.h5")
    write_grasp_file(wrong, tmp_path / "theirs.h5", "acronym")
    for path in ("wrong.h5", "theirs.h5"):
        grasps = read_grasp_file(tmp_path / path).grasps
        out = tmp_path / path.removesuffix(".h5")
        (found,) = label_library(
            library,
            station,
            out,
            format="acronym",
            grasps=grasps,
            settings=SETTINGS,
            workers=1,
            progress=False,
        )
        np.testing.assert_array_equal(found.given, [1.0, 0.0, 0.0])
        np.testing.assert_array_equal(found.success, [1.0, 1.0, 1.0])
        again = success_labels(read_grasp_file(found.path, "acronym").grasps)
        np.testing.assert_array_equal(again, found.success)


def test_another_pose_of_the_object_is_told(
    labelled: list[ObjectLabels],
    library: ObjectLibrary,
    station: Station,
    judged_here: None,
    tmp_path: Path,
) -> None:
    """The grasps come from a scene in which the cube lies on its side."""
    document = labelled[0].run.scene().document
    grasps = read_grasp_file(labelled[0].path, "acronym").grasps
    for angle, notes in ((90.0, 1), (0.0, 0)):
        (cube,) = document.instances
        X_SO = Pose((0.2, 0.2, 0.1), rpy_deg=(angle, 0.0, 30.0))
        scene = replace(document, library=str(library.root), instances=(replace(cube, X_SO=X_SO),))
        save_scene(scene, tmp_path / f"{angle:g}.yaml")
        given = replace(grasps, provenance={"scene": str(tmp_path / f"{angle:g}.yaml")})
        out = tmp_path / f"labels_{angle:g}"
        (found,) = label_library(
            library, station, out, grasps=given, settings=SETTINGS, workers=1, progress=False
        )
        told = [note for note in found.notes if "stands in another pose than in" in note]
        assert len(told) == notes


def test_shaken_objects_are_alone_in_the_air(
    library: ObjectLibrary, judged_here: None, tmp_path: Path
) -> None:
    """Also a long one, from all sides and at both ends, over a board that is not level."""
    tilted = load_station("panda_tabletop")
    document = replace(tilted.document, X_WS=Pose((0.3, -0.1, 0.0), rpy_deg=(0.0, 5.0, 30.0)))
    tilted = replace(tilted, document=document)
    settings = replace(SETTINGS, protocol="shake", grasps_per_object=12, only=("long",))
    (found,) = label_library(
        library, tilted, tmp_path, settings=settings, workers=1, progress=False
    )
    run = load_run(found.run.path)
    entry, X_WO = run.scene().entry("long"), instance_pose(run.scene(), tilted, "long")
    corners = np.array(np.meshgrid(*zip(entry.lower, entry.upper, strict=True))).reshape(3, -1)
    assert (X_WO[:3, :3] @ corners + X_WO[:3, 3:])[2].min() > 0.29
    assert run.document.trial["shake_periods"] == 2
    assert run.document.grasps.approach_angle_deg == 180.0
    assert run.document.trial["tilt_limit"] >= np.pi and "slip_limit" not in run.document.trial
    assert set(run.results["outcome"].tolist()) <= {Outcome.LIFTED, Outcome.SLIPPED}
    assert run.results["y"].min() < -0.4 and run.results["y"].max() > -0.3
    assert np.isnan(run.results["lift"]).all() and np.isnan(run.results["confidence"]).all()


def test_shaken_objects_are_not_those_of_a_robot(
    library: ObjectLibrary, station: Station, judged_here: None, tmp_path: Path
) -> None:
    """They are in the air, so neither robustness tests nor trials on a robot are about them."""
    settings = replace(SETTINGS, protocol="shake", grasps_per_object=1, only=("cube",))
    (found,) = label_library(
        library, station, tmp_path, settings=settings, workers=1, progress=False
    )
    with pytest.raises(InvalidInputError, match="its objects were shaken"):
        assess_robustness(found.run, progress=False)
    with pytest.raises(InvalidInputError, match="its objects were shaken"):
        plan_trials(found.run)
    with pytest.raises(InvalidInputError, match="no confidence, so that none is contested"):
        judge_again(found.run)


def test_what_cannot_be_labelled_is_refused(
    labelled: list[ObjectLabels], library: ObjectLibrary, station: Station, tmp_path: Path
) -> None:
    def label(**more) -> ObjectLabels:
        return next(label_library(library, station, tmp_path / "out", progress=False, **more))

    grasps = labelled[0].run.candidates.grasps
    with pytest.raises(InvalidInputError, match="grasps are of cube, but those of heavy are to"):
        label(settings=EvaluationSettings(only="heavy"), grasps=grasps)
    with pytest.raises(UnknownNameError, match=r"no object 'cub'.*cube"):
        label(settings=EvaluationSettings(only="cub"))
    with pytest.raises(InvalidInputError, match="in the camera frame"):
        label(format="graspnet")
    for more in ({"mode": "arm"}, {"protocol": "shake", "tilt_limit_deg": 10.0}):
        with pytest.raises(InvalidInputError, match=r"hand alone|may move in the hand"):
            label(settings=EvaluationSettings(**more))
    assert not (tmp_path / "out").exists()
    assert "has no mass" in label(settings=EvaluationSettings(only="wall")).error


def test_files_of_others_are_not_replaced(
    labelled: list[ObjectLabels], library: ObjectLibrary, station: Station, tmp_path: Path
) -> None:
    """Neither those of the user nor those of a run."""
    (tmp_path / "heavy.h5").write_text("mine")
    for folder, why in (
        (tmp_path, r"would replace heavy\.h5 in .*, which no earlier call"),
        (labelled[0].run.path, "is the folder of a run; choose another folder"),
    ):
        with pytest.raises(InvalidInputError, match=why):
            next(label_library(library, station, folder, settings=SETTINGS, progress=False))
    assert [path.name for path in tmp_path.iterdir()] == ["heavy.h5"]


def test_a_library_is_given_by_its_folder(
    library: ObjectLibrary, station: Station, tmp_path: Path
) -> None:
    settings = EvaluationSettings(only="wall")
    (found,) = label_library(library.root, station, tmp_path, settings=settings, progress=False)
    assert "has no mass" in found.error


def test_only_one_object_is_shaken_and_only_by_the_hand(station: Station, tmp_path: Path) -> None:
    """What has no effect is refused, before anything is written."""
    lift = replace(station.document.motion, lift_height=0.1)
    for more, why in (
        ({"mode": "reach"}, "protocol shake is for the hand alone"),
        ({"mode": "hand", "approach": True}, "protocol shake is for the hand alone"),
        ({"mode": "hand", "motion": lift}, "neither approaches nor lifts"),
        ({"mode": "hand"}, "has 6 objects; a hand is shaken with one alone"),
    ):
        settings = EvaluationSettings(protocol="shake", **more)
        with pytest.raises(InvalidInputError, match=why):
            evaluate("tabletop_six", station, tmp_path / "run", settings=settings, progress=False)
    assert not (tmp_path / "run").exists()
