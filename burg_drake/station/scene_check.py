"""Checks of a scene on a station: overlaps, support by the table, deep or hovering objects."""

from __future__ import annotations

import itertools
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike
from pydrake.geometry import Box, Convex, Cylinder, Mesh, Shape
from pydrake.math import RigidTransform
from scipy.spatial import ConvexHull, QhullError

from burg_drake.core import Array, InvalidInputError, check_pose, transform_points
from burg_drake.objects import (
    DEFAULT_CONTACT,
    ObjectLibrary,
    Primitive,
    resolution_hint,
    surface_overlap,
)
from burg_drake.scene import (
    BOARD_NAME,
    GROUND_TOLERANCE,
    HOVER_TOLERANCE,
    OBSTACLE_TOLERANCE,
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
    length_text,
    reaches_into_ground,
    support_vertices,
    surface_vertices,
    validate_scene,
)
from burg_drake.station.collision_world import (
    BodySweep,
    CollisionWorld,
    PosedShapes,
    read_object_shapes,
    surrounding_shapes,
)
from burg_drake.station.diagram_builder import build_station_diagram
from burg_drake.station.object_bodies import name_taken_error
from burg_drake.station.object_contact import LEANING_DISTANCE, replace_meshes_by_pieces
from burg_drake.station.robot import ROBOT_MODELS, Robot
from burg_drake.station.station_diagram import StationDiagram
from burg_drake.station.station_document import StationLike, as_station
from burg_drake.station.surroundings import SurroundingsProperties, obstacle_name_error
from burg_drake.station.visible_triangles import hull_vertices


def table_force(shapes: PosedShapes, X_WO: RigidTransform, thickness: float) -> float:
    """The force of the table on an object at rest [N].

    Args:
        shapes: shapes of the object in its frame.
        X_WO: pose of the object.
        thickness: thickness of the table [m].

    Returns:
        The force; infinite for a sphere, which has point contact with the table.
    """
    volume = sum(_volume_below(shape, X_WO @ X_OG) for X_OG, shape in shapes)
    return volume * SurroundingsProperties.hydroelastic_modulus / (thickness / 2)


def _volume_below(shape: Shape, X_WG: RigidTransform) -> float:
    """Volume of the part of a convex shape below z = 0 [m^3]."""
    if isinstance(shape, Box):
        corners = np.array(list(itertools.product((-0.5, 0.5), repeat=3)))
        p_GV = corners * shape.size()
    elif isinstance(shape, Cylinder):
        p_GV = _cylinder_corners(shape.radius(), shape.length())
    elif isinstance(shape, (Convex, Mesh)):
        p_GV = hull_vertices(shape)
    else:
        return np.inf
    p_WV = transform_points(X_WG.GetAsMatrix4(), p_GV)
    below, above = p_WV[p_WV[:, 2] < 0.0], p_WV[p_WV[:, 2] >= 0.0]
    share = below[:, None, 2:] / (below[:, None, 2:] - above[None, :, 2:])
    crossings = below[:, None] + share * (above[None] - below[:, None])
    return _hull_volume(np.vstack([below, crossings.reshape(-1, 3)]))


def _cylinder_corners(radius: float, length: float) -> Array:
    """Corners (N, 3) of the prism with which Drake approximates a cylinder along z [m]."""
    primitive = Primitive(shape="cylinder", size=(radius, length))
    sides = round(2.0 * np.pi * radius / resolution_hint(primitive, DEFAULT_CONTACT.faceting))
    angle = 2.0 * np.pi * np.arange(sides) / sides
    rim = radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    return np.vstack([np.insert(rim, 2, end, axis=1) for end in (-length / 2, length / 2)])


def _hull_volume(points: Array) -> float:
    """Volume of the convex hull of points (N, 3); 0 if they are coplanar or too few."""
    try:
        return float(ConvexHull(points).volume) if len(points) > 3 else 0.0
    except QhullError:
        return 0.0


MAX_SINK_DEPTH = 0.006
"""Metres that a tip may penetrate the table, if the table supports it there."""


@dataclass(frozen=True, eq=False)
class _PlacedInstance:
    """An instance at its last checked pose.

    Attributes:
        instance: the instance in the document.
        X_WO: pose in the world.
        extent: bounding box of its surface, along the axes of the board.
        surface, support: heights of the lowest points of its surface and of its contact geometry
            over the table's top [m].
    """

    instance: Instance
    X_WO: RigidTransform
    extent: Extent
    surface: float
    support: float


class SceneCheck:
    """Finds problems of scenes of one library on a station.

    Results are those of `check_scene`, which also checks the objects' true surfaces. Overlaps are
    those of the objects' convex contact geometry; the arm is in its home posture. Not thread-safe.

    Args:
        station: the station.
        library: the objects of the scenes.

    Raises:
        InvalidInputError, UnknownNameError: the station's robot cannot be built.
    """

    def __init__(self, station: StationLike, library: ObjectLibrary) -> None:
        station = as_station(station)
        self._station, self._library = station, library
        self._X_WS = station.document.X_WS.matrix()
        empty = SceneDocument(name="empty_board", library=str(library.root))
        robot: Robot = "arm" if station.document.arm is not None else "none"
        scene = Scene(empty, library, library.root)
        self._around = build_station_diagram(scene, station, robot=robot)
        self._parts = _describe_robot_parts(self._around)
        fixed = surrounding_shapes(self._around)
        shapes = partial(read_object_shapes, library, packages=station.packages)
        self._world = CollisionWorld(fixed, shapes)
        self._vertices: dict[str, tuple[Array, Array]] = {}
        self._placed: dict[str, _PlacedInstance] = {}

    def issues(self, scene: SceneLike) -> tuple[SceneIssue, ...]:
        """Problems of a scene: objects out of bounds, in the ground, hovering, beside the table, or
        overlapping.

        Args:
            scene: a scene of this library.

        Returns:
            The issues in the order of the document; empty if there are none.

        Raises:
            UnknownNameError: an object is not in the library, or one of its files is missing.
            MeshError: the surface of an object is damaged.
            InvalidInputError: the scene is of another library, a pose is not of finite numbers, a
                name is used by the station, or a model cannot be loaded.
        """
        scene = as_scene(scene)
        self._update_poses(scene)
        placed = self._placed
        issues = list(validate_scene(scene, {name: one.extent for name, one in placed.items()}))
        issues = [i for i in issues if i.kind != "in_ground" or not self._may_sink_in(i, scene)]
        issues = [i for i in issues if i.kind != "hovering"]  # boxes are too coarse for these
        issues += filter(None, map(self._hovering_issue, scene.instances))
        buried = {issue.instance for issue in issues if issue.kind == "in_ground"}
        issues += filter(None, map(self._table_issue, scene.instances))
        overlapping = self._overlaps(scene)
        buried |= {a for a, b, _ in overlapping if b == "table"}
        lifted = (name for name in scene.instances if name not in buried)
        issues += filter(None, map(self._sunken_issue, lifted))
        for a, b, depth in overlapping:
            if b == "table" and any(i.instance == a and i.kind == "in_ground" for i in issues):
                continue
            issues.append(self._overlap_issue(a, b, depth))
        return tuple(issues)

    def travel(
        self, scene: SceneLike, names: Iterable[str], direction_S: ArrayLike, limit: float
    ) -> float:
        """How far instances can be moved together along a straight line until they touch something
        else: another object, the table, an obstacle, or the arm in its home posture.

        Exact for the objects' convex contact geometry. Bodies that touch or overlap at the start
        block the motion only if it would increase their penetration: objects slide on the table
        that they stand on.

        Args:
            scene: a scene of this library.
            names: names of instances, including background.
            direction_S: (3,) direction in the scene frame, of any length above 0.
            limit: longest distance [m].

        Returns:
            The distance [m], at most `limit`; 0 if the motion is blocked at the start.

        Raises:
            UnknownNameError: the scene has no such instance.
            InvalidInputError: no names, no direction, or a limit that is negative or not a number;
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
        self._update_poses(scene)
        direction_W = self._X_WS[:3, :3] @ direction / length
        return self._sweep.first_contact(chosen, direction_W, limit)[0]

    @cached_property
    def _sweep(self) -> BodySweep:
        """Motion of bodies to the first contact, created on first use."""
        return BodySweep(self._world)

    def _overlaps(self, scene: Scene) -> list[tuple[str, str, float]]:
        """Overlaps: instance, other body and depth [m], in the order of the document."""
        among, fixed = self._world.overlaps()
        rank = {name: i for i, name in enumerate(self._world.bodies)}
        of_fixed = {name: len(rank) + i for i, name in enumerate(self._world.fixed)}
        limits = {"table": GROUND_TOLERANCE}
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

    def _overlap_issue(self, a: str, b: str, depth: float) -> SceneIssue:
        """The issue of an instance `a` that overlaps `b` by a depth [m]: a warning if it may lean
        on an obstacle of the station."""
        if b in self._station.document.background and depth <= OBSTACLE_TOLERANCE:
            message = f"{a!r} is {length_text(depth)} deep in {b!r}; move it, unless it leans there"
            kind: Literal["overlap", "obstacle_overlap"] = "obstacle_overlap"
        else:
            message, kind = _overlap_text(a, b, depth, self._parts, self._station.path), "overlap"
        return SceneIssue(instance=a, kind=kind, amount=depth, message=message, other=b)

    def _may_touch_table(self, name: str, depth: float, scene: Scene) -> bool:
        """Whether an instance's contact geometry may be at a depth in the table [m]: its surface
        stands on the table, or the table supports the object at this depth."""
        stands = not reaches_into_ground(self._placed[name].surface)
        return stands or (depth < MAX_SINK_DEPTH and self._is_supported(name, scene))

    def _may_sink_in(self, issue: SceneIssue, scene: Scene) -> bool:
        return issue.amount < MAX_SINK_DEPTH and self._is_supported(issue.instance, scene)

    def _is_supported(self, name: str, scene: Scene) -> bool:
        """Whether an instance is in the table no deeper than it sinks under its own weight and that
        of all other free objects, which may lie on it."""
        gravity = 9.81  # Metres per second squared.
        max_force_ratio = 1.05  # Ratio of table force to weight; the force is known to 2 %.
        weight = gravity * sum(scene.entry(n).mass_properties.mass for n in scene.instances)
        _, X_WO = self._world.bodies[name]
        thickness = self._station.document.table.size[2]
        push = table_force(self._world.shapes(name), X_WO, thickness)
        return 0.0 < push <= max_force_ratio * weight

    def _update_poses(self, scene: Scene) -> None:
        """Updates the poses of the instances of a scene."""
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
        """The issue of an object that would fall: onto which body, and how far."""
        down_direction = np.array([0.0, 0.0, -1.0])  # Unit vector in the world.
        placed = self._placed[name]
        height = min(placed.surface, placed.support)
        if height <= HOVER_TOLERANCE:
            return None
        fall, below = self._sweep.first_contact([name], down_direction, np.inf)
        if below in ("table", ""):
            fall, below = height, BOARD_NAME if below else ""
        elif fall <= HOVER_TOLERANCE + sum(self._gap_to_surface(n) for n in (name, below)):
            return None
        return hovering_issue(name, fall, below)

    def _gap_to_surface(self, name: str) -> float:
        """Largest distance by which a body's surface may protrude from its contact geometry [m], so
        that the contact geometries of touching objects are apart."""
        placed = self._placed.get(name)
        return self._library.entry(placed.instance.object).contact.excess if placed else 0.0

    def _sunken_issue(self, name: str) -> SceneIssue | None:
        """The issue of an isolated object that has sunk into the table in simulation. Objects that
        touch others cannot be lifted without them."""
        placed = self._placed[name]
        depth = -max(placed.surface, placed.support)
        if depth <= SUNKEN_TOLERANCE or self._world.touched(name, LEANING_DISTANCE) - {"table"}:
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
        """The issue of an object whose centre of mass is beside the table."""
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


def _describe_robot_parts(station_diagram: StationDiagram) -> dict[str, tuple[str, str]]:
    """Description of each body of the robot, and the part of the station that places it, by
    name."""
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


def _overlap_text(
    a: str, b: str, depth: float, parts: dict[str, tuple[str, str]], path: Path
) -> str:
    """The message for two bodies that overlap; `a` is an instance."""
    by = f"by {depth * 1e3:.1f} mm"
    if b not in parts:
        return f"{a!r} and {b!r} overlap {by}; move them apart"
    what, key = parts[b]
    return f"{a!r} overlaps {b!r} {what} {by}; move {a!r}, or change {key} in {path}"


def check_scene(scene: SceneLike, station: StationLike) -> tuple[SceneIssue, ...]:
    """Finds problems of a scene on a station.

    They are those of `validate_scene`, overlaps with other objects and with the station, and
    overlaps of the objects' true surfaces.

    Example::

        for issue in burg.check_scene("breakfast.yaml", "panda_tabletop"):
            print(issue.message)

    Args:
        scene: the scene.
        station: the station; the arm is in its home posture.

    Returns:
        The issues; empty if there are none.
    """
    scene, station = as_scene(scene), as_station(station)
    issues = SceneCheck(station, scene.library).issues(scene)
    return (*issues, *surface_issues(scene, issues))


def surface_issues(scene: Scene, known: Iterable[SceneIssue] = ()) -> tuple[SceneIssue, ...]:
    """Objects whose true surfaces are more than `TOUCH_TOLERANCE` deep in each other.

    Their contact geometry in simulation may still be apart, as convex pieces and primitives are
    smaller than the surface in places.

    Args:
        scene: the scene.
        known: issues found before; their overlapping pairs are left out.

    Returns:
        One warning per pair, in the order of the document.

    Raises:
        MeshError: the surface of an object is damaged.
    """
    found = {(issue.instance, issue.other) for issue in known if issue.kind == "overlap"}
    free = tuple(scene.instances)
    pairs = [*itertools.combinations(free, 2), *itertools.product(free, scene.background)]
    surfaces = {}
    for name in (*free, *scene.background):
        surfaces[name] = scene.library.surface(scene.instance(name).object)
        surfaces[name].apply_transform(scene.X_SO(name))
    issues = []
    for a, b in pairs:
        (low_a, high_a), (low_b, high_b) = surfaces[a].bounds, surfaces[b].bounds
        apart = (low_a + TOUCH_TOLERANCE > high_b) | (low_b + TOUCH_TOLERANCE > high_a)
        if (a, b) in found or apart.any():
            continue
        depth = surface_overlap(surfaces[a], surfaces[b], TOUCH_TOLERANCE)
        if depth > 0.0:
            message = (
                f"the visible surfaces of {a!r} and {b!r} overlap by {length_text(depth)}"
                ", although their collision shapes do not; move them apart"
            )
            issues.append(
                SceneIssue(
                    instance=a, kind="surface_overlap", amount=depth, message=message, other=b
                )
            )
    return tuple(issues)


def find_overlaps(station_diagram: StationDiagram) -> dict[tuple[str, str], float]:
    """Overlaps in the default context between instances and other bodies.

    Returns:
        Depth of the deepest overlap [m] by the pair's names: instances in the document's order
        before other bodies; robot links have their own names.
    """
    plant = station_diagram.plant
    names = station_diagram.body_names
    order = {name: i for i, name in enumerate(station_diagram.scene.instances)}
    context = station_diagram.diagram.CreateDefaultContext()
    replace_meshes_by_pieces(station_diagram, context)
    query = station_diagram.diagram.GetOutputPort("geometry_query").Eval(context)
    inspector = query.inspector()
    found: dict[tuple[str, str], float] = {}
    for pair in query.ComputePointPairPenetration():
        bodies = [
            plant.GetBodyFromFrameId(inspector.GetFrameId(g)).index()
            for g in (pair.id_A, pair.id_B)
        ]
        a, b = sorted((names[i] for i in bodies), key=lambda n: order.get(n, len(order)))
        if a in order:
            found[a, b] = max(found.get((a, b), 0.0), pair.depth)
    return dict(sorted(found.items(), key=lambda item: order[item[0][0]]))
