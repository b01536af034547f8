"""Engines: named presets of the simulator, its time step and its contact model."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar, Literal

from burg_drake.core import (
    InvalidInputError,
    Ranges,
    UnknownNameError,
    quote_value,
    require_ranges,
    suggest_names,
)


@dataclass(frozen=True, kw_only=True)
class Engine:
    """How trials are simulated.

    With `lagged`, friction on sliding objects is 2 % too high at 2 ms and 10 % too high at 5 ms.
    `sap` is wrong on marginal grasps. Drake's own stiction tolerance of 1e-4 m/s lets a box that
    hangs 20 mm off its centre tilt by 0.9 degrees in a trial at 1 ms, 1e-5 by 0.2, at about the
    same cost.

    Attributes:
        name: name of the preset.
        simulator: physics engine. The settings below are Drake's, except `time_step` and
            `whole_trial`.
        time_step: time step [s].
        contact_approximation: Drake's approximation of contact. `lagged` has correct friction
            limits within a few per cent at steps of 1 to 10 ms; `sap` does not.
        contact_model: contact of surfaces (hydroelastic) where the geometry allows it, or of points
            only.
        contact_surface: polygons are faster than triangles, and as accurate.
        stiction_tolerance: largest speed at which bodies creep that friction holds [m/s].
        whole_trial: whether every trial is simulated to its end. Otherwise it ends as soon as its
            outcome is decided.
        parallel: whether many trials are simulated at once, on a graphics card.
    """

    WRITTEN_WHOLE: ClassVar[bool] = True

    RANGES: ClassVar[Ranges] = {"time_step": (1e-4, 0.02), "stiction_tolerance": (1e-9, 1.0)}
    """With longer steps contact is wrong; shorter ones, a tenth of the reference's, take hours."""

    name: str
    time_step: float
    simulator: Literal["drake", "mujoco"] = "drake"
    contact_approximation: Literal["lagged", "similar", "sap"] = "lagged"
    contact_model: Literal["hydroelastic_with_fallback", "point"] = "hydroelastic_with_fallback"
    contact_surface: Literal["polygon", "triangle"] = "polygon"
    stiction_tolerance: float = 1e-5
    whole_trial: bool = False
    parallel: bool = False

    def __post_init__(self) -> None:
        require_ranges(self, f"engine {quote_value(self.name)}")

    @property
    def friction_creeps(self) -> bool:
        """Whether a load held by friction creeps at a constant speed, as with Drake's viscous
        friction. In other engines a moving load may be about to slip."""
        return self.simulator == "drake"

    @property
    def packages(self) -> dict[str, str]:
        """Additional packages that affect its results: their names in files and their installed
        names."""
        if self.parallel:
            return {"mujoco": "mujoco", "mujoco_warp": "mujoco-warp", "warp": "warp-lang"}
        return {} if self.simulator == "drake" else {self.simulator: self.simulator}

    @property
    def serial(self) -> Engine:
        """The engine of the same physics that simulates trials one by one, on the CPU; it itself,
        unless it is parallel."""
        if not self.parallel:
            return self
        return replace(self, name=self.name.removesuffix("-gpu"), parallel=False)


ENGINES = {
    engine.name: engine
    for engine in (
        Engine(name="reference", time_step=0.001, whole_trial=True),
        Engine(name="standard", time_step=0.002),
        Engine(name="screening", time_step=0.005),
        Engine(name="mujoco", simulator="mujoco", time_step=0.001),
        Engine(name="mujoco-gpu", simulator="mujoco", time_step=0.001, parallel=True),
    )
}
"""Presets: `reference`, `standard`, `screening` (Drake), `mujoco`, which is independent, and
`mujoco-gpu`, the same for many trials at once."""
DRAKE_ENGINES = tuple(name for name, engine in ENGINES.items() if engine.simulator == "drake")
"""Names of the presets that step Drake diagrams."""


DEFAULT_ENGINE = "standard"  # Name of the preset.


def as_drake_engine(engine: Engine | str) -> Engine:
    """As `as_engine`, but accepts only Drake engines.

    Raises:
        UnknownNameError: no such preset.
        InvalidInputError: the engine is not Drake.
    """
    found = as_engine(engine)
    if found.simulator != "drake":
        raise InvalidInputError(
            f"engine {quote_value(found.name)} is {found.simulator}, which simulates the hand"
            " alone and nothing else; this needs an engine of Drake: "
            f"{', '.join(DRAKE_ENGINES)}"
        )
    return found


def as_engine(engine: Engine | str) -> Engine:
    """Returns an engine unchanged, or a preset by its name.

    Raises:
        UnknownNameError: no such preset.
    """
    if isinstance(engine, Engine):
        return engine
    if engine not in ENGINES:
        raise UnknownNameError(
            f"engine {engine!r} does not exist; {suggest_names(str(engine), ENGINES)}"
        )
    return ENGINES[engine]
