"""Shape of an arm and its hand for bounds of the clearance: ball trees and distances between links.

It does not depend on the scene, takes seconds to compute, and is cached.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

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

from burg_drake.core import Array, Arrays, cached, content_hash
from burg_drake.motion.arm_links import ArmLinks
from burg_drake.motion.ball_tree import (
    Balls,
    BallTrees,
    BodyBalls,
    bodies_with_shape,
)
from burg_drake.motion.self_clearance import (
    ClearanceTable,
    JointGrid,
    Pair,
    PairTable,
    SelfClearance,
    collision_pairs,
)
from burg_drake.station import StationDiagram, hull_vertices

BALL_ARRAYS = ("center", "outer", "inner")
"""Arrays of `Balls`."""
NODE_ARRAYS = ("frame", "centers", "outer", "inner", "child")
"""Arrays of `BallTrees`."""


def shape_to_arrays(trees: BallTrees, self_clearance: SelfClearance) -> Arrays:
    """Arrays for `shape_from_arrays`, without the body indices of a diagram."""
    bodies = trees.bodies
    balls = Balls.joined([body.balls for body in bodies])
    arrays: dict[str, NDArray[Any]] = {
        "body_end": np.cumsum([len(body.balls.outer) for body in bodies]),
        "pairs": _pairs_to_array(self_clearance.pairs),
        "apart": _pairs_to_array(self_clearance.apart),
    }
    for name in ("frame", "center", "radius", "root"):
        arrays[f"body_{name}"] = np.array([getattr(body, name) for body in bodies])
    arrays |= {f"ball_{name}": getattr(balls, name) for name in BALL_ARRAYS}
    arrays |= {f"node_{name}": getattr(trees, name) for name in NODE_ARRAYS}
    for k, (table, pairs) in enumerate(self_clearance.tables):
        grid = table.grid
        arrays |= {
            f"table{k}_pairs": _pairs_to_array(pairs),
            f"table{k}_joints": np.array(grid.joints, dtype=np.intp),
            f"table{k}_whole": np.array(grid.whole, dtype=bool),
            f"table{k}_lower": table.lower,
            f"table{k}_upper": table.upper,
        }
        for name in ("low", "step", "count", "lever"):
            arrays[f"table{k}_{name}"] = getattr(grid, name)
    return arrays


def shape_from_arrays(arrays: Arrays) -> tuple[BallTrees, SelfClearance]:
    """Restores the result of `shape_to_arrays`; the bodies are numbered from 0."""
    ends = arrays["body_end"].tolist()
    bodies = tuple(
        BodyBalls(
            BodyIndex(k),
            int(arrays["body_frame"][k]),
            arrays["body_center"][k],
            float(arrays["body_radius"][k]),
            Balls(*(arrays[f"ball_{name}"][first:end] for name in BALL_ARRAYS)),
            int(arrays["body_root"][k]),
        )
        for k, (first, end) in enumerate(zip([0, *ends], ends, strict=False))
    )
    trees = BallTrees(bodies, *(arrays[f"node_{name}"] for name in NODE_ARRAYS))
    count = sum(name.endswith("_joints") for name in arrays)
    tables = [_read_table(arrays, f"table{k}_") for k in range(count)]
    return trees, SelfClearance(
        trees, _pairs_from_array(arrays["pairs"]), tables, _pairs_from_array(arrays["apart"])
    )


def _read_table(arrays: Arrays, prefix: str) -> ClearanceTable:
    grid = JointGrid(
        tuple(arrays[f"{prefix}joints"].tolist()),
        arrays[f"{prefix}low"],
        arrays[f"{prefix}step"],
        arrays[f"{prefix}count"],
        tuple(arrays[f"{prefix}whole"].tolist()),
        arrays[f"{prefix}lever"],
    )
    table = PairTable(grid, arrays[f"{prefix}lower"], arrays[f"{prefix}upper"])
    return table, _pairs_from_array(arrays[f"{prefix}pairs"])


def _pairs_to_array(pairs: Sequence[Pair]) -> NDArray[np.intp]:
    return np.array(pairs, dtype=np.intp).reshape(-1, 2)


def _pairs_from_array(numbers: NDArray[Any]) -> tuple[Pair, ...]:
    return tuple((int(i), int(j)) for i, j in numbers.tolist())


_kept: OrderedDict[str, tuple[BallTrees, SelfClearance]] = OrderedDict()


@dataclass(frozen=True, eq=False)
class ArmShape:
    """An arm with its hand.

    Attributes:
        links: its kinematics.
        limits: (n, 2) limits of the joints' positions [rad or m].
        trees: balls that cover it.
        self_clearance: its clearance from itself.
        content: hash of the inputs.
    """

    links: ArmLinks
    limits: Array
    trees: BallTrees
    self_clearance: SelfClearance
    content: str

    @classmethod
    def of(cls, station_diagram: StationDiagram) -> ArmShape:
        """Reads the robot of a diagram with an arm.

        Raises:
            InvalidInputError: the robot has a shape or a joint that is not known.
        """
        links = ArmLinks.from_diagram(station_diagram)
        joints = station_diagram.arm_joints
        limits = np.array(
            [(j.position_lower_limits()[0], j.position_upper_limits()[0]) for j in joints]
        )
        key = content_hash(*_arm_content(station_diagram, links), limits)
        if key not in _kept:

            def make() -> Arrays:
                trees = BallTrees.from_diagram(station_diagram, links)
                return shape_to_arrays(
                    trees, SelfClearance.of(station_diagram, links, trees, limits)
                )

            _kept[key] = shape_from_arrays(cached("robot", key, make))
        while len(_kept) > 16:  # shapes of robots kept in memory
            _kept.popitem(last=False)
        trees, self_clearance = _kept[key]
        own = dict(zip(bodies_with_shape(station_diagram, links), trees.bodies, strict=True))
        # In another scene the robot's bodies have other indices, in the same order.
        bodies = tuple(replace(known, body=body) for body, known in own.items())
        return cls(links, limits, replace(trees, bodies=bodies), self_clearance, key)


def _arm_content(station_diagram: StationDiagram, links: ArmLinks) -> Iterator[Any]:
    """Inputs of the balls and the distances."""
    plant = station_diagram.plant
    inspector = station_diagram.scene_graph.model_inspector()
    yield from (links.X_before, list(links.turns))
    bodies = bodies_with_shape(station_diagram, links)
    hand = plant.GetModelInstanceByName("hand")
    for index in bodies:
        body = plant.get_body(index)
        yield from (links.frame_of[index], links.X_FB[index], body.model_instance() == hand)
        for geometry in plant.GetCollisionGeometriesForBody(body):
            yield inspector.GetPoseInFrame(geometry).GetAsMatrix4()
            yield _shape_content(inspector, geometry)
    for pair in collision_pairs(plant, inspector, bodies):
        yield [bodies.index(body) for body in pair]


def _shape_content(inspector: SceneGraphInspector, geometry: GeometryId) -> list[Any]:
    shape = inspector.GetShape(geometry)
    match shape:
        case Sphere():
            sizes: Any = [shape.radius()]
        case Capsule() | Cylinder():
            sizes = [shape.radius(), shape.length()]
        case Box():
            sizes = shape.size().tolist()
        case Convex() | Mesh():
            sizes = hull_vertices(shape)
        case _:
            sizes = []  # unknown shape; `cover_body` raises an error
    return [type(shape).__name__, sizes]
