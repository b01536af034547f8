"""Suites: what is refused, what decides their hash, and the built-in ones."""

from __future__ import annotations

from pathlib import Path

import pytest

import burg_drake as burg
from burg_drake.apps import main
from burg_drake.benchmark import (
    CameraPlacement,
    SuiteSettings,
    load_suite,
    make_suite,
    suite_names,
    write_suite_scene,
)
from burg_drake.core import DocumentError, InvalidInputError, UnknownNameError
from burg_drake.scene import Board

CAMERA = CameraPlacement().camera(Board())


def suite_file(folder: Path) -> Path:
    path = folder / "mine.yaml"
    scenes = ["tabletop_six", "tabletop_close"]
    make_suite(path, scenes, cameras=[CAMERA], settings=SuiteSettings(tuning=1))
    return path


def changed(path: Path, old: str, new: str) -> Path:
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))
    return path


def test_a_suite_has_the_scenes_it_was_made_of(tmp_path: Path) -> None:
    suite = load_suite(suite_file(tmp_path))
    assert list(suite.scenes("test")) == ["tabletop_six"]
    assert list(suite.scenes("tuning")) == ["tabletop_close"]
    made, given = suite.scenes()["tabletop_six"], burg.load_scene("tabletop_six")
    assert made.content == given.content
    assert suite.document.library == "household" and suite.document.station == "panda_tabletop"


def test_the_description_is_shown_if_there_is_one(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = str(tmp_path / "one.yaml")
    new = ["benchmark", "new", path, "--scenes", "tabletop_six"]
    assert main([*new, "--description", "Six objects"]) == 0
    assert main(["benchmark", "show", path]) == 0
    assert "\none, release 1: Six objects\n" in capsys.readouterr().out
    assert main(["benchmark", "show", str(suite_file(tmp_path))]) == 0
    assert capsys.readouterr().out.startswith("mine, release 1\n")


@pytest.mark.parametrize(
    ("old", "new", "same"),
    [
        ("description: ''", "description: for people", True),
        ("grasps: 10", "grasps: 11", False),
        ("sensor: d435", "sensor: d455", False),
        ("translation: [0.115, 0.115", "translation: [0.116, 0.115", False),
        ("split: tuning", "split: test", False),
    ],
)
def test_the_hash_changes_with_what_decides_results(
    tmp_path: Path, old: str, new: str, same: bool
) -> None:
    path = suite_file(tmp_path)
    if old.startswith("translation"):
        old = next(line for line in path.read_text().splitlines() if "translation: [0." in line)
        old = old.strip()
        new = old.replace("translation: [0.", "translation: [0.0", 1)
    before = load_suite(path).hash
    assert (load_suite(changed(path, old, new)).hash == before) is same


def test_changed_objects_are_named(tmp_path: Path) -> None:
    path = suite_file(tmp_path)
    content = burg.load_library("household").content["mug"][:16]
    changed(path, content, "0" * 16)
    with pytest.raises(InvalidInputError, match=r"mug of library .*household changed since"):
        load_suite(path)


def test_objects_without_a_hash_are_named(tmp_path: Path) -> None:
    path = suite_file(tmp_path)
    content = burg.load_library("household").content["mug"][:16]
    changed(path, f"  mug: {content}\n", "")
    with pytest.raises(InvalidInputError, match=r"objects has no hash of mug"):
        load_suite(path)


def test_a_changed_station_is_named(tmp_path: Path) -> None:
    path = suite_file(tmp_path)
    changed(path, burg.load_station("panda_tabletop").content[:16], "0" * 16)
    with pytest.raises(InvalidInputError, match=r"station .*panda_tabletop.yaml changed since"):
        load_suite(path)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("object: mug", "object: cup", r"scenes\[0\]\.instances\[\d\]: .*cup"),
        ("name: tabletop_close", "name: Tabletop_Six", "two scenes are called"),
        ("engine: standard", "engine: fastest", "engine 'fastest' does not exist"),
        ("sensor: d435", "sensor: azure_kinect", "lens distortion"),
    ],
)
def test_bad_suites_are_refused(tmp_path: Path, old: str, new: str, message: str) -> None:
    path = suite_file(tmp_path)
    with pytest.raises((DocumentError, UnknownNameError, InvalidInputError), match=message):
        load_suite(changed(path, old, new))


def test_scenes_of_the_same_name_are_numbered(tmp_path: Path) -> None:
    six = burg.load_scene("tabletop_six")
    suite = make_suite(tmp_path / "two.yaml", [six, six], cameras=[CAMERA])
    assert list(suite.scenes()) == ["tabletop_six", "tabletop_six_2"]


def test_a_scene_can_be_set_up_from_its_files(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("burg_drake.printout.object_drawings.OUTLINE_RESOLUTION", 1e-3)
    suite = load_suite(suite_file(tmp_path))
    scene = suite.scenes()["tabletop_six"]
    write_suite_scene(suite, scene, tmp_path / "scenes")
    files = {path.suffix for path in (tmp_path / "scenes").iterdir()}
    assert files == {".yaml", ".pdf", ".png"}
    assert burg.load_scene(tmp_path / "scenes" / "tabletop_six.yaml").content == scene.content


@pytest.mark.parametrize("name", suite_names())
def test_built_in_suites_are_sound(name: str) -> None:
    suite = load_suite(name)
    assert len(suite.scenes()) == 20 and len(suite.scenes("tuning")) == 4
    first = next(iter(suite.scenes().values()))  # all were checked when the suite was made
    assert not [issue for issue in burg.check_scene(first, suite.station) if issue.is_error]
