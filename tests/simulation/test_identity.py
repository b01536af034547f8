"""The same trial gives the same bits, whatever was executed before it, and in any process."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path

import numpy as np
import pytest
from trial_world import QUICK, from_above, make_station

from burg_drake.core import Outcome, Pose
from burg_drake.scene import Instance, Scene
from burg_drake.simulation import Execution, HandTrial, TrialResult

GRASPS = {
    "lifted": ("box", from_above(0.065), None, None),
    "slipped": ("box", from_above(0.066, y=0.01, yaw=0.1), 0.02, None),
    "heavier": ("box", from_above(0.07, x=-0.005), None, 0.9),
    "pushes the block": ("box", from_above(0.065, x=0.006), None, None),
    "carries the block": ("carrier", from_above(0.05, y=-0.03), 0.8, 0.25),
    "beside everything": ("carrier", from_above(0.40), None, None),
    "collides": ("carrier", from_above(0.05, x=0.03), None, None),
    "slippery ball": ("ball", from_above(0.03, y=0.024), 0.05, None),
}
"""Target, grasp, friction and mass."""


def exact(result: TrialResult) -> dict[str, str]:
    """All that a trial returns, to the bit."""
    moved = {f"moved {name}": value for name, value in result.displacements.items()}
    numbers = asdict(result.margins) | moved
    words = {"outcome": str(result.outcome), "blocker": result.blocker, "reason": result.reason}
    return words | {name: float(value).hex() for name, value in numbers.items()}


def execute(trial: HandTrial, name: str) -> dict[str, str]:
    target, X_OG, friction, mass = GRASPS[name]
    return exact(trial.run(target, X_OG, friction=friction, mass=mass))


@pytest.fixture(scope="module")
def scene(make_scene: Callable[..., Scene]) -> Scene:
    """Three targets; a block beside the box, lower than the fingers, and one on the carrier."""
    return make_scene(
        ("box", 0.15, 0.2, 0.0),
        ("ball", 0.3, 0.2, 0.0),
        Instance(name="carrier", object="box", X_SO=Pose((0.5, 0.2, 0.0))),
        Instance(name="beside", object="block", X_SO=Pose((0.207, 0.21, 0.0))),
        Instance(name="on_top", object="block", X_SO=Pose((0.5, 0.235, 0.08))),
    )


@pytest.fixture(scope="module")
def alone(scene: Scene) -> dict[str, dict[str, str]]:
    """Each trial by itself, in a diagram of its own."""
    return {name: execute(HandTrial(scene, make_station(), engine=QUICK), name) for name in GRASPS}


def test_trials_differ_from_each_other(alone) -> None:
    outcomes = {name: result["outcome"] for name, result in alone.items()}
    assert len({tuple(result.items()) for result in alone.values()}) == len(GRASPS)
    assert len(set(outcomes.values())) >= 4, outcomes
    assert float.fromhex(alone["pushes the block"]["moved beside"]) > 0.001
    assert float.fromhex(alone["carries the block"]["moved on_top"]) > 0.1


@pytest.mark.thorough
def test_in_a_batch(scene: Scene, alone) -> None:
    """After each other and after itself; backwards they are executed in another process, below."""
    trial = HandTrial(scene, make_station(), engine=QUICK)
    for name in (*GRASPS, [*GRASPS][-1]):
        assert execute(trial, name) == alone[name], name


@pytest.mark.thorough
def test_after_a_trial_that_failed(scene: Scene, alone, monkeypatch: pytest.MonkeyPatch) -> None:
    """The state turns into NaN in the middle of a trial, after which no more can be told."""
    trial = HandTrial(scene, make_station(), engine=QUICK)
    advance = Execution.advance

    def corrupt(execution: Execution) -> float:
        now = advance(execution)
        if now > 0.03:
            state = trial.context.get_mutable_discrete_state().get_mutable_vector()
            state.SetFromVector(np.full(state.size(), np.nan))
        return now

    with monkeypatch.context() as patch:
        patch.setattr(Execution, "advance", corrupt)
        failed = trial.run("box", from_above(0.065))
    assert failed.outcome is Outcome.SIMULATION_FAILED
    assert failed.reason
    for name in ("carries the block", "lifted"):
        assert execute(trial, name) == alone[name], name


def test_after_a_trial_that_was_left_in_the_middle(scene: Scene, alone) -> None:
    """With the hand on its way up, neighbours free and other coefficients."""
    trial = HandTrial(scene, make_station(), engine=QUICK)
    execution = trial.begin(
        "carrier", trial.X_WG("carrier", from_above(0.05, y=-0.03)), friction=0.9, mass=0.4
    )
    assert execution.close() is None
    trial.world.command("lift", np.array([0.0, 0.2]))
    execution.advance()
    for name in ("carries the block", "heavier"):
        assert execute(trial, name) == alone[name], name


PROGRAM = """
import json, sys
sys.path[:] = json.loads(sys.argv[1])
from test_identity import GRASPS, execute, load_scene_trial
trial = load_scene_trial(sys.argv[2])
print(json.dumps({name: execute(trial, name) for name in list(GRASPS)[::-2]}))
"""


def load_scene_trial(path: str) -> HandTrial:
    """For another process."""
    from burg_drake.scene import load_scene

    return HandTrial(load_scene(path), make_station(), engine=QUICK)


def test_in_another_process_backwards(scene: Scene, alone) -> None:
    path = json.dumps([str(Path(__file__).parent), *sys.path])
    run = subprocess.run(
        [sys.executable, "-c", PROGRAM, path, str(scene.path)],
        check=True, capture_output=True, text=True,
    )  # fmt: skip
    assert json.loads(run.stdout) == {name: alone[name] for name in list(GRASPS)[::-2]}
