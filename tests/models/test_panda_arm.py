"""The arm's model against Franka's DH table, the published figures, and its own looks."""

from __future__ import annotations

import logging
import re
from math import pi
from pathlib import Path

import numpy as np
import pytest
from pydrake.geometry import FrameId, GeometryId, QueryObject
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.tree import BodyIndex, JointActuatorIndex
from pydrake.planning import RobotDiagramBuilder

from burg_drake.core import resolve_reference
from tools.panda_model.hand_document import hand_yaml
from tools.panda_model.sdf import arm_sdf, hand_sdf
from tools.robot_model.obj import mtl_text

NUMBER = re.compile(r"-?\d+(?:\.\d+)?(?:e-?\d+)?")

# Craig's DH table (a, d, alpha) of frankaemika.github.io/docs/control_parameters.html.
DH = [
    (0.0, 0.333, 0.0),
    (0.0, 0.0, -pi / 2),
    (0.0, 0.316, pi / 2),
    (0.0825, 0.0, pi / 2),
    (-0.0825, 0.384, -pi / 2),
    (0.0, 0.0, pi / 2),
    (0.088, 0.0, pi / 2),
]
FLANGE = 0.107
Q_MIN = [-2.8973, -1.7628, -2.8973, -3.0718, -2.8973, -0.0175, -2.8973]
Q_MAX = [2.8973, 1.7628, 2.8973, -0.0698, 2.8973, 3.7525, 2.8973]
VELOCITY = [2.175, 2.175, 2.175, 2.175, 2.61, 2.61, 2.61]
ACCELERATION = [15.0, 7.5, 10.0, 12.5, 15.0, 20.0, 20.0]
TORQUE = [87.0, 87.0, 87.0, 87.0, 12.0, 12.0, 12.0]
# Links 0 to 7 after Gaz et al. 2019; hand and two fingers after franka_ros.
ARM_MASS = 0.629769 + 4.970684 + 0.646926 + 3.228604 + 3.587895 + 1.225946 + 1.666555 + 0.735522
HAND_MASS = 0.73 + 2 * 0.015
HOME = np.array([0.0, -pi / 4, 0.0, -3 * pi / 4, 0.0, pi / 2, pi / 4])
INFLATION = 0.008
"""How far visual vertices may stand out of the collision geometry [m]."""


class Robot:
    """Arm and hand on the world, with a context."""

    def __init__(self) -> None:
        builder = RobotDiagramBuilder(time_step=0.002)
        self.plant = plant = builder.plant()
        builder.parser().AddModels(
            str(resolve_reference("package://burg_drake/models/panda/panda_arm.sdf"))
        )
        builder.parser().AddModels(
            str(resolve_reference("package://burg_drake/models/panda/panda_hand.sdf"))
        )
        plant.WeldFrames(plant.world_frame(), plant.GetFrameByName("panda_link0"))
        plant.WeldFrames(
            plant.GetFrameByName("panda_link8"),
            plant.GetFrameByName("panda_hand"),
            RigidTransform(RotationMatrix.MakeZRotation(-pi / 4), [0.0, 0.0, 0.0]),
        )
        plant.Finalize()
        self.diagram = builder.Build()
        self.context = self.diagram.CreateDefaultContext()
        self.plant_context = plant.GetMyMutableContextFromRoot(self.context)
        self.arm = plant.GetModelInstanceByName("panda_arm")

    def put(self, q: np.ndarray, opening: float = 0.08) -> None:
        """Sets the arm's joints [rad] and the distance between the pads [m]."""
        self.plant.SetPositions(self.plant_context, [*q, opening / 2, opening / 2])

    def query(self) -> QueryObject:
        """Geometry query object at the present posture."""
        scene_graph = self.diagram.scene_graph()
        return scene_graph.get_query_output_port().Eval(
            scene_graph.GetMyContextFromRoot(self.context)
        )

    def colliding(self) -> set[tuple[str, str]]:
        """Pairs of links that penetrate each other."""
        query = self.query()
        inspector = query.inspector()

        def link(geometry: GeometryId) -> str:
            return inspector.GetName(inspector.GetFrameId(geometry)).split("::")[-1]

        pairs = set()
        for contact in query.ComputePointPairPenetration():
            first, second = sorted((link(contact.id_A), link(contact.id_B)))
            pairs.add((first, second))
        return pairs

    def X_WF(self, frame: str) -> np.ndarray:
        """Pose (4, 4) of a named frame in the world."""
        pose = self.plant.GetFrameByName(frame).CalcPoseInWorld(self.plant_context)
        return pose.GetAsMatrix4()


@pytest.fixture(scope="module")
def robot() -> Robot:
    return Robot()


def dh_chain(q: np.ndarray) -> list[np.ndarray]:
    """Poses X_W1 to X_W7 and X_W8 (4, 4) by Craig's convention: Rx(alpha) Tx(a) Rz(theta) Tz(d)."""
    poses, X = [], np.eye(4)
    for (a, d, alpha), theta in zip(DH, q, strict=True):
        ca, sa, ct, st = np.cos(alpha), np.sin(alpha), np.cos(theta), np.sin(theta)
        X = X @ [
            [ct, -st, 0.0, a],
            [st * ca, ct * ca, -sa, -d * sa],
            [st * sa, ct * sa, ca, d * ca],
            [0.0, 0.0, 0.0, 1.0],
        ]
        poses.append(X)
    flange = np.eye(4)
    flange[2, 3] = FLANGE
    return [*poses, X @ flange]


def test_kinematics_match_the_dh_table(robot: Robot) -> None:
    rng = np.random.default_rng(1)
    for q in rng.uniform(Q_MIN, Q_MAX, (200, 7)):
        robot.put(q)
        for index, X_WL in enumerate(dh_chain(q), start=1):
            np.testing.assert_allclose(robot.X_WF(f"panda_link{index}"), X_WL, rtol=0, atol=1e-9)


def test_limits(robot: Robot) -> None:
    joints = [robot.plant.GetJointByName(f"panda_joint{i}") for i in range(1, 8)]
    assert [j.position_lower_limit() for j in joints] == Q_MIN
    assert [j.position_upper_limit() for j in joints] == Q_MAX
    assert [j.velocity_upper_limit() for j in joints] == VELOCITY
    assert [j.acceleration_upper_limit() for j in joints] == ACCELERATION
    assert [j.acceleration_lower_limit() for j in joints] == [-a for a in ACCELERATION]
    actuators = [robot.plant.get_joint_actuator(j) for j in _actuator_indices(robot)]
    assert [a.effort_limit() for a in actuators] == TORQUE
    reflected = [a.default_rotor_inertia() * a.default_gear_ratio() ** 2 for a in actuators]
    np.testing.assert_allclose(reflected, [0.6057] * 2 + [0.4625] * 2 + [0.2055] * 3, atol=1e-4)


def _actuator_indices(robot: Robot) -> list[JointActuatorIndex]:
    return robot.plant.GetJointActuatorIndices(robot.arm)


def test_masses(robot: Robot) -> None:
    hand = robot.plant.GetModelInstanceByName("panda_hand")
    context, plant = robot.plant_context, robot.plant
    assert plant.CalcTotalMass(context, [robot.arm]) == pytest.approx(ARM_MASS, abs=1e-9)
    assert plant.CalcTotalMass(context, [hand]) == pytest.approx(HAND_MASS, abs=1e-9)


def test_inertias_are_physical(robot: Robot) -> None:
    for index in robot.plant.GetBodyIndices(robot.arm):
        M_BBo_B = robot.plant.get_body(index).CalcSpatialInertiaInBodyFrame(robot.plant_context)
        assert M_BBo_B.IsPhysicallyValid()
        tensor = M_BBo_B.Shift(M_BBo_B.get_com()).CalcRotationalInertia().CopyToFullMatrix3()
        small, middle, large = np.linalg.eigvalsh(tensor)
        assert small > 0.0
        assert large < small + middle


def test_gravity_torque_of_the_shoulder(robot: Robot) -> None:
    """Joint 2 carries the moment of all that hangs beyond it: statics with point masses."""
    robot.put(np.array([0.4, 0.7, -0.3, -1.9, 0.8, 1.6, -0.5]))
    plant, context = robot.plant, robot.plant_context
    X_W2 = robot.X_WF("panda_link2")
    moment = np.zeros(3)
    for index in range(plant.num_bodies()):
        body = plant.get_body(BodyIndex(index))
        if body.name() not in ("world", "panda_link0", "panda_link1"):
            p_WBcm = body.EvalPoseInWorld(context) @ body.default_com()
            weight = [0.0, 0.0, -9.81 * body.default_mass()]
            moment += np.cross(p_WBcm - X_W2[:3, 3], weight)
    torque = plant.CalcGravityGeneralizedForces(context)[1]
    assert torque == pytest.approx(moment @ X_W2[:3, 2], abs=1e-9)


def test_parses_without_a_word(caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.WARNING, logger="drake"):
        Robot()
    assert [record.getMessage() for record in caplog.records] == []


def test_usual_postures_are_free(robot: Robot) -> None:
    rng = np.random.default_rng(2)
    spread = np.array([2.8, 0.5, 0.5, 0.5, 0.6, 0.5, 2.0])
    low, high = np.array(Q_MIN), np.array(Q_MAX)
    postures = np.clip(HOME + rng.uniform(-spread, spread, (400, 7)), low, high)
    for q in [HOME, *postures]:
        for opening in (0.0, 0.08):
            robot.put(q, opening)
            assert robot.colliding() == set(), q


# Postures at which the shells of the real arm would run into each other.
@pytest.mark.parametrize(
    ("q", "pair"),
    [
        ([0.0, 0.0, 0.0, -1.5, 0.0, -0.0175, 0.0], ("panda_hand", "panda_link5")),
        ([0.0, 0.0, 0.0, -3.07, 0.0, 1.7, 0.0], ("panda_link1", "panda_rightfinger")),
        ([0.0, 0.6, 0.0, -3.07, 0.0, 1.2, 0.0], ("panda_link1", "panda_link7")),
        ([0.0, 1.7, 0.0, -2.9, 0.0, 3.0, 0.0], ("panda_link0", "panda_link6")),
        ([1.3, 0.4, 1.6, -3.0, -1.8, 1.8, -1.6], ("panda_link2", "panda_link5")),
    ],
)
def test_folded_postures_collide(robot: Robot, q: list[float], pair: tuple[str, str]) -> None:
    robot.put(np.array(q))
    assert pair in robot.colliding()


@pytest.mark.parametrize("link", [f"panda_link{i}" for i in range(8)] + ["panda_hand"])
def test_looks_lie_inside_the_collision_geometry(robot: Robot, link: str) -> None:
    robot.put(np.zeros(7))
    mesh = resolve_reference("package://burg_drake/models/panda/meshes/" + _mesh_name(link))
    vertices, _ = read_obj(mesh)
    body = robot.plant.GetBodyByName(link)
    points = (body.EvalPoseInWorld(robot.plant_context) @ vertices[::3].T).T
    frame = robot.plant.GetBodyFrameIdOrThrow(body.index())
    distance = [distance_to_frame(robot, frame, p) for p in points]
    assert max(distance) < INFLATION
    # And the collision geometry hugs: most of the surface lies close to it.
    assert np.quantile(distance, 0.02) > -0.040


def distance_to_frame(robot: Robot, frame: FrameId, p_W: np.ndarray) -> float:
    """Distance from a world point (3,) to the collision geometry of one body [m]."""
    query = robot.query()
    inspector = query.inspector()
    results = query.ComputeSignedDistanceToPoint(p_W, 0.05)
    return min(
        (r.distance for r in results if inspector.GetFrameId(r.id_G) == frame), default=np.inf
    )


def _mesh_name(link: str) -> str:
    return link.removeprefix("panda_") + ".obj"


def read_obj(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """Vertices (V, 3) [m] and normals (V, 3) of an OBJ file."""
    lines = path.read_text().splitlines()
    vertices = [line.split()[1:] for line in lines if line.startswith("v ")]
    normals = [line.split()[1:] for line in lines if line.startswith("vn ")]
    return np.array(vertices, dtype=float), np.array(normals, dtype=float)


def test_meshes_are_light_and_have_normals_and_materials() -> None:
    folder = resolve_reference("package://burg_drake/models/panda/meshes")
    materials = (folder / "panda.mtl").read_text()
    files = sorted(folder.glob("*.obj"))
    assert len(files) == 10
    assert sum(f.stat().st_size for f in files) < 2.1e6
    for file in files:
        vertices, normals = read_obj(file)
        assert len(vertices) == len(normals) > 0
        np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1.0, atol=3e-3)
        text = file.read_text()
        assert text.startswith("mtllib panda.mtl\n")
        used = {line.split()[1] for line in text.splitlines() if line.startswith("usemtl")}
        assert all(f"newmtl {name}\n" in materials for name in used)


def test_files_are_what_the_generator_writes() -> None:
    models = Path(__file__).parents[2] / "models"
    for name, made in (("panda_arm", arm_sdf()), ("panda_hand", hand_sdf())):
        stored = (models / "panda" / f"{name}.sdf").read_text()
        assert NUMBER.sub("#", made) == NUMBER.sub("#", stored)
        numbers = [[float(n) for n in NUMBER.findall(text)] for text in (made, stored)]
        assert numbers[0] == pytest.approx(numbers[1], rel=1e-12, abs=1e-14)  # to rounding
    assert (models / "panda" / "meshes" / "panda.mtl").read_text() == mtl_text()
    assert (models / "hands" / "panda_hand.yaml").read_text() == hand_yaml()
