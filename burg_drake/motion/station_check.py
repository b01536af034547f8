"""Checks of a station and its arm: limits, home posture, span and reachability of the board."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from burg_drake.core import InvalidInputError, data_root
from burg_drake.motion.arm_collision import ArmCollision
from burg_drake.motion.arm_span import ArmSpan, unreachable_board, unreachable_objects
from burg_drake.motion.home_posture import HomeClearance, home_clearance, require_free_home
from burg_drake.motion.joint_limits import ArmLimits
from burg_drake.motion.numeric_ik import ArmKinematics
from burg_drake.motion.reachability import (
    ReachabilityMap,
    ReachabilitySettings,
    map_reachability,
    without_free_objects,
)
from burg_drake.objects import load_library
from burg_drake.scene import Board, Scene, SceneDocument, SceneLike, as_scene, placed_vertices
from burg_drake.station import (
    HandFigures,
    Station,
    StationDiagram,
    StationLike,
    as_station,
    build_station_diagram,
    check_hand,
    require_valid_scene,
    visible_board_share,
)


@dataclass(frozen=True, eq=False)
class ArmFigures:
    """Key figures of a station's arm.

    Attributes:
        joints: names, from base to hand.
        lower, upper, home: (n,) limits and home posture [rad or m].
        span: largest reach.
        clearance: clearance at home.
        reachability: reachability of the board.
    """

    joints: tuple[str, ...]
    lower: tuple[float, ...]
    upper: tuple[float, ...]
    home: tuple[float, ...]
    span: ArmSpan
    clearance: HomeClearance
    reachability: ReachabilityMap


@dataclass(frozen=True, eq=False)
class StationReport:
    """A station that can be used.

    Attributes:
        hand: key figures of the hand.
        arm: key figures of the arm; None without one.
        seen: share of the board that each camera sees.
        warnings: warnings to the station's author, a line each.
    """

    hand: HandFigures
    arm: ArmFigures | None
    seen: dict[str, float]
    warnings: tuple[str, ...]


def empty_scene(board: Board | None = None) -> Scene:
    """A scene with an empty board, A2 if None."""
    document = SceneDocument(name="empty_board", library="household", board=board or Board())
    return Scene(document, load_library("household"), data_root() / "scenes")


def inspect_station(
    station: StationLike,
    scene: SceneLike | None = None,
    *,
    settings: ReachabilitySettings | None = None,
) -> StationReport:
    """Runs all checks of a station.

    Args:
        station: the station.
        scene: the scene on it; an empty board if None.
        settings: settings of the reachability map.

    Raises:
        InvalidInputError: the station cannot be used; one line says why.
    """
    station = as_station(station)
    scene = None if scene is None else as_scene(scene)
    hand = check_hand(station.hand, station.hand_model, station.hand_path, station.packages)
    if scene is not None:
        require_valid_scene(scene, station)
    scene = scene or empty_scene()
    seen = {
        name: visible_board_share(camera, station, scene.board)
        for name, camera in station.document.cameras.items()
    }
    warnings = [
        f"camera {name!r} sees nothing of the board; change its X_WC"
        for name, share in seen.items()
        if share == 0.0
    ]
    if station.document.arm is None:
        return StationReport(hand, None, seen, tuple(warnings))
    diagram = build_station_diagram(scene, station, robot="arm", weld_objects=True)
    arm = _arm_figures(diagram, settings)
    warnings += _reach_warnings(arm, scene, station, settings)
    return StationReport(hand, arm, seen, tuple(warnings))


def usable_span(scene: Scene, station: Station) -> ArmSpan:
    """The span of a station's arm.

    Raises:
        InvalidInputError: the arm cannot be used; see `require_usable_arm`.
    """
    diagram = build_station_diagram(scene, station, robot="arm", weld_objects=True)
    return _require_usable(diagram, ArmKinematics.of(diagram))


def _require_usable(diagram: StationDiagram, kinematics: ArmKinematics) -> ArmSpan:
    """Returns the arm's span, or raises an error if the arm cannot be used."""
    scene, station = diagram.scene, diagram.station
    span = ArmSpan.of(kinematics, station)
    fault = unreachable_board(span, station, scene.board)
    if fault:
        raise InvalidInputError(fault)
    require_free_home(diagram, ArmCollision(diagram))
    ArmLimits.of(diagram, kinematics)  # required to time motions
    return span


def _arm_figures(diagram: StationDiagram, settings: ReachabilitySettings | None) -> ArmFigures:
    scene, station = diagram.scene, diagram.station
    assert station.document.arm is not None
    kinematics = ArmKinematics.of(diagram)
    span = _require_usable(diagram, kinematics)
    return ArmFigures(
        joints=tuple(joint.name() for joint in diagram.arm_joints),
        lower=tuple(kinematics.lower.tolist()),
        upper=tuple(kinematics.upper.tolist()),
        home=station.document.arm.home,
        span=span,
        clearance=home_clearance(diagram),
        reachability=map_reachability(scene, station, settings=settings),
    )


def _reach_warnings(
    arm: ArmFigures, scene: Scene, station: Station, settings: ReachabilitySettings | None
) -> list[str]:
    """Warnings about parts of the board and objects out of reach; an error if all of it is."""
    reached = arm.reachability.reached.any(axis=(0, 3))
    if not reached.any() and not _reaches_cleared(scene, station, settings):
        heights = " or ".join(f"{100 * h:g}" for h in arm.reachability.heights)
        raise InvalidInputError(
            f"{station.path}: no part of the board is within reach: {heights} cm above it, the arm"
            f" reaches no point in any of {len(arm.reachability.tilt)} hand orientations; change"
            " X_WS, arm.X_WA or the obstacles"
        )
    lines = []
    if not scene.instances and not reached.all():
        share = format_share(reached.mean())
        lines.append(f"the arm reaches only {share} of the board in any hand orientation")
    far = unreachable_objects(arm.span, scene, station)
    lines += far.values()
    lines += [
        f"above {name!r} and close around it, the arm reaches none of {len(arm.reachability.tilt)}"
        " hand orientations"
        for name in scene.instances
        if name not in far
        and _is_mapped(arm.reachability, scene, name)
        and not _is_near_reached(arm.reachability, scene, name)
    ]
    return lines


def _reaches_cleared(scene: Scene, station: Station, settings: ReachabilitySettings | None) -> bool:
    """Whether the arm reaches any part of the board without the objects."""
    if not scene.instances:
        return False
    cleared = map_reachability(without_free_objects(scene), station, settings=settings)
    return bool(cleared.reached.any())


def _is_mapped(reachability: ReachabilityMap, scene: Scene, name: str) -> bool:
    """Whether the map covers an instance: objects on furniture are above it."""
    return bool(placed_vertices(scene, name)[:, 2].min() < max(reachability.heights))


def _is_near_reached(reachability: ReachabilityMap, scene: Scene, name: str) -> bool:
    """Whether any orientation is reached over the rectangle around an instance, at any height."""
    p_SV = placed_vertices(scene, name)
    within = [
        (p_SV[:, k].min() - extent <= values) & (values <= p_SV[:, k].max() + extent)
        for k, (values, extent) in enumerate(
            zip((reachability.x, reachability.y), reachability.cell, strict=True)
        )
    ]
    return bool(reachability.reached[:, within[1]][:, :, within[0]].any())


def format_share(share: float) -> str:
    """A share as a whole percentage; 100 % only for 1."""
    return f"{np.floor(100.0 * share):.0f} %" if share < 1.0 else "100 %"
