"""Sampling on scenes and libraries: limits in the world, the hand's body, and equal settings."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from burg_drake.core import GraspSet, InvalidInputError, Pose, UnknownNameError
from burg_drake.evaluation import (
    SamplingSettings,
    sample_candidates,
    sample_library,
    sample_on_scene,
    sampled_set,
)
from burg_drake.grasping import HandClearance, hand_clearance_alone
from burg_drake.objects import load_library
from burg_drake.scene import Scene, load_scene
from burg_drake.station import Station, build_station_diagram, load_station

BLIND = SamplingSettings(blind=True)


def on_scene(scene, station, n=30, seed=0, only=None, **settings) -> dict[str, GraspSet]:
    """Blind unless told otherwise: the objects of the small scene are nothing to Drake."""
    how = SamplingSettings(**{"blind": True, **settings})
    return dict(sample_on_scene(scene, station, n, seed, how, only))


def turned(scene: Scene, **rpy_deg: tuple[float, float, float]) -> Scene:
    instances = tuple(
        dataclasses.replace(
            i, X_SO=Pose(i.X_SO.translation, rpy_deg=rpy_deg.get(i.name, (0, 0, 0)))
        )
        for i in scene.document.instances
    )
    document = dataclasses.replace(scene.document, instances=instances)
    return Scene(document, scene.library, scene.path)


def test_a_run_judges_the_grasps_of_a_file_with_the_same_settings(
    scene: Scene, station: Station
) -> None:
    run = sample_candidates(scene, station, 40, 3, BLIND)
    for name, grasps in on_scene(scene, station, 40, 3).items():
        assert run.grasps.id[run.instance == name].tolist() == grasps.id.tolist()


def test_a_library_has_the_grasps_of_a_scene_without_limits(scene: Scene, station: Station) -> None:
    there = dict(sample_library(scene.library, station, 25, 4, BLIND))
    here = on_scene(scene, station, 25, 4, approach_angle_deg=180.0)
    assert here["left"].id.tolist() == here["right"].id.tolist() == there["cube"].id.tolist()
    assert here["bar"].id.tolist() == there["bar"].id.tolist()
    (only,) = sample_library(scene.library, station, 25, 4, BLIND, ["bar"])
    assert only[0] == "bar" and only[1].id.tolist() == there["bar"].id.tolist()


def test_some_instances(scene: Scene, station: Station) -> None:
    everything = on_scene(scene, station)
    some = on_scene(scene, station, only=["bar", "left", "bar"])
    assert list(some) == ["left", "bar"]
    assert some["left"].id.tolist() == everything["left"].id.tolist()


@pytest.mark.parametrize("station_name", ["panda_tabletop", "panda_offset"])
def test_hands_come_from_the_side_of_the_arm(scene: Scene, station_name: str) -> None:
    station = load_station(station_name)
    scene = turned(scene, left=(0.0, 0.0, 130.0), right=(90.0, 0.0, 20.0))
    X_WS = station.document.X_WS.matrix()
    p_WA = station.document.arm.X_WA.matrix()[:3, 3]
    for name, grasps in on_scene(scene, station, 400, from_arm_side=True).items():
        X_WO = X_WS @ scene.X_SO(name)
        away = X_WO[:3, 3] - p_WA  # the origin of cube and bar is their middle
        away[2] = 0.0
        approach = (X_WO @ grasps.X_OG)[:, :3, 2]
        along = approach @ away / np.linalg.norm(away)
        assert len(grasps) == 400
        assert -1e-5 < along.min() < 0.05
        assert along.max() > 0.5 or name == "bar"  # which points at the arm
        from_down = np.degrees(np.arccos(np.clip(-approach[:, 2], -1.0, 1.0)))
        assert from_down.max() <= 75.0 + 1e-3


def test_a_side_that_no_hand_has(scene: Scene) -> None:
    with pytest.raises(
        InvalidInputError,
        match="'wsg_tabletop' has no arm",
    ):
        on_scene(scene, load_station("wsg_tabletop"), from_arm_side=True)
    station = load_station("panda_tabletop")
    X_WS = Pose(tuple(-np.array(scene.instance("left").X_SO.translation)))
    below = dataclasses.replace(station, document=dataclasses.replace(station.document, X_WS=X_WS))
    with pytest.raises(InvalidInputError, match="'left' is right above the base of the arm"):
        on_scene(scene, below, from_arm_side=True)


def test_settings_reach_the_sampler(scene: Scene, station: Station) -> None:
    weights = {"bar": np.arange(12.0)}
    sampled = on_scene(
        scene,
        station,
        24,
        friction=0.3,
        approaches=2,
        standoffs=(0.0, 0.005),
        diverse=2,
        weights=weights,
    )
    told = sampled["bar"].provenance
    assert (told["friction"], told["approaches"], told["diverse"]) == (0.3, 2, 2)
    assert told["standoffs"] == [0.0, 0.005] and told["weights"] is not None
    assert sampled["left"].provenance["weights"] is None
    assert told["opening"] == list(station.hand.opening)
    assert len(sampled["bar"]) == 24


def test_standoffs_end_with_the_pads_of_the_hand(scene: Scene) -> None:
    """The Panda's end 9.5 mm beyond G (franka_ros); the WSG's are 20 mm long."""
    message = r"standoff 9.6 mm puts the contacts outside the finger pads; give -9 to 9.5 mm"
    with pytest.raises(InvalidInputError, match=message):
        on_scene(scene, load_station("panda_tabletop"), standoffs=(0.0096,))
    assert on_scene(scene, load_station("wsg_tabletop"), standoffs=(0.0096,))
    with pytest.raises(InvalidInputError, match="outside the finger pads"):
        on_scene(scene, load_station("wsg_tabletop"), standoffs=(0.03,))


def test_what_does_not_fit(scene: Scene, station: Station) -> None:
    library, settings = scene.library, SamplingSettings()
    with pytest.raises(UnknownNameError, match=r"'three' has no free instance 'lef'; .*'left'"):
        on_scene(scene, station, only=["lef"])
    with pytest.raises(UnknownNameError, match="weights: the scene does not have object 'cub'"):
        on_scene(scene, station, weights={"cub": np.ones(12)})
    with pytest.raises(InvalidInputError, match=r"the mesh has 12 faces, give \(12,\)"):
        on_scene(scene, station, weights={"cube": np.ones(3)})
    with pytest.raises(InvalidInputError, match="grasps per object is 0"):
        sample_library(library, station, 0, 0, settings)
    with pytest.raises(UnknownNameError, match="library 'shapes' has no object 'cub'"):
        sample_library(library, station, 5, 0, settings, ["cub"])
    for limits in ({"approach_angle_deg": 75.0}, {"from_arm_side": True}):
        with pytest.raises(InvalidInputError, match="are in no scene"):
            sample_library(library, station, 5, 0, SamplingSettings(**limits))


# --- the hand's own body --------------------------------------------------------------------------


@pytest.mark.thorough
def test_clear_grasps_of_a_scene_touch_nothing_by_drakes_own_query(station: Station) -> None:
    scene = load_scene("tabletop_six")
    names = ["mug", "screwdriver"]
    clear = on_scene(scene, station, 25, only=names, blind=False)
    screen = HandClearance(build_station_diagram(scene, station, robot="hand"))
    for name, grasps in clear.items():
        X_WO = station.document.X_WS.matrix() @ scene.X_SO(name)
        assert len(grasps) == 25 < grasps.provenance["tried"]
        for X_OG in grasps.X_OG:
            assert max(screen.touched(X_WO @ X_OG).values(), default=0.0) < 1e-6
    blind = on_scene(scene, station, 400, only=["mug"])["mug"]
    expected = [i for i in clear["mug"].id if i in set(blind.id)]
    assert expected == clear["mug"].id[: len(expected)].tolist() and len(expected) > 10


def test_clear_grasps_of_a_library_touch_nothing_of_the_object(station: Station) -> None:
    library, settings = load_library("household"), SamplingSettings()
    ((_, grasps),) = sample_library(library, station, 40, 0, settings, ["can"])
    screen = hand_clearance_alone(library, "can", station)
    assert len(grasps) == 40 < grasps.provenance["tried"]
    for X_OG in grasps.X_OG:
        assert max(screen.touched(X_OG).values(), default=0.0) < 1e-6
    assert (grasps.X_OG[:, 2, 2] > 0.3).any()  # from below, where a scene has the table


# --- one set --------------------------------------------------------------------------------------


def test_a_set_says_how_it_was_made(scene: Scene, station: Station) -> None:
    settings = SamplingSettings(blind=True, diverse=2, weights={"bar": np.ones(12)})
    sampled = dict(sample_on_scene(scene, station, 10, 5, settings))
    grasps = sampled_set(sampled, scene.library, scene, station, 10, 5, settings)
    assert grasps.column("instance").tolist() == [i for i in sampled for _ in range(10)]
    told = grasps.provenance
    assert told["scene"] == str(scene.path) and told["content"]["scene"] == scene.content
    assert (told["n"], told["seed"], told["settings"]["diverse"]) == (10, 5, 2)
    assert told["content"]["objects"] == {"cube": "build of cube", "bar": "build of bar"}
    assert told["parts"]["bar"]["weights"] and told["versions"]["burg_drake"]
    plain = BLIND
    parts = dict(sample_library(scene.library, station, 10, 5, plain))
    of_library = sampled_set(parts, scene.library, None, station, 10, 5, plain)
    assert of_library.provenance["library"] == str(scene.library.root)
    assert "instance" not in of_library.columns
