"""The screen of many grasps: closed forms, Drake's own queries, and independence of the batch."""

from __future__ import annotations

import numpy as np
import pytest
from pydrake.geometry import QueryObject
from pydrake.math import RigidTransform
from pydrake.multibody.plant import CoulombFriction, MultibodyPlant
from pydrake.multibody.tree import RigidBody, SpatialInertia
from pydrake.planning import RobotDiagram, RobotDiagramBuilder
from random_shapes import KINDS, random_pose, random_shape

from burg_drake.core import make_pose, rotation_from_rpy
from burg_drake.geometry import CONTACT_TOLERANCE, Body, HandScreen, Shape, bodies, hand_screen

FINGER = Shape.box(make_pose(p_AB=(0.04, 0.0, 0.0)), np.array([0.01, 0.01, 0.02]))
TABLE = Body(make_pose(p_AB=(0.3, 0.0, -0.05)), [Shape.box(np.eye(4), np.array([0.6, 0.7, 0.05]))])


class Pair:
    """Random hand and scene, each with shapes of all kinds, in the screen and in Drake."""

    def __init__(self, seed: int) -> None:
        rng = np.random.default_rng(seed)
        builder = RobotDiagramBuilder()
        plant = builder.plant()
        self.body = plant.AddRigidBody("hand", SpatialInertia.SolidBoxWithMass(1.0, 1, 1, 1))
        hand = self._register(plant, self.body, rng)
        bodies = {}
        for k in range(4):
            X_WB = random_pose(rng, 0.15)
            instance = plant.AddModelInstance(f"body{k}")
            body = plant.AddRigidBody(f"body{k}", instance, self.body.default_spatial_inertia())
            bodies[f"body{k}"] = Body(X_WB, self._register(plant, body, rng))
            plant.WeldFrames(plant.world_frame(), body.body_frame(), RigidTransform(X_WB))
        self.screen = HandScreen(hand, bodies)
        plant.Finalize()
        self.diagram: RobotDiagram = builder.Build()
        self.context = self.diagram.CreateDefaultContext()

    def _register(
        self, plant: MultibodyPlant, body: RigidBody, rng: np.random.Generator
    ) -> list[Shape]:
        shapes = []
        for kind in KINDS:
            shape, drake, X_BP = random_shape(kind, rng)
            plant.RegisterCollisionGeometry(body, X_BP, drake, kind, CoulombFriction())
            shapes.append(shape)
        return shapes

    def touched(self, X_WG: np.ndarray) -> dict[str, float]:
        """Bodies that Drake finds the hand in, and how deep by its reckoning [m]."""
        plant, graph = self.diagram.plant(), self.diagram.scene_graph()
        plant_context = plant.GetMyMutableContextFromRoot(self.context)
        plant.SetFreeBodyPose(plant_context, self.body, RigidTransform(X_WG))
        port = graph.get_query_output_port()
        query: QueryObject = port.Eval(graph.GetMyContextFromRoot(self.context))
        found: dict[str, float] = {}
        for pair in query.ComputePointPairPenetration():
            frames = [query.inspector().GetFrameId(g) for g in (pair.id_A, pair.id_B)]
            names = {plant.GetBodyFromFrameId(frame).name() for frame in frames}
            (name,) = names - {"hand"}
            found[name] = max(found.get(name, 0.0), pair.depth)
        return found


@pytest.mark.parametrize("seed", range(3))
def test_agrees_with_drake_for_shapes_of_all_kinds(seed: int) -> None:
    """What Drake finds no deeper than 0.02 mm is left out: its search between a cylinder and
    something else ends at a tolerance."""
    pair = Pair(seed)
    rng = np.random.default_rng(100 + seed)
    X_WG = np.array([random_pose(rng, 0.15) for _ in range(400)])
    truth = [pair.touched(X) for X in X_WG]
    hits = 0
    for name in pair.screen.bodies:
        _, depth = pair.screen.deepest(X_WG, [name])
        for found, drake in zip(depth, truth, strict=True):
            assert (found > 0.0) == (name in drake) or max(found, drake.get(name, 0.0)) < 2e-5
            # Drake's depth is along some separating direction, ours along the nearest one
            assert found < drake.get(name, 0.0) + 2e-5
            hits += found > 0.0
    assert 150 < hits < 1400


@pytest.mark.parametrize("part", KINDS)
@pytest.mark.parametrize("piece", KINDS)
def test_every_kind_meets_every_kind(part: str, piece: str) -> None:
    """The part stands on top of the piece, on the same axis, and is moved along it."""
    X = np.eye(4)
    octahedron = 0.02 * np.vstack([np.eye(3), -np.eye(3)])
    pyramid = np.array(
        [(x, y, 0.03) for x in (-0.04, 0.04) for y in (-0.05, 0.05)] + [(0, 0, -0.1)]
    )
    upper = {  # 20 mm from the origin down
        "box": Shape.box(X, np.array([0.03, 0.01, 0.02])),
        "cylinder": Shape.cylinder(X, 0.03, 0.02),
        "ball": Shape.ball(X, 0.02),
        "hull": Shape.hull(X, octahedron),
    }[part]
    lower = {  # 30 mm from the origin up
        "box": Shape.box(X, np.array([0.04, 0.05, 0.03])),
        "cylinder": Shape.cylinder(X, 0.02, 0.03),
        "ball": Shape.ball(X, 0.03),
        "hull": Shape.hull(X, pyramid),
    }[piece]
    X_WB = make_pose(rotation_from_rpy((0.3, -0.5, 1.0)), (0.4, 0.2, 0.1))
    tested = HandScreen([upper], {"piece": Body(X_WB, [lower])})
    gaps = np.array([1e-4, 1e-6, -1e-6, -1e-4])
    X_BG = make_pose(p_AB=np.outer(0.05 + gaps, (0.0, 0.0, 1.0)))
    names, depth = tested.deepest(X_WB @ X_BG, ["piece"])
    assert names.tolist() == ["", "", "piece", "piece"]
    np.testing.assert_allclose(depth, np.maximum(-gaps, 0.0), atol=1e-12)


def test_a_finger_over_a_table_is_clear_when_it_touches() -> None:
    tested = HandScreen([FINGER], {"table": TABLE})
    heights = np.array([1e-4, 1e-7, 0.0, -CONTACT_TOLERANCE / 2, -1e-7, -1e-4, -0.03])
    X_WG = make_pose(p_AB=heights[:, None] * (0, 0, 1) + (0.1, 0.2, 0.02))
    names, depth = tested.deepest(X_WG, ["table"])
    assert names.tolist() == [""] * 4 + ["table"] * 3
    np.testing.assert_allclose(depth[4:], -heights[4:], atol=1e-12)
    assert not depth[:4].any()


def test_the_first_body_in_the_order_decides_not_the_deepest() -> None:
    pieces = [Shape.box(make_pose(p_AB=(0.0, 0.0, z)), np.full(3, 0.02)) for z in (0.0, 0.04)]
    block = Body(make_pose(p_AB=(0.065, 0.0, 0.0)), pieces)
    tested = HandScreen([FINGER], {"table": TABLE, "block": block})
    X_WG = make_pose(p_AB=(0.0, 0.0, 0.01))[None]  # 5 mm in the block, 10 mm in the table
    for order, expected in ((["block", "table"], 0.005), (["table", "block"], 0.01)):
        names, depth = tested.deepest(X_WG, order)
        assert names.tolist() == order[:1]
        assert depth[0] == pytest.approx(expected, abs=1e-12)
    assert tested.deepest(X_WG, [])[0].tolist() == [""]
    assert tested.deepest(X_WG[:0], ["table"])[1].shape == (0,)


def test_results_do_not_depend_on_the_batch(monkeypatch: pytest.MonkeyPatch) -> None:
    """To the last bit: alone, in a batch, in another order, and however the batch is cut."""
    rng = np.random.default_rng(8)
    X_WG = np.array([random_pose(rng, 0.2) for _ in range(300)])
    order = [f"body{k}" for k in (2, 0, 3, 1)]

    pair = Pair(1)
    names, depth = pair.screen.deepest(X_WG, order)
    assert 50 < sum(name != "" for name in names) < 300
    for k in range(100):
        alone = pair.screen.deepest(X_WG[k : k + 1], order)
        assert (alone[0][0], alone[1][0]) == (names[k], depth[k])
    mixed = rng.permutation(len(X_WG))
    turned = pair.screen.deepest(X_WG[mixed], order)
    assert turned[0].tolist() == names[mixed].tolist()
    assert turned[1].tobytes() == depth[mixed].tobytes()
    monkeypatch.setattr(hand_screen, "GRASP_CHUNK", 7)
    monkeypatch.setattr(bodies, "NARROW_PHASE_BLOCK", 100)
    cut = Pair(1).screen.deepest(X_WG, order)
    assert (cut[0].tolist(), cut[1].tobytes()) == (names.tolist(), depth.tobytes())


def test_the_scene_may_be_moved_with_the_hand() -> None:
    rng = np.random.default_rng(5)
    hand = [random_shape(kind, rng)[0] for kind in KINDS]
    pieces = [random_shape(kind, rng)[0] for kind in KINDS * 2]
    X_WG = np.array([random_pose(rng, 0.15) for _ in range(200)])
    X_VW = random_pose(rng, 2.0)
    _, here = HandScreen(hand, {"body": Body(np.eye(4), pieces)}).deepest(X_WG, ["body"])
    _, there = HandScreen(hand, {"body": Body(X_VW, pieces)}).deepest(X_VW @ X_WG, ["body"])
    np.testing.assert_allclose(there, here, atol=1e-9)
    assert 40 < (here > 0.0).sum() < 200
