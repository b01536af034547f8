"""Presets of the time stepping."""

from __future__ import annotations

import pytest

from burg_drake.core.errors import InvalidInputError, UnknownNameError
from burg_drake.station.document.engine import ENGINES, Engine, engine_preset


def test_presets_go_by_their_own_names_and_get_coarser() -> None:
    assert list(ENGINES) == [engine.name for engine in ENGINES.values()]
    steps = [engine_preset(name).time_step for name in ("reference", "standard", "screening")]
    assert steps == sorted(steps) and len(set(steps)) == 3
    assert {engine.contact_approximation for engine in ENGINES.values()} == {"lagged"}


def test_unknown_preset() -> None:
    with pytest.raises(UnknownNameError) as error:
        engine_preset("standart")
    assert str(error.value) == (
        "engine 'standart' does not exist; did you mean 'standard'? Known: reference, screening,"
        " standard"
    )


@pytest.mark.parametrize("step", [0.0, -0.001, 0.05, float("nan")])
def test_bad_step(step: float) -> None:
    with pytest.raises(InvalidInputError, match=r"time_step of engine 'mine' is .* 0.0001 to 0.02"):
        Engine(name="mine", time_step=step)
