"""Presets of the time stepping."""

from __future__ import annotations

import pytest

from burg_drake.core import InvalidInputError, UnknownNameError
from burg_drake.station import ENGINES, Engine, as_engine, build_station_diagram


def test_presets_go_by_their_own_names_and_get_coarser() -> None:
    assert list(ENGINES) == [engine.name for engine in ENGINES.values()]
    steps = [as_engine(name).time_step for name in ("reference", "standard", "screening")]
    assert steps == sorted(steps) and len(set(steps)) == 3
    assert {engine.contact_approximation for engine in ENGINES.values()} == {"lagged"}


def test_an_engine_goes_by_its_name_wherever_one_is_taken() -> None:
    own = Engine(name="mine", time_step=0.004)
    assert as_engine(own) is own
    built = build_station_diagram(
        "tabletop_six", "panda_tabletop", robot="none", engine="screening"
    )
    assert built.engine is ENGINES["screening"]


def test_unknown_preset() -> None:
    with pytest.raises(UnknownNameError) as error:
        as_engine("standart")
    assert str(error.value) == (
        "engine 'standart' does not exist; did you mean 'standard'? Known: mujoco, mujoco-gpu,"
        " reference, screening, standard"
    )


@pytest.mark.parametrize("step", [0.0, -0.001, 0.05, float("nan")])
def test_bad_step(step: float) -> None:
    with pytest.raises(InvalidInputError, match=r"time_step of engine 'mine' is .* 0.0001 to 0.02"):
        Engine(name="mine", time_step=step)
