"""The UR5e's model against Universal Robots' own table, statics, and itself."""

from __future__ import annotations

import logging
from math import pi

import numpy as np
import pytest
from pydrake.geometry import Cylinder, Role
from pydrake.multibody.tree import BodyIndex
from pydrake.planning import RobotDiagramBuilder

from burg_drake.core import resolve_reference
from tools.ur5e_model.__main__ import model_texts

# Universal Robots, "DH Parameters for calculations of kinematics and dynamics", UR5e: a, d, alpha
# of the standard convention; mass, and centre of mass in the frame at the link's far end.
DH = [
    (0.0, 0.1625, pi / 2),
    (-0.425, 0.0, 0.0),
    (-0.3922, 0.0, 0.0),
    (0.0, 0.1333, pi / 2),
    (0.0, 0.0997, -pi / 2),
    (0.0, 0.0996, 0.0),
]
MASS = [3.761, 8.058, 2.846, 1.37, 1.3, 0.365]
P_CM = [
    (0.0, -0.02561, 0.00193),
    (0.2125, 0.0, 0.11336),
    (0.15, 0.0, 0.0265),
    (0.0, -0.0018, 0.01634),
    (0.0, 0.0018, 0.01634),
    (0.0, 0.0, -0.001159),
]
LINKS = [
    "shoulder_link",
    "upper_arm_link",
    "forearm_link",
    "wrist_1_link",
    "wrist_2_link",
    "wrist_3_link",
]
HOME = np.array([0.0, -pi / 2, pi / 2, -pi / 2, -pi / 2, 0.0])


class Robot:
    """The arm on the world, with a context."""

    def __init__(self) -> None:
        builder = RobotDiagramBuilder(time_step=0.002)
        self.plant = plant = builder.plant()
        (self.arm,) = builder.parser().AddModels(
            str(resolve_reference("package://burg_drake/models/ur5e/ur5e.urdf"))
        )
        plant.WeldFrames(plant.world_frame(), plant.GetFrameByName("base"))
        plant.Finalize()
        self.diagram = builder.Build()
        self.context = self.diagram.CreateDefaultContext()
        self.plant_context = plant.GetMyMutableContextFromRoot(self.context)

    def put(self, q: np.ndarray) -> None:
        """Moves the arm to positions (6,)."""
        self.plant.SetPositions(self.plant_context, q)

    def X_WF(self, frame: str) -> np.ndarray:
        """Pose (4, 4) of a named frame in the world."""
        pose = self.plant.GetFrameByName(frame).CalcPoseInWorld(self.plant_context)
        return np.asarray(pose.GetAsMatrix4())

    def colliding(self) -> set[tuple[str, str]]:
        """Pairs of links that overlap, as far as they count."""
        graph = self.diagram.scene_graph()
        query = graph.get_query_output_port().Eval(graph.GetMyContextFromRoot(self.context))
        inspector = query.inspector()
        pairs = set()
        for contact in query.ComputePointPairPenetration():
            names = (
                inspector.GetName(inspector.GetFrameId(g)).split("::")[-1]
                for g in (contact.id_A, contact.id_B)
            )
            first, second = sorted(names)
            pairs.add((first, second))
        return pairs

    def distance(self, one: str, other: str) -> float:
        """Signed distance of two links [m], also of those that do not count as colliding."""
        graph = self.diagram.scene_graph()
        query = graph.get_query_output_port().Eval(graph.GetMyContextFromRoot(self.context))
        frames = [
            self.plant.GetBodyFrameIdOrThrow(self.plant.GetBodyByName(name).index())
            for name in (one, other)
        ]
        first, second = (graph.model_inspector().GetGeometries(f, Role.kProximity) for f in frames)
        return min(
            query.ComputeSignedDistancePairClosestPoints(a, b).distance
            for a in first
            for b in second
        )


@pytest.fixture(scope="module")
def robot() -> Robot:
    return Robot()


def far_ends(q: np.ndarray) -> list[np.ndarray]:
    """Poses (4, 4) of the DH frames: Rz(theta) Tz(d) Tx(a) Rx(alpha)."""
    poses, X = [], np.eye(4)
    for (a, d, alpha), theta in zip(DH, q, strict=True):
        c, s, ca, sa = np.cos(theta), np.sin(theta), np.cos(alpha), np.sin(alpha)
        X = X @ [
            [c, -s * ca, s * sa, a * c],
            [s, c * ca, -c * sa, a * s],
            [0.0, sa, ca, d],
            [0.0, 0.0, 0.0, 1.0],
        ]
        poses.append(X)
    return poses


def test_file_is_what_the_generator_writes() -> None:
    for path, text in model_texts().items():
        assert resolve_reference(f"package://burg_drake/models/{path}").read_text("utf-8") == text


def test_flange_is_where_the_dh_table_puts_it(robot: Robot) -> None:
    rng = np.random.default_rng(1)
    for q in rng.uniform(-2 * pi, 2 * pi, (100, 6)):
        robot.put(q)
        np.testing.assert_allclose(robot.X_WF("flange"), far_ends(q)[-1], rtol=0, atol=1e-12)


def test_masses_are_where_the_table_puts_them(robot: Robot) -> None:
    q = np.array([0.3, -1.1, 0.9, 0.4, -2.0, 1.3])
    robot.put(q)
    for name, mass, p_cm, X_WE in zip(LINKS, MASS, P_CM, far_ends(q), strict=True):
        body = robot.plant.GetBodyByName(name)
        assert body.default_mass() == mass
        p_W = body.EvalPoseInWorld(robot.plant_context) @ body.default_com()
        np.testing.assert_allclose(p_W, (X_WE @ [*p_cm, 1.0])[:3], rtol=0, atol=1e-12)


def test_gravity_torque_of_the_shoulder(robot: Robot) -> None:
    """Joint 2 carries the moment of all that is beyond it, by the table alone."""
    q = np.array([0.4, -0.7, 1.2, -0.5, 0.8, 0.0])
    robot.put(q)
    X = far_ends(q)
    moment = np.zeros(3)
    for mass, p_cm, X_WE in list(zip(MASS, P_CM, X, strict=True))[1:]:
        moment += np.cross((X_WE @ [*p_cm, 1.0])[:3] - X[0][:3, 3], [0.0, 0.0, -9.81 * mass])
    torque = robot.plant.CalcGravityGeneralizedForces(robot.plant_context)[1]
    assert torque == pytest.approx(moment @ X[0][:3, 2], abs=1e-9)


def test_inertias_are_physical(robot: Robot) -> None:
    for name in LINKS:
        M_BBo_B = robot.plant.GetBodyByName(name).CalcSpatialInertiaInBodyFrame(robot.plant_context)
        assert M_BBo_B.IsPhysicallyValid()
    # The bars are long: about their own axis x the inertia is least.
    for name in ("upper_arm_link", "forearm_link"):
        M = robot.plant.GetBodyByName(name).default_spatial_inertia()
        moments = M.Shift(M.get_com()).CalcRotationalInertia().get_moments()
        assert moments.argmin() == 0 and moments[1] > 10 * moments[0]


def test_limits(robot: Robot) -> None:
    joints = [robot.plant.get_joint(i) for i in robot.plant.GetJointIndices(robot.arm)]
    joints = [j for j in joints if j.num_positions()]
    turn = 2 * pi
    upper = [turn, turn, pi, turn, turn, turn]
    np.testing.assert_allclose([j.position_upper_limit() for j in joints], upper, atol=1e-12)
    np.testing.assert_allclose([-j.position_lower_limit() for j in joints], upper, atol=1e-12)
    speed = [j.velocity_upper_limit() for j in joints]
    np.testing.assert_allclose(speed, [pi] * 6, atol=1e-12)  # 180 degrees/s
    acceleration = [j.acceleration_upper_limit() for j in joints]
    np.testing.assert_allclose(acceleration, [pi] * 6, atol=1e-12)
    actuators = [
        robot.plant.get_joint_actuator(i) for i in robot.plant.GetJointActuatorIndices(robot.arm)
    ]
    assert [a.joint().name() for a in actuators] == [j.name() for j in joints]
    assert [a.effort_limit() for a in actuators] == [150.0, 150.0, 150.0, 28.0, 28.0, 28.0]
    assert [a.default_rotor_inertia() * a.default_gear_ratio() ** 2 for a in actuators] == [0.1] * 6


def test_parses_without_a_word(caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.WARNING, logger="drake"):
        Robot()
    assert [record.getMessage() for record in caplog.records] == []


def test_footprint_is_that_of_the_data_sheet(robot: Robot) -> None:
    """149 mm across."""
    inspector = robot.diagram.scene_graph().model_inspector()
    base = robot.plant.GetBodyFrameIdOrThrow(robot.plant.GetBodyByName("base").index())
    shapes = [inspector.GetShape(g) for g in inspector.GetGeometries(base, Role.kProximity)]
    widest = max(s.radius() for s in shapes if isinstance(s, Cylinder))
    assert 2 * widest == pytest.approx(0.149, abs=0.003)


def test_links_hang_together(robot: Robot) -> None:
    """Each link's collision geometry overlaps with that of the one before, in any posture."""
    rng = np.random.default_rng(3)
    for q in rng.uniform(-pi, pi, (5, 6)):
        robot.put(q)
        for one, other in zip(["base", *LINKS], LINKS, strict=False):
            assert robot.distance(one, other) < 0.0, (one, other)


@pytest.mark.parametrize(
    ("pair", "apart"),
    [(("base", "upper_arm_link"), 0.0143), (("wrist_1_link", "wrist_3_link"), 0.0152)],
)
def test_pairs_that_are_not_looked_at_never_meet(
    robot: Robot, pair: tuple[str, str], apart: float
) -> None:
    rng = np.random.default_rng(4)
    found = []
    for q in rng.uniform(-pi, pi, (150, 6)):
        robot.put(q)
        found.append(robot.distance(*pair))
    assert min(found) > 0.003
    assert np.quantile(found, 0.9) == pytest.approx(apart, abs=2e-4)
    robot.put(HOME)
    assert robot.distance(*pair) == pytest.approx(apart, abs=2e-4)


def test_usual_postures_are_free(robot: Robot) -> None:
    rng = np.random.default_rng(2)
    spread = np.array([3.0, 0.6, 0.9, 1.5, 1.2, 3.0])
    for q in [HOME, np.zeros(6), *(HOME + rng.uniform(-spread, spread, (300, 6)))]:
        robot.put(q)
        assert robot.colliding() == set(), q


@pytest.mark.parametrize(
    ("q", "pair"),
    [
        ([0.0, -1.57, 3.0, 0.0, 0.0, 0.0], ("forearm_link", "shoulder_link")),
        ([0.0, -1.57, 2.7, 0.0, 0.0, 0.0], ("shoulder_link", "wrist_2_link")),
        ([0.0, -0.2, 2.7, 1.2, 0.0, 0.0], ("base", "forearm_link")),
    ],
)
def test_folded_postures_collide(robot: Robot, q: list[float], pair: tuple[str, str]) -> None:
    robot.put(np.array(q))
    assert pair in robot.colliding()


def test_what_is_seen_is_what_collides(robot: Robot) -> None:
    inspector = robot.diagram.scene_graph().model_inspector()
    for index in robot.plant.GetBodyIndices(robot.arm):
        frame = robot.plant.GetBodyFrameIdOrThrow(BodyIndex(index))
        poses = [
            [inspector.GetPoseInFrame(g).GetAsMatrix4() for g in inspector.GetGeometries(frame, r)]
            for r in (Role.kIllustration, Role.kProximity)
        ]
        np.testing.assert_array_equal(*poses)
