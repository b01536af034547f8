"""How simulated time is stepped, as named presets; the preset is stored with every result."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Literal

from burg_drake.core import UnknownNameError, nearest, quoted
from burg_drake.core.documents import require_ranges

RANGES = {"time_step": (1e-4, 0.02), "stiction_tolerance": (1e-9, 1.0)}
"""With longer steps contact is wrong; shorter ones, a tenth of the reference's, take hours."""


@dataclass(frozen=True, kw_only=True)
class Engine:
    """Settings of Drake's discrete contact solver.

    Attributes:
        name: name of the preset.
        time_step: discrete step of the plant [s].
        contact_approximation: Drake's approximation of the contact problem. With `lagged`
            the pads hold up to Coulomb's limit, within a few per cent, at every step from 1 to 10
            ms; `sap` is wrong on marginal grasps. What slides over the table is braked 2 % too
            hard at 2 ms and 10 % at 5 ms.
        contact_model: hydroelastic where geometry allows it, else point contact.
        stiction_tolerance: speed at which friction that sticks creeps at most [m/s]. Drake's own
            1e-4 lets a box that hangs 20 mm off its centre tilt by 0.9 degrees in a trial at 1 ms,
            1e-5 by 0.2, at about the same cost.
        contact_surface: polygons are faster than triangles and as accurate here.
        whole_trial: simulate every trial to its end. Otherwise it ends as soon as its outcome is
            decided: the target is held without moving, touched by nothing but the hand, and there
            is nothing in the hand's way up.
    """

    WRITTEN_WHOLE: ClassVar[bool] = True

    name: str
    time_step: float
    contact_approximation: Literal["lagged", "similar", "sap"] = "lagged"
    contact_model: Literal["hydroelastic_with_fallback", "point"] = "hydroelastic_with_fallback"
    contact_surface: Literal["polygon", "triangle"] = "polygon"
    stiction_tolerance: float = 1e-5
    whole_trial: bool = False

    def __post_init__(self) -> None:
        require_ranges(self, RANGES, f"engine {quoted(self.name)}")


ENGINES = {
    engine.name: engine
    for engine in (
        Engine(name="reference", time_step=0.001, whole_trial=True),
        Engine(name="standard", time_step=0.002),
        Engine(name="screening", time_step=0.005),
    )
}
"""Presets by name: `reference` for truth, `standard` for results, `screening` for a first look."""


DEFAULT_ENGINE = "standard"


def as_engine(engine: Engine | str) -> Engine:
    """An engine as it is, or a preset by its name.

    Raises:
        UnknownNameError: no such preset.
    """
    if isinstance(engine, Engine):
        return engine
    if engine not in ENGINES:
        raise UnknownNameError(f"engine {engine!r} does not exist; {nearest(str(engine), ENGINES)}")
    return ENGINES[engine]
