"""Labels of grasps of a library: scenes of one object, protocols, files, and how calls go on."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh

from burg_drake.core import InvalidInputError, Outcome, UnknownNameError
from burg_drake.evaluation import (
    EvaluationSettings,
    ObjectLabels,
    assess_robustness,
    evaluate,
    label_library,
    load_run,
    scene_of_one,
)
from burg_drake.experiment import plan_trials
from burg_drake.formats import LABELLED_BY, read_grasp_file, success_labels
from burg_drake.objects import ObjectLibrary, load_library
from burg_drake.pipeline import ObjectSource, build_library
from burg_drake.simulation import height_to_shake
from burg_drake.station import Station, load_station

SETTINGS = EvaluationSettings(grasps_per_object=3, engine="screening")


@pytest.fixture(scope="module")
def library(measured_once: None, tmp_path_factory: pytest.TempPathFactory) -> ObjectLibrary:
    """A cube, one that is too heavy to be lifted, and a fixed wall."""
    cube = trimesh.creation.box((0.05, 0.05, 0.05))
    cube.apply_translation((0.0, 0.0, 0.025))
    wall = trimesh.creation.box((0.4, 0.05, 0.3))
    out = tmp_path_factory.mktemp("labelled") / "library"
    sources = [
        ObjectSource(name="cube", mesh=cube, mass=0.1),
        ObjectSource(name="heavy", mesh=cube, mass=30.0),
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
    assert [found.object for found in labelled] == ["cube", "heavy"]
    for found, success in zip(labelled, (1.0, 0.0), strict=True):
        assert found.path.name == f"{found.object}.h5"
        np.testing.assert_array_equal(found.success, [success] * 3)
        read = read_grasp_file(found.path, "acronym").grasps
        np.testing.assert_array_equal(success_labels(read), found.success)
        np.testing.assert_allclose(read.X_OG, found.run.candidates.grasps.X_OG, atol=1e-9)
        assert np.isnan(found.given).all()


def test_a_file_says_who_labelled_it_and_how(labelled: list[ObjectLabels]) -> None:
    by = read_grasp_file(labelled[0].path, "acronym").grasps.provenance[LABELLED_BY]
    assert (by["engine"], by["protocol"], by["mode"]) == ("screening", "lift", "hand")
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
    other = replace(SETTINGS, protocol="shake")
    with pytest.raises(InvalidInputError, match="another run"):
        next(label_library(library, station, out, settings=other, workers=1, progress=False))


def test_given_grasps_keep_their_labels_beside_the_new_ones(
    labelled: list[ObjectLabels],
    library: ObjectLibrary,
    station: Station,
    judged_here: None,
    tmp_path: Path,
) -> None:
    given = read_grasp_file(labelled[0].path, "acronym").grasps
    wrong = replace(given, columns={}, score=np.array([1.0, 0.0, 0.0]))
    (found,) = label_library(
        library, station, tmp_path, grasps=wrong, settings=SETTINGS, workers=1, progress=False
    )
    np.testing.assert_array_equal(found.given, [1.0, 0.0, 0.0])
    np.testing.assert_array_equal(found.success, [1.0, 1.0, 1.0])


def test_shaken_objects_are_alone_in_the_air_and_weigh_nothing(
    labelled: list[ObjectLabels],
    library: ObjectLibrary,
    station: Station,
    judged_here: None,
    tmp_path: Path,
) -> None:
    """So the pads hold what is ten times too heavy to be lifted, if it is hardly shaken."""
    scene = scene_of_one(library, "heavy", station, "shake")
    assert scene.X_SO("heavy")[2, 3] > height_to_shake(station)
    settings = replace(SETTINGS, protocol="shake", grasps_per_object=2, only=("cube",))
    (found,) = label_library(
        library, station, tmp_path, settings=settings, workers=1, progress=False
    )
    run = load_run(found.run.path)
    assert run.document.trial["shake_periods"] == 2
    assert run.document.grasps.approach_angle_deg == 180.0
    assert "tilt_limit" not in run.document.trial or run.document.trial["tilt_limit"] >= np.pi
    assert set(run.results["outcome"].tolist()) == {Outcome.LIFTED.value}
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


def test_what_cannot_be_labelled_is_refused(
    library: ObjectLibrary, station: Station, tmp_path: Path
) -> None:
    def label(**more) -> None:
        next(label_library(library, station, tmp_path / "out", progress=False, **more))

    with pytest.raises(InvalidInputError, match="has no mass"):
        label(settings=EvaluationSettings(only="wall"))
    with pytest.raises(UnknownNameError, match=r"no object 'cub'.*cube"):
        label(settings=EvaluationSettings(only="cub"))
    with pytest.raises(InvalidInputError, match="in the camera frame"):
        label(format="graspnet")
    assert not (tmp_path / "out").exists()


def test_a_shaken_hand_has_no_arm_and_no_approach(station: Station, tmp_path: Path) -> None:
    for more in ({"mode": "reach"}, {"mode": "hand", "approach": True}):
        settings = EvaluationSettings(protocol="shake", **more)
        with pytest.raises(InvalidInputError, match="protocol shake is for the hand alone"):
            evaluate("tabletop_six", station, tmp_path / "run", settings=settings, progress=False)
