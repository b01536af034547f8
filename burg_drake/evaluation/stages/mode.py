"""What a run asks about a grasp beside the clearance of the hand: its mode."""

from __future__ import annotations

from burg_drake.core import InvalidInputError
from burg_drake.core.grasps import MODES, Mode
from burg_drake.scene.document import Scene
from burg_drake.station.document import DRAKE_ENGINES, Engine, Station


def mode_for(station: Station, asked: Mode | None = None) -> Mode:
    """The mode of a run.

    Args:
        station: where it takes place.
        asked: what the user wants; None for `reach` where there is an arm, else `hand`.

    Raises:
        InvalidInputError: there is no such mode, or it needs an arm that the station lacks.
    """
    has_arm = station.document.arm is not None
    if asked is None:
        return "reach" if has_arm else "hand"
    if asked not in MODES:
        raise InvalidInputError(f"mode is {asked!r}; give {', '.join(MODES[:-1])} or {MODES[-1]}")
    if asked != "hand" and not has_arm:
        raise InvalidInputError(
            f"mode {asked!r} needs an arm, which station {station.name!r} lacks; give mode 'hand'"
        )
    return asked


def require_engine_for(engine: Engine, mode: Mode) -> None:
    """Refuses an engine that cannot run the trials of a mode.

    Raises:
        InvalidInputError: it has no arm.
        MissingDependencyError: it is not installed.
    """
    if engine.simulator == "drake":
        return
    if mode == "arm":
        raise InvalidInputError(
            f"mode arm needs an engine of Drake ({', '.join(DRAKE_ENGINES)}); with engine"
            f" {engine.name} use mode reach, in which the hand alone executes what the"
            " arm can reach"
        ).about("mode")
    from burg_drake.simulation.mujoco import require_mujoco

    require_mujoco()


def require_scene_for(engine: Engine, scene: Scene, station: Station) -> None:
    """Refuses objects and hands that an engine cannot have.

    Raises:
        InvalidInputError: an object has no convex pieces, or the hand's pads are not flat; see
            `simulation.mujoco`.
    """
    if engine.simulator != "drake":
        from burg_drake.simulation.mujoco import MujocoTrial

        _ = MujocoTrial(scene, station, engine=engine).complete_world
