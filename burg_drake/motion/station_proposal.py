"""Proposes a station for a scene: a built-in one that fits, or one laid out around the scene."""

from __future__ import annotations

import contextlib
import itertools
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from burg_drake.core import (
    Array,
    InvalidInputError,
    Pose,
    builtin_names,
    make_name,
    transform_points,
)
from burg_drake.motion.reachability import ReachabilitySettings
from burg_drake.motion.station_check import inspect_station
from burg_drake.motion.usable_arm import require_usable_arm
from burg_drake.scene import TOUCH_TOLERANCE, Scene, placed_vertices
from burg_drake.station import (
    Obstacle,
    Station,
    StationDocument,
    Table,
    load_station,
    require_valid_scene,
)

BOARD_CHECK_HEIGHTS = ReachabilitySettings().heights
"""Metres above the board at which the arm's reach is checked."""


@dataclass(frozen=True, eq=False)
class StationProposal:
    """A station for a scene.

    Attributes:
        document: the station.
        source: name of the built-in station; empty for a new one.
        misfits: why the built-in stations tried before do not fit, by name.
        warnings: warnings from the check of the station.
    """

    document: StationDocument
    source: str
    misfits: dict[str, str]
    warnings: tuple[str, ...] = ()


def propose_station(scene: Scene, path: Path) -> StationProposal:
    """A station that the scene fits on: a built-in one with an arm, else a new one.

    Args:
        scene: the scene.
        path: future file of the station; a new one is named after it.

    Returns:
        The station; it passes `inspect_station`. Without a place for an arm, it has no arm.

    Raises:
        InvalidInputError: the scene fits no station, for example because its objects overlap.
    """
    fitting, misfits = find_built_in(scene)
    if fitting is not None:
        document = replace(fitting.document, name=make_name(path.stem))
        return StationProposal(document, fitting.name, misfits)
    bare = _without_arm(scene, path)
    found: list[tuple[Station, tuple[str, ...]]] = []
    settings = _coarse_map(scene)
    # Each place of an arm takes some seconds to check.
    for station in itertools.islice(_with_arms(scene, bare), 4):
        with contextlib.suppress(InvalidInputError):
            report = inspect_station(station, scene, settings=settings)
            assert report.arm is not None
            if report.arm.reachability.reached[: len(BOARD_CHECK_HEIGHTS)].any():
                found.append((station, report.warnings))
        if found and not found[-1][1]:
            break
    nowhere = (bare, ("no place for an arm was found: the station has only a hand",))
    station, warnings = min(found, key=lambda item: len(item[1]), default=nowhere)
    return StationProposal(station.document, "", misfits, warnings)


def find_built_in(scene: Scene) -> tuple[Station | None, dict[str, str]]:
    """The first built-in station with an arm that a scene fits on; None if there is none.

    Returns:
        The station, and why the stations tried before do not fit, by name.

    Raises:
        InvalidInputError: the scene fits no station, for example because its objects overlap.
    """
    require_valid_scene(scene, _without_arm(scene, Path("station.yaml")))
    misfits: dict[str, str] = {}
    for name in sorted(builtin_names("stations"), key=lambda name: name != "panda_tabletop"):
        station = load_station(name)
        reason = misfit_reason(scene, station)
        if not reason:
            return station, misfits
        misfits[name] = reason
    return None, misfits


def misfit_reason(scene: Scene, station: Station) -> str:
    """Why a scene does not fit on a station, in a few words; empty if it does.

    By bounding boxes, board and objects have to be on the station's table, and fixed objects clear
    of its obstacles. Objects, base and home posture of the arm have to be free of collisions, and
    all free objects within the arm's span.
    """
    if station.document.arm is None:
        return "it has no arm"
    X_WS = station.document.X_WS.matrix()
    table = station.document.table
    half, center = np.array(table.size[:2]) / 2, np.array(table.center)
    size = f"its table is {table.size[0]:g} x {table.size[1]:g} m"
    placed = {
        name: transform_points(X_WS, placed_vertices(scene, name))
        for name in _all_instance_names(scene)
    }
    for name, p_W in {"the board": transform_points(X_WS, _board_corners(scene)), **placed}.items():
        beyond = float((np.abs(p_W[:, :2] - center) - half).max())
        if beyond > TOUCH_TOLERANCE:
            what = name if name == "the board" else repr(name)
            return f"{size}, and {what} would extend {1e3 * beyond:.0f} mm over its edge"
    for obstacle, box in station.document.background.items():
        corners = np.array(list(itertools.product((-0.5, 0.5), repeat=3))) * box.size
        p_WB = transform_points(box.X_WB.matrix(), corners)
        for name in scene.background:
            if _overlap_depth(placed[name], p_WB) > TOUCH_TOLERANCE:
                return f"its {obstacle!r} would overlap {name!r}"
    try:
        require_valid_scene(scene, station)
        far = require_usable_arm(scene, station)
    except InvalidInputError as error:
        return str(error).removeprefix(f"{scene.path}: ").removeprefix(f"{station.path}: ")
    return far[0] if far else ""


def _without_arm(scene: Scene, path: Path) -> Station:
    """A station with a table under the whole scene; the scene frame is the world frame."""
    usual = load_station("panda_tabletop")
    points = [
        _board_corners(scene),
        *(placed_vertices(scene, name) for name in _all_instance_names(scene)),
    ]
    document = StationDocument(
        name=make_name(path.stem),
        description=f"Laid out for scene {scene.name}.",
        hand=usual.document.hand,
        table=_table_under(np.vstack(points)[:, :2]),
    )
    return replace(usual, document=document, arm_model=None, path=path)


def _with_arms(scene: Scene, bare: Station) -> Iterator[Station]:
    """Yields stations with an arm that faces the free objects, one for each base pose with enough
    room, best first."""
    # Metres from base to objects, best first. Half a Panda's reach is 0.43.
    base_distances = (0.5, 0.6, 0.4, 0.7)
    # Degrees from x of the scene; in front of the board first.
    headings_deg = (90.0, 45.0, 135.0, 0.0, 180.0, -45.0, -135.0, -90.0)
    base_half_width = 0.12  # Metres. Half the side of the square that the base needs.
    shoulder_height = 0.6  # Metres above the base that must be free.
    usual = load_station("panda_tabletop")
    assert usual.document.arm is not None
    free = [placed_vertices(scene, name) for name in scene.instances] or [_board_corners(scene)]
    around = [placed_vertices(scene, name) for name in _all_instance_names(scene)]
    middle = np.median([(p.min(axis=0) + p.max(axis=0)) / 2 for p in free], axis=0)
    height = _support_height(scene)
    half = np.array(bare.document.table.size[:2]) / 2
    edges = np.array(bare.document.table.center) + np.array([-half, half])
    for distance, heading in itertools.product(base_distances, headings_deg):
        ahead = np.array([np.cos(np.deg2rad(heading)), np.sin(np.deg2rad(heading))])
        base = np.round(middle[:2] - distance * ahead, 3)
        room = np.array(
            [
                [*(base - base_half_width), 0.0],
                [*(base + base_half_width), height + shoulder_height],
            ]
        )
        if any(_overlap_depth(points, room) > 0.0 for points in around):
            continue
        x, y = base.tolist()
        arm = replace(usual.document.arm, X_WA=Pose((x, y, height), rpy_deg=(0.0, 0.0, heading)))
        document = replace(
            bare.document, arm=arm, table=_table_under(np.vstack([edges, room[:, :2]]))
        )
        if height:
            name = "arm_pedestal"
            while name in scene.instances or name in scene.background:
                name += "_"
            box = Obstacle(
                X_WB=Pose((x, y, height / 2)),
                size=(2 * base_half_width, 2 * base_half_width, height),
            )
            document = replace(document, background={name: box})
        yield replace(bare, document=document, arm_model=usual.arm_model)


def _support_height(scene: Scene) -> float:
    """Height of the support of the lowest free object [m]; 0 if it stands on the board."""
    lowest = [float(placed_vertices(scene, name)[:, 2].min()) for name in scene.instances]
    floor = min(lowest, default=0.0)
    return round(floor, 3) if floor > 0.05 else 0.0  # lower supports are not furniture


def _coarse_map(scene: Scene) -> ReachabilitySettings:
    """Settings of a coarse, fast reachability map at the board and at the free objects."""
    support = _support_height(scene)
    raised = tuple(support + height for height in BOARD_CHECK_HEIGHTS) if support else ()
    # At most 20 cells along the board's longer side.
    spacing = max(ReachabilitySettings().spacing, max(scene.board.size) / 20)
    return ReachabilitySettings(
        spacing=spacing,
        heights=(*BOARD_CHECK_HEIGHTS, *raised),
        tilts_deg=(0.0, 45.0),
        headings=(1, 6),
        redundant=(2, 6),
    )


def _all_instance_names(scene: Scene) -> tuple[str, ...]:
    return (*scene.instances, *scene.background)


def _board_corners(scene: Scene) -> Array:
    """(2, 3) opposite corners of the board in S."""
    return np.array([[0.0, 0.0, 0.0], [*scene.board.size, 0.0]])


def _table_under(points: Array) -> Table:
    """A table under points (N, 2)."""
    margin = 0.1  # Metres that the table reaches beyond what stands on it.
    lower, upper = points.min(axis=0) - margin, points.max(axis=0) + margin
    x, y = np.round((lower + upper) / 2, 3).tolist()
    width, depth = (np.ceil((upper - lower) * 100) / 100).tolist()
    return Table(center=(x, y), size=(width, depth, 0.05))


def _overlap_depth(a: Array, b: Array) -> float:
    """Penetration depth of the bounding boxes of points (N, 3) and (M, 3) [m]; negative if they
    are apart."""
    return float(np.minimum(a.max(axis=0) - b.min(axis=0), b.max(axis=0) - a.min(axis=0)).min())
