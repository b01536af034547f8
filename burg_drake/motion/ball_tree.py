"""A tree of balls around each body of the robot, and the balls that cover a convex shape.

The balls at the leaves cover the body and stick out of it by no more than a tolerance.

A ball about an interior point whose radius is the point's depth plus the tolerance sticks out by
at most the tolerance. Capsules take a row of balls along the axis. Boxes and cylinders are cut
into cells, and a greedy set cover picks balls. All trees have the same depth and share their
arrays.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from pydrake.geometry import (
    Box,
    Capsule,
    Convex,
    Cylinder,
    GeometryId,
    Mesh,
    SceneGraphInspector,
    Sphere,
)
from pydrake.multibody.tree import BodyIndex

from burg_drake.core import Array, Indices, InvalidInputError, Single, inverse, transform_points
from burg_drake.geometry import Polytope
from burg_drake.motion.arm_links import ArmLinks, LinkPoses
from burg_drake.station import StationDiagram, hull_vertices


class Cover:
    """Accuracy of the balls that cover a shape."""

    cell_size = 1.8  # Cell size as a multiple of the overshoot.
    max_cells = 2_000  # Cells of a shape. Larger shapes are cut more coarsely.
    coarsening = 1.1  # Factor by which the overshoot rises until there are few enough cells.
    max_inner_radius = 0.08  # Metres. Radius of the largest balls inside a shape.
    rounding = 1e-9  # Metres. Far above the rounding error of a distance.


@dataclass(frozen=True, eq=False)
class Balls:
    """M balls that cover a shape.

    Attributes:
        center: (M, 3) [m].
        outer: (M,) radii of the covering balls [m].
        inner: (M,) radii of balls with the same centres inside the shape [m].
    """

    center: Array
    outer: Array
    inner: Array

    def moved(self, X_AB: Array) -> Balls:
        """The balls, given in B, expressed in A; `X_AB` is (4, 4)."""
        return Balls(transform_points(X_AB, self.center), self.outer, self.inner)

    @classmethod
    def joined(cls, several: list[Balls]) -> Balls:
        """Concatenates balls."""
        return cls(
            np.concatenate([balls.center for balls in several]),
            np.concatenate([balls.outer for balls in several]),
            np.concatenate([balls.inner for balls in several]),
        )


def cover_body(
    inspector: SceneGraphInspector, geometries: list[GeometryId], overshoot: float
) -> Balls:
    """Balls that cover the collision geometries of a body, in its frame.

    Args:
        inspector: inspector of the scene graph.
        geometries: collision geometries of one body.
        overshoot: how far balls should stick out [m]; on shapes of several decimetres they stick
            out farther. For a convex mesh, its bounding box is covered.

    Raises:
        InvalidInputError: a geometry is of a shape that cannot be covered.
    """
    balls = Balls(np.zeros((0, 3)), np.zeros(0), np.zeros(0))
    capsules_first = sorted(
        geometries, key=lambda g: not isinstance(inspector.GetShape(g), Capsule)
    )
    for geometry in capsules_first:
        X_BP = inspector.GetPoseInFrame(geometry).GetAsMatrix4()
        more = _cover(inspector, geometry, overshoot, balls.moved(inverse(X_BP)))
        balls = Balls.joined([balls, more.moved(X_BP)])
    return balls


def _cover(
    inspector: SceneGraphInspector, geometry: GeometryId, overshoot: float, existing: Balls
) -> Balls:
    shape = inspector.GetShape(geometry)
    match shape:
        case Sphere():
            radius = np.array([shape.radius()])
            return Balls(np.zeros((1, 3)), radius, radius)
        case Capsule():
            # Half the overshoot takes only about 1.4 times as many balls in a row.
            return _cover_capsule(shape.radius(), shape.length(), overshoot / 2)
        case Box():
            return _cover_box(np.asarray(shape.size()) / 2, overshoot, existing)
        case Cylinder():
            return _cover_cylinder(shape.radius(), shape.length() / 2, overshoot, existing)
        case Convex() | Mesh():
            return _cover_hull(hull_vertices(shape), overshoot, existing)
    raise unsupported_shape_error(inspector, geometry)


def unsupported_shape_error(
    inspector: SceneGraphInspector, geometry: GeometryId
) -> InvalidInputError:
    """Error for a collision geometry of the robot with an unsupported shape."""
    return InvalidInputError(
        f"collision geometry {inspector.GetName(geometry)!r} of the robot is a"
        f" {type(inspector.GetShape(geometry)).__name__}; supported are boxes, capsules, cylinders,"
        " spheres and convex meshes"
    )


def _cover_capsule(radius: float, length: float, overshoot: float) -> Balls:
    """A row of balls along z. Half-way between centres, outer balls meet on the capsule's side."""
    step = 2.0 * np.sqrt((radius + overshoot) ** 2 - radius**2)
    count = int(np.ceil(length / step)) + 1
    z = np.linspace(-length / 2, length / 2, count)
    outer = np.hypot(radius, (z[1] - z[0]) / 2)
    return Balls(np.column_stack([0 * z, 0 * z, z]), np.full(count, outer), np.full(count, radius))


def _cell_counts(cells: Callable[[float], Array], overshoot: float) -> tuple[Array, float]:
    """(3,) numbers of cells along a shape, and the overshoot for them [m]."""
    while np.prod(count := cells(overshoot)) > Cover.max_cells:
        overshoot *= Cover.coarsening
    return count.astype(int), overshoot


def _cover_box(half: Array, overshoot: float, existing: Balls) -> Balls:
    count, overshoot = _cell_counts(
        lambda s: np.ceil(2.0 * half / (Cover.cell_size * s)), overshoot
    )
    ticks = [np.linspace(-h, h, 2 * n + 1) for h, n in zip(half, count, strict=True)]
    lattice = np.stack(np.meshgrid(*ticks, indexing="ij"), axis=-1)
    centers = _candidate_centers(lattice)
    depth = (half - np.abs(centers)).min(axis=1)
    return _choose_balls(centers, depth, lattice[::2, ::2, ::2], overshoot, existing)


def _cover_cylinder(radius: float, half_length: float, overshoot: float, existing: Balls) -> Balls:
    """Covers sectors of the cylinder; their outer corners lie on a circumscribed polygon."""
    sides = np.array([2.0 * np.pi * radius, radius, 2.0 * half_length])
    min_count = np.array([8, 1, 1])  # sectors, rings, layers
    (sectors, rings, layers), overshoot = _cell_counts(
        lambda s: np.maximum(min_count, np.ceil(sides / (Cover.cell_size * s))), overshoot
    )
    angle = np.pi * np.arange(2 * sectors + 1) / sectors
    rho = radius / np.cos(np.pi / sectors) * np.linspace(0.0, 1.0, 2 * rings + 1)
    z = np.linspace(-half_length, half_length, 2 * layers + 1)
    r, a, h = np.meshgrid(rho, angle, z, indexing="ij")
    lattice = np.stack([r * np.cos(a), r * np.sin(a), h], axis=-1)
    centers = _candidate_centers(lattice)
    axial = half_length - np.abs(centers[:, 2])
    depth = np.minimum(radius - np.hypot(centers[:, 0], centers[:, 1]), axial)
    return _choose_balls(centers, depth, lattice[::2, ::2, ::2], overshoot, existing)


def _cover_hull(points: Array, overshoot: float, existing: Balls) -> Balls:
    """Covers the hull's bounding box, which is exact for a hull that is a box."""
    polytope = Polytope.from_points(points)
    X = np.eye(4)
    if (box := polytope.as_box()) is not None:
        X, half = box
    else:
        X[:3, 3], half = polytope.bounds
    balls = _cover_box(half, overshoot, existing.moved(inverse(X))).moved(X)
    depth = (polytope.offsets - balls.center @ polytope.normals.T).min(axis=1)
    return Balls(balls.center, balls.outer, np.minimum(balls.inner, depth))


def _candidate_centers(lattice: Array) -> Array:
    """(C, 3) cell middles and inner cell corners of a lattice (2a+1, 2b+1, 2c+1, 3)."""
    middles, corners = lattice[1::2, 1::2, 1::2], lattice[2:-1:2, 2:-1:2, 2:-1:2]
    return np.concatenate([middles.reshape(-1, 3), corners.reshape(-1, 3)])


def _choose_balls(
    centers: Array, depth: Array, nodes: Array, overshoot: float, existing: Balls
) -> Balls:
    """Covers cells by balls: a greedy set cover.

    Args:
        centers: (C, 3) centres of the balls to choose from [m]; the cells' middles first.
        depth: (C,) depths of the centres in the shape [m].
        nodes: (a, b, c, 3) corners of the cells [m].
        overshoot: difference between the radius of a ball and the depth of its centre [m].
        existing: balls that may cover some of the cells already.
    """
    cells = _cell_corners(nodes)
    depth = np.minimum(depth, Cover.max_inner_radius)
    outer = depth + overshoot
    reach = np.linalg.norm(cells - centers[: cells.shape[1]], axis=-1).max(axis=0)
    outer[: len(reach)] = np.maximum(outer[: len(reach)], reach + Cover.rounding)
    left = ~_are_cells_covered(nodes, existing.center, existing.outer).any(axis=0)
    covers = _are_cells_covered(nodes, centers, outer)[:, left]
    picked = []
    count = covers.sum(axis=1)
    while covers.shape[1]:
        best = int(count.argmax())
        picked.append(best)
        new = covers[best]
        count = count - covers[:, new].sum(axis=1)
        covers = covers[:, ~new]
    return Balls(centers[picked], outer[picked], depth[picked])


def _cell_corners(nodes: Array) -> Array:
    """(8, cells, 3) corners of the cells between nodes (a, b, c, 3)."""
    ends = (slice(None, -1), slice(1, None))
    corners = [nodes[i, j, k] for i in ends for j in ends for k in ends]
    return np.stack([corner.reshape(-1, 3) for corner in corners])


def _are_cells_covered(nodes: Array, centers: Array, radii: Array) -> NDArray[np.bool_]:
    """(C, cells) whether balls cover cells."""
    flat = nodes.reshape(-1, 3)
    square = (centers**2).sum(axis=1)[:, None] + (flat**2).sum(axis=1) - 2.0 * centers @ flat.T
    covers = (square <= ((radii - Cover.rounding / 2) ** 2)[:, None]).reshape(-1, *nodes.shape[:3])
    for axis in (1, 2, 3):
        covers = np.moveaxis(covers, axis, 0)
        covers = np.moveaxis(covers[:-1] & covers[1:], 0, axis)
    return covers.reshape(len(centers), np.prod(covers.shape[1:]))


MISSING_BALL_RADIUS = -1e3
"""Metres. Radius of the entries of a node that hold no ball."""


@dataclass(frozen=True, eq=False)
class BodyBalls:
    """A body of the robot, covered by balls.

    Attributes:
        body: index of the body.
        frame: index of the arm's frame in which the body is fixed.
        center, radius: (3,) centre and radius of its bounding ball [m].
        balls: balls that cover it, in the frame.
        root: index of the first node of its tree.
    """

    body: BodyIndex
    frame: int
    center: Array
    radius: float
    balls: Balls
    root: int


@dataclass(frozen=True, eq=False)
class BallTrees:
    """T nodes of up to W balls each.

    Attributes:
        bodies: bodies of the robot with collision geometry, ordered by frames.
        frame: (T,) index of the arm's frame in which a node is fixed.
        centers: (3, W, T) centres of the balls [m].
        outer: (W, T) radii of balls that together contain the node's part of the body [m].
        inner: (W, T) radii of balls with the same centres inside the body, in leaves [m].
        child: (W, T) index of the child node; -1 in leaves and where there is no ball.
    """

    bodies: tuple[BodyBalls, ...]
    frame: Indices
    centers: Single
    outer: Single
    inner: Single
    child: Indices

    @cached_property
    def _body_frames(self) -> Indices:
        return np.array([body.frame for body in self.bodies], dtype=np.intp)

    @cached_property
    def _body_centers(self) -> Single:
        return np.array([body.center for body in self.bodies], dtype=np.float32)

    @classmethod
    def from_diagram(cls, station_diagram: StationDiagram, links: ArmLinks) -> BallTrees:
        """Covers the robot of a diagram."""
        overshoot = 8e-3  # Metres that balls stick out of moving links and the hand.
        base_overshoot = 25e-3  # Metres, for links that do not move. Only the arm can hit them.
        plant = station_diagram.plant
        inspector = station_diagram.scene_graph.model_inspector()
        bodies: list[BodyBalls] = []
        nodes: list[_Node] = []
        for body in bodies_with_shape(station_diagram, links):
            geometries = plant.GetCollisionGeometriesForBody(plant.get_body(body))
            frame = links.frame_of[body]
            balls = cover_body(inspector, geometries, overshoot if frame else base_overshoot)
            balls = balls.moved(links.X_FB[body])
            root = _append_tree(nodes, balls, frame, depth=3)
            bodies.append(BodyBalls(body, frame, *_enclosing_ball(balls), balls, root))
        width = max(len(node.balls.outer) for node in nodes)
        centers = np.zeros((3, width, len(nodes)), dtype=np.float32)
        outer, inner = np.full((2, width, len(nodes)), MISSING_BALL_RADIUS, dtype=np.float32)
        child = np.full((width, len(nodes)), -1, dtype=np.intp)
        for t, node in enumerate(nodes):
            size = len(node.balls.outer)
            centers[:, :size, t] = node.balls.center.T
            outer[:size, t], inner[:size, t] = node.balls.outer, node.balls.inner
            child[: len(node.children), t] = node.children
        frames = np.array([node.frame for node in nodes], dtype=np.intp)
        return cls(tuple(bodies), frames, centers, outer, inner, child)

    def body_ball_centers(self, poses: LinkPoses) -> Single:
        """(3, B, K) centres of the bounding balls of the bodies."""
        return poses.transform_per_frame(self._body_frames, self._body_centers)

    def node_ball_centers(self, node: Indices, poses: LinkPoses, which: Indices) -> Single:
        """(3, W, F) centres of the balls of nodes (F,) in configurations `which` (F,)."""
        centers = self.centers.take(node, axis=2)
        return poses.transform_per_node(self.frame[node], centers, which)


def bodies_with_shape(station_diagram: StationDiagram, links: ArmLinks) -> list[BodyIndex]:
    """Bodies of the robot that have collision geometry, ordered by frames."""
    plant = station_diagram.plant
    return [
        body
        for body, _ in sorted(links.frame_of.items(), key=lambda item: (item[1], int(item[0])))
        if plant.GetCollisionGeometriesForBody(plant.get_body(body))
    ]


@dataclass
class _Node:
    frame: int
    balls: Balls
    children: list[int]


def _append_tree(nodes: list[_Node], balls: Balls, frame: int, depth: int) -> int:
    """Appends a tree to the nodes; returns the index of its root."""
    root = len(nodes)
    node = _Node(frame, balls, [])
    nodes.append(node)
    if depth > 1:
        count = len(balls.outer)
        parts = _split_balls(balls, int(np.ceil(np.round(count ** (1.0 / depth), 9))))
        around = [_enclosing_ball(part) for part in parts]
        centers, radii = np.array([c for c, _ in around]), np.array([r for _, r in around])
        node.balls = Balls(centers, radii, np.full(len(parts), MISSING_BALL_RADIUS))
        node.children = [_append_tree(nodes, part, frame, depth - 1) for part in parts]
    return root


def _enclosing_ball(balls: Balls) -> tuple[Array, float]:
    """Centre (3,) and radius of a nearly smallest ball around balls.

    The centre steps towards the farthest ball (Badoiu and Clarkson, "Smaller core-sets for balls",
    SODA 2003).
    """
    center = (balls.center.min(axis=0) + balls.center.max(axis=0)) / 2
    best = (center, np.inf)
    for step in range(20):
        offsets = balls.center - center
        distance = np.sqrt((offsets * offsets).sum(axis=1))
        reach = distance + balls.outer
        far = int(reach.argmax())
        if reach[far] < best[1]:
            best = (center, float(reach[far]))
        if distance[far] < 1e-9:
            break
        center = center + offsets[far] / distance[far] * reach[far] / (step + 2)
    return best


def _split_balls(balls: Balls, count: int) -> list[Balls]:
    """Cuts the balls recursively across the longest side into parts of about equal size."""
    if count <= 1:
        return [balls]
    order = np.argsort(balls.center[:, np.ptp(balls.center, axis=0).argmax()], kind="stable")
    first = count // 2
    cut = round(len(order) * first / count)
    parts = []
    for chosen, share in ((order[:cut], first), (order[cut:], count - first)):
        part = Balls(balls.center[chosen], balls.outer[chosen], balls.inner[chosen])
        parts += _split_balls(part, min(share, len(chosen)))
    return parts
