"""The hand's model: pads, coupling of the fingers, statics of a grip."""

from __future__ import annotations

import logging

import numpy as np
import pytest
from pydrake.geometry import (
    AddRigidHydroelasticProperties,
    Box,
    GeometryId,
    ProximityProperties,
    Role,
    VolumeMesh,
)
from pydrake.math import RigidTransform
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import (
    ContactModel,
    CoulombFriction,
    DiscreteContactApproximation,
    MultibodyPlant,
)
from pydrake.multibody.tree import (
    PdControllerGains,
    RigidBody,
    SpatialInertia,
    UnitInertia,
    default_model_instance,
)
from pydrake.planning import RobotDiagramBuilder
from pydrake.systems.analysis import Simulator

from burg_drake.core import resolve_reference
from burg_drake.station import Hand, load_hand

FORCE = 40.0
"""Force limit of each finger in the tests [N]."""
SPEED = 0.05
"""Closing speed of each finger [m/s]."""
STEP = 0.002
BLOCK = (0.030, 0.040, 0.030)
"""Size of the block between the pads [m]."""


class Gripper:
    """The hand welded to the world without gravity; perhaps a rigid block between the pads."""

    def __init__(self, block: bool = False, servo: bool = False, offset: float = 0.0) -> None:
        builder = RobotDiagramBuilder(time_step=STEP)
        self.plant = plant = builder.plant()
        plant.set_contact_model(ContactModel.kHydroelasticWithFallback)
        plant.set_discrete_contact_approximation(DiscreteContactApproximation.kLagged)
        builder.parser().AddModels(
            str(resolve_reference("package://burg_drake/models/panda/panda_hand.sdf"))
        )
        plant.WeldFrames(plant.world_frame(), plant.GetFrameByName("panda_hand"))
        plant.mutable_gravity_field().set_gravity_vector([0.0, 0.0, 0.0])
        self.joints = [plant.GetJointByName(f"panda_finger_joint{i}") for i in (1, 2)]
        if servo:
            for name in ("panda_finger_joint1", "panda_finger_joint2"):
                actuator = plant.GetJointActuatorByName(name)
                actuator.set_effort_limit(FORCE)
                actuator.set_controller_gains(PdControllerGains(p=0.0, d=1000.0))
        self.block = add_block(plant) if block else None
        plant.Finalize()
        self.hand = plant.GetModelInstanceByName("panda_hand")
        if self.block is not None:
            X_WB = RigidTransform([0.0, offset, 0.1034])
            plant.SetDefaultFloatingBaseBodyPose(self.block, X_WB)
        self.diagram = builder.Build()
        self.simulator = Simulator(self.diagram)
        self.context = self.simulator.get_mutable_context()
        self.plant_context = plant.GetMyMutableContextFromRoot(self.context)

    def put(self, left: float, right: float) -> None:
        """Sets the fingers' positions [m]."""
        for joint, position in zip(self.joints, (left, right), strict=True):
            joint.set_translation(self.plant_context, position)

    def positions(self) -> np.ndarray:
        """Positions (2,) of left and right finger [m]."""
        return np.array([j.get_translation(self.plant_context) for j in self.joints])

    def pads(self) -> list[GeometryId]:
        """Collision geometries named `pad` of the left and the right finger."""
        inspector = self.diagram.scene_graph().model_inspector()
        found = []
        for finger in ("panda_leftfinger", "panda_rightfinger"):
            body = self.plant.GetBodyByName(finger)
            geometries = self.plant.GetCollisionGeometriesForBody(body)
            found += [g for g in geometries if inspector.GetName(g).split("::")[-1] == "pad"]
        assert len(found) == 2
        return found

    def close(self, seconds: float) -> None:
        """Closes both fingers at SPEED for some time."""
        port = self.plant.get_desired_state_input_port(self.hand)
        port.FixValue(self.plant_context, [0.0, 0.0, -SPEED, -SPEED])
        self.simulator.AdvanceTo(seconds)

    def pad_forces(self) -> np.ndarray:
        """Force (2, 3) of the left and the right pad on the block [N], world axes."""
        results = self.plant.get_contact_results_output_port().Eval(self.plant_context)
        assert results.num_point_pair_contacts() == 0
        pads, forces = self.pads(), np.zeros((2, 3))
        for i in range(results.num_hydroelastic_contacts()):
            info = results.hydroelastic_contact_info(i)
            M, N = info.contact_surface().id_M(), info.contact_surface().id_N()
            on_M = info.F_Ac_W().translational()
            if M in pads:
                forces[pads.index(M)] -= on_M
            else:
                forces[pads.index(N)] += on_M
        return forces


def add_block(plant: MultibodyPlant) -> RigidBody:
    """A free rigid block of 0.2 kg."""
    inertia = SpatialInertia(0.2, np.zeros(3), UnitInertia.SolidBox(*BLOCK))
    body = plant.AddRigidBody("block", default_model_instance(), inertia)
    properties = ProximityProperties()
    AddRigidHydroelasticProperties(0.01, properties)
    properties.AddProperty("material", "coulomb_friction", CoulombFriction(0.24, 0.24))
    plant.RegisterCollisionGeometry(body, RigidTransform(), Box(*BLOCK), "block", properties)
    return body


@pytest.fixture(scope="module")
def document() -> Hand:
    return load_hand("panda_hand")


def test_pads_meet_when_closed_and_open_to_80_mm(document: Hand) -> None:
    gripper = Gripper()
    inspector = gripper.diagram.scene_graph().model_inspector()
    for joint, opening in ((0.0, 0.0), (0.013, 0.026), (0.04, 0.08)):
        gripper.put(joint, joint)
        faces = []
        for finger, pad, inwards in zip(document.fingers, gripper.pads(), (-1, 1), strict=True):
            body = gripper.plant.GetBodyByName(finger.body)
            X_WP = body.EvalPoseInWorld(gripper.plant_context) @ inspector.GetPoseInFrame(pad)
            np.testing.assert_allclose(np.abs(X_WP.rotation().matrix()), np.eye(3), atol=1e-12)
            hull = inspector.GetConvexHull(pad)
            half = max(abs(hull.vertex(i)[1]) for i in range(hull.num_vertices()))
            faces.append(X_WP.translation()[1] + inwards * half)
        assert faces == pytest.approx([opening / 2, -opening / 2], abs=1e-12)
    assert document.opening == (0.0, 0.08)


def test_fronts_of_the_pads_look_at_each_other(document: Hand) -> None:
    """The tetrahedra fill the box; turned by 180 degrees about z, those of one finger are those of
    the other, and the front of both, which alone is divided, looks at the other finger."""
    gripper = Gripper()
    gripper.put(0.02, 0.02)
    inspector = gripper.diagram.scene_graph().model_inspector()
    base = gripper.plant.GetBodyByName("panda_hand")
    seen = []
    for finger, pad, inwards in zip(document.fingers, gripper.pads(), (-1.0, 1.0), strict=True):
        mesh = inspector.maybe_get_hydroelastic_mesh(pad)
        assert isinstance(mesh, VolumeMesh)
        assert mesh.CalcVolume() == pytest.approx(0.0175 * 0.0152 * 0.0185, rel=1e-9)
        body = gripper.plant.GetBodyByName(finger.body)
        X_WP = body.EvalPoseInWorld(gripper.plant_context) @ inspector.GetPoseInFrame(pad)
        X_HP = base.EvalPoseInWorld(gripper.plant_context).inverse() @ X_WP
        points = np.array([X_HP @ mesh.vertex(i) for i in range(mesh.num_vertices())])
        y = inwards * points[:, 1]
        front, back = np.isclose(y, y.max()).sum(), np.isclose(y, y.min()).sum()
        assert (front, back) == (16, 4)
        cells = [[t.vertex(i) for i in range(4)] for t in mesh.tetrahedra()]
        seen.append((points, cells))
    (left, cells), (right, other) = seen
    assert len(cells) == 36
    assert other == cells
    np.testing.assert_allclose(left * (-1.0, -1.0, 1.0), right, atol=1e-12)


def read_pad() -> tuple[np.ndarray, np.ndarray]:
    """Points (n, 3) of the left pad, first the inner one, and the others (m, 3) of its cells."""
    path = resolve_reference("package://burg_drake/models/panda/meshes/pad.vtk")
    lines = path.read_text().splitlines()
    count = int(next(x for x in lines if x.startswith("POINTS")).split()[1])
    points = np.array([[float(v) for v in x.split()] for x in lines[5 : 5 + count]])
    cells = np.array([[int(v) for v in x.split()[2:]] for x in lines if x.startswith("4 ")])
    return points, cells


def test_a_strip_at_the_tip_of_a_pad_is_nearly_as_stiff_as_one_of_columns() -> None:
    """Pressure in the tetrahedra, against a layer of 7.6 mm and 1e7 Pa, as which the pads count."""
    points, cells = read_pad()
    depth, strip = 0.0004, 0.003
    x = np.linspace(-0.00875, 0.00875, 60)[1:-1]
    z = np.linspace(0.00925 - strip, 0.00925, 60)[1:-1]
    spots = np.stack([a.ravel() for a in np.meshgrid(x, -0.0076 + depth, z)], axis=1)
    sides = points[cells] - points[0]
    # A spot is in the cell of the inner point with whose face its ray meets: all weights are > 0.
    weights = np.einsum("cij,nj->nci", np.linalg.inv(sides.swapaxes(1, 2)), spots - points[0])
    outward = np.where((weights > -1e-9).all(axis=2), weights.sum(axis=2), np.nan)
    pressure = 1.9e7 * (1.0 - np.nanmax(outward, axis=1))
    assert 0.95 < pressure.mean() / (1e7 * depth / 0.0076) < 1.0


def test_fronts_of_the_pads_carry_the_torsion_of_a_patch() -> None:
    """One point a triangle, against the integral over the rectangle."""
    points, cells = read_pad()
    faces = points[cells]
    front = faces[np.isclose(faces[..., 1], -0.0076).all(axis=1)]
    area = (
        np.linalg.norm(np.cross(front[:, 1] - front[:, 0], front[:, 2] - front[:, 0]), axis=1) / 2
    )
    lever = np.linalg.norm(front.mean(axis=1)[:, ::2], axis=1)
    x, z = (((np.arange(400) + 0.5) / 400 - 0.5)[:, None] * (0.0175, 0.0185)).T
    whole = np.hypot(*np.meshgrid(x, z)).mean() * 0.0175 * 0.0185
    assert area.sum() == pytest.approx(0.0175 * 0.0185, rel=1e-6)
    assert 0.97 < (area * lever).sum() / whole < 0.98


def test_grasp_frame_lies_between_the_pads(document: Hand) -> None:
    gripper = Gripper()
    gripper.put(0.02, 0.02)
    inspector = gripper.diagram.scene_graph().model_inspector()
    X_HG = document.X_HG.matrix()
    centres = []
    for finger, pad in zip(document.fingers, gripper.pads(), strict=True):
        body = gripper.plant.GetBodyByName(finger.body)
        X_HB = body.EvalPoseInWorld(gripper.plant_context)
        centres.append((X_HB @ inspector.GetPoseInFrame(pad)).translation())
    closing = centres[0] - centres[1]
    np.testing.assert_allclose(X_HG[:3, 0], closing / np.linalg.norm(closing), atol=1e-12)
    np.testing.assert_allclose(X_HG[:3, 2], [0.0, 0.0, 1.0], atol=1e-12)
    # Franka's tool centre point is 0.25 mm off the centre of the pads.
    np.testing.assert_allclose(X_HG[:3, 3], np.mean(centres, axis=0), atol=3e-4)


def test_document_names_what_the_model_has(document: Hand) -> None:
    plant = Gripper().plant
    assert plant.HasBodyNamed(document.body)
    for finger, joint in zip(document.fingers, Gripper().joints, strict=True):
        assert plant.HasBodyNamed(finger.body)
        assert finger.joint == joint.name()
        assert (finger.closed, finger.open) == (
            joint.position_lower_limits()[0],
            joint.position_upper_limits()[0],
        )
        assert plant.GetJointActuatorByName(finger.joint).effort_limit() == 70.0
    assert document.force < 70.0
    assert document.closing_speed == SPEED


def test_every_collision_geometry_is_compliant() -> None:
    gripper = Gripper()
    inspector = gripper.diagram.scene_graph().model_inspector()
    geometries = inspector.GetAllGeometryIds(Role.kProximity)
    assert len(geometries) == 3 + 2 * 4
    for geometry in geometries:
        properties = inspector.GetProximityProperties(geometry)
        modulus = properties.GetProperty("hydroelastic", "hydroelastic_modulus")
        # The pads' pressure grows over 0.95 of their thickness in place of half of it.
        is_pad = "pad" in inspector.GetName(geometry)
        assert modulus == pytest.approx(1.9e7 if is_pad else 1e7)


def test_fingers_mirror_each_other() -> None:
    plant = Gripper().plant
    left, right = (plant.GetBodyByName(f"panda_{side}finger") for side in ("left", "right"))
    turn = np.diag([-1.0, -1.0, 1.0])
    np.testing.assert_allclose(right.default_com(), turn @ left.default_com(), atol=1e-15)
    np.testing.assert_allclose(
        right.default_spatial_inertia().CalcRotationalInertia().CopyToFullMatrix3(),
        turn @ left.default_spatial_inertia().CalcRotationalInertia().CopyToFullMatrix3() @ turn,
        atol=1e-18,
    )
    assert left.default_spatial_inertia().IsPhysicallyValid()
    # The centre of mass is in the finger, outwards of its pad.
    assert 0.0 < left.default_com()[1] < 0.026 and 0.0 < left.default_com()[2] < 0.054


def test_right_finger_follows_the_left_one() -> None:
    gripper = Gripper()
    gripper.put(0.01, 0.01)
    port = gripper.plant.get_actuation_input_port()
    port.FixValue(gripper.plant_context, [0.01, 0.0])  # only the left finger is driven
    gripper.simulator.AdvanceTo(0.1)
    left, right = gripper.positions()
    # Both move as one mass of 0.03 kg under 0.01 N.
    assert left - 0.01 == pytest.approx(0.5 * (0.01 / 0.03) * 0.1**2, rel=0.05)
    assert right == pytest.approx(left, abs=1e-6)


def test_standard_mimic_is_still_ignored() -> None:
    """Drake 1.51 reads drake:mimic only; when this fails, the plain SDF element will do."""
    text = resolve_reference("package://burg_drake/models/panda/panda_hand.sdf").read_text()
    own = '      <drake:mimic joint="panda_finger_joint1" multiplier="1" offset="0"/>\n'
    plain = '<mimic joint="panda_finger_joint1"><multiplier>1</multiplier></mimic>'
    assert own in text
    head, tail = text.replace(own, "").rsplit("</axis>", 1)
    for sdf, count in ((text, 1), (f"{head}{plain}</axis>{tail}", 0)):
        plant = MultibodyPlant(time_step=STEP)
        Parser(plant).AddModelsFromString(sdf, "sdf")
        plant.Finalize()
        assert plant.num_constraints() == count


def test_grip_presses_with_the_commanded_force() -> None:
    gripper = Gripper(block=True, servo=True)
    gripper.put(0.022, 0.022)
    gripper.close(0.4)
    forces = gripper.pad_forces()
    np.testing.assert_allclose(forces[:, 1], [-FORCE, FORCE], rtol=0.01)
    np.testing.assert_allclose(forces[:, [0, 2]], 0.0, atol=0.01 * FORCE)
    # The pads have stopped at the block, a hair inside of it.
    np.testing.assert_allclose(gripper.positions(), BLOCK[1] / 2, atol=1e-4)


def test_coupling_centres_a_block_that_stands_aside() -> None:
    gripper = Gripper(block=True, servo=True, offset=0.004)
    gripper.put(0.030, 0.030)
    gripper.close(0.6)
    assert gripper.block is not None
    p_WB = gripper.block.EvalPoseInWorld(gripper.plant_context).translation()
    assert p_WB[1] == pytest.approx(0.0, abs=1e-4)
    np.testing.assert_allclose(gripper.pad_forces()[:, 1], [-FORCE, FORCE], rtol=0.01)


def test_parses_without_a_word(caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.WARNING, logger="drake"):
        Gripper()
    assert [record.getMessage() for record in caplog.records] == []
