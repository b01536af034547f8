"""What a data set refers to outside of its folder: found from any place, and known again."""

from __future__ import annotations

import re
import shutil
from dataclasses import replace
from pathlib import Path

import pytest

import burg_drake as burg
from burg_drake.apps import main
from burg_drake.core import InvalidInputError, UnknownNameError, data_root, rng_from
from burg_drake.dataset import (
    AppearanceSettings,
    DatasetRecipe,
    check_generated,
    draw_appearance,
    sample_again,
)
from burg_drake.scene import SceneRecipe

LOOKS = AppearanceSettings(room=0.0, shadows=0.0, distractors=(3, 4), distractor_library="things")
RECIPE = DatasetRecipe(views=1, sensor="d435", size=(160, 120), colors=False, looks=LOOKS)


@pytest.fixture
def made(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A data set with distractors of an own library, made from the folder that has it."""
    shutil.copytree(data_root() / "models" / "household", tmp_path / "here" / "things")
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    burg.generate_dataset(["tabletop_six"], "panda_tabletop", "data", RECIPE)
    monkeypatch.chdir(tmp_path / "elsewhere")
    return tmp_path / "here"


def test_distractors_are_found_from_any_place(made: Path) -> None:
    data = made / "data"
    assert check_generated(data) == []
    dataset = burg.load_dataset(data)
    assert dataset[0].appearance["library"] == "../things"
    assert len(dataset[0].appearance["distractors"]) >= 1
    again = sample_again(dataset, dataset.keys[0])
    assert again.appearance == dataset[0].appearance
    elsewhere = made.parent / "moved"
    made.rename(elsewhere)
    assert check_generated(elsewhere / "data") == []


def test_a_library_of_other_content_is_named(made: Path) -> None:
    library = made / "things" / "library.yaml"
    text = library.read_text()
    build = re.search(r"build: (\w+)", text)
    assert build
    library.write_text(text.replace(build[1], build[1][::-1]))  # as after another build
    (found,) = check_generated(made / "data")
    assert found.file == "dataset.yaml" and found.sample == ""
    assert "the library of distractors has changed since" in found.message
    dataset = burg.load_dataset(made / "data")
    with pytest.raises(InvalidInputError, match=r"images cannot be rendered again"):
        sample_again(dataset, dataset.keys[0])
    with pytest.raises(InvalidInputError, match="library of distractors"):
        burg.generate_dataset(
            ["tabletop_six"],
            "panda_tabletop",
            made / "data",
            replace(RECIPE, looks=replace(LOOKS, distractor_library=str(made / "things"))),
        )


def test_an_unknown_library_leaves_no_folder(tmp_path: Path) -> None:
    recipe = replace(RECIPE, looks=replace(LOOKS, distractor_library="nothing_there"))
    with pytest.raises(UnknownNameError, match=r"nothing_there"):
        burg.generate_dataset(["tabletop_six"], "panda_tabletop", tmp_path / "data", recipe)
    assert not (tmp_path / "data").exists()


def test_what_a_scene_shows_is_no_distractor() -> None:
    scene, station = burg.load_scene("tabletop_six"), burg.load_station("panda_tabletop")
    labelled = {one.object for one in scene.instances.values()}
    settings = AppearanceSettings(distractors=(4, 4), distractor_library="household")
    seen = {
        thing.object
        for k in range(10)
        for thing in draw_appearance(settings, scene, station, rng_from("test", k)).distractors
    }
    assert seen and not seen & labelled
    assert labelled < set(scene.library.objects)


def test_distractors_are_of_no_library_that_is_labelled() -> None:
    """What one scene does not show may be labelled in another."""
    scene, station = burg.load_scene("tabletop_six"), burg.load_station("panda_tabletop")
    things = draw_appearance(
        AppearanceSettings(distractors=(6, 6)), scene, station, rng_from("test", 0)
    ).distractors
    clutter = burg.load_library("clutter").objects
    assert things and {thing.object for thing in things} <= set(clutter)
    assert not set(clutter) & set(burg.load_library("household").objects)


@pytest.mark.parametrize(("count", "workers"), [(0, 1), (None, 0)])
def test_numbers_below_one(tmp_path: Path, count: int | None, workers: int) -> None:
    recipe = replace(RECIPE, looks=None, sampled=SceneRecipe(library="household"))
    with pytest.raises(InvalidInputError, match=r"1 or more"):
        burg.generate_dataset(
            burg.load_library("household"), "panda_tabletop", tmp_path / "data", recipe,
            count=count, workers=workers,
        )  # fmt: skip
    with pytest.raises(InvalidInputError, match=r"count is for sampled scenes"):
        burg.generate_dataset(
            ["tabletop_six"], "panda_tabletop", tmp_path / "data", RECIPE, count=1
        )


def test_seed_and_sampling_of_a_recipe_hold(tmp_path: Path) -> None:
    file = tmp_path / "recipe.yaml"
    file.write_text(
        "version: 1\nseed: 7\nviews: 1\nlooks: null\ncolors: false\n"
        "sensor: d435\nsize: [160, 120]\n"
        "sampled: {library: household, count: 2, seed: 5}\n"
    )
    command = ["dataset", "generate", "--sample", "household:1", "--recipe", str(file), "--quiet"]
    assert main([*command, "-o", str(tmp_path / "first")]) == 0
    recipe = burg.load_dataset(tmp_path / "first").document.recipe
    assert (recipe["seed"], recipe["sampled"]["seed"], recipe["sampled"]["count"]) == (7, 5, 2)
    file.write_text("version: 1\nseed: 7\nviews: 1\nlooks: null\ncolors: false\n")
    assert main([*command, "-n", "1", "-o", str(tmp_path / "second")]) == 0
    recipe = burg.load_dataset(tmp_path / "second").document.recipe
    assert (recipe["sampled"]["seed"], recipe["sampled"]["count"]) == (7, 1)
