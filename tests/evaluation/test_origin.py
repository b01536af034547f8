"""What every row tells about its run: whole, exact, and refused where it is not understood."""

from __future__ import annotations

import dataclasses
import math

import pytest

from burg_drake.core import InvalidInputError
from burg_drake.evaluation import TrialOrigin, engine_label, read_origin, settings_numbers
from burg_drake.simulation import TrialSettings
from burg_drake.station import ENGINES, Engine, GraspMotion

CUSTOM = Engine(
    name="mine",
    time_step=1 / 3000,
    contact_approximation="similar",
    contact_model="point",
    contact_surface="triangle",
    whole_trial=True,
)


def origin(engine: Engine) -> TrialOrigin:
    return TrialOrigin(
        scene="/a folder/scene, 1.yaml",
        scene_content="0123456789ab",
        station="panda_tabletop",
        station_content="ba9876543210",
        mode="arm",
        engine=engine,
        trial={"lift_height": 0.1 + 0.2, "disturbance": 1e-7},
        versions={"drake": "1.51.1", "platform": "Linux-6.1-x86_64"},
        seed=7,
        run="0a1b",
    )


def row(made: TrialOrigin) -> dict[str, object]:
    return {
        **made.cells(),
        "engine": engine_label(made.engine),
        "seed": made.seed,
        "run": made.run,
    }


@pytest.mark.parametrize("engine", [*ENGINES.values(), CUSTOM], ids=lambda engine: engine.name)
def test_cells_give_back_the_origin(engine: Engine) -> None:
    assert read_origin(row(origin(engine)), "here") == origin(engine)


def test_settings_are_those_of_the_trial_and_defaults_where_none_were_recorded() -> None:
    settings = origin(CUSTOM).settings()
    motion = GraspMotion(lift_height=0.1 + 0.2)
    assert settings == TrialSettings(
        motion=motion, disturbance=1e-7, tilt_limit=math.pi, slip_limit=math.inf
    )


@pytest.mark.parametrize("approach", [True, False])
def test_limits_and_approach_come_back_bit_for_bit(approach: bool) -> None:
    asked = TrialSettings(
        motion=GraspMotion(), tilt_limit=math.radians(7), slip_limit=1 / 300, approach=approach
    )
    for settings in (asked, dataclasses.replace(asked, tilt_limit=math.pi, slip_limit=math.inf)):
        there = dataclasses.replace(origin(CUSTOM), trial=settings_numbers(settings))
        assert read_origin(row(there), "here").settings() == settings


def test_the_motion_comes_back_bit_for_bit() -> None:
    motion = GraspMotion(
        standoff=0.07,
        retreat=1 / 30,
        lift_height=0.1 + 0.2,
        least_lift=0.02,
        lift_direction=(0.3, 0, 2),
    )
    there = dataclasses.replace(
        origin(CUSTOM), trial=settings_numbers(TrialSettings(motion=motion))
    )
    settings = read_origin(row(there), "here").settings()
    assert settings == TrialSettings(motion=motion)
    assert settings.motion is not None and settings.motion.lift_direction == (0.3, 0.0, 2.0)


@pytest.mark.parametrize(
    ("trial", "message"),
    [
        ({"lift_height": 0.1, "least_lift": 0.2}, "here: .*least_lift is 0.2 m, more than lift_he"),
        ({"lift_direction_1": 0.0}, "this release"),
        ({f"lift_direction_{k}": 0.0 for k in (1, 2, 3)}, "here: .*has length 0"),
    ],
)
def test_motions_that_no_hand_can_make(trial: dict[str, float], message: str) -> None:
    with pytest.raises(InvalidInputError, match=message):
        dataclasses.replace(origin(CUSTOM), trial=trial).settings("here")


def test_an_engine_that_only_shares_the_name_of_a_preset_is_marked() -> None:
    changed = dataclasses.replace(ENGINES["standard"], time_step=0.004)
    assert engine_label(ENGINES["standard"]) == "standard"
    assert engine_label(changed) == "standard (custom)"
    assert engine_label(CUSTOM) == "mine (custom)"
    back = read_origin(row(origin(changed)), "here").engine
    assert back == changed


@pytest.mark.parametrize(
    ("column", "text", "message"),
    [
        ("engine_settings", "time_step=0.002 warp=9", r"this"),
        ("engine_settings", "time_step=fast", "here, engine_settings: time_step: 'fast' is not a"),
        ("engine_settings", "time_step=0.002 contact_model=soft", "'soft' is not valid"),
        ("engine_settings", "time_step=0.5", "it must be 0.0001 to 0.02"),
        ("engine_settings", "", "key 'time_step' is missing"),
        ("trial_settings", "lift_height", "'lift_height' is not name=value"),
        (
            "trial_settings",
            "lift_height=high",
            "here: trial_settings: lift_height is 'high'; it must",
        ),
        ("engine", "warp", r"engine 'warp' is not a preset .*reference, .*called 'warp .custom.'"),
        ("engine", "reference", "contradict each other: the preset .* has time_step=0.001 whole_t"),
        ("engine_settings", "time_step=0.004", "'standard' and engine_settings contradict"),
    ],
)
def test_what_cannot_be_read_is_said(column: str, text: str, message: str) -> None:
    with pytest.raises(InvalidInputError, match=message):
        read_origin({**row(origin(ENGINES["standard"])), column: text}, "here")


@pytest.mark.parametrize(
    "trial", [{"poll": 0.0}, {"lift_time": -1.0}, {"hold_time": -0.5}, {"hold_time": 1e9}]
)
def test_settings_that_no_trial_can_have(trial: dict[str, float]) -> None:
    with pytest.raises(InvalidInputError, match=f"{next(iter(trial))} of a trial is"):
        dataclasses.replace(origin(CUSTOM), trial=trial).settings()


def test_a_trial_setting_of_another_release_is_refused() -> None:
    other = dataclasses.replace(origin(CUSTOM), trial={"spin": 1.0})
    with pytest.raises(InvalidInputError, match="this release"):
        other.settings()
