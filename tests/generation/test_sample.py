"""Single scenes: what a recipe asks for, and what becomes of the rest."""

from __future__ import annotations

import itertools
from dataclasses import replace
from pathlib import Path

import pytest
import trimesh
from scipy.spatial import cKDTree

from burg_drake.core import InvalidInputError, Pose, UnknownNameError
from burg_drake.generation import (
    SceneSampler,
    attempts_with_same_objects,
    sample_again,
    sample_scene,
    scene_sampling,
)
from burg_drake.objects import ObjectLibrary
from burg_drake.scene import Board, Instance, Scene, SceneDocument, SceneRecipe
from burg_drake.station import Station, check_scene, load_station

A3 = Board(size=(0.42, 0.297))
SMALL = ("can", "marble", "mug")
PLACED = SceneRecipe(library="household", count=3, only=SMALL, board=A3, settle=False)


def test_a_heap_comes_to_rest_where_it_is_sound(
    household: ObjectLibrary, tabletop: Station
) -> None:
    recipe = replace(PLACED, layout="heap", settle=True, count=2, only=("box", "marble"))
    sampled = sample_scene(recipe, household, tabletop)
    assert sampled.accepted and sampled.placed == 2 and not sampled.missing
    assert not [i for i in check_scene(sampled.scene, tabletop) if i.is_error]


def test_surfaces_of_what_touches_are_hardly_in_each_other(
    household: ObjectLibrary, tabletop: Station
) -> None:
    """In the first attempt of this scene a screwdriver is 1.3 mm deep in a bowl. The oracle takes
    Manifold's intersection, and samples in place of the surfaces."""
    recipe = SceneRecipe(library="household", layout="touching", count=6, seed=5, settle=False)
    scene = sample_scene(recipe, household, tabletop, number=17).scene
    surfaces = [
        household.surface(one.object).apply_transform(one.X_SO.matrix())
        for one in scene.instances.values()
    ]
    for one, other in itertools.combinations(surfaces, 2):
        common = trimesh.boolean.intersection([one, other], engine="manifold", check_volume=False)
        for surface in (one, other) if len(common.vertices) else ():
            samples, _ = trimesh.sample.sample_surface(surface, 1_000_000, seed=0)
            assert cKDTree(samples).query(common.vertices)[0].max() < 1.15e-3


def test_another_number_or_seed_is_another_scene(
    household: ObjectLibrary, tabletop: Station
) -> None:
    sampler = SceneSampler(PLACED, household, tabletop)
    other = SceneSampler(replace(PLACED, seed=1), household, tabletop)
    documents = [s.sample(n).scene.document for s in (sampler, other) for n in (0, 1)]
    for i, one in enumerate(documents):
        assert all(one.instances != other.instances for other in documents[i + 1 :])
    assert sampler.sample(1).scene.document == documents[1]


def test_the_origin_is_no_part_of_the_content(household: ObjectLibrary, tabletop: Station) -> None:
    scene = sample_scene(PLACED, household, tabletop).scene
    bare = Scene(replace(scene.document, origin=None), household, scene.path)
    assert scene.document.origin is not None
    assert bare.content == scene.content


def test_a_scene_is_made_again(household: ObjectLibrary, tabletop: Station) -> None:
    scene = sample_scene(PLACED, household, tabletop, number=4).scene
    again = sample_again(scene)
    assert again.same and again.scene is not None and again.scene.document == scene.document
    moved = replace(scene.document, instances=scene.document.instances[::-1])
    again = sample_again(Scene(moved, household, scene.path))
    assert not again.same
    assert again.differences == ("the file was changed after it was sampled",)


def test_what_was_made_with_other_things_is_refused(
    household: ObjectLibrary, tabletop: Station
) -> None:
    scene = sample_scene(PLACED, household, tabletop).scene
    origin = scene.document.origin
    assert origin is not None
    old = replace(origin, library_content="0" * 12, versions=origin.versions | {"drake": "1.0"})
    other = Scene(replace(scene.document, origin=old), household, scene.path)
    with pytest.raises(InvalidInputError) as caught:
        sample_again(other)
    assert str(caught.value) == (
        "the inputs of scene_0000.yaml have changed (the library has content 000000000000 there,"
        f" {origin.library_content} here; drake is 1.0 there, {origin.versions['drake']}"
        " here), so the scene may come out differently; force it to make the scene"
        " anyway"
    )
    assert sample_again(other, force=True).scene is not None
    with pytest.raises(InvalidInputError, match="has no `origin`, so it was not sampled"):
        sample_again(Scene(replace(scene.document, origin=None), household, scene.path))


@pytest.mark.thorough
def test_refusals_do_not_change_the_mix_of_objects(
    household: ObjectLibrary, tabletop: Station
) -> None:
    """Attempts with an airplane are refused often; it is one of four that are drawn as often."""
    recipe = replace(
        PLACED,
        count=2,
        only=("airplane", "bowl", "can", "marble"),
        board=Board(size=(0.38, 0.3)),
        tries=2,
        seed=2,
    )
    sampler = SceneSampler(recipe, household, tabletop)
    scenes = [sampler.sample(number) for number in range(60)]
    assert all(sampled.accepted for sampled in scenes)
    airplanes = sum("airplane" in sampled.scene.instances for sampled in scenes)
    assert abs(airplanes - 30) < 9  # 2.3 standard deviations
    assert sum(sampled.attempts > 1 for sampled in scenes) > 10


def test_objects_without_room_do_not_cost_the_scene(
    household: ObjectLibrary, tabletop: Station
) -> None:
    """The board is smaller than an airplane."""
    recipe = replace(
        PLACED, count=1, only=("airplane", "marble"), board=Board(size=(0.1, 0.1)), attempts=20
    )
    sampler = SceneSampler(recipe, household, tabletop)
    scenes = [sampler.sample(number) for number in range(8)]
    assert all("marble" in sampled.scene.instances for sampled in scenes)
    late = [s.attempts for s in scenes if s.attempts > 1]
    assert late and min(late) > attempts_with_same_objects(recipe) == 16


def test_too_small_a_board(household: ObjectLibrary, tabletop: Station) -> None:
    small = replace(PLACED, board=Board(size=(0.15, 0.12)), only=("can", "mug", "box"), attempts=4)
    sampled = sample_scene(small, household, tabletop)
    assert not sampled.accepted
    assert sampled.refused == {"an object found no place": 4}
    assert sampled.scene.document.origin is None
    fewer = sample_scene(replace(small, fewer=True), household, tabletop)
    assert fewer.accepted and fewer.missing
    assert fewer.placed == 3 - len(fewer.missing)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (
            {"only": ("can", "cup")},
            "object 'cup' cannot be arranged: library {root} does not have it, or it has no mass or"
            " no stable pose; known:"
            " airplane, banana, bottle, bowl, box, can, marble, mug, scissors, screwdriver",
        ),
        (
            {"count": 4},
            "4 different objects were asked for, but there are only 3 to choose from; ask for"
            " fewer, or allow objects to repeat",
        ),
        (
            {"visible_from": "boards"},
            "station 'panda_tabletop' has no camera 'boards'; did you mean 'board'? Known: board,"
            " overview",
        ),
    ],
)
def test_impossible_recipes(
    household: ObjectLibrary, tabletop: Station, changes: dict[str, object], message: str
) -> None:
    recipe = replace(PLACED, **changes)  # type: ignore[arg-type]
    with pytest.raises((InvalidInputError, UnknownNameError)) as caught:
        sample_scene(recipe, household, tabletop)
    assert str(caught.value) == message.format(root=household.root)


def test_rules(household: ObjectLibrary, tabletop: Station) -> None:
    """A can alone, the same between four taller boxes, and one that is far beside the board."""

    def scene(*instances: tuple[str, str, tuple[float, float, float], float]) -> Scene:
        placed = tuple(
            Instance(name=name, object=what, X_SO=Pose(p, rpy_deg=(0.0, 0.0, yaw)))
            for name, what, p, yaw in instances
        )
        document = SceneDocument(name="rules", library="household", instances=placed)
        return Scene(document, household, Path("rules.yaml"))

    asked = replace(PLACED, visible_from="overview", clear_grasps=1)
    can = ("can", "can", (0.3, 0.2, 0.0), 0.0)
    boxes = [
        (f"box_{i}", "box", (0.3 + x, 0.2 + y, 0.0), yaw)
        for i, (x, y, yaw) in enumerate(
            [(0.07, 0.0, 0.0), (-0.07, 0.0, 0.0), (0.0, 0.07, 90.0), (0.0, -0.07, 90.0)]
        )
    ]
    assert scene_sampling.find_broken_rule(scene(can), tabletop, asked) == ""
    blocked = replace(PLACED, clear_grasps=1)
    assert (
        scene_sampling.find_broken_rule(scene(can, *boxes), tabletop, blocked)
        == scene_sampling.FEW_GRASPS_REASON
    )
    away = scene(("can", "can", (3.0, 0.2, 0.0), 0.0))
    assert scene_sampling.find_broken_rule(away, tabletop, asked) == scene_sampling.HIDDEN_REASON
    with pytest.raises(InvalidInputError, match=r"within_reach .* 'wsg_tabletop'"):
        reach = replace(PLACED, within_reach=True)
        SceneSampler(reach, household, load_station("wsg_tabletop"))
