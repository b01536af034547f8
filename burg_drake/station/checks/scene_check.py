"""Whether scenes can stand on a station, asked again and again while one is composed.

Only what changed since the last question costs time: the robot is looked at once, each object once,
and what is added is registered beside what is there.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike
from pydrake.math import RigidTransform

from burg_drake.core import Array, InvalidInputError, check_pose, transform_points
from burg_drake.objects.library import ObjectLibrary
from burg_drake.scene.document import (
    BOARD_NAME,
    GROUND_TOLERANCE,
    HOVER_TOLERANCE,
    SINK_TOLERANCE,
    SUNKEN_TOLERANCE,
    TOUCH_TOLERANCE,
    Extent,
    Instance,
    Scene,
    SceneDocument,
    SceneIssue,
    SceneLike,
    as_scene,
    hovering_issue,
    is_below,
    length_text,
    support_vertices,
    surface_vertices,
    validate_scene,
)
from burg_drake.station.checks.body_shapes import object_shapes, surrounding_shapes
from burg_drake.station.checks.collision_world import CollisionWorld
from burg_drake.station.checks.sinking import push_up
from burg_drake.station.checks.travel import Travel
from burg_drake.station.diagram import GAP, StationDiagram, build_station_diagram
from burg_drake.station.document import Station, StationLike, as_station
from burg_drake.station.world import ROBOT_MODELS, Robot, name_taken_error, obstacle_name_error

GRAVITY = 9.81
"""[m/s^2]."""
DEEPEST = 0.006
"""A tip may be so deep in the table [m], if the table bears it there."""
DOWN_DIRECTION = np.array([0.0, 0.0, -1.0])
"""In the world."""
PUSH_ERROR = 1.05
"""What lies still was pushed up by its weight; the table's force is known to 2 %."""


@dataclass(frozen=True, eq=False)
class _PlacedInstance:
    """An instance as it was last looked at.

    Attributes:
        instance: of the document.
        X_WO: pose in the world.
        extent: the box around its surface, along the axes of the board.
        surface, support: heights over the table's top of the lowest point of its surface, and of
            what it rests with [m].
    """

    instance: Instance
    X_WO: RigidTransform
    extent: Extent
    surface: float
    support: float


class SceneCheck:
    """Says of scenes of one library what is wrong with them on a station.

    Verdicts are those of `burg_drake.station.checks.scene_issues.check_scene`, which looks at the
    objects' true surfaces as well. Overlaps are those of the convex shapes that objects touch
    others with; the arm is in its home posture. To be used from one thread at a time.

    Args:
        station: where the scenes stand.
        library: the objects of the scenes.

    Raises:
        InvalidInputError, UnknownNameError: the station's robot cannot be built.
    """

    def __init__(self, station: StationLike, library: ObjectLibrary) -> None:
        station = as_station(station)
        self._station, self._library = station, library
        self._X_WS = station.document.X_WS.matrix()
        self._around = _empty_station(station, library)
        self._parts = _robot_parts(self._around)
        fixed = surrounding_shapes(self._around)
        shapes = partial(object_shapes, library, packages=station.packages)
        self._world = CollisionWorld(fixed, shapes)
        self._vertices: dict[str, tuple[Array, Array]] = {}
        self._placed: dict[str, _PlacedInstance] = {}

    def issues(self, scene: SceneLike) -> tuple[SceneIssue, ...]:
        """What is wrong with a scene: objects out of bounds, in the ground, hovering, beside the
        table, or overlapping.

        Args:
            scene: of this library.

        Returns:
            What was found, in the order of the document; nothing if all is well.

        Raises:
            UnknownNameError: an object is not in the library, or one of its files is missing.
            MeshError: the surface of an object is damaged.
            InvalidInputError: the scene is of another library, a pose is not of finite numbers, a
                name is taken by the station, or a model cannot be loaded.
        """
        scene = as_scene(scene)
        self._place(scene)
        placed = self._placed
        issues = list(validate_scene(scene, {name: one.extent for name, one in placed.items()}))
        issues = [i for i in issues if i.kind != "in_ground" or not self._may_sink(i, scene)]
        issues = [i for i in issues if i.kind != "hovering"]  # of which boxes say too little
        hovering = (self._hovering_issue(name) for name in scene.instances)
        issues += [issue for issue in hovering if issue is not None]
        buried = {issue.instance for issue in issues if issue.kind == "in_ground"}
        beside = (self._table_issue(name) for name in scene.instances)
        issues += [issue for issue in beside if issue is not None]
        overlapping = self._overlaps(scene)
        buried |= {a for a, b, _ in overlapping if b == "table"}
        sunken = (self._sunken_issue(name) for name in scene.instances if name not in buried)
        issues += [issue for issue in sunken if issue is not None]
        for a, b, depth in overlapping:
            if b == "table" and any(i.instance == a and i.kind == "in_ground" for i in issues):
                continue
            message = _overlap_issue(a, b, depth, self._parts, self._station.path)
            issues.append(
                SceneIssue(instance=a, kind="overlap", amount=depth, message=message, other=b)
            )
        return tuple(issues)

    def travel(
        self, scene: SceneLike, names: Iterable[str], direction_S: ArrayLike, limit: float
    ) -> float:
        """How far instances can be moved together along a straight line until they touch something
        else: another object, the table, an obstacle, or the arm in its home posture.

        It is exact for the convex shapes that objects touch others with. What touches or overlaps
        already is in the way only where the motion would drive it in deeper: objects slide on the
        table that they stand on.

        Args:
            scene: of this library.
            names: of instances, background included.
            direction_S: (3,) direction in the scene frame, of any length above 0.
            limit: longest way [m].

        Returns:
            The way [m], at most `limit`; 0 if something is in the way.

        Raises:
            UnknownNameError: the scene has no such instance.
            InvalidInputError: no names, no direction, or a limit that is negative or no number;
                and see `issues`.
        """
        scene = as_scene(scene)
        chosen = list(dict.fromkeys(names))
        if not chosen:
            raise InvalidInputError("no instance is named; name the instances to move")
        for name in chosen:
            scene.instance(name)
        direction = np.asarray(direction_S, dtype=float)
        length = float(np.linalg.norm(direction))
        if direction.shape != (3,) or not (np.isfinite(length) and length > 0.0):
            raise InvalidInputError(
                f"direction {direction.tolist()} must be three finite numbers, at least"
                " one of them not 0"
            )
        if not limit >= 0.0:
            raise InvalidInputError(f"limit {limit} must be a distance of at least 0 [m]")
        self._place(scene)
        direction_W = self._X_WS[:3, :3] @ direction / length
        return self._travel.first_contact(chosen, direction_W, limit)[0]

    @cached_property
    def _travel(self) -> Travel:
        """Ways in the world; most scenes need none."""
        return Travel(self._world)

    def _overlaps(self, scene: Scene) -> list[tuple[str, str, float]]:
        """Instances, what they overlap, and how deep [m], in the order of the document."""
        among, fixed = self._world.overlaps()
        rank = {name: i for i, name in enumerate(self._world.bodies)}
        of_fixed = {name: len(rank) + i for i, name in enumerate(self._world.fixed)}
        limits = dict.fromkeys(self._station.document.background, SINK_TOLERANCE)
        limits["table"] = GROUND_TOLERANCE
        for name in {name for name, other in fixed if other == "table"}:
            sunk = -self._placed[name].support  # Drake's depths are off by up to a millimetre
            fixed[name, "table"] = min(fixed[name, "table"], sunk)
        found = [(rank[a], rank[b], a, b, depth) for (a, b), depth in among.items()]
        found += [(rank[a], of_fixed[b], a, b, depth) for (a, b), depth in fixed.items()]
        return [
            (a, b, depth)
            for _, _, a, b, depth in sorted(found)
            if depth > limits.get(b, TOUCH_TOLERANCE)
            and a in scene.instances
            and not (b == "table" and self._may_touch_table(a, depth, scene))
        ]

    def _may_touch_table(self, name: str, depth: float, scene: Scene) -> bool:
        """Whether what an instance rests with may be so deep in the table [m]: its surface stands
        on it, or the table bears it there."""
        stands = not is_below(self._placed[name].surface)
        return stands or (depth < DEEPEST and self._is_supported(name, scene))

    def _may_sink(self, issue: SceneIssue, scene: Scene) -> bool:
        return issue.amount < DEEPEST and self._is_supported(issue.instance, scene)

    def _is_supported(self, name: str, scene: Scene) -> bool:
        """Whether what an instance is below the table's top is no more than what it sinks in by
        under its own weight and that of what may lie on it: all free objects at most."""
        weight = GRAVITY * sum(scene.entry(n).mass_properties.mass for n in scene.instances)
        _, X_WO = self._world.bodies[name]
        thickness = self._station.document.table.size[2]
        push = push_up(self._world.shapes(name), X_WO, thickness)
        return 0.0 < push <= PUSH_ERROR * weight

    def _place(self, scene: Scene) -> None:
        """Takes over where the instances of a scene stand."""
        if scene.library is not self._library and scene.library != self._library:
            raise InvalidInputError(
                f"{scene.path}: the scene's library is {scene.library.root}, but the"
                f" check was made for {self._library.root}"
            )
        self._require_free_names(scene)
        instances = {**scene.instances, **scene.background}
        known = self._placed
        self._placed = {
            name: known[name]
            if name in known and known[name].instance == instance
            else self._placed_instance(scene, name, instance)
            for name, instance in instances.items()
        }
        self._world.place(
            {name: (one.instance.object, one.X_WO) for name, one in self._placed.items()}
        )

    def _placed_instance(self, scene: Scene, name: str, instance: Instance) -> _PlacedInstance:
        X_SO = check_pose(instance.X_SO.matrix(), f"{scene.path}: X_SO of {name!r}")
        if instance.object not in self._vertices:
            self._vertices[instance.object] = (
                surface_vertices(self._library, instance.object),
                support_vertices(self._library, instance.object),
            )
        surface, support = self._vertices[instance.object]
        extent = Extent.of(transform_points(X_SO, surface), transform_points(X_SO, support))
        X_WO = self._X_WS @ X_SO
        heights = (float((p_OV @ X_WO[2, :3]).min() + X_WO[2, 3]) for p_OV in (surface, support))
        return _PlacedInstance(instance, RigidTransform(X_WO), extent, *heights)

    def _require_free_names(self, scene: Scene) -> None:
        for name in (*scene.instances, *scene.background):
            if name in self._station.document.background:
                raise obstacle_name_error(self._station, name)
            if name in ROBOT_MODELS or self._around.plant.HasModelInstanceNamed(name):
                raise name_taken_error(scene, name)

    def _hovering_issue(self, name: str) -> SceneIssue | None:
        """Whether an object would fall: onto what, and how far."""
        placed = self._placed[name]
        height = min(placed.surface, placed.support)
        if height <= HOVER_TOLERANCE:
            return None
        fall, below = self._travel.first_contact([name], DOWN_DIRECTION, np.inf)
        if below in ("table", ""):
            fall, below = height, BOARD_NAME if below else ""
        elif fall <= HOVER_TOLERANCE + sum(self._gap_to_surface(n) for n in (name, below)):
            return None
        return hovering_issue(name, fall, below)

    def _gap_to_surface(self, name: str) -> float:
        """How far a body's surface may stand out of what it touches others with, at most [m]: by
        so much, objects whose surfaces meet are apart."""
        placed = self._placed.get(name)
        return self._library.entry(placed.instance.object).contact.excess if placed else 0.0

    def _sunken_issue(self, name: str) -> SceneIssue | None:
        """Whether an object alone stands in the table, as deep as the table bears it in simulation.
        What touches others cannot be lifted without them."""
        placed = self._placed[name]
        depth = -max(placed.surface, placed.support)
        if depth <= SUNKEN_TOLERANCE or self._world.touched(name, GAP) - {"table"}:
            return None
        return SceneIssue(
            instance=name,
            kind="sunken",
            amount=depth,
            message=(
                f"{name!r} reaches {length_text(depth)} into the table; raise it by "
                f"{length_text(depth)}"
            ),
        )

    def _table_issue(self, name: str) -> SceneIssue | None:
        """Whether the centre of mass is beside the table, so that the object cannot stay."""
        table, placed = self._station.document.table, self._placed[name]
        entry = self._library.entry(placed.instance.object)
        p_WOcm = placed.X_WO @ np.array(entry.mass_properties.center_of_mass)
        beyond = float((np.abs(p_WOcm[:2] - table.center) - np.array(table.size[:2]) / 2).max())
        if beyond <= 0.0:
            return None
        return SceneIssue(
            instance=name,
            kind="out_of_bounds",
            amount=beyond,
            message=(
                f"{name!r} is {length_text(beyond)} off the table of station {self._station.name!r}"
            ),
        )


def _empty_station(station: Station, library: ObjectLibrary) -> StationDiagram:
    """The station with nothing on it; the arm is in its home posture."""
    document = SceneDocument(name="empty_board", library=str(library.root))
    robot: Robot = "arm" if station.document.arm is not None else "none"
    return build_station_diagram(Scene(document, library, library.root), station, robot=robot)


def _robot_parts(station_diagram: StationDiagram) -> dict[str, tuple[str, str]]:
    """Of each body of the robot, by name: what to say of it, and what of the station puts it
    there."""
    arm, plant = station_diagram.station.document.arm, station_diagram.plant
    if arm is None:
        return {}
    base = plant.GetFrameByName(arm.base, plant.GetModelInstanceByName("arm")).body()
    still = {body.index() for body in plant.GetBodiesWeldedTo(base)}
    return {
        plant.get_body(index).name(): ("where the arm stands", "arm.X_WA")
        if index in still
        else ("of the arm in its home posture", "arm.home")
        for index in station_diagram.robot_bodies
    }


def _overlap_issue(
    a: str, b: str, depth: float, parts: dict[str, tuple[str, str]], path: Path
) -> str:
    """One line about two bodies that overlap; a is an instance."""
    by = f"by {depth * 1e3:.1f} mm"
    if b not in parts:
        return f"{a!r} and {b!r} overlap {by}; move them apart"
    what, key = parts[b]
    return f"{a!r} overlaps {b!r} {what} {by}; move {a!r}, or change {key} in {path}"
