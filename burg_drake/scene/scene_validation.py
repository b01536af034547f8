"""Geometric checks of a scene: bounds of the board, contact with the ground, hovering."""

from __future__ import annotations

import functools
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from burg_drake.core import Array, InvalidInputError, transform_points
from burg_drake.objects import ObjectLibrary, support_corners
from burg_drake.scene.scene_document import Scene, SceneLike, as_scene

IN_BOUNDS_TOLERANCE = 1e-4
"""Metres that an object may exceed the board's edge, because of rounding."""
TOUCH_TOLERANCE = 1e-3
"""Metres that two objects may overlap at the start; they separate within a step."""
GROUND_TOLERANCE = 1.5e-3
"""Metres that an object may be in the ground, as the table yields in simulation."""
OBSTACLE_TOLERANCE = 2.5e-3
"""Metres that an object may be in an obstacle, as leaning objects sink by up to 2 mm."""
SUNKEN_TOLERANCE = 1e-3
"""Metres in the table from which a warning is given; real tables yield by less."""
HOVER_TOLERANCE = 1e-3
"""Metres above the board from which a warning is given."""

BOARD_NAME = "board"
"""Name of the board, where no other object is below."""

IssueKind = Literal[
    "out_of_bounds",
    "in_ground",
    "sunken",
    "hovering",
    "overlap",
    "obstacle_overlap",
    "surface_overlap",
]


@dataclass(frozen=True, kw_only=True)
class SceneIssue:
    """An error or warning about a scene.

    Attributes:
        instance: name of the instance.
        kind: kind of the issue. `hovering`, `sunken` (in the table, which carries it there),
            `obstacle_overlap` (as deep in an obstacle as an object that leans on it may be) and
            `surface_overlap` (only the surfaces overlap, not the contact geometry) are warnings,
            all other kinds are errors.
        amount: distance beyond, below or above something, or penetration depth [m].
        message: one clear line.
        other: body that the instance overlaps or hovers above: another instance, the table, the
            board, or a body of the station.
    """

    instance: str
    kind: IssueKind
    amount: float
    message: str
    other: str = ""

    @property
    def is_error(self) -> bool:
        """Whether grasps would be evaluated in a world that differs from the document's."""
        warnings = ("hovering", "sunken", "obstacle_overlap", "surface_overlap")
        return self.kind not in warnings


@dataclass(frozen=True, eq=False)
class Extent:
    """Bounding box of a placed object, along the axes of the board.

    Attributes:
        low, high: (3,) corners of the box in the scene frame [m].
        support: height of the lowest contact point of the object in the scene frame [m].
    """

    low: Array
    high: Array
    support: float

    @classmethod
    def of(cls, p_SV: Array, p_SC: Array) -> Extent:
        """Makes the extent of an object with points (N, 3) and contact points (M, 3)."""
        return cls(p_SV.min(axis=0), p_SV.max(axis=0), float(p_SC[:, 2].min()))


def validate_scene(
    scene: SceneLike, extents: Mapping[str, Extent] | None = None
) -> tuple[SceneIssue, ...]:
    """Checks the placement of a scene's instances on the board.

    Hovering above another object is judged by bounding boxes, so that an object inside a mug is not
    reported; `SceneCheck` uses the shapes.

    Args:
        scene: the scene; fixed background objects may stand anywhere.
        extents: extents of all instances, including background, if known; otherwise read from the
            library's meshes.

    Returns:
        Issues in the order of the document; empty if there are none.
    """
    scene = as_scene(scene)
    if extents is None:
        extents = {}
        for name in (*scene.instances, *scene.background):
            p_OC = support_vertices(scene.library, scene.instance(name).object)
            p_SC = transform_points(scene.X_SO(name), p_OC)
            extents[name] = Extent.of(placed_vertices(scene, name), p_SC)
    issues: list[SceneIssue] = []
    for name in scene.instances:
        others = {other: extent for other, extent in extents.items() if other != name}
        found = (
            _out_of_bounds_issue(scene, name, extents[name]),
            _ground_issue(scene, name, extents[name])
            or _hovering_issue(name, extents[name], others),
        )
        issues += [issue for issue in found if issue is not None]
    return tuple(issues)


def require_no_errors(scene: Scene, issues: Iterable[SceneIssue]) -> None:
    """Refuses a scene with errors; warnings pass.

    Raises:
        InvalidInputError: one line with the first error and the number of further ones.
    """
    errors = [issue for issue in issues if issue.is_error]
    if errors:
        more = len(errors) - 1
        rest = f" (and {more} more; burg-drake scene validate lists all)" if more else ""
        raise InvalidInputError(f"{scene.path}: {errors[0].message}{rest}")


def placed_vertices(scene: Scene, instance: str) -> Array:
    """(N, 3) vertices of an instance's surface in the scene frame [m]."""
    p_OV = surface_vertices(scene.library, scene.instance(instance).object)
    return transform_points(scene.X_SO(instance), p_OV)


def support_vertices(library: ObjectLibrary, name: str) -> Array:
    """(N, 3) points of an object's primitive, else its pieces, else its surface, in the object
    frame [m]; the object rests on a plane with these points.

    Raises:
        UnknownNameError: there is no such object, or one of its files is missing.
        MeshError: one of its files is damaged.
    """
    entry = library.entry(name)
    if entry.contact.primitive is None and not entry.pieces:
        return surface_vertices(library, name)
    return support_corners(library, entry)


def surface_vertices(library: ObjectLibrary, name: str) -> Array:
    """(N, 3) vertices of an object's surface in the object frame [m].

    Raises:
        UnknownNameError: there is no such object, or its mesh file is missing.
        MeshError: the mesh file is damaged.
    """
    entry = library.entry(name)
    return read_library_vertices(library, entry.surface or entry.mesh)


def read_library_vertices(library: ObjectLibrary, file: str) -> Array:
    """(N, 3) vertices of a mesh file of a library [m].

    Raises:
        UnknownNameError: the file is missing.
        MeshError: the file is damaged.
    """
    path = library.path(file)
    try:
        return read_vertices(path)
    except (OSError, ValueError) as error:
        raise library.damaged(path) from error


def read_vertices(mesh: Path) -> Array:
    """(N, 3) vertices of an .obj file of a library.

    Raises:
        OSError, ValueError: the file cannot be read, or holds no vertices.
    """
    status = mesh.stat()
    return _cached_vertices(mesh, status.st_mtime_ns, status.st_size)


@functools.lru_cache(maxsize=32)
def _cached_vertices(mesh: Path, changed: int, size: int) -> Array:
    """As `read_vertices`, cached by file, modification time and size; the array is read-only."""
    rows = [line.split()[1:4] for line in mesh.read_text().splitlines() if line.startswith("v ")]
    p_OV = np.array(rows, dtype=float).reshape(-1, 3)
    if not len(p_OV) or not np.isfinite(p_OV).all():
        raise ValueError(f"{mesh} has no vertices, or only ones that are not finite")
    p_OV.flags.writeable = False
    return p_OV


def _out_of_bounds_issue(scene: Scene, name: str, extent: Extent) -> SceneIssue | None:
    suspect_distance = 5.0  # Metres; a larger coordinate was probably meant in mm.
    size = scene.board.size
    lower, upper = extent.low, extent.high
    beyond = {
        "left": float(-lower[0]),
        "right": float(upper[0] - size[0]),
        "lower": float(-lower[1]),
        "upper": float(upper[1] - size[1]),
    }
    sides = sorted((s for s in beyond if beyond[s] > IN_BOUNDS_TOLERANCE), key=lambda s: -beyond[s])
    if not sides:
        return None
    where = " and ".join(f"{length_text(beyond[s])} over the {s} edge" for s in sides)
    board = f"{size[0] * 1e3:g} x {size[1] * 1e3:g} mm"
    hint = ""
    if np.abs(scene.instance(name).X_SO.translation).max() >= suspect_distance:
        hint = "; check that translations are in metres"
    return SceneIssue(
        instance=name,
        kind="out_of_bounds",
        amount=beyond[sides[0]],
        message=f"{name!r} is off the board: {where} of the board ({board}){hint}",
    )


def _ground_issue(scene: Scene, name: str, extent: Extent) -> SceneIssue | None:
    surface, support = float(extent.low[2]), extent.support
    if support < -GROUND_TOLERANCE and reaches_into_ground(surface):
        height = round(scene.instance(name).X_SO.translation[2] - support, 4) + 0.0
        return SceneIssue(
            instance=name,
            kind="in_ground",
            amount=-support,
            message=f"{name!r} reaches {length_text(-support)} below the surface of the board;"
            f" set z = {height:.4f} to put it on top",
        )
    return None


def _hovering_issue(name: str, extent: Extent, others: Mapping[str, Extent]) -> SceneIssue | None:
    support_tolerance = 5e-3  # Metres between boxes of objects that may rest on each other.
    height = min(float(extent.low[2]), extent.support)
    if height <= HOVER_TOLERANCE:
        return None
    below = BOARD_NAME
    for other, box in others.items():
        if (box.low[:2] >= extent.high[:2]).any() or (extent.low[:2] >= box.high[:2]).any():
            continue
        if box.low[2] < extent.low[2] and extent.low[2] - box.high[2] < height:
            height, below = float(extent.low[2] - box.high[2]), other
    if below != BOARD_NAME and height < support_tolerance:
        return None
    return hovering_issue(name, height, below)


def hovering_issue(name: str, height: float, below: str) -> SceneIssue:
    """Issue for a hovering instance.

    Args:
        name: name of the instance.
        height: height of its fall [m].
        below: name of the object that it falls on, or `BOARD_NAME`; empty if nothing is below it.
    """
    where = "the board" if below == BOARD_NAME else repr(below)
    hovers = f"hovers {length_text(height)} above {where}" if below else "has nothing below it"
    return SceneIssue(
        instance=name,
        kind="hovering",
        amount=height,
        message=f"{name!r} {hovers}; it will fall when simulated",
        other=below,
    )


def reaches_into_ground(surface: float) -> bool:
    """Whether a surface with its lowest point at this height over the ground [m] reaches into it.
    If not, the object stands on the ground, whatever the height of its contact geometry."""
    rounding_tolerance = 1e-4  # Metres below the ground, because of rounding.
    return surface < -rounding_tolerance


def length_text(length: float) -> str:
    """A length [m] as text."""
    return f"{length * 1e3:.1f} mm" if length < 0.1 else f"{length:.3g} m"
