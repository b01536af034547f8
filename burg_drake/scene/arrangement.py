"""Arrangement of objects on a board: at random, side by side, packed, or above a heap."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from burg_drake.core import (
    Array,
    InvalidInputError,
    UnknownNameError,
    make_pose,
    rot_z,
    rotation_from_quaternion,
    suggest_names,
    unused_name,
)
from burg_drake.objects import ObjectLibrary
from burg_drake.scene.object_shapes import ObjectShape, ObjectShapes
from burg_drake.scene.occupancy import (
    BOX_TOLERANCE,
    Arrangement,
    ObjectRequest,
    OccupiedBoard,
    StandingObject,
    draw_pose,
    free_distance,
    place_in_stable_pose,
    random_place,
    to_instance,
)
from burg_drake.scene.packing import pack_objects, packing_density
from burg_drake.scene.polygons import exit_distance
from burg_drake.scene.scene_document import (
    DEFAULT_TRIES,
    LAYOUT_NAMES,
    Board,
    LayoutName,
    PoseChoice,
)


def place_beside(
    occupied: OccupiedBoard, turned: StandingObject, rng: np.random.Generator, *, touching: bool
) -> StandingObject | None:
    """Looks for a place beside one of the standing objects, or anywhere for the first object.

    Each try draws a standing object and a direction from it, both uniformly.

    Args:
        occupied: the board and what stands there.
        turned: the object, turned by a yaw.
        rng: random generator.
        touching: push the object against the others until their pieces touch.

    Returns:
        None if there is no room, or no object to push against.
    """
    gap_range = (0.002, 0.010)  # Metres between adjacent footprints, too little for a finger.
    start_gap = 1e-4  # Metres between footprints before one object is pushed.
    if not occupied.standing:
        return random_place(occupied, turned, rng, gap_range[0], 1)[0]
    partner = occupied.standing[rng.integers(len(occupied.standing))]
    angle = rng.uniform(0.0, 2.0 * np.pi)
    direction = np.array([np.cos(angle), np.sin(angle)])
    around = partner.footprint.no_fit_polygon(turned.footprint)
    middle = partner.footprint.middle - turned.footprint.middle
    distance = exit_distance(around, middle, direction)
    distance += start_gap if touching else rng.uniform(*gap_range)
    place = middle + distance * direction
    if touching:
        return _push_to_contact(occupied, partner, turned, place, -direction, distance)
    standing = turned.shifted(place)
    if occupied.in_bounds(standing) and occupied.is_free(turned, place, gap_range[0]):
        return standing
    return None


def _push_to_contact(
    occupied: OccupiedBoard,
    partner: StandingObject,
    turned: StandingObject,
    place: Array,
    direction: Array,
    limit: float,
) -> StandingObject | None:
    """Pushes an object from a place (2,) towards its partner along a unit vector (2,) until it
    touches others; None if the place is not free, nothing is touched within the limit [m], or the
    object ends off the board."""
    standing = turned.shifted(place)
    least, most = occupied.distance_range_in_bounds(standing, direction)
    if least > min(most, limit) + BOX_TOLERANCE or most < -BOX_TOLERANCE:
        return None
    if not occupied.is_free(turned, place, 0.0):
        return None
    along = np.array([*direction, 0.0])
    distance = free_distance(
        standing.pieces, occupied.pieces(partner), along, limit, stop_below=least - BOX_TOLERANCE
    )
    if distance == limit:
        return None
    standing = standing.shifted(distance * direction)
    return standing if occupied.in_bounds(standing) else None


class Heap:
    """Objects that hang above a spot of a board, to be dropped."""

    def __init__(self, occupied: OccupiedBoard, shapes: list[ObjectShape]) -> None:
        """Args:
        occupied: the board and the objects on it.
        shapes: shapes of all objects to be added.
        """
        layer_count = 3.0  # Layers of objects on the spot, if objects were balls of their size.
        self._size = occupied.size
        self._below = [*occupied.obstacles]
        for standing in occupied.standing:
            self._below.append(standing.shape.hull.moved(standing.X_SO))
        covered = sum(np.pi * np.ptp(s.corners, axis=0).mean() ** 2 / 4.0 for s in shapes)
        self._radius = np.sqrt(covered / np.pi / layer_count)

    def place_above(self, shape: ObjectShape, rng: np.random.Generator) -> Array | None:
        """Places an object above the spot, in a random orientation, as low as possible.

        Returns:
            Its pose (4, 4) in S; None if it reaches beyond the board at all places.
        """
        draw_count = 6  # Random places, of which the lowest is taken.
        wxyz = rng.normal(size=4)
        R_SO = rotation_from_quaternion(wxyz / np.linalg.norm(wxyz))
        corners = shape.corners @ R_SO.T
        lower, upper = corners.min(axis=0), corners.max(axis=0)
        middle = (lower + upper)[:2] / 2.0
        best: Array | None = None
        for _ in range(draw_count):
            radius, angle = self._radius * np.sqrt(rng.uniform()), rng.uniform(0.0, 2.0 * np.pi)
            xy = self._size / 2.0 + radius * np.array([np.cos(angle), np.sin(angle)]) - middle
            if (xy + lower[:2] < 0.0).any() or (xy + upper[:2] > self._size).any():
                continue
            X_SO = self._lowered_pose(shape, R_SO, xy, float(lower[2]))
            if best is None or X_SO[2, 3] < best[2, 3]:
                best = X_SO
        if best is not None:
            self.add(shape, best)
        return best

    def add(self, shape: ObjectShape, X_SO: Array) -> None:
        """Adds an object at a pose (4, 4) in S."""
        self._below.append(shape.hull.moved(X_SO))

    def place_lowest(self, shape: ObjectShape, rng: np.random.Generator) -> Array | None:
        """Places an object anywhere on the board, in one of its stable poses, where its centre of
        mass gets lowest. This finds free room beside a heap.

        Returns:
            Its pose (4, 4) in S; None if it is larger than the board.
        """
        draw_count = 30  # Random places and stable poses, of which the lowest is taken.
        edge_margin = 0.012  # Metres from the board's edge.
        entry, best, lowest = shape.library.entry(shape.name), None, np.inf
        for _ in range(draw_count):
            pose = int(rng.integers(len(entry.stable_poses)))
            R_SO = rot_z(rng.uniform(0.0, 2.0 * np.pi)) @ entry.X_SO(pose)[:3, :3]
            corners = shape.corners @ R_SO.T
            lower, upper = corners.min(axis=0), corners.max(axis=0)
            least, most = edge_margin - lower[:2], self._size - edge_margin - upper[:2]
            if (least > most).any():
                continue
            X_SO = self._lowered_pose(shape, R_SO, rng.uniform(least, most), float(lower[2]))
            height = float((X_SO @ (*entry.mass_properties.center_of_mass, 1.0))[2])
            if height < lowest:
                best, lowest = X_SO, height
        if best is not None:
            self.add(shape, best)
        return best

    def _lowered_pose(self, shape: ObjectShape, R_SO: Array, xy: Array, lowest: float) -> Array:
        """The pose of an object that is lowered onto the objects below."""
        hull_gap = 0.004  # Metres between the hulls of dropped objects.
        top = max((float(body.points[..., 2].max()) for body in self._below), default=0.0)
        start = max(top, 0.0) + hull_gap - lowest
        X_SO = make_pose(R_SO, (*xy, start))
        distance = free_distance(
            shape.hull.moved(X_SO), self._below, np.array([0.0, 0.0, -1.0]), start + lowest
        )
        X_SO[2, 3] -= max(0.0, distance - hull_gap)
        return X_SO


def choose_objects(
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
        library: the library; objects without mass or stable pose are left out.
        count: number of objects.
        rng: random generator.
        only: names of the objects to draw from; all if empty.
        repeat: an object may be drawn several times.
        taken: names that instances must not get.

    Raises:
        UnknownNameError: `only` names an object that is not in the library.
        InvalidInputError: there are not enough objects.
    """
    usable = [n for n, e in library.objects.items() if not e.is_fixed and e.stable_poses]
    for name in only:
        if name not in usable:
            raise UnknownNameError(
                f"object {name!r} cannot be arranged: library {library.root} does not"
                f" have it, or it has no mass or no stable pose; {suggest_names(name, usable)}"
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
        unique = unused_name(name, used)
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
    tries: int = DEFAULT_TRIES,
    needs_all: bool = False,
) -> Arrangement:
    """Looks for a place for each object.

    Each object gets a stable pose, and then up to `tries` random places and yaws; large objects
    come first. Objects without a place are missing in the result.

    Args:
        wanted: the objects.
        shapes: shapes of the library's objects; keep them for further calls.
        board: objects stay within its edges.
        rng: random generator; the same state gives the same result.
        layout: arrangement of the objects relative to one another.
        poses: how to draw stable poses.
        obstacles: points (N, 3) in S of convex bodies to avoid [m], such as the boxes of a station.
        tries: number of places to try for each object.
        needs_all: stop at the first object without a place.

    Raises:
        UnknownNameError: an object is not in the library.
        InvalidInputError: an object cannot be placed, for example because it has no mass; or there
            is no such layout.
    """
    if layout not in LAYOUT_NAMES:
        raise InvalidInputError(
            f"layout {layout!r} does not exist; {suggest_names(layout, LAYOUT_NAMES)}"
        )
    occupied = OccupiedBoard(board, obstacles)
    for request in wanted:
        _ = shapes[request.object]
    if layout == "heap":
        return _place_above_heap(wanted, shapes, occupied, rng, tries)
    chosen = [
        (shapes[request.object], draw_pose(request, shapes, rng, poses)) for request in wanted
    ]
    if layout == "packed":
        places, used = _pack_in_best_order(chosen, board, obstacles, rng, needs_all)
    else:
        places, used = _scatter(chosen, occupied, rng, layout, tries, needs_all)
    X_SO = [None if place is None else place.X_SO for place in places]
    return _make_arrangement(wanted, X_SO, used)


def _scatter(
    chosen: Sequence[tuple[ObjectShape, int]],
    occupied: OccupiedBoard,
    rng: np.random.Generator,
    layout: LayoutName,
    tries: int,
    needs_all: bool,
) -> tuple[list[StandingObject | None], int]:
    """Places objects by trial and error, large ones first; also returns the number of tries."""
    gaps = {"random": 0.001, "wide": 0.040}  # Metres between footprints, by layout.
    max_places = 20  # Random places for each random yaw.
    places: list[StandingObject | None] = [None] * len(chosen)
    total = 0
    for i in _indices_by_area(chosen):
        shape, pose = chosen[i]
        used = 0
        while used < tries and places[i] is None:
            some = min(max_places, tries - used) if layout in gaps else 1
            turned = place_in_stable_pose(shape, pose, rng.uniform(0.0, 2.0 * np.pi))
            if layout in gaps:
                places[i], some = random_place(occupied, turned, rng, gaps[layout], some)
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


def _pack_in_best_order(
    chosen: Sequence[tuple[ObjectShape, int]],
    board: Board,
    obstacles: Sequence[Array],
    rng: np.random.Generator,
    needs_all: bool,
) -> tuple[list[StandingObject | None], int]:
    """Packs the objects in several orders, two by size and the others random; returns the densest
    result."""
    order_count = 4  # Orders in which the objects are packed.
    best: list[StandingObject | None] = [None] * len(chosen)
    value = (-1, 0.0)
    for k in range(order_count):
        order = _indices_by_area(chosen) if k < 2 else rng.permutation(len(chosen)).tolist()
        objects = [chosen[i] for i in order]
        found = pack_objects(OccupiedBoard(board, obstacles), objects, k % 2, needs_all)
        placed = [place for place in found if place is not None]
        if (len(placed), packing_density(placed)) > value:
            value = (len(placed), packing_density(placed))
            for i, place in zip(order, found, strict=True):
                best[i] = place
    return best, order_count * len(chosen)


def _place_above_heap(
    wanted: Sequence[ObjectRequest],
    shapes: ObjectShapes,
    occupied: OccupiedBoard,
    rng: np.random.Generator,
    tries: int,
) -> Arrangement:
    """Start poses above the middle of the board."""
    heap = Heap(occupied, [shapes[request.object] for request in wanted])
    X_SO: list[Array | None] = []
    used = 0
    for request in wanted:
        found = None
        for _ in range(tries):
            used += 1
            found = heap.place_above(shapes[request.object], rng)
            if found is not None:
                break
        X_SO.append(found)
    return _make_arrangement(wanted, X_SO, used)


def _indices_by_area(chosen: Sequence[tuple[ObjectShape, int]]) -> list[int]:
    """Indices of objects, by the area that they cover, largest first."""
    size = [np.prod(np.ptp(shape.outline(pose).hull.corners, axis=0)) for shape, pose in chosen]
    return [int(i) for i in np.argsort(-np.array(size), kind="stable")]


def _make_arrangement(
    wanted: Sequence[ObjectRequest], X_SO: Sequence[Array | None], tries: int
) -> Arrangement:
    pairs = list(zip(wanted, X_SO, strict=True))
    placed = tuple(to_instance(request, X) for request, X in pairs if X is not None)
    return Arrangement(placed, tuple(request.name for request, X in pairs if X is None), tries)
