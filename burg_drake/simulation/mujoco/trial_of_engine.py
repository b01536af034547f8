"""The trial of the hand alone that an engine runs."""

from __future__ import annotations

from typing import Any

from burg_drake.scene.document import SceneLike
from burg_drake.simulation.mujoco.mujoco_trial import MujocoTrial
from burg_drake.simulation.trials import HandTrial
from burg_drake.station.document import Engine, StationLike, as_engine


def hand_trial_of(
    scene: SceneLike, station: StationLike, engine: Engine | str, **more: Any
) -> HandTrial | MujocoTrial:
    """Builds the trial of an engine; see `HandTrial` and `MujocoTrial`.

    Args:
        scene, station: as they have them.
        engine: what steps it.
        more: `settings`, `motion`, `lock`.
    """
    engine = as_engine(engine)
    kind = HandTrial if engine.simulator == "drake" else MujocoTrial
    return kind(scene, station, engine=engine, **more)
