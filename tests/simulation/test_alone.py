"""A trial in a world of its target alone ends as one with all objects, and meets whom it meets."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from pydrake.math import RigidTransform
from trial_world import CENTRE, QUICK, from_above, make_station

from burg_drake.core import InvalidInputError, Outcome, UnknownNameError
from burg_drake.scene import Scene, load_scene
from burg_drake.simulation import HandLiftClearance, HandTrial, grasp_trial
from burg_drake.station import build_station_diagram

MakeScene = Callable[..., Scene]


def test_the_target_is_alone_where_nothing_else_is_met(make_scene: MakeScene) -> None:
    scene = make_scene(("box", 0.3, 0.2, 0.0), ("post", 0.5, 0.2, 0.0))
    trial = HandTrial(scene, make_station(), engine=QUICK)
    complete = HandTrial(scene, make_station(), engine=QUICK, lock=False)
    alone, together = trial.run("box", CENTRE), complete.run("box", CENTRE)
    assert list(trial.world.diagram.free) == ["box"]
    assert list(trial.world.diagram.standing) == ["post"]
    assert list(complete.world.diagram.free) == ["box", "post"]
    assert alone.outcome is together.outcome is Outcome.LIFTED
    assert alone.displacements == {"post": 0.0}
    for name in ("slip", "tilt", "lift", "pad_force", "patch_area"):
        first, second = getattr(alone.margins, name), getattr(together.margins, name)
        assert first == pytest.approx(second, rel=1e-3, abs=1e-5), name


def test_a_target_that_something_leans_on_is_never_alone(make_scene: MakeScene) -> None:
    """The hulls of the two are less than a millimetre apart."""
    scene = make_scene(("box", 0.3, 0.2, 0.0), ("block", 0.3, 0.2 + 0.045 + 0.0255, 0.0))
    trial = HandTrial(scene, make_station(), engine=QUICK)
    trial.run("box", CENTRE)
    assert trial.world is trial.complete_world


def test_worlds_that_were_dropped_are_built_again_with_the_same_results(
    make_scene: MakeScene, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The one that was not used for longest is dropped, with the check of the way ahead in it."""
    monkeypatch.setattr(grasp_trial, "MAX_KEPT_WORLDS", 2)
    monkeypatch.setattr(grasp_trial, "MAX_KEPT_WORLDS", 2)
    names = ("box", "block", "can")
    scene = make_scene(*((name, 0.1 + 0.2 * k, 0.2, 0.0) for k, name in enumerate(names)))
    trial, built = HandTrial(scene, make_station(), engine=QUICK), []
    build = trial._build
    monkeypatch.setattr(trial, "_build", lambda alone: built.append(alone) or build(alone))
    found: dict[str, str] = {}
    for name in ("box", "block", "box", "can", "box", "block"):
        result = trial.run(name, from_above(scene.entry(name).upper[2] - 0.015))
        assert result.outcome is Outcome.LIFTED
        assert found.setdefault(name, repr(result)) == repr(result)
    assert built == ["box", "block", "can", "block"]
    assert trial.lift_clearance.cache_info().currsize == 2


def test_contact_at_points_meets_pieces_and_not_the_hull_of_a_surface() -> None:
    """Of a bowl, which is hollow."""
    scene = load_scene("tabletop_six")
    engine = replace(QUICK, contact_model="point")
    on_points = HandTrial(scene, "panda_tabletop", engine=engine).complete_world.diagram
    assert not on_points.parts.surfaces
    on_patches = HandTrial(scene, "panda_tabletop", engine=QUICK).complete_world.diagram
    assert len(on_patches.parts.surfaces) == 5


def test_what_cannot_be_alone_is_refused() -> None:
    with pytest.raises(
        UnknownNameError, match=r"'mugg' is not a free instance .*did you mean 'mug'"
    ):
        build_station_diagram("tabletop_six", "panda_tabletop", robot="hand", for_trials="mugg")
    with pytest.raises(InvalidInputError, match="welded objects are not simulated"):
        build_station_diagram(
            "tabletop_six", "panda_tabletop", robot="none", for_trials=True, weld_objects=True
        )


def test_the_way_up_is_free_of_where_others_were_in_an_earlier_trial(make_scene: MakeScene) -> None:
    scene = make_scene(("box", 0.3, 0.2, 0.0), ("post", 0.5, 0.2, 0.0))
    trial = HandTrial(scene, make_station(), engine=QUICK)
    X_WG, up = trial.X_WG("box", CENTRE), np.array([0.0, 0.0, 1.0])
    trial.run("box", CENTRE)
    alone, complete = trial.world, trial.complete_world
    assert alone is not complete
    clearance = HandLiftClearance(build_station_diagram(scene, make_station(), robot="hand"), "box")
    plant = complete.diagram.plant
    plant.SetFloatingBaseBodyPoseInWorldFrame(
        plant.GetMyMutableContextFromRoot(complete.context),
        plant.get_body(complete.diagram.free["post"]),
        RigidTransform([0.3, 0.2, 0.3]),
    )
    assert not clearance.is_free(complete, X_WG, 0.3, up)
    assert clearance.is_free(alone, X_WG, 0.3, up)
