"""Comparing a trial with its record: the last bit counts, and a rounded table is recognised."""

from __future__ import annotations

import dataclasses
import importlib.metadata
import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest

from burg_drake.core import InvalidInputError, Outcome, Stage, Verdict, software_versions
from burg_drake.evaluation import (
    ReplayEngine,
    TrialOrigin,
    comparison,
    differences,
    replay_engine,
)
from burg_drake.station import ENGINES

VERDICT = Verdict(
    Outcome.LIFTED,
    Stage.EXECUTED,
    margins={"overlap": 0.0, "slip": 0.1 + 0.2, "tilt": math.nan, "others_turned": 0.1},
    displacements={"mug": 0.0, "bowl": 1 / 3},
    turned={"mug": 0.0, "bowl": 0.1},
    q_grasp=(1.0,),
    cpu={Stage.CLEAR: 1.0},
)
ORIGIN = TrialOrigin(
    scene="s",
    scene_content="0",
    station="t",
    station_content="1",
    mode="reach",
    engine=ENGINES["standard"],
    trial={},
    versions=software_versions(),
)


def compared(found: Sequence[Any], origin: TrialOrigin = ORIGIN) -> list[str]:
    return comparison(found, origin, ReplayEngine(origin.engine))


def changed(**margins: float) -> Verdict:
    return dataclasses.replace(VERDICT, margins={**VERDICT.margins, **margins})


def test_the_same_bits_are_as_recorded() -> None:
    again = dataclasses.replace(changed(slip=0.1 + 0.2), cpu={}, q_grasp=())
    assert differences(VERDICT, again) == []
    assert compared([]) == ["as recorded"]
    # a table tells margins that were not measured as NaN, a journal does not tell them
    assert differences(changed(lift=math.nan), VERDICT) == []


def test_a_margin_that_was_not_measured_then_is_no_difference() -> None:
    assert differences(VERDICT, changed(clearance=0.003)) == []
    found = differences(changed(clearance=0.002), changed(clearance=0.003))
    assert [d.name for d in found] == ["clearance"]
    assert [d.name for d in differences(changed(clearance=0.002), VERDICT)] == ["clearance"]


def test_motions_of_centres_of_mass_are_not_held_against_those_of_farthest_points() -> None:
    """As releases recorded them that did not measure rotations."""
    old = dataclasses.replace(
        changed(others_moved=1 / 3, pushed=0.1, others_turned=math.nan), turned={}
    )
    now = dataclasses.replace(
        changed(others_moved=0.4, others_turned=0.2, pushed=0.2),
        displacements={"mug": 0.1, "bowl": 0.4},
        toppled="bowl",
    )
    assert differences(old, now) == []
    (found,) = differences(old, dataclasses.replace(now, blocker="mug"))
    assert found.name == "blocker"
    names = {difference.name for difference in differences(VERDICT, now)}
    assert names >= {"toppled", "others_moved", "others_turned", "pushed", "moved mug"}


def test_the_last_bit_counts() -> None:
    found = differences(VERDICT, changed(slip=np.nextafter(0.1 + 0.2, 1.0)))
    assert [difference.name for difference in found] == ["slip"]
    assert found[0].rounding
    assert compared(found) == [
        "as recorded, except for the last digits of slip, which the table rounds"
    ]
    assert [d.name for d in differences(VERDICT, changed(overlap=-0.0))] == ["overlap"]


def test_15_digits_are_rounding_and_14_are_not() -> None:
    value = 1.2345678901234567e-3
    for digits, rounding in ((15, True), (13, False)):
        recorded = changed(slip=float(f"{value:.{digits}g}"))
        (found,) = differences(recorded, changed(slip=value))
        assert found.rounding is rounding


def test_everything_that_differs_is_listed() -> None:
    moved = {"mug": 0.25, "bowl": 1 / 3}
    other = dataclasses.replace(
        changed(slip=0.4, tilt=0.5),
        outcome=Outcome.LIFTED_DISTURBED,
        blocker="box",
        displacements=moved,
    )
    assert compared(differences(VERDICT, other)) == [
        "differs from what was recorded",
        "outcome: recorded 'lifted', now 'lifted_disturbed'",
        "blocker: recorded '', now 'box'",
        f"slip: recorded {0.1 + 0.2!r}, now 0.4",
        "tilt: recorded nan, now 0.5",
        "moved mug: recorded 0.0, now 0.25",
    ]


def test_other_versions_are_named() -> None:
    origin = dataclasses.replace(ORIGIN, versions={**ORIGIN.versions, "drake": "1.2.3"})
    found = differences(VERDICT, changed(slip=0.4))
    first, *_ = compared(found, origin)
    assert first == (
        f"differs from what was recorded (with drake 1.2.3, now {software_versions()['drake']})"
    )
    assert compared([], origin) == ["as recorded"]


def test_a_version_of_the_engine_is_named_if_it_executed_the_trial() -> None:
    pytest.importorskip("mujoco")
    origin = dataclasses.replace(ORIGIN, versions={**ORIGIN.versions, "mujoco": "1.2.3"})
    found = differences(VERDICT, changed(slip=0.4))
    assert compared(found, origin)[0] == "differs from what was recorded"
    now = importlib.metadata.version("mujoco")
    first, *_ = compared(found, origin.judged_by("mujoco"))
    assert first == f"differs from what was recorded (with mujoco 1.2.3, now {now})"


# --- engines with parallel trials -----------------------------------------------------------------

H100 = "NVIDIA H100 (driver supports CUDA 12.8, Warp is built with CUDA 12.9)"


def on_device(device: str) -> TrialOrigin:
    """Origin of trials of a parallel engine, as a table records it."""
    versions = {**software_versions(), "device": device.replace(" ", "_")} if device else {}
    return dataclasses.replace(ORIGIN, engine=ENGINES["mujoco-gpu"], versions=versions)


@pytest.fixture
def devices(monkeypatch: pytest.MonkeyPatch) -> dict[str | None, str]:
    """Descriptions of the devices of this machine: of all cards (None), and of others by name."""
    found: dict[str | None, str] = {"cpu": "cpu"}

    def find(name: str | None) -> list[str]:
        if name not in found:
            raise InvalidInputError("there is none here")
        return [found[name]]

    monkeypatch.setattr("burg_drake.evaluation.replay.find_devices", find)
    monkeypatch.setattr("burg_drake.evaluation.replay.describe_devices", lambda one: one[0])
    return found


def test_a_trial_of_a_card_is_judged_by_a_card_if_there_is_one(
    devices: dict[str | None, str],
) -> None:
    devices[None] = H100
    for recorded in (H100, "", f"{H100}; cpu"):  # "": by a release that did not record it
        engine = replay_engine(on_device(recorded))
        assert engine == ReplayEngine(ENGINES["mujoco-gpu"], None, H100)
        assert str(engine) == f"engine mujoco-gpu on {H100}"
        assert engine.repeats_bits(on_device(recorded)) == (recorded == H100)
    del devices[None]
    engine = replay_engine(on_device(H100))
    assert engine == ReplayEngine(ENGINES["mujoco-gpu"].serial)
    assert str(engine) == "engine mujoco on the CPU" and not engine.repeats_bits(on_device(H100))


def test_a_trial_of_warps_cpu_device_is_judged_there(devices: dict[str | None, str]) -> None:
    """Even if there is a card."""
    devices[None] = H100
    engine = replay_engine(on_device("cpu"))
    assert engine == ReplayEngine(ENGINES["mujoco-gpu"], "cpu", "cpu")
    assert str(engine) == "engine mujoco-gpu on Warp's CPU device"
    assert engine.repeats_bits(on_device("cpu"))
    del devices["cpu"]
    assert replay_engine(on_device("cpu")).engine == ENGINES["mujoco-gpu"].serial


def test_a_trial_of_another_engine_is_judged_by_it() -> None:
    assert replay_engine(ORIGIN) == ReplayEngine(ENGINES["standard"])
    assert replay_engine(ORIGIN).repeats_bits(ORIGIN)


def test_on_the_same_device_bits_count_and_on_another_one_outcomes(
    devices: dict[str | None, str],
) -> None:
    devices[None] = H100
    found = differences(VERDICT, changed(slip=0.4))
    same = on_device(H100)
    assert comparison(found, same, replay_engine(same))[0] == "differs from what was recorded"
    other = on_device("NVIDIA A100")
    first, *_ = comparison(found, other, replay_engine(other))
    assert first == f"as recorded, but for what engine mujoco-gpu on {H100} rounds in another way"
    lost = differences(VERDICT, dataclasses.replace(VERDICT, outcome=Outcome.SLIPPED))
    first, *_ = comparison(lost, other, replay_engine(other))
    assert first == f"differs from what was recorded (with device NVIDIA_A100, now {H100})"
