"""Lays out objects on a board: at random, apart or together, packed, or hanging above a heap.

Only geometry, without physics. But for what touches, objects are held apart by what their convex
pieces cover of the board, which is quick, and on the safe side: nothing overlaps, and nothing
stands under another one's overhang. What touches is pushed together until pieces of both are in
contact (see `scene.arrangement.sweep`).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from burg_drake.core import Array, InvalidInputError, UnknownNameError, nearest
from burg_drake.objects.library import ObjectLibrary
from burg_drake.scene.arrangement.adjacent import place_beside
from burg_drake.scene.arrangement.heap import Heap
from burg_drake.scene.arrangement.object_shapes import ObjectShape, ObjectShapes
from burg_drake.scene.arrangement.occupancy import (
    Arrangement,
    ObjectRequest,
    OccupiedBoard,
    StandingObject,
    draw_pose,
    random_place,
    stand_in_pose,
    to_instance,
)
from burg_drake.scene.arrangement.packing import density, pack
from burg_drake.scene.document import LAYOUTS, TRIES, Board, LayoutName, PoseChoice

GAPS = {"random": 0.001, "wide": 0.040}
"""Least distance of shadows [m]; a finger of the Panda's hand is 22 mm wide."""
PLACES = 20
"""Random places that are tried for each random yaw."""
ORDERS = 4
"""Orders in which objects are packed."""


def choose(
    library: ObjectLibrary,
    count: int,
    rng: np.random.Generator,
    *,
    only: Sequence[str] = (),
    repeat: bool = False,
    taken: Sequence[str] = (),
) -> tuple[ObjectRequest, ...]:
    """Draws objects of a library.

    Args:
        library: the library; what has no mass or no stable pose is left out.
        count: how many.
        rng: draws.
        only: names of the objects to draw from; all if empty.
        repeat: an object may come several times.
        taken: names that instances must not get.

    Raises:
        UnknownNameError: `only` names an object that is not there.
        InvalidInputError: there are not enough objects.
    """
    usable = [n for n, e in library.objects.items() if not e.is_fixed and e.stable_poses]
    for name in only:
        if name not in usable:
            raise UnknownNameError(
                f"object {name!r} cannot be arranged: library {library.root} does not"
                f" have it, or it has no mass or no stable pose; {nearest(name, usable)}"
            )
    names = sorted(set(only) or usable)
    if not names or (not repeat and count > len(names)):
        raise InvalidInputError(
            f"{count} different objects were asked for, but there are only {len(names)} "
            f"{'in ' + str(library.root) if not only else 'to choose from'}; ask for"
            " fewer, or allow objects to repeat"
        )
    drawn = [names[i] for i in rng.choice(len(names), count, replace=repeat)]
    wanted: list[ObjectRequest] = []
    used = set(taken)
    for name in drawn:
        unique, k = name, 2
        while unique in used:
            unique, k = f"{name}_{k}", k + 1
        used.add(unique)
        wanted.append(ObjectRequest(name=unique, object=name))
    return tuple(wanted)


def arrange(
    wanted: Sequence[ObjectRequest],
    shapes: ObjectShapes,
    board: Board,
    rng: np.random.Generator,
    *,
    layout: LayoutName = "random",
    poses: PoseChoice = "probability",
    obstacles: Sequence[Array] = (),
    tries: int = TRIES,
    needs_all: bool = False,
) -> Arrangement:
    """Looks for a place for each object.

    Each gets its stable pose first, then up to `tries` random places and yaws; large ones begin.
    What finds no place is missing in the result.

    Args:
        wanted: the objects.
        shapes: of the library's objects; to be kept for the next time.
        board: objects stay within its edges.
        rng: draws; the same one gives the same result.
        layout: how they stand to one another.
        poses: how stable poses are drawn.
        obstacles: points (N, 3) of convex bodies in S that are in the way [m], such as those of
            `scene.arrangement.occupancy.corners` and boxes of a station.
        tries: places to look at for each object.
        needs_all: stop at the first object that finds no place.

    Raises:
        UnknownNameError: an object is not in the library.
        InvalidInputError: an object cannot be placed, as it has no mass, for example; or there is
            no such layout.
    """
    if layout not in LAYOUTS:
        raise InvalidInputError(f"layout {layout!r} does not exist; {nearest(layout, LAYOUTS)}")
    occupied = OccupiedBoard(board, obstacles)
    for one in wanted:
        _ = shapes[one.object]
    if layout == "heap":
        return _heap(wanted, shapes, occupied, rng, tries)
    chosen = [(shapes[one.object], draw_pose(one, shapes, rng, poses)) for one in wanted]
    if layout == "packed":
        places, used = _packed(chosen, board, obstacles, rng, needs_all)
    else:
        places, used = _scattered(chosen, occupied, rng, layout, tries, needs_all)
    X_SO = [None if place is None else place.X_SO for place in places]
    return _result(wanted, X_SO, used)


def _scattered(
    chosen: Sequence[tuple[ObjectShape, int]],
    occupied: OccupiedBoard,
    rng: np.random.Generator,
    layout: LayoutName,
    tries: int,
    needs_all: bool,
) -> tuple[list[StandingObject | None], int]:
    """Places by trial and error, large objects first; and the number of trials."""
    places: list[StandingObject | None] = [None] * len(chosen)
    total = 0
    for i in _large_first(chosen):
        shape, pose = chosen[i]
        used = 0
        while used < tries and places[i] is None:
            some = min(PLACES, tries - used) if layout in GAPS else 1
            turned = stand_in_pose(shape, pose, rng.uniform(0.0, 2.0 * np.pi))
            if layout in GAPS:
                places[i], some = random_place(occupied, turned, rng, GAPS[layout], some)
            else:
                places[i] = place_beside(occupied, turned, rng, touching=layout == "touching")
            used += some
        total += used
        place = places[i]
        if place is not None:
            occupied.add(place)
        elif needs_all:
            break
    return places, total


def _packed(
    chosen: Sequence[tuple[ObjectShape, int]],
    board: Board,
    obstacles: Sequence[Array],
    rng: np.random.Generator,
    needs_all: bool,
) -> tuple[list[StandingObject | None], int]:
    """The densest of several orders; the first two are by size, the others are random."""
    best: list[StandingObject | None] = [None] * len(chosen)
    value = (-1, 0.0)
    for k in range(ORDERS):
        order = _large_first(chosen) if k < 2 else rng.permutation(len(chosen)).tolist()
        objects = [chosen[i] for i in order]
        found = pack(OccupiedBoard(board, obstacles), objects, k % 2, needs_all)
        placed = [place for place in found if place is not None]
        if (len(placed), density(placed)) > value:
            value = (len(placed), density(placed))
            for i, place in zip(order, found, strict=True):
                best[i] = place
    return best, ORDERS * len(chosen)


def _heap(
    wanted: Sequence[ObjectRequest],
    shapes: ObjectShapes,
    occupied: OccupiedBoard,
    rng: np.random.Generator,
    tries: int,
) -> Arrangement:
    """Start poses above the middle of the board."""
    heap = Heap(occupied, [shapes[one.object] for one in wanted])
    X_SO: list[Array | None] = []
    used = 0
    for one in wanted:
        found = None
        for _ in range(tries):
            used += 1
            found = heap.place_above(shapes[one.object], rng)
            if found is not None:
                break
        X_SO.append(found)
    return _result(wanted, X_SO, used)


def _large_first(chosen: Sequence[tuple[ObjectShape, int]]) -> list[int]:
    """Numbers of objects, those that cover most of the board first."""
    size = [np.prod(np.ptp(shape.outline(pose).hull.corners, axis=0)) for shape, pose in chosen]
    return [int(i) for i in np.argsort(-np.array(size), kind="stable")]


def _result(
    wanted: Sequence[ObjectRequest], X_SO: Sequence[Array | None], tries: int
) -> Arrangement:
    placed = zip(wanted, X_SO, strict=True)
    return Arrangement(
        tuple(to_instance(one, X) for one, X in placed if X is not None),
        tuple(one.name for one, X in zip(wanted, X_SO, strict=True) if X is None),
        tries,
    )
