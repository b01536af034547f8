"""A trial in a world of its target alone ends as one with all objects, and meets whom it meets."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from trial_world import CENTRE, QUICK, make_station

from burg_drake.core.grasps.outcome import Outcome
from burg_drake.scene.document.scene import Scene
from burg_drake.simulation.trials.hand_trial import HandTrial

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
