"""Scoring of sets: objects, instances, gravity and clearance."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from burg_drake.core import (
    GraspSet,
    InvalidInputError,
    UnknownNameError,
    make_pose,
    rotation_from_rpy,
    software_versions,
)
from burg_drake.evaluation import SCENE_COLUMNS, scored_set
from burg_drake.geometry import Surface
from burg_drake.grasping import (
    CLEARANCE_VERSION,
    METRICS,
    PANDA_JAWS,
    QUALITY_VERSION,
    Payload,
    grasp_quality,
    sample_antipodal,
)
from burg_drake.objects import ObjectLibrary, load_library
from burg_drake.scene import Scene, load_scene
from burg_drake.station import Station, load_station

SCENE = """\
version: 1
name: two
library: household
instances:
  - {object: can, X_SO: {translation: [0.15, 0.2, 0.06]}}
  - {object: box, X_SO: {translation: [0.35, 0.2, 0.06], rpy_deg: [90, 0, 30]}}
"""


@pytest.fixture(scope="module")
def library() -> ObjectLibrary:
    return load_library("household")


@pytest.fixture(scope="module")
def station() -> Station:
    return load_station("panda_tabletop")


@pytest.fixture
def scene(tmp_path: Path) -> Scene:
    (tmp_path / "two.yaml").write_text(SCENE)
    return load_scene(tmp_path / "two.yaml")


def sampled(library: ObjectLibrary, name: str, n: int = 8) -> GraspSet:
    mesh = library.surface(name)
    return sample_antipodal(mesh, n, np.random.default_rng(0), object=name)


def mixed(library: ObjectLibrary) -> GraspSet:
    """Grasps of two objects that alternate."""
    joined = GraspSet.concatenate([sampled(library, "can"), sampled(library, "box")])
    return joined.select(np.arange(16).reshape(2, 8).T.ravel())


def test_each_grasp_is_scored_on_its_object(library: ObjectLibrary, station: Station) -> None:
    grasps = mixed(library)
    scored = scored_set(grasps, library, station, friction={"box": 0.5})
    np.testing.assert_array_equal(scored.id, grasps.id)
    for name, friction in (("can", None), ("box", 0.5)):
        mine = grasps.object == name
        payload = Payload.of(library.entry(name), friction)
        jaws_alike = grasp_quality(
            grasps.X_OG[mine], Surface.of(library.surface(name)), payload, PANDA_JAWS
        )
        for metric in METRICS:
            np.testing.assert_allclose(
                scored.column(metric)[mine], getattr(jaws_alike, metric), rtol=1e-6, atol=1e-12
            )
    assert "clearance" not in scored.columns
    assert scored.provenance["quality"]["payloads"]["box"]["friction"] == 0.5


def test_a_scene_gives_gravity_and_clearance(
    library: ObjectLibrary, station: Station, scene: Scene
) -> None:
    grasps = mixed(library)
    scored = scored_set(grasps, library, station, scene, by="gravity_margin")
    mine = grasps.object == "box"
    up = rotation_from_rpy(np.radians([90, 0, 30])).T @ (0, 0, 1)
    expected = grasp_quality(
        grasps.X_OG[mine],
        Surface.of(library.surface("box")),
        Payload.of(library.entry("box")),
        up=up,
    )
    np.testing.assert_allclose(
        scored.column("gravity_margin")[mine], expected.gravity_margin, rtol=1e-6
    )
    np.testing.assert_array_equal(scored.score, scored.column("gravity_margin"))
    assert (scored.column("gravity_margin") >= 0.999 * scored.column("load_margin")).all()
    assert np.isfinite(scored.column("clearance")).all()
    assert set(scored.column("nearest")) <= {"can", "box", "table"}


def test_clearance_is_of_the_open_hand_in_the_scene(
    library: ObjectLibrary, station: Station, scene: Scene
) -> None:
    """From above, a can of 66 mm has room for 80 mm; from below, the hand is in the table."""
    center = np.mean([library.entry("can").lower, library.entry("can").upper], axis=0)
    top = library.entry("can").upper[2] - 0.01
    above = make_pose(rotation_from_rpy((np.pi, 0, 0)), (center[0], center[1], top))
    below = make_pose(None, (center[0], center[1], -0.02))
    grasps = GraspSet.create(np.stack([above, below]), object="can")
    scored = scored_set(grasps, library, station, scene)
    assert 0.0 < scored.column("clearance")[0] < 0.02
    assert scored.column("nearest")[0] == "can"
    assert scored.column("clearance")[1] < -0.03
    assert scored.column("screened").tolist()[0] == "clear"
    assert scored.column("screened")[1].startswith("collision_")
    assert scored.column("collides_with").tolist() == ["", scored.column("nearest")[1]]


def test_what_decided_a_collision(library: ObjectLibrary, station: Station, scene: Scene) -> None:
    """Hands in the air, in the board beside the can, and in the box 0.2 m from it."""
    down = rotation_from_rpy((np.pi, 0, 0))
    places = make_pose(down, [(0, 0, 0.3), (0, -0.15, -0.06), (0.2, 0, 0)])
    scored = scored_set(GraspSet.create(places, object="can"), library, station, scene)
    outcomes = ["clear", "collision_table", "collision_clutter"]
    assert scored.column("screened").tolist() == outcomes
    assert scored.column("collides_with").tolist() == ["", "table", "box"]


def test_provenance_tells_what_a_set_was_scored_with(
    library: ObjectLibrary, station: Station, scene: Scene
) -> None:
    how = scored_set(mixed(library), library, station, scene).provenance["quality"]
    assert how["scene"] == str(scene.path.resolve())
    assert how["station"] == str(station.path.resolve())
    assert how["content"] == {
        "scene": scene.content,
        "station": station.content,
        "objects": {name: library.entry(name).build for name in ("box", "can")},
    }
    assert how["versions"] == software_versions()
    assert (how["version"], how["clearance_version"]) == (QUALITY_VERSION, CLEARANCE_VERSION)
    alone = scored_set(mixed(library), library, station).provenance["quality"]
    assert alone["library"] == str(library.root.resolve())
    assert not {"scene", "clearance_version"} & {*alone, *alone["content"]}


def test_without_a_scene_nothing_is_left_of_an_earlier_one(
    library: ObjectLibrary, station: Station, scene: Scene
) -> None:
    grasps = mixed(library).with_columns(label=np.arange(16.0))
    placed = scored_set(grasps, library, station, scene)
    assert set(SCENE_COLUMNS) <= set(placed.columns)
    again = scored_set(placed, library, station)
    assert not set(SCENE_COLUMNS) & set(again.columns)
    assert np.isnan(again.column("gravity_margin")).all()
    np.testing.assert_array_equal(again.column("label"), grasps.column("label"))
    assert "scene" not in again.provenance["quality"]


def test_what_cannot_be_scored(library: ObjectLibrary, station: Station, scene: Scene) -> None:
    grasps = mixed(library)
    with pytest.raises(UnknownNameError, match="friction is given for 'mug', but there are no"):
        scored_set(grasps, library, station, friction={"mug": 0.3})
    with pytest.raises(InvalidInputError, match="gravity_margin depends on where up is"):
        scored_set(grasps, library, station, by="gravity_margin")
    with pytest.raises(UnknownNameError, match="there is no metric 'volum'"):
        scored_set(grasps, library, station, by="volum")
    with pytest.raises(InvalidInputError, match="has 0 instances of 'mug'; add a column"):
        scored_set(sampled(library, "mug"), library, station, scene)
    named = grasps.with_columns(instance=np.full(16, "can_2"))
    with pytest.raises(UnknownNameError, match=r"'can_2', .* 'two'"):
        scored_set(named, library, station, scene)
